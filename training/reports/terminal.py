"""The printed tables and the plots of an evaluation."""

import json

from fowt_env.descriptions.platform import Platform, read_platform, turbine_of
from fowt_env.descriptions.ratings import ratings
from fowt_env.files.tables import read_table
from fowt_env.training.evaluation.bootstrap import holm
from fowt_env.training.evaluation.cases import chosen_cases
from fowt_env.training.evaluation.failures import KINDS, lost_text
from fowt_env.training.evaluation.leaderboard_file import write_leaderboard
from fowt_env.training.evaluation.results import file_name, run_file
from fowt_env.training.evaluation.run_case import OK, REFERENCE
from fowt_env.training.reports.evaluation_plots import plot_evaluation, plot_pareto
from fowt_env.training.reports.metric_words import counted, seeds_text
from fowt_env.visual.response import BOXES, plot_boxes
from fowt_env.visual.time_series import TIME, plot_runs, plot_spectra

# chosen_cases and write_leaderboard are defined in evaluation; this is their former place
__all__ = ["chosen_cases", "evaluation_plots", "leaderboard_rows", "summary_rows", "write_leaderboard"]

# printed columns: heading, metric, format
PRINTED_METRICS = (
    ("rotor\nspeed\nmean\nrpm", "RotSpeed_mean_[rpm]", ".2f"),
    ("rotor\nspeed\nstd\nrpm", "RotSpeed_std_[rpm]", ".3f"),
    ("over-\nspeed\nmax\n%", "overspeed_[%]", ".1f"),
    ("power\nto rated\nmean\nkW", "GenPwr_capped_mean_[kW]", ".0f"),
    ("power\n\nstd\nkW", "GenPwr_std_[kW]", ".0f"),
    ("great-\nest\npower\nkW", "GenPwr_max_[kW]", ".0f"),
    ("ptfm\npitch\nmean\ndeg", "PtfmPitch_mean_[deg]", ".2f"),
    ("ptfm\npitch\nstd\ndeg", "PtfmPitch_std_[deg]", ".3f"),
    ("ptfm\npitch\nmax\ndeg", "PtfmPitch_max_[deg]", ".2f"),
    ("blade\npitch\ntravel\ndeg/s", "blade_pitch_travel_[deg/s]", ".3f"),
    ("torque\n\ntravel\nkNm/s", "torque_travel_[kN-m/s]", ".3f"),
    ("shaft\ntorque\nDEL\nkN m", "RotTorq_DEL_[kN-m]", ".0f"),
    ("nac.\nacc.\nrms\nm/s²", "NcIMUTAxs_rms_[m/s^2]", ".3f"),
    ("line\ntension\nmax\nkN", "FAIRTEN_max_[kN]", ".0f"),
)


# left out of a table wider than the terminal, the first one first
DROPPED_FIRST = (
    "FAIRTEN_max_[kN]",
    "NcIMUTAxs_rms_[m/s^2]",
    "RotSpeed_mean_[rpm]",
    "PtfmPitch_max_[deg]",
    "PtfmPitch_mean_[deg]",
    "GenPwr_std_[kW]",
    "GenPwr_max_[kW]",
    "GenPwr_capped_mean_[kW]",
    "RotTorq_DEL_[kN-m]",
)


def summary_rows(means, width):
    """Return (headings, rows of texts, lost runs per row) of evaluate.summary, in `width` characters."""
    lost = list(means[list(KINDS)].sum(axis=1))
    columns = {
        "controller": ("controller", list(means["controller"])),
        "case": ("case", list(means["case"])),
        "runs": ("runs", [f"{n - bad}/{n}" for n, bad in zip(means["runs"], lost, strict=True)]),
    }
    for heading, name, form in PRINTED_METRICS:
        columns[name] = heading, ["-" if value != value else format(value, form) for value in means[name]]
    return *_fitted(columns, DROPPED_FIRST, width), lost


def _fitted(columns, drops, width):
    """Return (headings, rows of texts) of {name: (heading, texts)}, with fewer columns if too wide.

    drops: names of the columns that may be left out, the first one first.
    """
    for name in (None, *drops):
        columns.pop(name, None)
        if sum(2 + max(map(len, [*head.split("\n"), *texts])) for head, texts in columns.values()) <= width:
            break
    headings, texts = zip(*columns.values(), strict=True)
    return headings, list(zip(*texts, strict=True))


# the printed leaderboard: heading, metric, format, with its interval, with its paired difference
LEADERBOARD = (
    ("rotor speed std\nrpm", "RotSpeed_std_[rpm]", ".3f", True, True),
    ("platform pitch std\ndeg", "PtfmPitch_std_[deg]", ".3f", True, True),
    ("pitch travel\ndeg/s", "blade_pitch_travel_[deg/s]", ".3f", False, True),
    ("torque travel\nkN m/s", "torque_travel_[kN-m/s]", ".3f", False, True),
    ("shaft DEL\nkN m", "RotTorq_DEL_[kN-m]", ".0f", False, True),
    ("tower DEL\nkN m", "TwrBsMyt_DEL_[kN-m]", ".0f", False, True),
    ("power up to rated\nkW", "GenPwr_capped_mean_[kW]", ".0f", False, True),
    ("greatest power\nkW", "GenPwr_max_[kW]", ".0f", False, False),
)
# left out one by one in a narrow terminal; pitch and torque travel stay beside the deviations
LEADERBOARD_DROPS = ("GenPwr_max_[kW]", "TwrBsMyt_DEL_[kN-m]", "GenPwr_capped_mean_[kW]")


def leaderboard_rows(board, width=200):
    """Return (title, headings, rows of texts, remarks) of a leaderboard, in `width` characters if possible.

    A difference is in percent of the baseline, with "*" if significant: its p-value, corrected for all
    metrics of the row (bootstrap.holm), is at most 1 less the level of the intervals. Remarks: lines on
    what the table lacks or does not show, and why.
    """
    baseline, entries = board["baseline"], board["controllers"]
    name = "" if not board.get("suite") else f"suite {board['suite']['name']} {board['suite']['version']}, "
    intervals = has_intervals(board)
    kind = "lifetime means" if len(set(board["shares"].values())) > 1 else "means"
    title = f"{name}{counted(len(board['cases']), 'case')}, {seeds_text(board['seeds'])}: {kind}"
    if intervals:
        title += f" [{round(100 * board['interval']['level'])} % interval]"
    if baseline is not None:
        title += f", paired difference from {baseline}{' (* significant)' if intervals else ''}"
    sure = [_sure(entry, board["interval"]["level"]) for entry in entries]
    columns = {
        "controller": ("controller", [entry["controller"] for entry in entries]),
        "runs": ("runs", [_runs_text(entry) for entry in entries]),
    }
    if any(entry["score"] for entry in entries):
        columns["score"] = "score", [_score_text(entry["score"]) for entry in entries]
    for heading, metric, form, with_interval, with_difference in LEADERBOARD:
        columns[metric] = (
            heading,
            [
                _cell(
                    entry,
                    metric,
                    form,
                    with_interval,
                    with_difference and entry["controller"] != baseline,
                    stars,
                )
                for entry, stars in zip(entries, sure, strict=True)
            ],
        )
    return title, *_fitted(columns, LEADERBOARD_DROPS, width), _remarks(board, intervals)


def _sure(entry, level):
    """Return the set of printed metrics with a significant difference, corrected for all of them."""
    names = [metric for _, metric, _, _, different in LEADERBOARD if different]
    adjusted = holm([entry["difference"][name]["p"] for name in names])
    return {name for name, p in zip(names, adjusted, strict=True) if p <= 1.0 - level}


def has_intervals(board):
    """Return whether any metric of a leaderboard has an interval, which needs enough seeds."""
    return any(
        figure["low"] is not None and figure["low"] == figure["low"]
        for entry in board["controllers"]
        for figure in entry["metrics"].values()
    )


def no_interval(board):
    """Return "3 seeds: no interval (needs 4)"."""
    return f"{counted(len(board['seeds']), 'seed')}: no interval (needs {board['interval']['least_seeds']})"


def _remarks(board, intervals):
    """Return the lines below the leaderboard: on intervals, lost runs, the baseline and limits."""
    lines = [] if intervals else [no_interval(board)]
    lost = {entry["controller"]: lost_text(entry) for entry in board["controllers"] if entry["lost"]}
    if lost:
        texts = "; ".join(f"{name}: {text}" for name, text in lost.items())
        scored = any(entry["score"] for entry in board["controllers"])
        counts = f"; a score counts them {board['penalty']:g} times the reference's" if scored else ""
        lines.append(f"runs lost by {texts}: not in these means{counts}; ranked last")
    if board["baseline"] is None and board["controllers"]:
        lines.append("no paired differences: every controller has runs that failed or lost power")
    if board["baseline"] in lost:
        lines.append(f"differences from {board['baseline']} are over the runs that it did not lose")
    for entry in board["controllers"]:
        if entry["beyond"]:
            lines.append(f"{entry['controller']} exceeds a limit: {'; '.join(entry['beyond'])}")
    if board["unchecked"]:
        lines.append(f"limits of {', '.join(board['unchecked'])} not checked: their baseline was not run")
    return lines


def _runs_text(entry):
    """Return "6/6" of a controller's runs that ended well, with the numbers of lost ones."""
    lost = f", {lost_text(entry)}" if entry["lost"] else ""
    return f"{entry['runs'] - entry['lost']}/{entry['runs']}{lost}"


def _cell(entry, metric, form, with_interval, with_difference, sure):
    """Return the text of a metric: mean [low, high] difference %, with "*" if it is in `sure`."""
    figure, gap = entry["metrics"][metric], entry["difference"][metric]
    if figure["mean"] != figure["mean"]:
        return "-"
    text = format(figure["mean"], form)
    if with_interval and figure["low"] == figure["low"]:
        text += f" [{format(figure['low'], form)}, {format(figure['high'], form)}]"
    if with_difference and gap["percent"] == gap["percent"]:
        text += f" {gap['percent']:+.1f}%{'*' if metric in sure else ' '}"
    return text


def _score_text(score):
    """Return the text of a score, in brackets if a limit is exceeded or a run was lost."""
    if score is None or score["mean"] is None:
        return "-"
    return f"{score['mean']:.3f}" if score["valid"] else f"({score['mean']:.3f})"


def evaluation_plots(table, board, folder):
    """Plot a results folder with its table and leaderboard; return the paths.

    pareto.png: rotor-speed against platform-pitch deviation; metrics.png: the controllers over all cases;
    boxes.png, timeseries_CASE.png and spectra_CASE.png: quartiles, series and spectra of the first seed of
    each case that succeeded.
    """
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    table = table[table["controller"] != REFERENCE]
    good = table[table["status"] == OK]
    if good.empty:
        return []
    paths = [folder / "pareto.png", folder / "metrics.png"]
    plot_pareto(board, paths[0], order=table["controller"].unique())
    names = [name for _, name, _ in PRINTED_METRICS]
    plot_evaluation(table, names, paths[1], "Mean over seeds, with their range")
    boxes = {}
    for case, about in manifest["cases"].items():
        rows = good[good["case"] == case]
        if rows.empty:
            continue
        seed = rows["seed"].iloc[0]
        names = rows.loc[rows["seed"] == seed, "controller"]
        runs = {name: read_table(run_file(folder / "runs", name, case, seed)) for name in names}
        name = file_name(case)
        paths += [folder / f"timeseries_{name}.png", folder / f"spectra_{name}.png"]
        title = f"{case}, seed {seed}"
        plot_runs(runs, paths[-2], title, skip=about["skip"], ratings=ratings(turbine_of(about["platform"])))
        period = platform_pitch_period(about["platform"])
        plot_spectra(runs, paths[-1], title, about["skip"], platform_pitch_period=period)
        boxes[case] = {name: _scored_rows(frame, about["skip"]) for name, frame in runs.items()}
    paths.append(folder / "boxes.png")
    plot_boxes(boxes, paths[-1], "First seed of each case: quartiles, and 1 to 99 %")
    return paths


def _scored_rows(frame, skip):
    """Return the plotted channels of the scored part of a run."""
    columns = [TIME, *(channel for _, channel in BOXES if channel in frame.columns)]
    return frame.loc[frame[TIME] >= skip, columns]


def platform_pitch_period(platform):
    """Return the natural period (s) in platform pitch of a platform's file, or None."""
    description = platform if isinstance(platform, Platform) else read_platform(platform)
    return description.published.get("natural_periods", {}).get("pitch")
