"""One self-contained HTML page of an evaluation: table, plots, schedule, provenance.

    from fowt_env.training.reports.html_page import write_report
    write_report("results/above_rated")

The page holds its data and plotly.js, and asks nothing of a network. Needs plotly:
pip install "fowt-env[report]".
"""

import base64
import html
import json
import platform as machine
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from string import Template

import numpy as np

from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.files import parse_json
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import read_table
from fowt_env.training.evaluation.bootstrap import lifetime_means
from fowt_env.training.evaluation.evaluate import run_file
from fowt_env.training.evaluation.failures import failures_as_worst
from fowt_env.training.evaluation.leaderboard_file import check_leaderboard
from fowt_env.training.evaluation.metrics import better, mean_exponent
from fowt_env.training.evaluation.results_table import KEY, WEIGHT, WORDS, case_shares, read_results
from fowt_env.training.evaluation.run_case import OK, TRIPPED
from fowt_env.training.evaluation.seeds import ranges
from fowt_env.visual.time_series import PANELS, SPECTRA, TIME, frequency_marks, spectrum

NO_METRIC = (*KEY, *WORDS, "stopped_[s]", "scored_[s]", WEIGHT)
# columns that the leaderboard shows at once, those of them that the table has
PAGE_METRICS = (
    "RotSpeed_std_[rpm]",
    "PtfmPitch_std_[deg]",
    "blade_pitch_travel_[deg/s]",
    "torque_travel_[kN-m/s]",
    "RotTorq_DEL_[kN-m]",
    "TwrBsMyt_DEL_[kN-m]",
    "GenPwr_capped_mean_[kW]",
    "GenPwr_max_[kW]",
)
PARETO_AXES = ("PtfmPitch_std_[deg]", "RotSpeed_std_[rpm]", "blade_pitch_travel_[deg/s]")  # across, up, size
ALL_CASES = ""
MEAN, DIFFERENCE = "mean", "difference"
# what the shown size allows; stated on the page
DISPLAY_RATE = 2.0  # Hz
MAX_POINTS = 3000  # of one drawn series
MAX_SERIES_RUNS = 64  # whose time series are in the page, unless cases are named
SPECTRUM_RANGE = (0.002, 1.0)  # Hz
SPECTRUM_SPAN = 1e-7  # of the peak: what lies lower is not drawn
PERCENTILES = (1.0, 25.0, 50.0, 75.0, 99.0)
SAMPLED_CHANNELS = (  # channels whose samples have boxes
    "RotSpeed_[rpm]",
    "GenPwr_[kW]",
    "PtfmPitch_[deg]",
    "PtfmSurge_[m]",
    "BldPitch1_[deg]",
    "FAIRTEN1_[kN]",
)
# m/s
SCHEDULE_WINDS = (4.0, 6.0, 8.0, 10.0, 11.0, 11.5, 12.0, 13.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0, 25.0)
SCHEDULE = (
    ("rotor speed (rpm)", "RotSpeed"),
    ("blade pitch (deg)", "BldPitch1"),
    ("power (kW)", "GenPwr"),
    ("thrust (kN)", "RotThrust"),
    ("generator torque (kN m)", "GenTq"),
    ("platform pitch (deg)", "PtfmPitch"),
)


def write_report(
    folder, out=None, cases=None, seeds=None, rate=None, platform=None, schedule=True, progress=None
):
    """Path of the HTML page written of an evaluation's folder.

    folder     holds results.csv (or metrics.csv) and runs/<controller>/<case>_seed<n>.parquet; its
               leaderboard.json and manifest.json are used where they are there
    out        the page; None: report.html in the folder
    cases      names of the cases whose time series go into the page; None: evenly chosen ones, so that
               at most MAX_SERIES_RUNS runs do
    seeds      whose time series go in; None: the first of each case
    rate       samples per second of the drawn series, means over their interval; None: DISPLAY_RATE, or
               what MAX_POINTS allow
    platform   whose steady schedule is shown; None: that of the manifest's cases, else oc3_hywind; where its
               file cannot be read here, the page says so in place of the schedule
    schedule   whether there is one (it takes some seconds)
    progress   called as progress(done, total, text)
    Raises: InputError for a folder without results, a table or run that cannot be read, an unknown case
    or seed, or where plotly is missing.
    """
    plotly_script = _plotly_script()
    folder = Path(folder)
    out = folder / "report.html" if out is None else Path(out)
    if out.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"report page {str(out)!r}: must end with .html")
    if rate is not None:
        check_number("rate", rate, 0.0, low_open=True, allowed="a positive number of samples per second")
    if not folder.is_dir():
        raise InputError(f"results {str(folder)!r} is no folder: make one with fowt evaluate --out FOLDER")
    table = read_results(folder)
    board_file, manifest = _leaderboard(folder / "leaderboard.json"), _json_file(folder / "manifest.json")
    say = progress or (lambda done, total, text: None)
    chosen = _chosen_runs(table, cases, seeds)
    runs = _read_runs(folder, table, chosen, rate, say)
    point = _schedule(platform, _platform_of(manifest), say) if schedule else None
    data = _page_data(table, board_file, runs, point)
    texts = _page_texts(folder, table, manifest, board_file, data, runs, point)
    page = Path(__file__).parent / "page"
    scripts = {"plotly": plotly_script, "script": (page / "page.js").read_text(encoding="utf-8")}
    style = (page / "page.css").read_text(encoding="utf-8")
    template = Template((page / "page.html").read_text(encoding="utf-8"))
    text = template.substitute(texts, style=style, data=_embedded_json(data), **scripts)
    with replacing(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return out


def _plotly_script():
    """plotly.js itself. Raises: InputError that names the extra to install."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise InputError(f'the report needs plotly ({error}): pip install "fowt-env[report]"') from error
    return get_plotlyjs()


def _json_file(path):
    """Mapping in a JSON file, {} without one. Raises: InputError for a file that holds something else."""
    if not path.is_file():
        return {}
    try:
        value = parse_json(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"file {str(path)!r} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise InputError(f"file {str(path)!r}: must hold a mapping")
    return value


def _leaderboard(path):
    """LeaderboardFile, or None without the file. Raises: InputError for a file that holds something else."""
    return check_leaderboard(_json_file(path), path) if path.is_file() else None


def _chosen_runs(table, cases, seeds):
    """Rows of the runs whose time series go into the page."""
    known = list(dict.fromkeys(table["case"]))
    for case in cases or ():
        if case not in known:
            raise unknown("case of the results", case, known)
    there = set(table["seed"])
    for seed in seeds or ():
        if seed not in there:
            raise unknown("seed of the results", seed, there)
    if seeds is None:
        first = table.groupby("case")["seed"].transform("min")
        table = table[table["seed"] == first]
    else:
        table = table[table["seed"].isin(seeds)]
    if cases is None:
        per_case = max(table.groupby("case").size())
        capacity = max(1, MAX_SERIES_RUNS // per_case)
        if len(known) > capacity:
            kept = np.unique(np.linspace(0, len(known) - 1, capacity).round().astype(int))
            known = [known[i] for i in kept]
        cases = known
    return table[table["case"].isin(cases)]


def _read_runs(folder, table, chosen, rate, say):
    """{"series": {case: {seed: {controller: drawn run}}}, "quantiles": ..., "rate": Hz drawn, "missing": n}.

    Every run is read once: its samples count in the boxes, and if it is a chosen one it is drawn.
    """
    drawn = set(chosen.index)
    series, samples, rates, missing = {}, {}, [], 0
    for number, (index, row) in enumerate(table.iterrows()):
        say(number, len(table), f"reading {row['controller']}, {row['case']}, seed {row['seed']}")
        path = run_file(folder / "runs", row["controller"], row["case"], row["seed"])
        frame = read_table(path) if path.is_file() else None
        if frame is None or TIME not in frame.columns or len(frame) < 2:
            missing += 1
            continue
        skip = _skipped(row, frame)
        kept = frame[frame[TIME] >= frame[TIME].iloc[0] + skip - 1e-9]
        if row["status"] == "ok" and len(kept):
            for channel in (name for name in SAMPLED_CHANNELS if name in frame.columns):
                cell = samples.setdefault(channel, {}).setdefault((row["controller"], row["case"]), [])
                cell.append(kept[channel].to_numpy())
        if index in drawn:
            run, used = _drawn_run(frame, skip, rate)
            rates.append(used)
            series.setdefault(row["case"], {}).setdefault(str(row["seed"]), {})[row["controller"]] = run
    quantiles = {}
    for channel, cells in samples.items():
        for (controller, case), parts in cells.items():
            values = np.percentile(np.concatenate(parts), PERCENTILES)
            quantiles.setdefault(channel, {}).setdefault(controller, []).append([case, *_rounded(values)])
    return {"series": series, "quantiles": quantiles, "rates": sorted(set(rates)), "missing": missing}


def _skipped(row, frame):
    """Seconds at the start of a run that were not scored; 0 where the table does not say."""
    scored = row.get("scored_[s]", float("nan"))
    length = frame[TIME].iloc[-1] - frame[TIME].iloc[0]
    return float(max(0.0, length - scored)) if row["status"] == "ok" and scored == scored else 0.0


def _drawn_run(frame, skip, rate):
    """({"series", "spectra", "marks", "start", "skip"} of one run, samples per second that are drawn)."""
    time = frame[TIME].to_numpy(dtype=float)
    step = (time[-1] - time[0]) / (len(time) - 1)
    wanted = DISPLAY_RATE if rate is None else rate
    block = max(1, round(1.0 / (wanted * step)))
    if rate is None:
        block = max(block, -(-len(time) // MAX_POINTS))
    present = [channel for _, channel in PANELS if channel in frame.columns]
    series = {}
    for channel in present:
        values = _block_means(frame[channel].to_numpy(dtype=float), block)
        series[channel] = _packed(values, time[0] + 0.5 * (block - 1) * step, block * step)
    scored = frame[time >= time[0] + skip - 1e-9]
    spectra = {}
    for _, channel, _ in SPECTRA:
        if channel in frame.columns and len(scored) >= 16 and np.isfinite(scored[channel]).all():
            frequency, density = spectrum(scored[TIME], scored[channel])
            inside = (frequency >= SPECTRUM_RANGE[0]) & (frequency <= SPECTRUM_RANGE[1])
            if inside.any() and density[inside].max() > 0.0:
                floor = density[inside].max() * SPECTRUM_SPAN
                logs = np.log10(np.maximum(density[inside], floor))
                spectra[channel] = _packed(logs, frequency[inside][0], frequency[1] - frequency[0])
    marks = [[f"{name} {at:.3g} Hz", float(at)] for name, at in frequency_marks(scored)] if spectra else []
    run = {"series": series, "spectra": spectra, "marks": marks, "start": float(time[0]), "skip": skip}
    return run, float(f"{1.0 / (block * step):.4g}")


def _block_means(values, block):
    """Means over `block` samples each; a shorter rest at the end is left out."""
    if block == 1:
        return values
    return values[: len(values) // block * block].reshape(-1, block).mean(axis=1)


def _packed(values, start, step):
    """Evenly spaced values as base64 of 16-bit codes between their bounds; code 0 is a missing value."""
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    span = high - low
    codes = np.zeros(len(values), dtype="<u2")
    codes[finite] = 1 + (np.rint((values[finite] - low) / span * 65534.0) if span > 0.0 else 0)
    text = base64.b64encode(codes.tobytes()).decode("ascii")
    return {"codes": text, "low": low, "high": high, "start": float(start), "step": float(step)}


def _rounded(values):
    """Floats with six digits, NaN as None: what JSON can hold."""
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]


def _platform_of(manifest):
    """Platform of a manifest's cases where they name a single one, else oc3_hywind."""
    cases = manifest.get("cases")
    described = cases.values() if isinstance(cases, dict) else ()
    named = {case.get("platform") for case in described if isinstance(case, dict)} - {None}
    only = named.pop() if len(named) == 1 else None
    return only if isinstance(only, str) else "oc3_hywind"


def _schedule(asked, own, say):
    """{"platform", "wind", "panels"} of the steady operating points over wind speed.

    Of the platform that was asked for, else of the evaluation's own: {"platform", "missing": why} where that
    is a file of another place.
    """
    import fowt_env

    platform = asked or own
    try:
        fowt_env.build_scene(platform)
    except InputError as error:
        if asked:
            raise
        return {"platform": platform, "missing": str(error)}
    points = []
    for number, speed in enumerate(SCHEDULE_WINDS):
        say(number, len(SCHEDULE_WINDS), f"steady point at {speed:g} m/s")
        points.append(fowt_env.trim(fowt_env.build_scene(platform, wind=speed)))
    panels = [
        {"label": label, "values": _rounded([point[name] for point in points])} for label, name in SCHEDULE
    ]
    return {"platform": platform, "wind": list(SCHEDULE_WINDS), "panels": panels}


def _metric_columns(table):
    """[{name, label, unit, headline, better}] of the table's metrics, the headline ones first."""
    names = [name for name in table.columns if name not in NO_METRIC and table[name].notna().any()]
    first = [name for name in PAGE_METRICS if name in names]
    columns = []
    for name in [*first, *(name for name in names if name not in first)]:
        label, _, unit = name.partition("_[")
        columns.append(
            {
                "name": name,
                "label": label.replace("_", " "),
                "unit": unit.removesuffix("]"),
                "headline": name in first or not first,
                "better": better(name),
            }
        )
    return columns


def _means(table, metrics, case):
    """Leaderboard rows from the table alone: lifetime means, failed and tripped runs as the worst."""
    rows = []
    part = failures_as_worst(table if case == ALL_CASES else table[table["case"] == case], metrics)
    exponents = np.array([mean_exponent(name) for name in metrics])
    for controller, group in part.groupby("controller", sort=False):
        cases = list(dict.fromkeys(group["case"]))
        by_case = (group[metrics] ** exponents).groupby(group["case"]).mean().reindex(cases).to_numpy()
        shares = np.ones(1) if case != ALL_CASES else case_shares(group, cases)
        means = lifetime_means(by_case[:, None] ** (1.0 / exponents), np.ones((1, 1)), shares, exponents)[0]
        lost = {
            "failed": int((~group["status"].isin((OK, TRIPPED))).sum()),
            "tripped": int((group["status"] == TRIPPED).sum()),
        }
        values = dict(zip(metrics, _rounded(means), strict=True))
        rows.append({"controller": controller, "runs": len(group), **lost, "values": values})
    return rows


def _board_rows(board, what, case):
    """Leaderboard rows of a LeaderboardFile: means or paired differences, with their intervals."""
    rows = []
    for entry in board.controllers:
        part = entry if case == ALL_CASES else entry.cases.get(case)
        if part is None:
            continue
        figures = dict(part.metrics if what == MEAN else part.difference)
        if entry.score and case == ALL_CASES and what == MEAN:
            figures["score"] = entry.score
        rows.append(
            {
                "controller": entry.controller,
                "runs": part.runs,
                "failed": part.failed,
                "tripped": part.tripped,
                "rank": entry.rank,
                "beyond": entry.beyond,
                "values": {name: figure.mean for name, figure in figures.items()},
                "intervals": {
                    name: [figure.low, figure.high]
                    for name, figure in figures.items()
                    if figure.low is not None and figure.high is not None
                },
            }
        )
    return rows


def _board(table, board_file, metrics):
    """({view: {case: rows}}, {view: title}) of the leaderboard, from leaderboard.json where it is there."""
    cases = [ALL_CASES, *dict.fromkeys(table["case"])]
    if board_file is None:
        return {MEAN: {case: _means(table, metrics, case) for case in cases}}, {MEAN: "means"}
    views = {
        what: {case: _board_rows(board_file, what, case) for case in cases} for what in (MEAN, DIFFERENCE)
    }
    difference = "no differences: all have failed runs"
    if board_file.baseline is not None:
        difference = f"differences to {board_file.baseline}"
    return views, {MEAN: "means", DIFFERENCE: difference}


def _remark(table, board_file, case):
    """What the figures of the leaderboard are, in a sentence or two."""
    part = table if case == ALL_CASES else table[table["case"] == case]
    seeds, cases = sorted(set(part["seed"])), part["case"].nunique()
    text = f"{len(part)} runs, {cases} {'case' if cases == 1 else 'cases'}, "
    text += f"{'seed' if len(seeds) == 1 else 'seeds'} {_numbers(seeds)}. "
    interval = None if board_file is None else board_file.interval
    if interval is not None and len(seeds) >= interval.least_seeds:
        text += f"Small print: {100 * interval.level:g} % intervals ({interval.method}). "
    else:
        text += "Means over the lifetime; a run that failed or tripped has the worst figures of its case. "
        why = "there is no leaderboard.json"
        if interval is not None:
            count = "a single seed" if len(seeds) == 1 else f"{len(seeds)} seeds"
            why = f"{count} of the {interval.least_seeds} that one needs"
        text += f"No intervals: {why}. "
    return text + "Click a heading to sort; the best figure of a column is in colour."


def _numbers(values):
    """1, 2, 3, 7 as "1 to 3, 7"."""
    texts = (str(a) if a == b else f"{a} to {b}" if b > a + 1 else f"{a}, {b}" for a, b in ranges(values))
    return ", ".join(texts)


def _page_data(table, board_file, runs, schedule):
    """Mapping that the page's script reads."""
    metrics = _metric_columns(table)
    names = [metric["name"] for metric in metrics]
    views, titles = _board(table, board_file, names)
    score = {"name": "score", "label": "score", "unit": "", "headline": True, "better": -1}
    if any(row["values"].get("score") is not None for row in views[MEAN][ALL_CASES]):
        metrics = [score, *metrics]
    shown = [metric["name"] for metric in metrics]
    good = table[table["status"] == "ok"]
    points = [
        [
            *(row[key] for key in ("controller", "case", "seed")),
            dict(zip(names, _rounded([row[name] for name in names]), strict=True)),
        ]
        for row in good.to_dict("records")
    ]
    labels = {channel: label.replace("\n", " ") for label, channel in PANELS}
    cases = list(dict.fromkeys(table["case"]))
    ranked = board_file is not None and all(entry.rank is not None for entry in board_file.controllers)
    first = ("rank",) if ranked else ()
    sortable = {*first, *shown, "controller"}
    shares = dict(zip(cases, map(float, case_shares(table, cases)), strict=True))
    return {
        "controllers": list(dict.fromkeys(table["controller"])),
        "ranked": ranked,
        "baseline": None if board_file is None else board_file.baseline,
        "shares": shares if len(set(shares.values())) > 1 else None,
        "cases": cases,
        "metrics": metrics,
        "sort": next(name for name in (*first, "score", PARETO_AXES[1], "controller") if name in sortable),
        "views": titles,
        "board": views,
        "remarks": {case: _remark(table, board_file, case) for case in [ALL_CASES, *cases]},
        "pareto": list(PARETO_AXES),
        "runs": points,
        "quantiles": runs["quantiles"],
        "series": runs["series"],
        "panels": [{"label": label.replace("\n", "<br>"), "channel": channel} for label, channel in PANELS],
        "spectra": [
            {"label": f"{label}<br>({unit}²/Hz)", "channel": channel} for label, channel, unit in SPECTRA
        ],
        "titles": {**{name: name.replace("_", " ") for name in names}, **labels},
        "schedule": None if schedule is None or "missing" in schedule else schedule,
    }


def _embedded_json(data):
    """JSON that can stand inside a script element: no < that could end it, and no NaN."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _page_texts(folder, table, manifest, board_file, data, runs, schedule):
    """{placeholder: HTML} of what the page says in words; every name is escaped."""
    suite = manifest.get("suite")
    suite = suite.get("name") if isinstance(suite, dict) else suite
    title = f"{suite or folder.resolve().name}: evaluation of controllers"
    controllers, all_cases = data["controllers"], len(data["cases"])
    lead = f"{len(controllers)} controllers on {all_cases} cases: {', '.join(controllers)}"
    failed = table[table["status"] != OK]
    lost = failed.itertuples()
    items = "".join(
        f"<li>{html.escape(text)}</li>"
        for text in (f"{r.status}: {r.controller}, {r.case}, seed {r.seed}: {r.reason}" for r in lost)
    )
    summary = f'<summary class="bad">{len(failed)} failed or tripped runs</summary>'
    failures = f"<details open>{summary}<ul>{items}</ul></details>"
    section = ""
    if schedule and "missing" in schedule:
        why = html.escape(schedule["missing"])
        section = (
            '<section id="schedule"><div class="heading"><h2>Steady schedule</h2></div><p class="remark">'
            f"Not shown: {why}. Give another with --platform, or none with --no-schedule.</p></section>"
        )
    elif schedule:
        where = html.escape(schedule["platform"])
        section = (
            '<section id="schedule"><div class="heading"><h2>Steady schedule</h2></div><p class="remark">'
            f"Operating points of {where} in steady wind and still water, the platform floating.</p>"
            '<div class="plot" id="schedule-plot"></div></section>'
        )
    rates = " or ".join(f"{rate:g}" for rate in runs["rates"]) or "no"
    series = (
        "Drag to zoom, double click to go back, click a name to hide it."
        f" {len(runs['series'])} of {all_cases} cases are in this page, at {rates} samples per second (means"
        " over that interval); the files under runs/ hold every sample. Shaded: the start that is not scored."
    )
    if runs["missing"]:
        series += f" {runs['missing']} of {len(table)} runs have no time series in the folder."
    spectra = (
        "Of the case and seed chosen above, the scored part of the run, from all samples of its file: Welch's"
        " estimate, Hann windows of a third of the record. Dashed: wave peak and 1P of the first controller."
    )
    winds = "Means over the seeds of each case; below, in small print, the ratio to the baseline's."
    if data["shares"] is not None:
        winds += " Below the name of a case stands its share of the lifetime."
    remarks = {"series_remark": series, "spectra_remark": spectra, "winds_remark": winds}
    texts = {"title": title, "lead": lead, **remarks}
    return {
        **{name: html.escape(text) for name, text in texts.items()},
        "failures": failures if len(failed) else "",
        "schedule_section": section,
        "schedule_link": '<a href="#schedule">Schedule</a>' if schedule else "",
        "provenance": _provenance(table, manifest, board_file),
    }


def _provenance(table, manifest, board_file):
    """Rows of the table of provenance."""
    facts = {}
    if manifest:
        suite = manifest.get("suite")
        if isinstance(suite, dict):
            suite = " ".join(str(suite[key]) for key in ("name", "version") if key in suite)
        facts |= {"suite": suite, "created": manifest.get("created"), "plant sources": manifest.get("plant")}
        facts |= _case_facts(manifest)
        for key in ("versions", "options", "controllers"):
            if isinstance(manifest.get(key), dict):
                facts[key] = ", ".join(
                    f"{name} {_brief(name, value)}" for name, value in manifest[key].items()
                )
    else:
        facts["evaluation"] = "the folder has no manifest.json: the versions that made its runs are not known"
    if board_file is not None and board_file.baseline is not None:
        facts["baseline"] = board_file.baseline
    facts["seeds"] = _numbers(sorted(set(table["seed"])))
    facts["cases"] = ", ".join(dict.fromkeys(table["case"]))
    if "scored_[s]" in table.columns:
        lengths = sorted(table["scored_[s]"].dropna().unique())
        facts["scored"] = ", ".join(f"{value:g} s" for value in lengths)
    packages = ("fowt-env", "numpy", "scipy", "pandas", "plotly")
    made = ", ".join(f"{name} {_version(name)}" for name in packages)
    facts["page made by"] = f"{made}, Python {machine.python_version()}"
    return "".join(
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(str(value))}</td></tr>"
        for name, value in facts.items()
        if value not in (None, "")
    )


def _case_facts(manifest):
    """{"trip", "sensors", "site"} of a manifest's cases and suite, as texts."""
    cases = manifest.get("cases")
    cases = [case for case in (cases.values() if isinstance(cases, dict) else ()) if isinstance(case, dict)]
    facts = {}
    for key in ("trip", "sensors"):
        found = dict.fromkeys(str(case[key]) for case in cases if case.get(key) is not None)
        facts[key] = " or ".join(found)
    suite = manifest.get("suite")
    site = suite.get("site") if isinstance(suite, dict) else None
    if isinstance(site, dict):
        facts["site"] = f"Weibull A = {site.get('A')} m/s, k = {site.get('k')} ({site.get('source')})"
    return facts


def _brief(label, value):
    """A manifest's value in a few characters: a controller's name, where it has another, and its hash."""
    if not isinstance(value, dict):
        return str(value)
    words = [str(item) for key, item in value.items() if not (key == "name" and item == label)]
    return f"({', '.join(words)})"


def _version(name):
    """Version of an installed package, or "unknown"."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
