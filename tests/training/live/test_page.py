"""The live page in a real browser: what moves, what is said, what is saved, and who may reach it."""

import asyncio
import contextlib
import http.client
import json
import re
import socket
import urllib.parse
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from offline_browser import browser  # noqa: F401  # a fixture

pytest.importorskip("bokeh", reason="bokeh is not installed: the extra `live` is missing")

from fowt_env.errors import InputError  # noqa: E402
from fowt_env.training.live import tuning  # noqa: E402
from fowt_env.training.live.page import fitting  # noqa: E402
from fowt_env.training.live.server import HOST, tune  # noqa: E402
from fowt_env.training.live.tuning import Weather, law_of  # noqa: E402

SHORT = {"duration": 150.0}
DONE = "/all figures/.test(document.getElementById('status').textContent)"
SHOWN = "Array.from(Bokeh.documents[0].get_model_by_name('series_B').data['RotSpeed_[rpm]'])"


@pytest.fixture(scope="module")
def server():
    running = tune("pi", "pi", **SHORT)
    yield running
    running.stop()


@contextlib.contextmanager
def page_of(browser, server, **settings):  # noqa: F811
    """A page whose figures are all there, which loads nothing from elsewhere and reports no error."""
    context = browser.new_context(**settings)
    page, messages = context.new_page(), []
    page.set_default_timeout(60_000)
    page.on("console", lambda each: messages.append(each.text) if each.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.on("request", lambda request: messages.append(request.url) if is_elsewhere(request.url) else None)
    page.goto(server.url)
    page.wait_for_function(f"window.fowt && fowt.ready && {DONE}")
    yield page
    context.close()
    assert messages == []


def is_elsewhere(url):
    place = urllib.parse.urlsplit(url)
    return place.scheme in ("http", "https", "ws", "wss") and place.hostname != HOST


@pytest.fixture(scope="module")
def page(browser, server):  # noqa: F811
    with page_of(browser, server) as opened:
        yield opened


def test_a_slider_moved_by_the_keyboard_redraws_the_run_of_its_setting(page):
    page.locator("section.law.B .noUi-handle").first.focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function("fowt.delays.length > 0")
    page.wait_for_function(f"/KP=/.test(document.getElementById('command').textContent) && {DONE}")
    command = page.locator("#command").inner_text()
    law = law_of(re.search(r"--controller '(.*?)'", command).group(1))
    assert law.controller == "pi" and 1.0 < dict(law.settings)["KP"] < 1.2
    wanted = tuning.picture(Weather(**SHORT), law).series["RotSpeed_[rpm]"]
    np.testing.assert_allclose(page.evaluate(SHOWN), wanted, rtol=1e-6)
    assert (
        "one seed" in page.locator("#table").inner_text() or "6 seeds" in page.locator("#table").inner_text()
    )
    assert "KP=" in page.locator("#verdict").inner_text()
    assert "phase margin" in page.locator("#loops").inner_text()


def test_what_cannot_be_run_is_said_with_its_key_and_the_figures_stay(page):
    before = page.evaluate(SHOWN)
    for wind, words in (("ntm:14:Z", "Z"), ("none", "wind")):
        field = page.locator("input[type=text]").first
        field.fill(wind)
        field.press("Enter")
        page.wait_for_function("document.querySelector('#status .bad') !== null")
        assert words in page.locator("#status").inner_text()
        assert page.evaluate(SHOWN) == before
        page.evaluate("document.getElementById('status').innerHTML = ''")


def test_b_is_saved_as_a_design_once_and_in_the_working_folder_alone(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = page.locator("input[type=text]").last
    for text, words in (
        ("../x.json", "without a folder"), ("x.txt", ".json"), ("mine.json", "wrote mine.json"),
        ("mine.json", "exists already"),
    ):  # fmt: skip
        name.fill(text)
        name.press("Enter")
        page.get_by_role("button", name="save as design").click()
        page.wait_for_function(f"document.getElementById('saved').textContent.includes({json.dumps(words)})")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.json"]
    assert json.loads((tmp_path / "mine.json").read_text())["kind"] == "pi"


def test_a_page_shows_a_run_that_was_computed_before_it_was_open(browser, server):  # noqa: F811
    wanted = tuning.picture(Weather(**SHORT), law_of("pi")).series
    with page_of(browser, server) as page:
        np.testing.assert_allclose(page.evaluate(SHOWN), wanted["RotSpeed_[rpm]"], rtol=1e-6)
        assert page.evaluate("fowt.film.length") > 140.0
        for channel, axis in (("PtfmPitch_[deg]", "y"), ("Wave1Elev_[m]", "y"), ("time", "x")):
            name = f"series_{max(0, [c for _, c in tuning.SERIES].index(channel) if axis == 'y' else 0)}"
            ends = f"(r => [r.start, r.end])(Bokeh.documents[0].get_model_by_name('{name}').{axis}_range)"
            low, high = page.evaluate(ends)
            assert low <= wanted[channel].min() and wanted[channel].max() <= high


def test_an_axis_stays_while_its_curves_fill_it_and_is_set_anew_otherwise():
    assert fitting(np.array([1.3, 8.6]), 0.0, 1.0) == (1.0, 9.0)
    assert fitting(np.array([1.3, np.nan, 8.6]), 0.0, 10.0) == (0.0, 10.0)
    assert fitting(np.array([1.3, 4.2]), 0.0, 10.0) == pytest.approx((1.2, 4.2))
    assert fitting(np.array([-1.0, 8.6]), 0.0, 10.0) == (-1.0, 9.0)
    low, high = fitting(np.full(3, 43.1), 0.0, 1.0)
    assert low <= 43.1 <= high and 0.0 < high - low < 1e-3


@pytest.mark.nightly
def test_a_phone_scrolls_in_one_direction_and_both_themes_have_their_colours(browser, server):  # noqa: F811
    for scheme in ("light", "dark"):
        with page_of(browser, server, viewport={"width": 380, "height": 800}, color_scheme=scheme) as page:
            times = "slider to picture: 1234 ms (median 1234, 95 % 1234)"  # as after a move
            page.evaluate(f"document.getElementById('delay').textContent = '{times}'")
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            assert page.evaluate("document.documentElement.dataset.theme") == scheme
            shade = page.evaluate("getComputedStyle(document.body).backgroundColor")
            assert (sum(map(int, re.findall(r"\d+", shade)[:3])) < 200) == (scheme == "dark")
            page.click("#theme")
            assert page.evaluate("getComputedStyle(document.body).backgroundColor") != shade


def test_the_turbines_move_and_can_be_stopped(page):
    clock = "fowt.film.clock"
    first = page.evaluate(clock)
    page.wait_for_function(f"{clock} !== {first}")
    page.click("#play")
    still = page.evaluate(clock)
    page.wait_for_timeout(150)
    assert page.evaluate(clock) == still
    drawn = "document.getElementById('film').toDataURL().length"
    assert page.evaluate(drawn) > 5000


def test_the_server_listens_on_the_loopback_alone_and_hides_its_path(server):
    place = urllib.parse.urlsplit(server.url)
    assert place.hostname == HOST and len(place.path) > 10
    connection = http.client.HTTPConnection(HOST, place.port)
    connection.request("GET", "/")
    assert connection.getresponse().status == 404
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {HOST}
    for address in others:
        with pytest.raises(OSError):
            socket.create_connection((address, place.port), timeout=1.0)


def test_a_page_of_another_origin_is_refused_its_connection(server):
    place = urllib.parse.urlsplit(server.url)
    answers = []
    for origin in (f"http://{place.netloc}", "http://evil.example"):
        connection = http.client.HTTPConnection(HOST, place.port)
        headers = {
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
        }
        headers |= {"Sec-WebSocket-Version": "13", "Origin": origin}
        connection.request("GET", f"{place.path}/ws", headers=headers)
        answers.append(connection.getresponse().status)
    assert answers[1] == 403 and answers[0] != 403


@pytest.mark.nightly
def test_a_notebook_shows_the_page_in_a_frame_while_its_own_loop_runs():
    async def cell():
        return tune("pi", **SHORT)

    with ThreadPoolExecutor(1) as thread:  # playwright runs a loop in this one
        running = thread.submit(lambda: asyncio.run(cell())).result()
    assert f'<iframe src="{running.url}"' in running._repr_html_()
    port = urllib.parse.urlsplit(running.url).port
    with pytest.raises(InputError, match=f"port {port}"):
        tune("pi", port=port, **SHORT)
    running.stop()
    with pytest.raises(InputError, match="condition of the live page 'winds'"):
        tune(winds="14")
