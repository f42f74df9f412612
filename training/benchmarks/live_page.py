"""Times the live page of fowt tune in headless Chromium: from a move of a slider to the painted picture."""

import shutil

import numpy as np
import pandas as pd

from fowt_env.errors import InputError
from fowt_env.training.live.server import tune

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync")
READY = "window.fowt && fowt.ready && /all figures/.test(document.getElementById('status').textContent)"
LIMIT = 120_000.0  # ms, of one wait


def delays(controller="pi", moves=40, motion=False, progress=None):
    """Return a DataFrame of a row per move: "delay_[ms]" from a key press on a slider to its painted picture.

    The moves come one after another, each to a new setting after the whole page has followed. motion: whether
    the turbines move meanwhile. progress: called as progress(text, done, total).
    Raises: InputError without playwright or Chromium, or for a controller without sliders.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise InputError(
            f"the live page is timed with playwright ({error}): pip install playwright"
        ) from error
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise InputError(f"the live page is timed in a browser: none of {', '.join(BROWSERS)} is installed")
    server = tune(controller)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
            page = browser.new_page(viewport={"width": 1400, "height": 900})
            page.set_default_timeout(LIMIT)
            page.goto(server.url)
            page.wait_for_function(READY)
            if not motion and page.locator("#play").get_attribute("aria-pressed") == "true":
                page.click("#play")
            sliders = page.locator("section.law.B .noUi-handle")
            if not sliders.count():
                raise InputError(f"controller {controller!r}: has no sliders")
            for move in range(moves):
                if move in (0, moves // 2):  # every move is to a new setting: kept runs would be faster
                    (sliders.last if move else sliders.first).focus()
                page.keyboard.press("ArrowRight")
                page.wait_for_function(f"fowt.delays.length > {move}")
                page.wait_for_function(READY)
                if progress is not None:
                    progress("moving a slider", move + 1, moves)
            found = page.evaluate("fowt.delays")
            browser.close()
    finally:
        server.stop()
    return pd.DataFrame({"move": np.arange(1, moves + 1), "delay_[ms]": np.round(found[:moves], 1)})
