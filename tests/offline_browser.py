"""Opens pages in a headless Chromium without a network, for tests of reports."""

import contextlib
import shutil

import pytest


@pytest.fixture(scope="module")
def browser():
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        found = [*map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))]
        found.append(shutil.which(playwright.chromium.executable_path))  # of `playwright install chromium`
        path = next(filter(None, found), None)
        if path is None:
            pytest.skip("no Chromium is installed: the page is not opened in a browser")
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


@contextlib.contextmanager
def offline_page(browser, path, drawn, **settings):
    """A page in an offline browser once `drawn` is there; its console must stay empty: nothing refused."""
    context = browser.new_context(offline=True, **settings)
    page = context.new_page()
    page.set_default_timeout(15_000)
    messages = []
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(path.as_uri())
    page.wait_for_selector(drawn)
    yield page
    context.close()
    assert messages == []
