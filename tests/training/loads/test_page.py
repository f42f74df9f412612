"""The page of a design load table: its data, its texts, and the page in a browser, offline."""

import json
import re

import pytest
from load_runs import load_case, small_table
from offline_browser import browser, offline_page  # noqa: F401  # a fixture

from fowt_env.errors import InputError
from fowt_env.training.loads.page import page_data, write_load_page
from fowt_env.training.loads.records import FinishedRun
from fowt_env.training.loads.tables import load_tables

TITLE = "Loads of <b>spar</b>"
DRAWN = "#extrapolation-plot .scatterlayer path.js-line"
LEFT_OUT = [("2.5", "Ride-through", "no model of converter & grid")]


@pytest.fixture(scope="module")
def results():
    cases, finished = small_table()
    gone = load_case("1.3", "dlc1.3_u12", "pi", 9)
    finished[gone.key] = FinishedRun(*gone.key, "failed", "<script>alert(1)</script>")
    return load_tables([*cases, gone], finished)


@pytest.fixture(scope="module")
def path(results, tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "loads.html"
    about = {"left_out": LEFT_OUT, "remarks": ["the site is deep"], "facts": {"site": "north & south"}}
    return write_load_page(out, results, title=TITLE, lead="two controllers", **about)


@pytest.fixture
def page(browser, path):  # noqa: F811
    with offline_page(browser, path, DRAWN) as opened:
        yield opened


def test_the_page_escapes_texts_and_names_what_is_missing(path):
    text = path.read_text(encoding="utf-8")
    assert "Loads of &lt;b&gt;spar&lt;/b&gt;" in text and "<b>spar" not in text
    assert "&lt;script&gt;alert(1)" in text and "no model of converter &amp; grid" in text
    assert "1 run of 61 failed or are not finished" in text
    assert "Not for design, since the plant lacks their dynamics" in text and "rigid tower" in text
    assert "1 run ended early, by the protection" in text
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1]
    assert "<" not in data and json.loads(data)["controllers"] == ["pi", "lqr"]


def test_data_of_the_page_are_those_of_the_table(results):
    data = page_data(results)
    loads = {(row.column, row.side, row.controller): row for row in results.extremes}
    row = next(r for r in data["ultimate"] if (r["name"], r["side"]) == ("TwrBsMyt", "max"))
    assert row["group"] == "tower base" and row["absent"] == "rigid tower" and row["unit"] == "kN-m"
    for label, cell in zip(data["controllers"], row["cells"], strict=True):
        own = loads["TwrBsMyt_[kN-m]", "max", label]
        assert cell["load"] == pytest.approx(own.factored, rel=1e-5) and cell["name"] == own.name
        assert len(cell["at"]) == len(own.at)
    assert not any("@" in r["name"] for r in data["ultimate"] + data["fatigue"])
    groups = list(dict.fromkeys(r["group"] for r in data["ultimate"]))
    assert groups.index("tower base") < groups.index("mooring") or "mooring" not in groups
    flags = {r["name"]: r for r in data["constraints"]}
    assert flags["platform pitch"]["cells"][0]["count"] > 0 and flags["offset"]["limit"] is None
    curve = next(r for r in data["extrapolation"] if (r["name"], r["side"]) == ("TwrBsMyt", "largest"))
    assert curve["cells"][1]["curve"] and curve["cells"][1]["low"] < curve["cells"][1]["value"]
    json.dumps(data, allow_nan=False)


def test_another_ending_is_refused(results, tmp_path):
    with pytest.raises(InputError, match="must end with .html"):
        write_load_page(tmp_path / "page.txt", results, title="x")


@pytest.mark.slow
def test_the_page_works_in_a_browser(page):
    assert page.locator("h1").inner_text() == TITLE
    rows = page.locator("#ultimate-table tbody tr.row")
    every = rows.count()
    page.fill("#ultimate-filter", "TwrBsM max")
    assert 0 < rows.count() < every
    page.fill("#ultimate-filter", "nothing has this name")
    assert rows.count() == 0
    page.fill("#ultimate-filter", "")
    page.select_option("#ultimate-group", "tower base")
    assert all(name.startswith("TwrBs") for name in rows.locator("td:first-child").all_inner_texts())
    rows.first.click()
    details = page.locator("#ultimate-table tr.details")
    assert "× 1.35" in details.inner_text() and "Wind1VelX" in details.inner_text()
    rows.first.press("Enter")
    assert details.count() == 0
    page.select_option("#ultimate-view", "differences")
    assert "minus pi" in page.locator("#ultimate-table thead").inner_text()
    page.select_option("#fatigue-exponent", "10")
    assert "m = 10" in page.locator("#fatigue-table thead").inner_text()
    assert page.locator("#constraint-table .bad").count() > 0
    page.select_option("#extrapolation-what", index=1)
    assert page.locator("#extrapolation-plot .main-svg").count() > 0


@pytest.mark.slow
def test_a_click_on_a_heading_sorts_and_the_heading_stays(page):
    page.click('#ultimate-table th[data-key="0"] button')
    cells = page.locator("#ultimate-table tbody tr.row td:nth-child(3) > span:first-child").all_inner_texts()
    sizes = [abs(float(text.replace("\u2212", "-"))) for text in cells]
    assert sizes == sorted(sizes, reverse=True)
    inner = page.locator("#ultimate .scroll > div")
    inner.evaluate("element => element.scrollTo(0, 300)")
    top = page.locator("#ultimate-table thead th").first.bounding_box()["y"]
    assert top == pytest.approx(inner.bounding_box()["y"], abs=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_a_phone(browser, path, scheme):  # noqa: F811
    size = {"width": 390, "height": 844}
    with offline_page(browser, path, DRAWN, viewport=size, color_scheme=scheme) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        assert page.evaluate("document.documentElement.dataset.theme") == scheme
