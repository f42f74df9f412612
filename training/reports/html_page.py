"""Writes a self-contained HTML page of an evaluation: table, plots, schedule, provenance.

    from fowt_env.training.reports.html_page import write_report
    write_report("results/above_rated")

The page contains its data and plotly.js, and loads nothing from a network. Needs plotly:
pip install "fowt-env[report]".
"""

import base64
import html
from pathlib import Path

import numpy as np

from fowt_env.descriptions.checks import check_number, is_number
from fowt_env.descriptions.files import parse_json
from fowt_env.errors import InputError, unknown
from fowt_env.files.tables import read_table
from fowt_env.training.evaluation.bootstrap import lifetime_means
from fowt_env.training.evaluation.evaluate import run_file
from fowt_env.training.evaluation.failures import known_figures, lost_counts, lost_text
from fowt_env.training.evaluation.leaderboard import SCORES
from fowt_env.training.evaluation.leaderboard_file import Interval, check_leaderboard
from fowt_env.training.evaluation.metric_names import SHORT, short_name
from fowt_env.training.evaluation.metrics import better, mean_exponent
from fowt_env.training.evaluation.results_table import KEY, WEIGHT, WORDS, case_shares, read_results
from fowt_env.training.evaluation.run_case import OK
from fowt_env.training.reports import page_words
from fowt_env.training.reports.evaluation_plots import platform_pitch_period
from fowt_env.training.reports.metric_words import about_metric, counted, seeds_text
from fowt_env.training.reports.own_limits import OF_LIMIT, read_limits
from fowt_env.training.reports.page_file import PAGE, page_path, plotly_source, write_page
from fowt_env.training.reports.verdict import TESTED, corrected_p, verdict
from fowt_env.visual.response import BOXES, SCHEDULE
from fowt_env.visual.style import style_numbers
from fowt_env.visual.time_series import PANELS, SPECTRA, TIME, frequency_marks, spectrum

NO_METRIC = (*KEY, *WORDS, "stopped_[s]", "scored_[s]", WEIGHT)
PAGE_METRICS = tuple(SHORT)  # columns of the leaderboard before "all metrics" is chosen
PARETO_AXES = ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]")  # across, up, size
SORTS = ("rank", "score_lifetime", PARETO_AXES[0], "controller")  # the first that there is
LIMIT_COLUMN = {
    "name": OF_LIMIT, "label": "of its limit", "unit": "", "headline": True, "better": 0,
    "about": "Rotor-speed and platform-pitch deviations over the least ones of linear control with the same"
    " inputs, travel, power and torque: 1 at the limit. All cases: mean and range over the winds above the"
    " lulls near rated wind.",
}  # fmt: skip
ALL_CASES = ""
DISPLAY_RATE = 2.0  # Hz
MAX_POINTS = 3000  # of one drawn series
MAX_SERIES_RUNS = 120  # with time series in the page, unless cases or seeds are named
SPECTRUM_RANGE = (0.002, 1.0)  # Hz
SPECTRUM_SPAN = 1e-6  # of the peak, down to which the axis reaches
PERCENTILES = (1.0, 25.0, 50.0, 75.0, 99.0)
# m/s
SCHEDULE_WINDS = (4.0, 6.0, 8.0, 10.0, 11.0, 11.5, 12.0, 13.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0, 25.0)


def write_report(
    folder, out=None, cases=None, seeds=None, rate=None, platform=None, schedule=True, progress=None,
    sections=(),
):  # fmt: skip
    """Write the HTML page of an evaluation folder; return its path.

    folder     contains results.csv (or metrics.csv) and runs/<controller>/<case>_seed<n>.parquet, and
               optionally leaderboard.json, manifest.json and of_limit.csv
    out        the page; None: report.html in the folder
    cases      names of the cases with time series; None: all
    seeds      seeds with time series; None: all. Without cases and seeds, at most MAX_SERIES_RUNS runs: the
               first seed of each case (of evenly spaced cases, if these are too many), then further seeds
    rate       samples per second of the series, means over the interval; None: DISPLAY_RATE, less for series
               of more than MAX_POINTS samples
    platform   platform of the steady schedule; None: the manifest's, else oc3_hywind; if the platform file
               cannot be read here, the page says so in place of the schedule
    schedule   whether the page has a steady schedule (some seconds)
    progress   called as progress(done, total, text)
    sections   (heading, HTML) of further sections, below the verdict; their texts must be escaped
    Raises: InputError for a folder without results, a table or run that cannot be read, an unknown case
    or seed, or if plotly is missing.
    """
    plotly = plotly_source()
    folder = Path(folder)
    out = page_path(folder / "report.html" if out is None else out)
    if rate is not None:
        check_number("rate", rate, 0.0, low_open=True, allowed="a positive number of samples per second")
    if not folder.is_dir():
        raise InputError(f"results {str(folder)!r} is not a folder: create it with fowt evaluate --out")
    table = read_results(folder)
    manifest, path = _json_file(folder / "manifest.json"), folder / "leaderboard.json"
    board_file = check_leaderboard(_json_file(path), path) if path.is_file() else None
    say = progress or (lambda done, total, text: None)
    about = page_words.described_cases(manifest)
    runs = _read_runs(folder, table, _chosen_runs(table, cases, seeds), about, rate, say)
    point = _schedule(platform, about, say) if schedule else None
    data = _page_data(table, board_file, manifest, runs, point, read_limits(folder))
    texts = _page_texts(folder, table, manifest, board_file, data, runs, point)
    texts["further"] = "".join(
        f'<section><div class="heading"><h2>{html.escape(heading)}</h2></div>{body}</section>'
        for heading, body in sections
    )
    return write_page(out, PAGE / "page.html", PAGE / "page.js", texts, data, plotly)


def _json_file(path):
    """Return the mapping in a JSON file, {} if the file is missing. Raises: InputError for other content."""
    if not path.is_file():
        return {}
    try:
        value = parse_json(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"file {str(path)!r} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise InputError(f"file {str(path)!r}: must contain a mapping")
    return value


def _chosen_runs(table, cases, seeds):
    """Return the rows of the runs with time series in the page."""
    known = list(dict.fromkeys(table["case"]))
    for what, names in (("case", cases), ("seed", seeds)):
        for name in names or ():
            if name not in set(table[what]):
                raise unknown(f"{what} of the results", name, list(dict.fromkeys(table[what])))
    if cases is not None or seeds is not None:
        kept = table["case"].isin(known if cases is None else cases)
        return table[kept & (True if seeds is None else table["seed"].isin(seeds))]
    # one group of runs for each case and seed: the first seed of every case, the second, ...
    turn = table.groupby("case")["seed"].rank(method="dense")
    groups = [rows.index for _, rows in table.groupby([turn, table["case"].map(known.index)])]
    firsts = groups[: len(known)]
    capacity = max(1, MAX_SERIES_RUNS // max(map(len, firsts)))
    if len(firsts) > capacity:
        kept = np.unique(np.linspace(0, len(firsts) - 1, capacity).round().astype(int))
        groups = [firsts[i] for i in kept]
    total = np.cumsum([len(group) for group in groups])
    most = max(1, int(np.searchsorted(total, MAX_SERIES_RUNS, side="right")))
    return table.loc[[index for group in groups[:most] for index in group]]


def _read_runs(folder, table, chosen, about, rate, say):
    """Return {"series": {case: {seed: {controller: run}}}, "pool", "quantiles", "rates" (Hz), "missing": n}.

    Every run is read once, for the box plots and, if in `chosen`, for its time series.
    about: {case: mapping} of the manifest. pool: distinct codes of the series, which refer to them by index.
    """
    drawn, pool = set(chosen.index), {}
    periods = {}
    for case, each in about.items():
        try:
            periods[case] = platform_pitch_period(str(each.get("platform")))
        except InputError:
            periods[case] = None
    series, samples, rates, missing = {}, {}, set(), 0
    for number, (index, row) in enumerate(table.iterrows()):
        controller, case, seed = row["controller"], row["case"], row["seed"]
        say(number, len(table), f"reading {controller}, {case}, seed {seed}")
        path = run_file(folder / "runs", controller, case, seed)
        frame = read_table(path) if path.is_file() else None
        if frame is None or TIME not in frame.columns or len(frame) < 2:
            missing += 1
            continue
        skip = _skipped(row, frame, about.get(case, {}))
        kept = frame[frame[TIME] >= frame[TIME].iloc[0] + skip - 1e-9]
        if row["status"] == OK and len(kept):
            for channel in (name for _, name in BOXES if name in frame.columns):
                cell = samples.setdefault(channel, {}).setdefault(controller, {}).setdefault(case, [])
                cell.append(kept[channel].to_numpy())
        if index in drawn:
            run, used = _drawn_run(frame, skip, rate, periods.get(case), pool)
            rates.add(used)
            series.setdefault(case, {}).setdefault(str(seed), {})[controller] = run
    quantiles = {
        channel: {
            controller: [
                [case, *_rounded(np.percentile(np.concatenate(parts), PERCENTILES))]
                for case, parts in cells.items()
            ]
            for controller, cells in controllers.items()
        }
        for channel, controllers in samples.items()
    }
    rest = {"pool": list(pool), "rates": sorted(rates), "missing": missing}
    return {"series": series, "quantiles": quantiles, **rest}


def _skipped(row, frame, about):
    """Return the unscored time at the start of a run, s, from the manifest or the table."""
    if is_number(about.get("skip")):
        return float(max(0.0, about["skip"]))
    scored = row.get("scored_[s]", float("nan"))
    length = frame[TIME].iloc[-1] - frame[TIME].iloc[0]
    return float(max(0.0, length - scored)) if row["status"] == "ok" and scored == scored else 0.0


def _drawn_run(frame, skip, rate, pitch_period, pool):
    """Return ({"series", "spectra", "marks", "start", "skip"} of one run, samples per second)."""
    time = frame[TIME].to_numpy(dtype=float)
    step = (time[-1] - time[0]) / (len(time) - 1)
    target_rate = DISPLAY_RATE if rate is None else rate
    block = max(1, round(1.0 / (target_rate * step)))
    if rate is None:
        block = max(block, -(-len(time) // MAX_POINTS))
    present = [channel for _, channel in PANELS if channel in frame.columns]
    series = {}
    for channel in present:
        values = frame[channel].to_numpy(dtype=float)  # means of blocks; an incomplete last block is dropped
        values = values[: len(values) // block * block].reshape(-1, block).mean(axis=1)
        series[channel] = _packed(values, time[0] + 0.5 * (block - 1) * step, block * step, pool)
    scored = frame[time >= time[0] + skip - 1e-9]
    spectra = {}
    for _, channel, _ in SPECTRA:
        if channel in frame.columns and len(scored) >= 16 and np.isfinite(scored[channel]).all():
            frequency, density = spectrum(scored[TIME], scored[channel])
            inside = (frequency >= SPECTRUM_RANGE[0]) & (frequency <= SPECTRUM_RANGE[1])
            if inside.any() and density[inside].max() > 0.0:
                logs = np.full(inside.sum(), np.nan)
                np.log10(density[inside], out=logs, where=density[inside] > 0.0)
                spectra[channel] = _packed(logs, frequency[inside][0], frequency[1] - frequency[0], pool)
    marked = frequency_marks(scored, pitch_period) if spectra else ()
    marks = [[f"{name} {at:.3g} Hz", float(at)] for name, at in marked]
    run = {"series": series, "spectra": spectra, "marks": marks, "start": float(time[0]), "skip": skip}
    return run, float(f"{1.0 / (block * step):.4g}")


def _packed(values, start, step, pool):
    """Return evenly spaced values as 16-bit codes between their bounds, in base64; code 0 is missing.

    pool: {codes: index}; new codes are added, so that equal series (the weather) are stored once.
    """
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    span = high - low
    codes = np.zeros(len(values), dtype="<u2")
    codes[finite] = 1 + (np.rint((values[finite] - low) / span * 65534.0) if span > 0.0 else 0)
    text = base64.b64encode(codes.tobytes()).decode("ascii")
    index = pool.setdefault(text, len(pool))
    return {"codes": index, "low": low, "high": high, "start": float(start), "step": float(step)}


def _rounded(values):
    """Return floats rounded to six digits, and None for NaN, which JSON lacks."""
    return [float(f"{v:.6g}") if v is not None and np.isfinite(v) else None for v in values]


def _rounded_items(values):
    """Return the mapping with floats rounded to six digits, without items that are None."""
    return {name: float(f"{value:.6g}") for name, value in values.items() if value is not None}


def _schedule(chosen, about, say):
    """Return {"platform", "wind", "panels"} of the steady operating points over wind speed.

    chosen: platform; None: the only platform of the manifest's cases, else oc3_hywind; {"platform",
    "missing": reason} if the file of that platform is missing.
    """
    import fowt_env

    named = {case.get("platform") for case in about.values()} - {None}
    only = named.pop() if len(named) == 1 else None
    platform = chosen or (only if isinstance(only, str) else "oc3_hywind")
    try:
        fowt_env.build_scene(platform)
    except InputError as error:
        if chosen:
            raise
        return {"platform": platform, "missing": str(error)}
    points = []
    for number, speed in enumerate(SCHEDULE_WINDS):
        say(number, len(SCHEDULE_WINDS), f"steady point at {speed:g} m/s")
        points.append(fowt_env.trim(fowt_env.build_scene(platform, wind=speed)))
    panels = [
        {"label": label, "values": _rounded([point[channel.partition("_[")[0]] for point in points])}
        for label, channel in SCHEDULE
        if channel in points[0]
    ]
    return {"platform": platform, "wind": list(SCHEDULE_WINDS), "panels": panels}


def _metric_columns(table):
    """Return [{name, label, unit, headline, better, about}] of the metrics, headline ones first."""
    names = [name for name in table.columns if name not in NO_METRIC and table[name].notna().any()]
    first = [name for name in PAGE_METRICS if name in names]
    return [
        {
            "name": name,
            "label": short_name(name),
            "unit": name.partition("_[")[2].removesuffix("]"),
            "headline": name in first or not first,
            "better": better(name),
            "about": f"{about_metric(name)} ({name})",
        }
        for name in [*first, *(name for name in names if name not in first)]
    ]


def _score_columns():
    """Return the columns of the two scores, as of _metric_columns."""
    what = {"lifetime": "of lifetime means", "winds": "mean of those of the single cases"}
    about = "Score, {}: weighted mean of the ratios of metrics to the reference's. Less is better."
    shared = {"unit": "", "headline": True, "better": -1}
    return [
        {"name": f"score_{key}", "label": heading, "about": about.format(what[key]), **shared}
        for heading, key in SCORES.items()
    ]


def _means(table, metrics, case):
    """Return leaderboard rows from the table alone: lifetime means of the runs that ended well."""
    rows = []
    part = known_figures(table if case == ALL_CASES else table[table["case"] == case], metrics)
    exponents = np.array([mean_exponent(name) for name in metrics])
    for controller, group in part.groupby("controller", sort=False):
        cases = list(dict.fromkeys(group["case"]))
        by_case = (group[metrics] ** exponents).groupby(group["case"]).mean().reindex(cases).to_numpy()
        shares = np.ones(1) if case != ALL_CASES else case_shares(group, cases)
        means = lifetime_means(by_case[:, None] ** (1.0 / exponents), np.ones((1, 1)), shares, exponents)[0]
        whole = set(group.loc[group["status"] == OK, "case"]) == set(cases)  # else no lifetime mean
        values = dict(zip(metrics, _rounded(means if whole else np.full_like(means, np.nan)), strict=True))
        counts = lost_counts(group["status"])
        lost = {"lost": sum(counts.values()), "lost_text": lost_text(counts)}
        rows.append({"controller": controller, "runs": len(group), **lost, "values": values})
    return rows


def _board_rows(board, case):
    """Return leaderboard rows of a LeaderboardFile: means and paired differences, with their intervals.

    p: {metric: p-value} of the tested differences, corrected for their number; {}: no tests.
    """
    rows = []
    for entry in board.controllers:
        part = entry if case == ALL_CASES else entry.cases.get(case)
        if part is None:
            continue
        figures, gaps = dict(part.metrics), part.difference
        if entry.score and case == ALL_CASES:
            scores = {f"score_{key}": getattr(entry.score, key) for key in SCORES.values()}
            figures |= {name: figure for name, figure in scores.items() if figure is not None}
        other = entry.controller != board.baseline
        rows.append(
            {
                "controller": entry.controller,
                "runs": part.runs,
                "lost": part.lost,
                "lost_text": part.lost_text,
                "rank": entry.rank,
                "beyond": entry.beyond,
                "undecided": entry.undecided,
                "held": entry.held,
                "values": _rounded_items({name: figure.mean for name, figure in figures.items()}),
                "intervals": _intervals(figures),
                "gaps": _rounded_items({name: gap.mean for name, gap in gaps.items() if other}),
                "gap_intervals": _intervals(gaps) if other else {},
                "percent": _rounded_items({name: gap.percent for name, gap in gaps.items() if other}),
                "p": corrected_p(entry) if other and case == ALL_CASES else {},
            }
        )
    return rows


def _intervals(figures):
    """Return {metric: [low, high]} of the intervals."""
    known = {name: (f.low, f.high) for name, f in figures.items() if None not in (f.low, f.high)}
    return {name: _rounded(ends) for name, ends in known.items()}


def _remark(table, board_file, case):
    """Return a remark on the runs, cases, seeds and tests of the leaderboard."""
    part = table if case == ALL_CASES else table[table["case"] == case]
    seeds = sorted(set(part["seed"]))
    text = f"{counted(len(part), 'run')}, {counted(part['case'].nunique(), 'case')}, {seeds_text(seeds)}."
    if board_file is None:
        return f"{text} Means only: the folder has no leaderboard.json with intervals and differences."
    needed = board_file.interval.least_seeds
    if len(seeds) < needed:
        count = "a single seed" if len(seeds) == 1 else f"{len(seeds)} seeds"
        return f"{text} No intervals and no tests: {count} of the {needed} they need."
    if case != ALL_CASES and board_file.baseline is not None:
        return f"{text} Differences are tested over all cases together, not case by case."
    return text


def _fine_print(board_file, interval):
    """Return HTML of the help text of the leaderboard."""
    lines = [
        "Click a heading to sort by that column; its tooltip explains the metric. Bold: best of column among"
        " controllers that lost no run."
    ]
    names = ", ".join(short_name(name) for name in TESTED)
    if board_file is None:
        lines.append("Means over the lifetime, of the runs that ended well.")
    elif board_file.baseline is not None:
        lines += [
            f"Differences are paired: each run minus that of {html.escape(board_file.baseline)} in the same"
            " wind and waves.",
            "* significant: if there were no difference, one as large would be seen with a probability of at"
            f" most {1.0 - interval.level:.2g} (p-value with Holm's correction over the {len(TESTED)} tested"
            f" metrics: {names})."
            " A difference without a star may be due to chance, which does not prove that it is zero.",
            '<span class="better">✓ better</span> and <span class="worse">✗ worse</span> than the baseline;'
            " grey: tested and not significant; regular weight: not tested.",
        ]
    if interval.method:
        lines.append(f"Intervals: {100 * interval.level:g} %, {html.escape(interval.method)}.")
    return "".join(f"<p>{line}</p>" for line in lines)


def _add_limits(board, limits):
    """Add the ratio to the limit at own spending to the leaderboard rows of each case and of all cases.

    board: {case: rows} of _page_data; limits: table of own_limits. Of all cases: mean and range.
    """
    for case, rows in board.items():
        here = limits if case == ALL_CASES else limits[limits["case"] == case]
        values = here.groupby("controller")[OF_LIMIT].agg(["mean", "min", "max"]).dropna()
        for row in rows:
            if row["controller"] in values.index:
                mean, *ends = _rounded(values.loc[row["controller"]].to_numpy())
                row["values"][OF_LIMIT] = mean
                if case == ALL_CASES:
                    row.setdefault("intervals", {})[OF_LIMIT] = ends


def _page_data(table, board_file, manifest, runs, schedule, limits=None):
    """Return the mapping that the page's script reads."""
    metrics = _metric_columns(table)
    names = [metric["name"] for metric in metrics]
    cases = list(dict.fromkeys(table["case"]))
    board = {
        case: _means(table, names, case) if board_file is None else _board_rows(board_file, case)
        for case in [ALL_CASES, *cases]
    }
    if any(row["values"].get("score_lifetime") is not None for row in board[ALL_CASES]):
        metrics = [*_score_columns(), *metrics]
    if limits is not None:
        _add_limits(board, limits)
        metrics = [*metrics, LIMIT_COLUMN]
    points = [
        [row["controller"], row["case"], str(row["seed"]), _rounded([row[name] for name in names])]
        for row in table[table["status"] == OK].to_dict("records")
    ]
    ranked = board_file is not None and all(entry.rank is not None for entry in board_file.controllers)
    sortable = {"controller", *(metric["name"] for metric in metrics), *(("rank",) if ranked else ())}
    shares = dict(zip(cases, map(float, case_shares(table, cases)), strict=True))
    shares = shares if len(set(shares.values())) > 1 else None
    conditions = page_words.case_conditions(table, manifest, shares)
    units = {metric["name"]: f"{metric['label']} ({metric['unit']})" for metric in metrics if metric["unit"]}
    seeds = table.groupby("case", sort=False)["seed"].unique()
    lost = {}
    for who, case, seed, text in page_words.lost_runs(table):
        lost.setdefault(case, {}).setdefault(str(seed), {})[who] = text
    controllers = list(dict.fromkeys(table["controller"]))
    return {
        "controllers": controllers,
        "numbers": style_numbers(controllers),  # of their colours
        "ranked": ranked,
        "baseline": None if board_file is None else board_file.baseline,
        "alpha": 1.0 - (Interval() if board_file is None else board_file.interval).level,
        "shares": shares,
        "cases": cases,
        "seeds": {case: [str(seed) for seed in sorted(each)] for case, each in seeds.items()},
        "conditions": {row["case"]: page_words.conditions_text(row) for row in conditions},
        "lost": lost,
        "metrics": metrics,
        "sort": next(name for name in SORTS if name in sortable),
        "board": board,
        "remarks": {case: _remark(table, board_file, case) for case in [ALL_CASES, *cases]},
        "pareto": list(PARETO_AXES),
        "columns": names,
        "runs": points,
        "quantiles": runs["quantiles"],
        "pool": runs["pool"],
        "series": runs["series"],
        "panels": [{"label": label.replace("\n", "<br>"), "channel": channel} for label, channel in PANELS],
        "spectra": [
            {"label": f"{label}<br>({unit}²/Hz)", "channel": channel} for label, channel, unit in SPECTRA
        ],
        "span": SPECTRUM_SPAN,
        "titles": {name: units.get(name, name.replace("_", " ")) for name in names}
        | {channel: label.replace("\n", " ") for label, channel in PANELS},
        "schedule": None if schedule is None or "missing" in schedule else schedule,
    }


def _page_texts(folder, table, manifest, board_file, data, runs, schedule):
    """Return {placeholder: HTML} of the texts of the page; every name is escaped."""
    series = "The samples are means over 1/rate seconds; the files under runs/ contain every sample."
    shown = sum(len(each) for each in runs["series"].values())
    known = sum(map(len, data["seeds"].values()))
    rates = " or ".join(f"{rate:g}" for rate in runs["rates"]) or "no"
    scope = f"{shown} of {known} combinations of case and seed are shown, at {rates} samples per second."
    if shown < known:
        scope += " Others: fowt report FOLDER --cases NAME --seeds 1,2."
    if runs["missing"]:
        scope += f" {counted(runs['missing'], 'run')} of {len(table)} have no time series in the folder."
    interval = Interval() if board_file is None else board_file.interval
    texts = {
        "title": page_words.page_title(manifest, data["cases"]),
        "lead": page_words.page_lead(table, manifest),
        "series_remark": f"{scope} {series}",
        "case_count": counted(len(data["cases"]), "case"),
    }
    conditions = page_words.case_conditions(table, manifest, data["shares"])
    return {
        **{name: html.escape(text) for name, text in texts.items()},
        "verdict": verdict(board_file, table["seed"].nunique(), interval.least_seeds),
        "fine_print": _fine_print(board_file, interval),
        "conditions": page_words.conditions_table(conditions),
        "failures": page_words.lost_list(page_words.lost_runs(table), len(table)),
        "schedule_section": _schedule_section(schedule),
        "schedule_link": '<a href="#schedule">Steady schedule</a>' if schedule else "",
        "provenance": page_words.provenance(folder, table, manifest, board_file),
    }


def _schedule_section(schedule):
    """Return HTML of the steady schedule's section, or the reason why it is missing; "" for none."""
    if not schedule:
        return ""
    if "missing" in schedule:
        remark = f"Not shown: {schedule['missing']}. Choose another --platform, or --no-schedule."
        body = f'<p class="remark">{html.escape(remark)}</p>'
    else:
        where = html.escape(schedule["platform"])
        body = (
            f'<p class="remark">Operating points of {where} in steady wind and still water, the platform'
            ' floating.</p><div class="plot" id="schedule-plot"></div>'
        )
    return f'<section id="schedule"><div class="heading"><h2>Steady schedule</h2></div>{body}</section>'
