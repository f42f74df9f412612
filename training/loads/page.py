"""Writes the HTML page of a design load table: matrix, loads, constraints, 50-year values.

    from fowt_env.training.loads.page import write_load_page
    write_load_page("results/loads.html", load_tables(cases, finished), title="Design loads of oc3_hywind")

The page contains its data and plotly.js, and loads nothing from a network. Needs plotly:
pip install "fowt-env[report]".
"""

import html
import platform as machine
from importlib.metadata import version
from math import isfinite
from pathlib import Path

from fowt_env.training.evaluation.run_case import PARKED
from fowt_env.training.loads.selection import runs_of
from fowt_env.training.loads.statistics import GROUPS, LEAST_IS_WORST, MOORING
from fowt_env.training.loads.tables import absent_part, family_of, meaning_of
from fowt_env.training.reports.metric_words import counted
from fowt_env.training.reports.page_file import page_path, plotly_source, write_page
from fowt_env.training.reports.page_words import table_rows

PARTS = Path(__file__).parent / "page_parts"
MOST_LOST = 50  # runs that are named
RULES = {
    "largest": "largest of the seeds",
    "mean": "mean of the seeds' extremes",
    "upper_half": "mean of the larger half of the seeds' extremes",
    "extrapolated": "extrapolated to 50 years",
}
SIDES = {"max": "largest", "min": "least"}


def write_load_page(out, results, *, title, lead="", left_out=(), remarks=(), facts=None):
    """Write the page of LoadTables; return its path.

    title, lead  texts of the head
    left_out     [(number, description, reason)] of load cases that were not run
    remarks      texts above the tables
    facts        {name: text} of the provenance
    Raises: InputError for another ending than .html, or if plotly is missing.
    """
    out, plotly = page_path(out), plotly_source()
    data = page_data(results)
    texts = {name: html.escape(text) for name, text in {"title": title, "lead": lead}.items()}
    texts |= {
        "verdict": _verdict(results, remarks),
        "matrix": _matrix(results),
        "sources": html.escape(_sources(results)),
        "left_out": _left_out(left_out),
        "lost": _lost(results),
        "reference": f"{results.reference_cycles:.3g}",
        "years": f"{results.years:g}",
        "baseline": html.escape(results.baseline),
        "extrapolation_link": '<a href="#extrapolation">50-year loads</a>' if data["extrapolation"] else "",
        "extrapolation_section": _extrapolation() if data["extrapolation"] else "",
        "provenance": _provenance(facts or {}),
    }
    style = (PARTS / "loads.css").read_text(encoding="utf-8")
    return write_page(out, PARTS / "loads.html", PARTS / "loads.js", texts, data, plotly, style)


def page_data(results):
    """Return the mapping that the page's script reads; NaN as None."""
    cases = {case.name: case.case for case, _ in results.runs}
    return {
        "controllers": list(results.controllers),
        "baseline": results.baseline,
        "rules": RULES,
        "exponents": sorted({row.exponent for row in results.lifetime}),
        "return_years": next((each.years for each in results.extrapolations.values()), 50.0),
        "ultimate": _ultimate(results, cases),
        "fatigue": _fatigue(results, cases),
        "constraints": _constraints(results),
        "extrapolation": _curves(results),
    }


def _number(value):
    """Return a number rounded to six digits, None for NaN and None."""
    return None if value is None or not isfinite(value) else float(f"{value:.6g}")


def _rank(column):
    """Return the place of a channel's part, structure before motions."""
    group = family_of(column)
    parts = [name.partition("{")[0] for name in (*GROUPS, MOORING)]
    return next((place for place, name in enumerate(parts) if group.startswith(name)), len(parts))


def _of_channel(column, order, cases, names):
    """Return what rows of a channel share; names: of the conditions whose plants are asked for the load."""
    name, _, unit = column.rstrip("]").partition("_[")
    about, group = meaning_of(column), family_of(column)
    absent = next((text for text in (absent_part(column, cases[each]) for each in names) if text), "")
    words = " ".join((name, unit, about, group, absent)).lower()
    return {
        "name": name, "unit": unit, "about": about, "group": group, "absent": absent, "order": order,
        "words": words,
    }  # fmt: skip


def _by_row(rows, key):
    """Return {key: {controller: row}} in order."""
    found = {}
    for row in rows:
        found.setdefault(key(row), {})[row.controller] = row
    return found


def _ultimate(results, cases):
    """Return the rows of the ultimate table: loads of a group, without directions, each side."""
    found = []
    table = _by_row(results.extremes, lambda row: (row.column, row.side))
    ordered = sorted(table.items(), key=lambda item: _rank(item[0][0]))
    for order, ((column, side), own) in enumerate(ordered):
        if "@" in column or not family_of(column):
            continue
        row = _of_channel(column, order, cases, [each.name for each in own.values()]) | {"side": side}
        row["cells"] = [_ultimate_cell(own.get(label)) for label in results.controllers]
        drivers = " ".join(f"{each.dlc} {each.name}" for each in own.values())
        row["words"] += f" {side} {drivers}".lower()
        found.append(row)
    return found


def _ultimate_cell(row):
    """Return an Extreme for the page, or None."""
    if row is None:
        return None
    at = []
    for name, value in row.at.items():
        short, _, unit = name.rstrip("]").partition("_[")
        at.append([short, unit, _number(value)])
    return {
        "load": _number(row.factored), "low": _number(row.low), "high": _number(row.high),
        "value": _number(row.value), "factor": row.factor, "rule": row.characteristic, "dlc": row.dlc,
        "name": row.name, "seed": row.seed, "time": row.time, "largest": _number(row.largest),
        "gap": _number(row.difference), "gap_low": _number(row.difference_low),
        "gap_high": _number(row.difference_high), "at": at,
    }  # fmt: skip


def _fatigue(results, cases):
    """Return the rows of the fatigue table."""
    names = list(dict.fromkeys(case.name for case, _ in results.runs if case.hours_per_year > 0.0))
    found = []
    table = _by_row(results.lifetime, lambda row: (row.column, row.exponent))
    ordered = sorted(table.items(), key=lambda item: _rank(item[0][0]))
    for order, ((column, exponent), own) in enumerate(ordered):
        if "@" in column:
            continue
        cells = [
            label in own
            and {
                "load": _number(own[label].value), "low": _number(own[label].low),
                "high": _number(own[label].high), "ratio": _number(own[label].ratio),
                "ratio_low": _number(own[label].ratio_low), "ratio_high": _number(own[label].ratio_high),
                "share": [[dlc, _number(part)] for dlc, part in own[label].share],
            }
            for label in results.controllers
        ]  # fmt: skip
        row = _of_channel(column, order, cases, names[:1])
        found.append(row | {"m": exponent, "cells": [cell or None for cell in cells]})
    return found


def _constraints(results):
    """Return the rows of the constraints."""
    own = {label: [each.flags for _, each in runs_of(results.runs, label)] for label in results.controllers}
    found = {}
    for label, flag, case in results.flags:
        row = found.setdefault(
            flag.name,
            {
                "name": flag.name, "unit": flag.unit, "limit": flag.limit,
                "least": flag.name in LEAST_IS_WORST, "cells": [None] * len(results.controllers),
            },
        )  # fmt: skip
        count = sum(any(f.name == flag.name and f.exceeded for f in flags) for flags in own[label])
        row["cells"][results.controllers.index(label)] = {
            "value": _number(flag.value), "exceeded": bool(flag.exceeded), "dlc": case.dlc, "name": case.name,
            "seed": case.seed, "time": flag.time, "count": count, "runs": len(own[label]),
        }  # fmt: skip
    return list(found.values())


def _curves(results):
    """Return the rows of the extrapolation: channel, side, and a curve per controller."""
    found = {}
    for (label, column, side), each in results.extrapolations.items():
        if not isfinite(each.value):
            continue
        name, _, unit = column.rstrip("]").partition("_[")
        row = found.setdefault(
            (column, side),
            {"name": name, "unit": unit, "side": SIDES[side], "cells": [None] * len(results.controllers)},
        )
        row["cells"][results.controllers.index(label)] = {
            "value": _number(each.value), "low": _number(each.low), "high": _number(each.high),
            "block": _number(each.block), "largest": _number(each.largest), "governing": each.governing,
            "form": [_number(value) for value in results.forms.get((label, column, side), ())],
            "curve": [[_number(load), _number(rate)] for load, rate in each.curve],
        }  # fmt: skip
    return [found[key] for key in sorted(found, key=lambda key: _rank(key[0]))]


# --------------------------------------------------------------------------- texts


def _verdict(results, remarks):
    """Return HTML of what must be known before a figure is used."""
    cases = [case for case, _ in results.runs]
    lines = []
    if results.lost:
        whole = _lost_conditions(results)
        text = f"{counted(len(results.lost), 'run')} of {len(results.cases)} failed or are not finished"
        text += (
            f", all seeds of {counted(len(whole), 'condition')}: the table is not complete" if whole else ""
        )
        lines.append(f'<b class="bad">{html.escape(text)}</b>')
    if results.ended:
        lines.append(
            f"{counted(len(results.ended), 'run')} ended early, by the protection: their statistics are those"
            " until then."
        )
    missing = {}
    for row in results.extremes:
        case = next(case for case in cases if case.name == row.name)
        if text := absent_part(row.column, case.case):
            missing.setdefault(text, set()).add(family_of(row.column))
    if missing:
        parts = "; ".join(f"{text} ({', '.join(sorted(groups))})" for text, groups in missing.items())
        lines.append(f"Not for design, since the plant lacks their dynamics: {html.escape(parts)}.")
    lines += [html.escape(text) for text in remarks]
    exceeded = sorted({flag.name for _, flag, _ in results.flags if flag.exceeded})
    if exceeded:
        lines.append(f"Exceeded in at least one run: {html.escape(', '.join(exceeded))}.")
    return "".join(f"<p>{line}</p>" for line in lines) or "<p>Every run has statistics.</p>"


def _lost_conditions(results):
    """Return the (controller, dlc, name) of conditions without any run that has statistics."""
    there = {(case.controller, *case.condition) for case, _ in results.runs}
    return sorted({(case.controller, *case.condition) for case, _ in results.lost} - there)


def _matrix(results):
    """Return the HTML rows of the matrix, one per design load case."""
    rows = []
    by_number = {}
    for case in results.cases:
        by_number.setdefault(case.dlc, []).append(case)
    for dlc, members in by_number.items():
        winds = sorted({case.wind_speed for case in members if case.wind_speed is not None})
        heights = sorted({case.Hs for case in members})
        hours = {}
        for case in members:
            if case.analysis != "ultimate":
                hours[case.controller] = hours.get(case.controller, 0.0) + case.hours_per_year
        first = members[0]
        labels = {case.controller for case in members}
        rows.append(
            [
                dlc, first.description, counted(len({case.name for case in members}), "condition"),
                f"{len(members)}" + (" (parked)" if labels == {PARKED} else ""),
                _span(winds), _span(heights), f"{first.safety}, {first.factor:g}",
                RULES[first.characteristic] if first.analysis != "fatigue" else "fatigue",
                f"{max(hours.values()):.4g}" if any(hours.values()) else "",
            ]
        )  # fmt: skip
    head = [
        "DLC", "description", "conditions", "runs", "wind (m/s)", "Hs (m)", "class, factor",
        "characteristic load", "hours per year",
    ]  # fmt: skip
    return table_rows(head, [[html.escape(str(cell)) or "–" for cell in row] for row in rows])


def _span(values):
    """Return the text of the range of sorted values."""
    if not values:
        return ""
    return f"{values[0]:g}" if values[0] == values[-1] else f"{values[0]:g} to {values[-1]:g}"


def _sources(results):
    """Return the sources of factors and cases as one text."""
    factors = dict.fromkeys(f"{case.factor:g}: {case.factor_source}" for case in results.cases)
    cases = dict.fromkeys(f"{case.dlc}: {case.source}" for case in results.cases if case.source)
    return f"Factors: {'; '.join(factors)}. Cases: {'; '.join(cases)}."


def _left_out(rows):
    """Return HTML of the list of load cases that were not run, "" for none."""
    items = "".join(
        f"<li><b>{html.escape(dlc)}</b> {html.escape(what)}: {html.escape(why)}</li>"
        for dlc, what, why in rows
    )
    summary = f"<summary>{counted(len(rows), 'load case')} left out in whole or in part</summary>"
    return f"<details>{summary}<ul>{items}</ul></details>" if rows else ""


def _lost(results):
    """Return HTML of the list of runs without statistics, "" for none."""
    items = []
    for case, run in results.lost[:MOST_LOST]:
        why = "not finished" if run is None else f"{run.status}: {run.reason}"
        items.append(
            f"<li><b>{html.escape(case.controller)}</b>, {html.escape(case.name)}, seed {case.seed}:"
            f" {html.escape(why)}</li>"
        )
    if len(results.lost) > MOST_LOST:
        items.append(f"<li>and {len(results.lost) - MOST_LOST} more</li>")
    summary = f'<summary class="bad">{counted(len(results.lost), "run")} without statistics</summary>'
    body = f'<ul class="lost" tabindex="0">{"".join(items)}</ul>'
    return f"<details open>{summary}{body}</details>" if items else ""


def _extrapolation():
    """Return HTML of the section of long-term loads."""
    return (
        '<section id="extrapolation"><div class="heading"><h2>50-year loads of production</h2>'
        '<label>load <select id="extrapolation-what"></select></label></div>'
        '<details class="help"><summary aria-label="Method">?</summary><div><p>Peaks over threshold in each'
        " condition, with the tail of a Weibull distribution about the mean load, integrated over the winds"
        " and all seas of the site, with a scale whose square is linear in Hs squared; the exponent is"
        " estimated from neighbouring winds together. Interval: a bootstrap over the seeds. Inverse FORM: the"
        " largest load on the 50-year contour of wind, Hs and largest load of a run, from runs in usual and"
        " severe seas, with its wind and sea. Cross: Gumbel distributions of the largest values of the runs,"
        " as a check. Without partial factor.</p></div>"
        "</details>"
        '<div class="plot" id="extrapolation-plot"></div><div class="scroll"><div tabindex="0" role="region"'
        ' aria-label="50-year loads"><table class="figures" id="extrapolation-table"><thead></thead><tbody>'
        "</tbody></table></div></div></section>"
    )


def _provenance(facts):
    """Return the HTML rows of the provenance."""
    made = [f"{name} {version(name)}" for name in ("fowt-env", "numpy", "scipy", "pandas", "plotly")]
    rows = facts | {"page made by": ", ".join([*made, f"Python {machine.python_version()}"])}
    return "".join(
        f'<tr><th scope="row">{html.escape(name)}</th><td>{html.escape(str(text))}</td></tr>'
        for name, text in rows.items()
    )
