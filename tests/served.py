"""A server in a thread of the tests, and a client of it."""

import socket
import struct
from contextlib import contextmanager, suppress
from functools import cache
from math import inf
from threading import Thread

import fowt_env
from fowt_env.errors import SimulationStopped
from fowt_env.realtime.record import HEADER, Kind, Record, size_of, unpack
from fowt_env.realtime.server import Server, Timing, open_link
from fowt_env.run.stepped import SteppedRun

FAST = Timing(factor=inf, timeout=5.0)


class Client:
    """Speaks the records of fowt connect serve over a socket."""

    def __init__(self, protocol, address, hello=True):
        kind = socket.SOCK_STREAM if protocol == "tcp" else socket.SOCK_DGRAM
        self.socket = socket.socket(socket.AF_INET, kind)
        self.socket.settimeout(10.0)
        self.socket.connect(address)
        self.stream = protocol == "tcp"
        self.about = {}
        if hello:
            self.send(Kind.HELLO)
            self.about = self.receive().json()
            self.send(Kind.READY)

    def send(self, kind, sequence=0, values=()):
        payload = struct.pack(f"<{len(values)}d", *values)
        self.socket.send(Record(kind, sequence, payload=payload).pack())

    def receive(self):
        if not self.stream:
            return unpack(self.socket.recv(65536), 65536)
        head = self.socket.recv(HEADER.size, socket.MSG_WAITALL)
        rest = size_of(head, 65536) - HEADER.size
        return unpack(head + (self.socket.recv(rest, socket.MSG_WAITALL) if rest else b""), 65536)

    def states(self, law=None, answered=lambda record: True):
        """Every STATE up to the END, of which those `answered` by a law; then .end is the END."""
        states = []
        while (record := self.receive()).kind == Kind.STATE:
            states.append(record)
            if law is not None and answered(record):
                self.send(Kind.COMMAND, record.sequence, law(record))
        self.end = record.json()
        return states


@cache
def small_scene():
    """Steady wind, still water."""
    return fowt_env.build_scene("oc3_hywind", wind=18.0)


@contextmanager
def served(duration=3.0, control_dt=0.1, protocol="tcp", timing=FAST, channels=(), patience=0.4, **settings):
    """(Server, function that connects a Client) of a server in a thread, which ends within the block."""
    link = open_link(protocol, "127.0.0.1", 0, patience)
    server = Server(SteppedRun(small_scene(), duration, control_dt, **settings), link, timing, channels)

    def work():
        with suppress(SimulationStopped):
            server.reason = server.serve()
        link.close()

    thread = Thread(target=work, daemon=True)
    thread.start()
    clients = []

    def connect(hello=True):
        clients.append(Client(protocol, link.address, hello))
        return clients[-1]

    yield server, connect
    thread.join(20.0)
    for client in clients:
        client.socket.close()
    assert not thread.is_alive()
