"""Writes the outcome of an evaluation as sentences, from the paired statistics of the leaderboard.

A difference is called better or worse only if it is significant; with too few seeds for a test the sentences
say so and list the observed differences.
"""

import html
import math

from fowt_env.training.evaluation.bootstrap import holm
from fowt_env.training.evaluation.metric_names import short_name
from fowt_env.training.evaluation.metrics import better
from fowt_env.training.reports.terminal import LEADERBOARD

TESTED = tuple(metric for _, metric, _, _, different in LEADERBOARD if different)
OBSERVED = (*TESTED[:3], "GenPwr_capped_mean_[kW]")
SHOWN = 5  # sentences that are always visible


def corrected_p(entry):
    """Return {metric: p-value} of a LeaderboardEntry over TESTED, with Holm's correction; {}: no test."""
    gaps = {name: entry.difference.get(name) for name in TESTED}
    adjusted = holm([math.nan if gap is None or gap.p is None else gap.p for gap in gaps.values()])
    return {name: float(p) for name, p in zip(gaps, adjusted, strict=True) if math.isfinite(p)}


def percent_text(percent):
    """Return a percentage as text: "+34 %", "+9.2 %", "+0.03 %", with minus sign and no-break space."""
    size = abs(percent)
    text = f"{size:.{0 if size >= 9.95 else 1 if size >= 0.095 else 2}f}"
    sign = "±" if float(text) == 0.0 else "+" if percent > 0.0 else "\N{MINUS SIGN}"
    return f"{sign}{text if sign != '±' else '0'}\N{NO-BREAK SPACE}%"


def verdict(board, seeds, least_seeds):
    """Return HTML of the verdict on a LeaderboardFile (or None); every name is escaped.

    seeds: number of seeds of the evaluation; least_seeds: minimum number for a test.
    """
    if board is None:
        return "<p>No verdict: without leaderboard.json there are no paired differences.</p>"
    others = [entry for entry in board.controllers if entry.controller != board.baseline]
    if board.baseline is None:
        return "<p>No verdict: no baseline, as every controller has runs that failed or lost power.</p>"
    if not others:
        return "<p>No verdict: a single controller was evaluated, without another to compare.</p>"
    lost = [entry for entry in board.controllers if entry.controller == board.baseline and entry.lost]
    tested = {entry.controller: corrected_p(entry) for entry in others}
    level = 1.0 - board.interval.level
    name = f"<b>{html.escape(board.baseline)}</b>"
    if any(tested.values()) or seeds >= least_seeds:
        head = f"Against {name}, paired by case and seed; * significant (p ≤ {level:.2g}, Holm-corrected)."
    else:
        count = "A single seed" if seeds == 1 else f"{seeds} seeds"
        head = f"{count}: no difference is tested (that needs {least_seeds} seeds). Observed against {name}:"
    for entry in lost:
        head += f" The baseline itself lost runs ({_lost(entry)}); these have no differences."
    items = [f"<li>{_sentence(entry, tested[entry.controller], level)}</li>" for entry in others]
    text = f"<p>{head}</p><ul>{''.join(items[:SHOWN])}</ul>"
    if items[SHOWN:]:
        more = f"<summary>{len(items) - SHOWN} more</summary><ul>{''.join(items[SHOWN:])}</ul>"
        text += f"<details>{more}</details>"
    return text


def _sentence(entry, tested, level):
    """Return HTML of the sentence on one controller."""
    gaps = {
        name: entry.difference[name].percent
        for name in (tested or OBSERVED)
        if name in entry.difference and entry.difference[name].percent is not None
    }
    sure = {name: percent for name, percent in gaps.items() if tested.get(name, 1.0) <= level}
    good = [_gap(n, p, "better", "*") for n, p in sure.items() if better(n) * p > 0.0]
    bad = [_gap(n, p, "worse", "*") for n, p in sure.items() if better(n) * p < 0.0]
    rest = [_gap(name, percent) for name, percent in gaps.items() if name not in sure]
    name = f"<b>{html.escape(entry.controller)}</b>"
    if not gaps:
        text = f"{name}: no difference is available"
    elif not tested:
        text = f"{name}: {', '.join(rest)} (not tested)"
    elif good or bad:
        text = f"{name}: " + " for ".join(filter(None, (_joined(good), _joined(bad))))
        text += " (better)" if not bad else " (worse)" if not good else ""
        text += f"; not significant: {', '.join(rest)}" if rest else ""
    else:
        text = f"{name}: no significant difference ({', '.join(rest)})"
    if entry.lost:
        text += f'; <span class="bad">{_lost(entry)}</span>, which are not in these means'
    if entry.beyond:
        text += f'; <span class="bad">exceeds a limit: {html.escape("; ".join(entry.beyond))}</span>'
    if entry.undecided:
        text += f"; not decided: {html.escape('; '.join(entry.undecided))}"
    return text + "."


def _gap(name, percent, kind="", star=""):
    """Return HTML of the difference in one metric."""
    words = f"{html.escape(short_name(name))} {percent_text(percent)}{star}"
    return f'<span class="{kind}">{words}</span>' if kind else words


def _joined(parts):
    """Return a list as text: "a, b and c"."""
    return " and ".join(filter(None, (", ".join(parts[:-1]), *parts[-1:])))


def _lost(entry):
    """Return the lost runs of a controller as text: "1 failed, 2 tripped of 12 runs"."""
    return f"{entry.lost_text} of {entry.runs} runs"
