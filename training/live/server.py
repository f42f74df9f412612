"""Serves the page of fowt tune on the loopback interface, for a browser or within a notebook.

Needs Bokeh: pip install "fowt-env[live]".
"""

import asyncio
import html
import secrets
import socket
from collections.abc import Sequence
from threading import Event, Thread
from typing import Any

from fowt_env.errors import InputError, unknown
from fowt_env.training.live.tuning import Law, Weather, law_of

HOST = "127.0.0.1"
NOTEBOOK_HEIGHT = 900  # pixels


class LiveServer:
    """Serves pages of fowt tune in a thread of its own; url: address of the page.

    port: 0 for a free one. The path of the address is random, so that other users of the machine cannot guess
    it, and websockets are accepted from this address alone.
    In a notebook the server, as last value of a cell, is shown as the page.
    Raises: InputError if Bokeh is missing or the port is in use.
    """

    def __init__(
        self, weather: Weather, laws: Sequence[Law], further: Sequence[str] = (), port: int = 0
    ) -> None:
        try:
            import bokeh  # noqa: F401
        except ImportError as error:
            raise InputError(f'the live page needs Bokeh ({error}): pip install "fowt-env[live]"') from error
        weather.scene()  # errors of the conditions, before a page is open
        self._ready, self._failure = Event(), None
        self._loop: Any = None
        self.url = ""
        self._thread = Thread(target=self._serve, args=(weather, laws, further, port), daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            raise InputError(f"live page at port {port}: {self._failure}") from self._failure

    def _serve(self, *arguments):
        weather, laws, further, port = arguments
        try:
            from bokeh.server.server import Server
            from tornado.ioloop import IOLoop

            from fowt_env.training.live.page import application

            asyncio.set_event_loop(asyncio.new_event_loop())
            path, port = f"/{secrets.token_urlsafe(9)}", port or _free_port()
            server = Server(
                {path: application(weather, laws, further)},
                address=HOST,
                port=port,
                allow_websocket_origin=[f"{HOST}:{port}"],
                io_loop=IOLoop.current(),
                use_index=False,
            )
        except Exception as error:  # raised again in the thread that waits
            self._failure = error
            self._ready.set()
            return
        self._loop, self.url = server.io_loop, f"http://{HOST}:{server.port}{path}"
        server.start()
        self._ready.set()
        server.io_loop.start()
        server.stop()
        server.io_loop.close()

    def wait(self) -> None:
        """Wait until the server is stopped."""
        self._thread.join()

    def stop(self) -> None:
        """Stop the server and wait for its thread."""
        self._loop.add_callback(self._loop.stop)
        self._thread.join()

    def _repr_html_(self):
        """Return the page as a frame, for notebooks."""
        size = f'width="100%" height="{NOTEBOOK_HEIGHT}" style="border:0"'
        return f'<iframe src="{html.escape(self.url)}" {size}></iframe>'


def _free_port():
    """Return a port of the loopback interface that is free now."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


def tune(
    controller: str = "pi",
    against: str = "pi",
    further: Sequence[str] = (),
    port: int = 0,
    **weather: Any,
) -> LiveServer:
    """Open the live page of fowt tune and return its LiveServer, which a notebook shows as the page.

    controller, against: texts of law_of, such as "pi[KP=1.2]"; weather: fields of Weather.
    Raises: InputError as Weather, law_of and LiveServer.
    """
    for key in weather:
        if key not in Weather.__dataclass_fields__:
            raise unknown("condition of the live page", key, Weather.__dataclass_fields__)
    return LiveServer(Weather(**weather), [law_of(against), law_of(controller)], further, port)
