"""Formats the printed tables of an evaluation."""

from fowt_env.training.evaluation.bootstrap import holm
from fowt_env.training.evaluation.failures import KINDS, lost_text
from fowt_env.training.evaluation.leaderboard import SCORES, limits_text, score_text
from fowt_env.training.evaluation.metric_names import short_name
from fowt_env.training.reports.metric_words import counted, seeds_text

# printed columns: heading, metric, format, order of removal on a narrow terminal (None: kept), plot title
PRINTED_METRICS = (
    ("rotor\nspeed\nmean\nrpm", "RotSpeed_mean_[rpm]", ".2f", 3, "rotor speed, mean (rpm)"),
    ("rotor\nspeed\nstd\nrpm", "RotSpeed_std_[rpm]", ".3f", None, "rotor speed, std (rpm)"),
    ("over-\nspeed\nmax\n%", "overspeed_[%]", ".1f", 8, "rotor speed above rated, max (%)"),
    ("power\nto rated\nmean\nkW", "GenPwr_capped_mean_[kW]", ".0f", 7, "power up to rated, mean (kW)"),
    ("power\n\nstd\nkW", "GenPwr_std_[kW]", ".0f", None, "power, std (kW)"),
    ("power\n\nmax\nkW", "GenPwr_max_[kW]", ".0f", 6, "power, max (kW)"),
    ("ptfm\npitch\nmean\ndeg", "PtfmPitch_mean_[deg]", ".2f", 5, "platform pitch, mean (deg)"),
    ("ptfm\npitch\nstd\ndeg", "PtfmPitch_std_[deg]", ".3f", None, "platform pitch, std (deg)"),
    ("ptfm\npitch\nmax\ndeg", "PtfmPitch_max_[deg]", ".2f", 4, "platform pitch, max (deg)"),
    ("blade\npitch\ntravel\ndeg/s", "blade_pitch_travel_[deg/s]", ".3f", None, "pitch rate, mean (deg/s)"),
    ("torque\n\ntravel\nkNm/s", "torque_travel_[kN-m/s]", ".3f", None, "torque rate, mean (kN m/s)"),
    ("shaft\n\nDEL\nkN m", "RotTorq_DEL_[kN-m]", ".0f", 9, "shaft torque, fatigue load (kN m)"),
    ("nac.\nacc.\nrms\nm/s²", "NcIMUTAxs_rms_[m/s^2]", ".3f", 2, "nacelle acceleration, rms (m/s²)"),
    ("line\ntension\nmax\nkN", "FAIRTEN_max_[kN]", ".0f", 1, "mooring tension, max (kN)"),
)


def summary_rows(means, width):
    """Return (headings, rows of texts, lost runs per row) of evaluate.summary for `width` characters."""
    lost = list(means[list(KINDS)].sum(axis=1))
    columns = {name: (name, list(means[name])) for name in ("controller", "case")}
    columns["runs"] = "runs", [f"{n - bad}/{n}" for n, bad in zip(means["runs"], lost, strict=True)]
    for heading, name, form, *_ in PRINTED_METRICS:
        columns[name] = heading, ["-" if value != value else format(value, form) for value in means[name]]
    drops = {rank: name for _, name, _, rank, _ in PRINTED_METRICS if rank}
    return *_fitted(columns, [drops[rank] for rank in sorted(drops)], width), lost


def _fitted(columns, drops, width):
    """Return (headings, rows of texts) of {name: (heading, texts)}, dropping columns to fit the width.

    drops: names of the columns that may be dropped, in this order.
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
    ("power std\nkW", "GenPwr_std_[kW]", ".0f", False, True),
    ("torque travel\nkN m/s", "torque_travel_[kN-m/s]", ".3f", False, True),
    ("shaft DEL\nkN m", "RotTorq_DEL_[kN-m]", ".0f", False, True),
    ("tower DEL\nkN m", "TwrBsMyt_DEL_[kN-m]", ".0f", False, True),
    ("power up to rated\nkW", "GenPwr_capped_mean_[kW]", ".0f", False, True),
    ("maximum power\nkW", "GenPwr_max_[kW]", ".0f", False, False),
)
# dropped one by one on a narrow terminal; what the deviations cost is kept next to them
LEADERBOARD_DROPS = ("GenPwr_max_[kW]", "TwrBsMyt_DEL_[kN-m]", "GenPwr_capped_mean_[kW]")


def leaderboard_rows(board, width=200, of_limit=None):
    """Return (title, headings, rows of texts, remarks) of a leaderboard, in `width` characters if possible.

    of_limit: {controller: text} of own_limits.limit_texts, or None.

    A difference is in percent of the baseline, with "*" if significant: its p-value, corrected for all
    metrics of the row (bootstrap.holm), is at most 1 minus the level of the intervals. Remarks: lines on
    missing intervals, lost runs, limits and the baseline.
    """
    baseline, entries = board["baseline"], board["controllers"]
    level = board["interval"]["level"]
    lows = [figure["low"] for entry in entries for figure in entry["metrics"].values()]
    intervals = any(low is not None and low == low for low in lows)
    name = "" if not board.get("suite") else f"suite {board['suite']['name']} {board['suite']['version']}, "
    kind = "lifetime means" if len(set(board["shares"].values())) > 1 else "means"
    title = f"{name}{counted(len(board['cases']), 'case')}, {seeds_text(board['seeds'])}: {kind}"
    title += f" [{round(100 * level)} % interval]" if intervals else ""
    if baseline is not None:
        title += f", paired difference from {baseline}{' (* significant)' if intervals else ''}"
    columns = {
        "controller": ("controller", [entry["controller"] for entry in entries]),
        "runs": ("runs", [_runs_text(entry) for entry in entries]),
    }
    if any(entry["score"] for entry in entries):
        for heading, key in SCORES.items():
            texts = [score_text(entry["score"], key) for entry in entries]
            columns[key] = heading.replace(", ", "\n"), texts
    if of_limit:
        columns["of_limit"] = "of its\nlimit", [of_limit.get(entry["controller"], "-") for entry in entries]
    if any(entry["held"] is not None for entry in entries):
        columns["limits"] = "limits", [limits_text(entry) for entry in entries]
    tested = [metric for _, metric, _, _, different in LEADERBOARD if different]
    adjusted = [holm([entry["difference"][metric]["p"] for metric in tested]) for entry in entries]
    stars = [{m for m, p in zip(tested, each, strict=True) if p <= 1.0 - level} for each in adjusted]
    for heading, metric, form, with_interval, different in LEADERBOARD:
        cells = [
            _cell(entry, metric, form, with_interval, different and entry["controller"] != baseline, sure)
            for entry, sure in zip(entries, stars, strict=True)
        ]
        columns[metric] = heading, cells
    return title, *_fitted(columns, LEADERBOARD_DROPS, width), _remarks(board, intervals)


def _remarks(board, intervals):
    """Return the lines below the leaderboard: on intervals, lost runs, the baseline and limits."""
    lines, entries = [], board["controllers"]
    if not intervals:
        needed = board["interval"]["least_seeds"]
        lines.append(f"{counted(len(board['seeds']), 'seed')}: no interval (needs {needed})")
    lost = {entry["controller"]: lost_text(entry) for entry in entries if entry["lost"]}
    if lost:
        texts = "; ".join(f"{name}: {text}" for name, text in lost.items())
        scored = any(entry["score"] for entry in entries)
        counts = f"; a score counts them {board['penalty']:g} times the reference's" if scored else ""
        lines.append(f"runs lost by {texts}: not in these means{counts}; ranked last")
    if board["baseline"] is None and entries:
        lines.append("no paired differences: every controller has runs that failed or lost power")
    if board["baseline"] in lost:
        lines.append(f"differences from {board['baseline']} are over the runs that the baseline did not lose")
    for words, key in (("exceeds a limit", "beyond"), ("has limits not decided", "undecided")):
        lines += [
            f"{entry['controller']} {words}: {'; '.join(entry[key])}" for entry in entries if entry[key]
        ]
    suite = board.get("suite") or {}
    if suite.get("score") and not suite.get("drawn"):
        lines.append(
            "seeds not drawn from a hash (--draw-seeds): for development, as a controller can recognise them"
        )
    if board["unchecked"]:
        names = ", ".join(map(short_name, board["unchecked"]))
        lines.append(f"limits of {names} not checked: their baseline was not run")
    return lines


def _runs_text(entry):
    """Return the completed runs of a controller as "6/6", with the numbers of lost runs."""
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
