"""Scores agents against baselines on the same runs: ratios of lifetime means, with 95 % intervals.

    fowt evaluate --controllers policy:ppo_lqr,gspi_oc3,rosco_float --seeds 1:6:1 --out results/rl
    fowt dev scores baselines results/rl --against gspi_oc3,rosco_float

Both means are over the lifetime, in the same wind and waves. Training seeds of one configuration form a
group, whose interval resamples training and weather seeds (training.evaluation.bootstrap). A lost run of an
agent counts PENALTY times the baseline's metrics of that case and seed; lost baseline runs have no ratio.
"""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from fowt_env.caches import cached
from fowt_env.controllers import DESIGN, POLICY, information
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import replacing
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import write_table
from fowt_env.plant.measurement import SENSOR_FIELDS
from fowt_env.training.evaluation.bootstrap import LEAST_SEEDS, LEVEL, crossed_ratio, holm
from fowt_env.training.evaluation.failures import KINDS, lost_counts, penalised
from fowt_env.training.evaluation.metrics import METRICS, mean_exponent, never_negative
from fowt_env.training.evaluation.results_table import KEY, case_shares

PAST_ANY = "past a constraint"


class Figure(NamedTuple):
    """Defines a metric scored as ratio to a baseline's, with a first and a second target (None: no target).

    more: whether the ratio must be at least the target; else at most.
    """

    name: str
    metric: str
    first: float | None = None
    then: float | None = None
    more: bool = False

    def verdict(self, ratio, sure=(), failed=0):
        """Return the last target that a ratio reaches, with "*" if significant; "" without a ratio.

        sure: for each target, whether the hypothesis that the ratio equals it is rejected, after correction
        for all tests (agent_scores). "then, first*": the ratio reaches the second target, and significantly
        the first. With a single target "met" or "missed". "failed": runs were lost.
        """
        if self.first is None or not np.isfinite(ratio):
            return ""
        if failed:
            return "failed"
        aims = [aim for aim in (self.first, self.then) if aim is not None]
        met = sum((ratio >= aim) if self.more else (ratio <= aim) for aim in aims)
        text = "missed" if not met else "met" if len(aims) == 1 else "then" if met == 2 else "first"
        sure = (*sure, False, False)
        if not sure[0]:
            return text
        return "then, first*" if text == "then" and not sure[1] else f"{text}*"


FIGURES = (
    Figure("rotor-speed std", "RotSpeed_std_[rpm]", 0.8, 0.6),
    Figure("platform-pitch std", "PtfmPitch_std_[deg]", 0.8, 0.7),
    Figure("blade-pitch travel", "blade_pitch_travel_[deg/s]", 1.0),
    Figure("energy", "GenPwr_capped_mean_[kW]", 0.995, more=True),
    Figure("power std", "GenPwr_std_[kW]", 1.0),
    Figure("largest power", "GenPwr_max_[kW]", 1.0),
    Figure("tower-base DEL", "TwrBsMyt_DEL_[kN-m]", 1.0),
    Figure("fairlead DEL", "FAIRTEN_DEL_[kN]", 1.0),
    Figure("shaft-torque DEL", "RotTorq_DEL_[kN-m]", 1.0),
    Figure("torque travel", "torque_travel_[kN-m/s]", 1.0),
)
COUNTS = {  # constraint: metric that counts how often it was exceeded
    "rotor past 130 %": "rotor_speed_violations_[-]",
    "tower top past 3.3 m/s2": "tower_top_acceleration_violations_[-]",
    "blade pitch past 10 deg/s": "blade_pitch_rate_violations_[-]",
}


def figures_named(names):
    """Return the Figures with these names: those of FIGURES, or metrics as Figures without a target.

    Raises: InputError for other names.
    """
    known = {figure.name: figure for figure in FIGURES}
    known |= {metric: Figure(metric, metric) for metric in METRICS}
    for name in names:
        if name not in known:
            raise unknown("figure", name, known)
    return [known[name] for name in names]


def grouped(table, baselines, groups=None, agents=None):
    """Return {name: labels of the training seeds} of the groups and then of single agents.

    groups: {name: labels}. agents: labels; None: all that are neither baselines nor in a group.
    Raises: InputError for labels without runs, and for duplicate names.
    """
    known = list(dict.fromkeys(table["controller"]))
    groups = dict(groups or {})
    inside = [label for labels in groups.values() for label in labels]
    if agents is None:
        agents = [name for name in known if name not in baselines and name not in inside]
    for name in (*baselines, *inside, *agents):
        if name not in known:
            raise unknown("controller of the evaluation", name, known)
    for name, labels in groups.items():
        if name in known or len(set(labels)) < len(labels) or not labels:
            raise InputError(
                f"group {name!r} = {', '.join(labels)}: needs a name that no controller has, and controllers"
                " that differ"
            )
    return groups | {name: (name,) for name in agents}


def agent_scores(table, baselines, groups=None, agents=None, figures=FIGURES):
    """Return a DataFrame with ratio, interval and verdict per agent or group, baseline and figure.

    table: of evaluate.evaluate; groups, agents: as in `grouped`. Columns: agent, baseline, figure, metric,
    ratio (of the lifetime means, its mean over the training seeds), low, high (NaN with too few seeds:
    training.evaluation.bootstrap.crossed_ratio), p_first, p_then (two-sided p-values of the ratio being the
    target), holm_first, holm_then (corrected for all targets of all figures over this baseline), pairs (runs
    with a ratio), runs, failed, tripped, lost_power, training_seeds, verdict (Figure.verdict; significant:
    a corrected p-value of at most 1 - LEVEL). A baseline's metric of 0 gives no ratio.
    Raises: InputError for labels without runs, or if agent and baseline have no run in common.
    """
    return _scores(table, baselines, grouped(table, baselines, groups, agents), figures)


def _scores(table, baselines, chosen, figures):
    """Return agent_scores of {name: labels}."""
    over = {name: penalised(table, name).set_index(KEY).sort_index() for name in baselines}
    cases, seeds = list(dict.fromkeys(table["case"])), sorted(set(table["seed"]))
    shares = case_shares(table, cases)
    rows = []
    for name, labels in chosen.items():
        made = table[table["controller"].isin(labels)]
        counts = {"runs": len(made), **lost_counts(made["status"]), "training_seeds": len(labels)}
        for baseline, runs in over.items():
            ratios = [_ratio_row(runs, labels, baseline, cases, seeds, shares, figure) for figure in figures]
            if not any(row["pairs"] for row in ratios):
                raise InputError(f"{name} and {baseline}: no run of both has a value")
            corrected = holm([p for row in ratios for p in (row["p_first"], row["p_then"])])
            for figure, row, pair in zip(figures, ratios, corrected.reshape(-1, 2), strict=True):
                sure = [p <= 1.0 - LEVEL for p in pair]
                verdict = figure.verdict(row["ratio"], sure, sum(counts[kind] for kind in KINDS))
                row |= {"holm_first": pair[0], "holm_then": pair[1], **counts, "verdict": verdict}
                rows.append({"agent": name, "baseline": baseline} | row)
    return pd.DataFrame(rows)


def _ratio_row(runs, labels, baseline, cases, seeds, shares, figure):
    """Return {column: value} of one Figure: ratio, interval, p-values, pairs."""
    index = pd.MultiIndex.from_product([[*labels, baseline], cases, seeds])
    values = runs[figure.metric].reindex(index).to_numpy(dtype=float)  # NaN: failed or missing run
    values = values.reshape(-1, len(cases), len(seeds))
    exponent, positive = mean_exponent(figure.metric), never_negative(figure.metric)
    estimate = crossed_ratio(values[:-1], values[-1], shares, exponent, positive=positive)
    p = [float("nan") if aim is None else estimate.p_value(aim) for aim in (figure.first, figure.then)]
    pairs = int(np.isfinite(values[:-1] + values[-1]).sum()) if np.isfinite(estimate.value) else 0
    row = {"figure": figure.name, "metric": figure.metric, "ratio": estimate.value}
    return row | {"low": estimate.low, "high": estimate.high, "p_first": p[0], "p_then": p[1], "pairs": pairs}


def agent_counts(table, baselines, groups=None, agents=None):
    """Return a DataFrame with runs, lost runs and exceeded constraints per agent, group and baseline.

    Columns: agent, inputs (of `inputs`), runs, failed, tripped, lost_power, the names of COUNTS (runs that
    exceed it at least once), PAST_ANY, largest overspeed (%), verdict ("met" if no run was lost and no
    constraint exceeded).
    """
    return _counts(table, grouped(table, baselines, groups, agents) | {name: (name,) for name in baselines})


def _counts(table, chosen):
    """Return agent_counts of {name: labels}."""
    rows = []
    for name, labels in chosen.items():
        here = table[table["controller"].isin(labels)]
        past = here[list(COUNTS.values())] > 0
        lost = lost_counts(here["status"])
        row = {"agent": name, "inputs": "; ".join(dict.fromkeys(map(inputs, labels))), "runs": len(here)}
        row |= lost | {text: int(past[metric].sum()) for text, metric in COUNTS.items()}
        row[PAST_ANY] = int(past.any(axis=1).sum())
        row["largest overspeed (%)"] = float(here["overspeed_[%]"].max())
        row["verdict"] = "missed" if row[PAST_ANY] or sum(lost.values()) else "met"
        rows.append(row)
    return pd.DataFrame(rows)


@cached(256)
def inputs(label):
    """Return the inputs of a controller: "measured" for sensor channels, the others by name.

    "" for labels that name neither a controller of the package nor an existing agent or design.
    """
    if ":" in label and not label.startswith((POLICY, DESIGN)):
        return ""  # labels of a table must not execute user code
    try:
        used = information(label)
    except InputError:
        return ""
    measured = ["measured"] if set(used) & set(SENSOR_FIELDS) else []
    return ", ".join(measured + [x for x in used if x not in SENSOR_FIELDS])


def kind_of(case):
    """Return the name of a case without the wind speed at its end: "ntm" for "ntm_18" and "ntm_11_4"."""
    return re.sub(r"(_\d+){1,2}$", "", case)


def by_kind(table, baseline, groups=None, agents=None, figures=FIGURES, each=False):
    """Return (scores, counts) of agent_scores and agent_counts per kind of case, in a first column `kind`.

    each: every case is a separate kind; else all winds of a kind (kind_of) are pooled. Ratios are NaN in a
    kind in which an agent has no metric. p-values are corrected for the figures of one kind.
    """
    chosen = grouped(table, [baseline], groups, agents)
    scores, counts = [], []
    for kind, here in table.groupby(table["case"] if each else table["case"].map(kind_of), sort=False):
        counts.append(_counts(here, chosen | {baseline: (baseline,)}).assign(kind=kind))
        for name, labels in chosen.items():
            try:
                scores.append(_scores(here, [baseline], {name: labels}, figures).assign(kind=kind))
            except (InputError, KeyError):  # no run has a metric; the counts show it
                blank = {"agent": name, "baseline": baseline, "kind": kind, "pairs": 0, "verdict": ""}
                scores.append(pd.DataFrame([blank | {"figure": figure.name} for figure in figures]))
    whole = pd.concat(scores, ignore_index=True), pd.concat(counts, ignore_index=True)
    return tuple(frame[["kind", *frame.columns.drop("kind")]] for frame in whole)


def ratio_text(row):
    """Return the ratio of a row of agent_scores as text: ratio [low, high]."""
    if not np.isfinite(row["ratio"]):
        return "-"
    ends = f" [{row['low']:.3f}, {row['high']:.3f}]" if np.isfinite(row["low"]) else ""
    return f"{row['ratio']:.3f}{ends}"


def frame_markdown(frame):
    """Return the markdown table of a DataFrame of texts, a named index as first column."""
    frame = frame.reset_index() if frame.index.name else frame
    return markdown_table(frame.columns, frame.astype(str).to_numpy()) + "\n"


def wide_markdown(frame, texts, title, index, column, rows=None):
    """Return the markdown table of texts of the rows of a frame: values of `index` by those of `column`.

    rows: values of `index` that are shown; None: all. Rows keep the order of the frame.
    """
    wide = frame.assign(text=texts).pivot(index=index, columns=column, values="text")
    wide = wide.loc[frame[index].unique() if rows is None else rows, frame[column].unique()]
    wide.index.name = title
    return frame_markdown(wide.rename(columns="`{}`".format))


def _remark(scores):
    """Return [line] on why ratios have no interval; [] if every ratio has an interval."""
    bare = np.isfinite(scores["ratio"]) & ~np.isfinite(scores["low"])
    text = f"No interval: fewer than {LEAST_SEEDS} weather seeds, or two or three training seeds.\n"
    return [text] if bare.any() else []


def scores_markdown(scores, counts):
    """Return agent_scores and agent_counts as markdown: one table per baseline and one of failures."""
    parts = []
    for baseline, rows in scores.groupby("baseline", sort=False):
        texts = [f"{ratio_text(row)} {row['verdict']}".rstrip() for row in rows.to_dict("records")]
        parts.append(wide_markdown(rows, texts, f"over `{baseline}`", "figure", "agent"))
    shown = counts.drop(columns=PAST_ANY)
    shown["largest overspeed (%)"] = shown["largest overspeed (%)"].map("{:.1f}".format)
    shown["agent"] = shown["agent"].map("`{}`".format)
    return "\n".join([*parts, *_remark(scores), frame_markdown(shown)])


def kinds_markdown(scores, counts, figures=None):
    """Return by_kind as markdown: one table per figure (names; None: all) and one of failures."""
    parts = []
    for name in figures or scores["figure"].unique():
        rows = scores[scores["figure"] == name]
        texts = [ratio_text(row) for row in rows.to_dict("records")]
        title = f"{name} over `{rows['baseline'].iloc[0]}`"
        parts.append(wide_markdown(rows, texts, title, "kind", "agent"))
    columns = zip(counts[list(KINDS)].sum(axis=1), counts[PAST_ANY], counts["runs"], strict=True)
    texts = [f"{missing} / {past} of {runs}" for missing, past, runs in columns]
    lost = wide_markdown(counts, texts, f"lost / {PAST_ANY}", "kind", "agent")
    return "\n".join([*parts, *_remark(scores), lost])


def write_scores(tables, text, path):
    """Write PATH.md of the text and PATH_suffix.csv of {suffix: frame} ("": PATH.csv); return the paths."""
    path = Path(path)
    written = [path.with_name(path.name + ".md")]
    with replacing(written[0]) as temporary:
        temporary.write_text(text, encoding="utf-8")
    for suffix, frame in tables.items():
        name = f"{path.name}_{suffix}.csv" if suffix else f"{path.name}.csv"
        written.append(path.with_name(name))
        write_table(frame, written[-1])
    return written
