import base64
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from offline_browser import browser, offline_page  # noqa: F401  # browser is a fixture
from typer.testing import CliRunner

pytest.importorskip("plotly", reason="plotly is not installed: the extra `report` is missing")

import fowt_env  # noqa: E402
from fowt_env.errors import InputError  # noqa: E402
from fowt_env.training.cli import app as cli  # noqa: E402
from fowt_env.training.cli.console import EXIT_INPUT  # noqa: E402
from fowt_env.training.evaluation.evaluate import run_file  # noqa: E402
from fowt_env.training.reports import html_page  # noqa: E402
from fowt_env.training.reports.html_page import SCHEDULE_WINDS, write_report  # noqa: E402
from fowt_env.training.reports.own_limits import FILE, OF_LIMIT  # noqa: E402

SERIES = "#series-plot .scatterlayer path.js-line"  # what is drawn last
EVIL = "<img src=x onerror=alert(1)></script>&"
CONTROLLERS = ("calm", "busy", EVIL)
CASES = ("ntm_14", "ntm_18")
SKIP = 20.0


def run(number, seed, shift=0, end=120.0):
    """A run of 0.1 s rows whose rotor and platform swing at 0.05 Hz, wider for greater numbers."""
    t = np.arange(0.0, end + 0.05, 0.1)
    swing = np.sin(0.1 * np.pi * t + seed + 10.0 * shift)
    return pd.DataFrame(
        {
            "Time_[s]": t,
            "Wind1VelX_[m/s]": 18.0 + np.sin(0.3 * t + seed),
            "Wave1Elev_[m]": 2.0 * np.cos(0.2 * np.pi * t),
            "RotSpeed_[rpm]": 12.0 + 0.1 * (number + 1) * swing,
            "BldPitch1_[deg]": 15.0 + swing,
            "GenPwr_[kW]": 5000.0 + 40.0 * (number + 1) * swing,
            "PtfmPitch_[deg]": 3.0 + (0.3 - 0.1 * number) * swing,
        }
    )


def write_folder(folder):
    """An evaluation of three controllers on two cases and two seeds, one run of which failed."""
    rows = []
    for case in CASES:
        for seed in (1, 2):
            for number, controller in enumerate(CONTROLLERS):
                frame = run(number, seed, CASES.index(case))
                failed = (case, seed, number) == ("ntm_18", 2, 1)
                frame = frame[frame["Time_[s]"] < 50.0] if failed else frame
                path = run_file(folder / "runs", controller, case, seed)
                path.parent.mkdir(parents=True, exist_ok=True)
                frame.to_parquet(path)
                scored = frame[frame["Time_[s]"] >= SKIP]
                figures = {
                    "RotSpeed_std_[rpm]": scored["RotSpeed_[rpm]"].std(ddof=0),
                    "PtfmPitch_std_[deg]": scored["PtfmPitch_[deg]"].std(ddof=0),
                    "blade_pitch_travel_[deg/s]": 0.1 * (number + 1),
                    "novelty_[-]": 7.0 - number,
                }
                row = {"controller": controller, "case": case, "seed": seed, "scored_[s]": 120.0 - SKIP}
                row |= (
                    {"status": "failed", "reason": f"lost {EVIL}"}
                    if failed
                    else {"status": "ok", "reason": ""}
                )
                rows.append(row | (dict.fromkeys(figures, np.nan) if failed else figures))
    pd.DataFrame(rows).to_csv(folder / "results.csv", index=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("evaluation")
    write_folder(path)
    return path


@pytest.fixture
def copy(folder, tmp_path):
    """A copy of the folder, which a test may change."""
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def data_of(page):
    """What the page's script reads."""
    text = page.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL).group(1))


def decoded(packed, pool):
    """The values of a packed series, as the page's script decodes them; NaN where there is none."""
    codes = np.frombuffer(base64.b64decode(pool[packed["codes"]]), dtype="<u2").astype(float)
    values = packed["low"] + (codes - 1.0) * (packed["high"] - packed["low"]) / 65534.0
    return np.where(codes == 0, np.nan, values)


def test_the_page_asks_nothing_of_a_network_and_names_are_never_read_as_markup(page_file):
    text = page_file.read_text(encoding="utf-8")
    assert text.count("* plotly.js v") == 1
    assert not re.search(r"<(script|link|img|iframe)[^>]*\b(src|href)=[\"']?(https?:)?//", text)
    assert page_file.stat().st_size < 8e6
    assert "<img src=x" not in text
    assert "&lt;img src=x onerror=alert(1)&gt;&lt;/script&gt;&amp;" in text
    assert data_of(page_file)["controllers"] == list(CONTROLLERS)


def test_means_are_over_the_lifetime_and_the_runs_that_ended_well(folder, page_file):
    table, data = pd.read_csv(folder / "results.csv"), data_of(page_file)
    rows = {row["controller"]: row for row in data["board"][""]}
    speeds = table[table["controller"] == "busy"].groupby("case")["RotSpeed_std_[rpm]"]
    expected = np.sqrt(speeds.apply(lambda each: (each**2).mean()).mean())
    assert rows["busy"]["values"]["RotSpeed_std_[rpm]"] == pytest.approx(expected, rel=1e-5)
    assert (rows["busy"]["lost"], rows["busy"]["lost_text"], rows["busy"]["runs"]) == (1, "1 failed", 4)
    assert "novelty_[-]" in [metric["name"] for metric in data["metrics"]]  # metrics of other versions


def test_drawn_series_are_block_means_and_spectra_keep_the_peak(page_file):
    data = data_of(page_file)
    drawn = data["series"]["ntm_14"]["1"]["calm"]
    packed = drawn["series"]["RotSpeed_[rpm]"]
    frame = run(0, 1)
    means = frame["RotSpeed_[rpm]"].to_numpy()[:1200].reshape(-1, 5).mean(axis=1)
    assert (packed["step"], packed["start"]) == (pytest.approx(0.5), pytest.approx(0.2))
    np.testing.assert_allclose(decoded(packed, data["pool"]), means, atol=np.ptp(means) / 65534.0)
    assert drawn["skip"] == pytest.approx(SKIP)
    power = drawn["spectra"]["Wave1Elev_[m]"]
    values = decoded(power, data["pool"])
    assert power["start"] + power["step"] * values.argmax() == pytest.approx(0.1, abs=power["step"])
    assert values.min() < values.max() - 9.0  # far below the peak it falls on: no floor
    weather = {run["series"]["Wave1Elev_[m]"]["codes"] for run in data["series"]["ntm_14"]["1"].values()}
    assert len(weather) == 1  # the same for all, and in the page once


def test_every_seed_is_drawn_and_beyond_the_most_runs_the_first_of_each_case(folder, tmp_path, monkeypatch):
    def drawn(name, **settings):
        data = data_of(write_report(folder, tmp_path / name, schedule=False, **settings))
        return {case: list(seeds) for case, seeds in data["series"].items()}, data

    assert drawn("a.html")[0] == {case: ["1", "2"] for case in CASES}
    one, data = drawn("b.html", cases=["ntm_18"], seeds=[2])
    assert one == {"ntm_18": ["2"]} and data["seeds"] == {case: ["1", "2"] for case in CASES}
    assert len(data["quantiles"]["RotSpeed_[rpm]"]["calm"]) == 2  # boxes have every case all the same
    for most, expected in (
        (9, {"ntm_14": ["1", "2"], "ntm_18": ["1"]}),
        (8, {case: ["1"] for case in CASES}),
        (5, {"ntm_14": ["1"]}),
    ):
        monkeypatch.setattr(html_page, "MAX_SERIES_RUNS", most)
        assert drawn(f"{most}.html")[0] == expected


def test_the_page_has_the_torque_and_the_start_that_is_not_scored_of_a_lost_run_too(copy):
    cases = {case: {"platform": "oc3_hywind", "skip": 30.0} for case in CASES}
    (copy / "manifest.json").write_text(json.dumps({"cases": cases}))
    data = data_of(write_report(copy, schedule=False))
    channels = [panel["channel"] for panel in data["panels"]]
    assert channels.index("GenTq_[kN-m]") < channels.index("GenPwr_[kW]") and len(set(channels)) == len(
        channels
    )
    runs = data["series"]["ntm_18"]["2"]
    assert {name: run["skip"] for name, run in runs.items()} == dict.fromkeys(CONTROLLERS, 30.0)
    assert data["lost"] == {"ntm_18": {"2": {"busy": f"failed: lost {EVIL}"}}}
    assert {type(run[2]) for run in data["runs"]} == {str}  # a browser rounds numbers beyond 2^53
    marks = {text.rsplit(" ", 2)[0]: at for text, at in runs["calm"]["marks"]}
    assert marks["platform pitch"] == pytest.approx(1.0 / 29.9, rel=0.02)  # of the platform's file
    assert marks["wave peak"] == pytest.approx(0.1, abs=0.02)
    assert marks["1P"] == pytest.approx(12.0 / 60.0, rel=0.01)


def test_a_leaderboard_file_gives_its_intervals_and_differences(copy):
    name = "RotSpeed_std_[rpm]"
    figure = {name: {"mean": 0.25, "low": 0.2, "high": 0.3}}
    gap = {name: {"mean": -0.1, "low": -0.2, "high": -0.05, "percent": -28.6, "p": 0.004}}
    part = {"runs": 4, "failed": 0, "metrics": figure, "difference": gap}
    score = {"mean": 0.9, "low": 0.8, "high": 1.0}
    score |= {"lifetime": dict(score), "winds": {"mean": 0.95, "low": None, "high": None}}
    entry = {"controller": "calm", **part, "score": score, "cases": {"ntm_14": part}}
    entries = [entry | {"held": False, "undecided": ["speed"]}]
    board = {"baseline": "busy", "interval": {"level": 0.95, "method": "bootstrap"}, "controllers": entries}
    (copy / "leaderboard.json").write_text(json.dumps(board))
    data = data_of(write_report(copy, schedule=False))
    row = data["board"][""][0]
    assert row["intervals"] == {name: [0.2, 0.3], "score_lifetime": [0.8, 1.0]}
    assert (row["values"]["score_winds"], row["held"], row["undecided"]) == (0.95, False, ["speed"])
    assert row["percent"] == {name: -28.6} and row["gap_intervals"] == {name: [-0.2, -0.05]}
    assert row["p"] == {name: pytest.approx(0.004)} and data["board"]["ntm_14"][0]["p"] == {}
    assert data["baseline"] == "busy" and data["sort"] == "score_lifetime"
    assert data["board"]["ntm_18"] == []
    assert "rotor-speed std \N{MINUS SIGN}29" in (copy / "report.html").read_text(encoding="utf-8")
    (copy / "leaderboard.json").write_text('{"rows": []}')
    why = "leaderboard.json' does not match this version .baseline is missing.*controllers is missing"
    with pytest.raises(InputError, match=why):
        write_report(copy, schedule=False)


def test_the_limit_at_own_spending_is_a_column_with_its_range_over_the_winds(copy, browser):  # noqa: F811
    rows = [("calm", "ntm_14", 1.1), ("calm", "ntm_18", 1.3), ("busy", "ntm_14", np.nan)]
    pd.DataFrame(rows, columns=["controller", "case", OF_LIMIT]).to_csv(copy / FILE, index=False)
    page = write_report(copy, schedule=False)
    board = data_of(page)["board"]
    (calm,), (at_18,) = ([r for r in board[case] if r["controller"] == "calm"] for case in ("", "ntm_18"))
    assert (calm["values"][OF_LIMIT], calm["intervals"][OF_LIMIT]) == (pytest.approx(1.2), [1.1, 1.3])
    assert at_18["values"][OF_LIMIT] == 1.3
    assert not any(OF_LIMIT in r["values"] for r in board[""] if r["controller"] != "calm")
    with offline_page(browser, page, SERIES) as opened:
        opened.locator("#intervals").check()
        assert opened.locator("#table tbody tr", has_text="calm").first.locator("td").last.inner_text() == (
            "1.20\n1.10 … 1.30"
        )
        assert OF_LIMIT not in opened.locator("#box-what").inner_html()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"cases": ["ntm_19"]}, "ntm_18"),
        ({"seeds": [9]}, "unknown seed"),
        ({"out": "page.pdf"}, "html"),
        ({"rate": 0.0}, "rate = 0"),
        ({"rate": float("nan")}, "rate = nan"),
    ],
)
def test_settings_that_cannot_be_used_are_named(folder, arguments, message):
    with pytest.raises(InputError, match=message):
        write_report(folder, schedule=False, **arguments)


def test_a_folder_without_results_is_refused(tmp_path):
    result = CliRunner().invoke(cli.app, ["report", str(tmp_path)])
    assert result.exit_code == EXIT_INPUT and "contains no results.csv" in result.stderr
    with pytest.raises(InputError, match="is not a folder"):
        write_report(tmp_path / "none")


def test_the_schedule_is_the_steady_point_of_each_wind(folder, tmp_path):
    page = tmp_path / "page.html"
    result = CliRunner().invoke(cli.app, ["report", str(folder), "--out", str(page)])
    assert result.exit_code == 0, result.stderr
    schedule = data_of(page)["schedule"]
    panels = {panel["label"]: panel["values"] for panel in schedule["panels"]}
    point = fowt_env.trim(fowt_env.build_scene("oc3_hywind", wind=18.0))
    at = SCHEDULE_WINDS.index(18.0)
    assert panels["blade pitch (deg)"][at] == pytest.approx(point["BldPitch1"], rel=1e-5)
    assert panels["thrust (kN)"][at] == pytest.approx(point["RotThrust"], rel=1e-5)


def test_a_page_comes_out_where_the_platform_of_the_evaluation_is_a_file_of_another_place(copy):
    cases = {case: {"platform": "/home/alice/<b>.toml"} for case in CASES}
    (copy / "manifest.json").write_text(json.dumps({"cases": cases}))
    text = write_report(copy).read_text(encoding="utf-8")
    assert "&#x27;/home/alice/&lt;b&gt;.toml&#x27; does not exist. Choose another --platform" in text
    assert data_of(copy / "report.html")["schedule"] is None
    with pytest.raises(InputError, match="mine.toml"):
        write_report(copy, platform="mine.toml")


@pytest.fixture(scope="module")
def page_file(folder, tmp_path_factory):
    return write_report(folder, tmp_path_factory.mktemp("page") / "page.html", schedule=False)


@pytest.fixture
def opened(browser, page_file):  # noqa: F811
    with offline_page(browser, page_file, SERIES) as page:
        yield page


def data_of_opened(page):
    """The data of the page that a browser has open."""
    return json.loads(page.locator("#data").text_content())


def test_a_click_on_a_heading_sorts_and_a_second_one_turns_the_order_round(opened):
    def names():
        return opened.locator("#table tbody td:first-child").all_inner_texts()

    heading = opened.locator('#table th[data-key="PtfmPitch_std_[deg]"] button')
    heading.click()
    assert names() == [EVIL, "calm", "busy"]  # busy lost a run: last in either order
    assert opened.locator("#table th[aria-sort]").get_attribute("aria-sort") == "ascending"
    heading.click()
    assert names() == ["calm", EVIL, "busy"]
    opened.locator('#table th[data-key="controller"] button').click()
    assert names() == [EVIL, "busy", "calm"]


def test_every_plot_is_drawn_and_names_are_text_in_it(opened):
    assert opened.locator("#pareto-plot .points path").count() == len(CONTROLLERS)
    assert opened.locator("#box-plot path.box").count() == len(CONTROLLERS) * len(CASES)
    assert opened.locator("#spectra-plot path.js-line").count() >= len(CONTROLLERS)
    assert opened.locator("img").count() == 0
    assert EVIL in opened.locator("#series-plot .legendtext").all_text_contents()


def test_another_case_and_another_theme_change_what_is_drawn(opened):
    drawn = "[...document.querySelectorAll('#series-plot path.js-line')].map(p => p.getAttribute('d')).join()"
    before = opened.evaluate(drawn)
    opened.select_option("#series-case", "ntm_18")
    opened.wait_for_function(f"{drawn} !== {json.dumps(before)}")
    shown = opened.evaluate("document.getElementById('series-plot').data.map(line => line.y)")
    data = data_of_opened(opened)
    expected = decoded(data["series"]["ntm_18"]["1"]["calm"]["series"]["RotSpeed_[rpm]"], data["pool"])
    assert any(len(y) == len(expected) and np.allclose(y, expected, atol=1e-9) for y in shown)
    light = opened.evaluate("getComputedStyle(document.body).backgroundColor")
    opened.click("#theme")
    assert opened.evaluate("getComputedStyle(document.body).backgroundColor") != light


def test_a_difference_has_its_percentage_its_mark_and_its_star_in_the_table(copy, browser):  # noqa: F811
    """Significant: star and mark; tested and not significant: neither; not tested: the mark alone."""
    speed, pitch, other = "RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "novelty_[-]"
    base = {"mean": 0.5}
    gaps = {
        speed: {"mean": -0.2, "percent": -40.0, "p": 0.001},
        pitch: {"mean": 0.1, "percent": 20.0, "p": 0.4},
        "blade_pitch_travel_[deg/s]": {"mean": 0.1, "percent": 50.0},
    }
    part = {"runs": 4, "failed": 0, "metrics": dict.fromkeys((*gaps, other), base)}
    entries = [
        {"controller": "calm", "rank": 1, **part, "difference": {}},
        {"controller": EVIL, "rank": 2, **part, "difference": gaps},
    ]
    (copy / "leaderboard.json").write_text(json.dumps({"baseline": "calm", "controllers": entries}))
    with offline_page(browser, write_report(copy, schedule=False), SERIES) as page:
        cells = page.locator("#table tbody tr").nth(1).locator("td .gap")
        assert cells.all_inner_texts() == ["\N{MINUS SIGN}40 % * ✓", "+20 %", "+50 % ✗"]
        assert [each.get_attribute("class") for each in cells.all()] == [
            "gap better sure",
            "gap",
            "gap worse",
        ]
        page.select_option("#table-view", "differences")
        assert page.locator("#table tbody tr").nth(0).locator("td .gap").first.inner_text() == "baseline"
        page.select_option("#table-case", "ntm_14")  # which the file has nothing of
        assert page.locator("#table tbody td").count() == 0


def test_a_law_that_lost_runs_is_best_in_nothing_and_a_wreck_sets_no_scale(copy, browser):  # noqa: F811
    figure = {"RotSpeed_std_[rpm]": {"mean": 0.5}, "PtfmPitch_std_[deg]": {"mean": 0.5}}
    wreck = {name: {"mean": 0.001} for name in figure}
    gap = {name: {"mean": -0.4, "percent": -80.0} for name in figure}
    entries = [
        {"controller": "calm", "runs": 4, "failed": 0, "metrics": figure, "difference": {}},
        {"controller": EVIL, "runs": 4, "failed": 0, "metrics": figure, "difference": {}},
        {"controller": "busy", "runs": 4, "failed": 0, "lost_power": 2, "metrics": wreck, "difference": gap},
    ]
    (copy / "leaderboard.json").write_text(json.dumps({"baseline": "calm", "controllers": entries}))
    path = run_file(copy / "runs", "busy", "ntm_18", 2)
    frame = pd.read_parquet(path)
    frame.loc[frame.index[-100:], "RotSpeed_[rpm]"] = 0.0
    frame.to_parquet(path)
    with offline_page(browser, write_report(copy, schedule=False), SERIES) as page:
        names = page.locator("#table thead th button .label").all_inner_texts()
        assert "rank" not in names and names[1] == "lost"
        rows = page.locator("#table tbody tr")
        assert [rows.nth(i).locator(".best").count() for i in range(3)] == [2, 2, 0]
        assert "2 lost power" in rows.nth(2).inner_text() and "✓" not in rows.nth(2).inner_text()
        ends = "document.getElementById('pareto-plot').layout.xaxis.range"
        assert page.evaluate(ends)[0] > 0.1
        assert "1 off scale: busy" in page.locator("#pareto-remark").inner_text()
        page.select_option("#series-case", "ntm_18")
        page.select_option("#series-seed", "2")
        low, high = page.evaluate("document.getElementById('series-plot').layout.yaxis3.range")
        assert 11.0 < low < high < 13.0  # of the rotor speed, which is at rest at the end of the wreck
        notes = page.evaluate(
            "document.getElementById('series-plot').layout.annotations.map(each => each.text)"
        )
        assert "1 off scale: busy" in notes


def test_a_metric_is_explained_to_pointer_and_keyboard_and_the_explanation_can_be_left(opened):
    tip = opened.locator("#tip")
    assert tip.is_hidden()
    heading = opened.locator('#table th[data-key="RotSpeed_std_[rpm]"] button')
    heading.hover()
    assert re.search("Rotor speed: standard deviation. Unit: rpm. Less is better.", tip.inner_text())
    opened.mouse.move(5, 5)
    assert tip.is_hidden()
    heading.focus()
    assert tip.is_visible() and heading.get_attribute("aria-describedby") == "tip"
    opened.keyboard.press("Escape")
    assert tip.is_hidden() and heading.get_attribute("aria-describedby") is None
    opened.locator("#wind-table th [data-tip]").first.focus()
    assert "seeds 1, 2" in tip.inner_text()


def test_the_pareto_plot_has_the_axes_of_the_png_and_names_its_line_only_if_there_is_one(opened):
    titles = opened.evaluate(
        "['xaxis', 'yaxis'].map(k => document.getElementById('pareto-plot').layout[k].title.text)"
    )
    assert titles[0].startswith("rotor speed") and titles[1].startswith("platform pitch")
    calm = opened.evaluate("document.getElementById('pareto-plot').data.find(trace => trace.name === 'calm')")
    means = data_of_opened(opened)["board"][""][0]["values"]
    assert calm["x"] == [means["RotSpeed_std_[rpm]"]] and calm["y"] == [means["PtfmPitch_std_[deg]"]]
    line = "document.getElementById('pareto-plot').data.some(trace => trace.name === 'Pareto front')"
    assert opened.evaluate(line)  # "calm" turns most evenly, the last one pitches least
    assert "dotted line" in opened.locator("#pareto-remark").inner_text()
    # of a single controller there is no front
    opened.evaluate("DATA.board[''] = DATA.board[''].slice(0, 1); drawPareto()")
    assert not opened.evaluate(line)
    assert "dotted line" not in opened.locator("#pareto-remark").inner_text()


def test_a_lost_run_is_seen_with_its_reason_where_its_series_ends(opened):
    assert f"busy, ntm_18, seed 2: failed: lost {EVIL}" in opened.locator("#leaderboard li").all_inner_texts()
    assert opened.locator("#series-lost li").count() == 0
    opened.select_option("#series-case", "ntm_18")
    opened.select_option("#series-seed", "2")
    assert opened.locator("#series-lost li").all_inner_texts() == [f"busy: failed: lost {EVIL}"]
    assert "busy (lost)" in opened.locator("#series-plot .legendtext").all_text_contents()


def test_what_slips_in_as_markup_is_not_run(browser, page_file, tmp_path):  # noqa: F811
    """The policy's hashes, tried with a page into which a script and a handler were written."""
    path = tmp_path / "page.html"
    text = page_file.read_text(encoding="utf-8")
    attack = '<script>window.struck = 1</script><img src="x" onerror="window.struck = 2"></body>'
    path.write_text(text.replace("</body>", attack), encoding="utf-8")
    context = browser.new_context(offline=True)
    page = context.new_page()
    page.goto(path.as_uri())
    page.wait_for_selector("#series-plot .scatterlayer path.js-line")  # its own scripts run
    assert page.evaluate("window.struck") is None
    context.close()


@pytest.mark.nightly
def test_nothing_is_wider_than_a_telephone_and_a_wide_table_says_that_it_scrolls(browser, page_file):  # noqa: F811
    with offline_page(browser, page_file, SERIES, viewport={"width": 390, "height": 800}) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        assert page.locator("#leaderboard .hint").is_visible()
        page.evaluate("document.querySelector('#leaderboard .scroll > div').scrollLeft = 1e6")
        page.wait_for_selector("#leaderboard .scroll:not(.more)")
