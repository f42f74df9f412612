"""Formats the text files of an import, with the source of each value as a comment."""

import numpy as np

from fowt_env.descriptions.blade_structure import COLUMNS as STRUCTURE_COLUMNS
from fowt_env.descriptions.blade_structure import LARGEST
from fowt_env.descriptions.tower_modes import COLUMNS
from fowt_env.descriptions.units import DEGREE

WIDTH = 40  # characters of a line before its comment


def value_text(value):
    """Return a TOML value as text: numbers with ten digits, floats always with a point or an exponent."""
    if isinstance(value, str):
        quoted = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else " " for c in quoted) + '"'
    if isinstance(value, (list, tuple, np.ndarray)):
        items = [value_text(item) for item in value]
        if items and isinstance(value[0], (list, tuple, np.ndarray)):
            return "[\n" + "".join(f"    {item},\n" for item in items) + "]"
        return "[" + ", ".join(items) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {value_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    text = f"{float(value) + 0.0:.10g}"
    return text if any(mark in text for mark in ".en") else text + ".0"


def toml_text(tables, head):
    """Return the TOML text of {table: rows (key, value, comment)} or lists of tables. head: comment lines."""
    lines = [f"# {line}" for line in head]
    for name, rows in tables.items():
        several = bool(rows) and isinstance(rows[0], list)
        for one in rows if several else [rows] * bool(rows):
            lines += ["", *([f"[[{name}]]" if several else f"[{name}]"] if name else [])]
            lines += [_line(*row) for row in one if row[1] is not None]
    return "\n".join(lines) + "\n"


def _line(key, value, comment=""):
    text = f"{key} = {value_text(value)}"
    comment = "".join(c if c.isprintable() else " " for c in comment)
    return f"{text.ljust(WIDTH)} # {comment}" if comment else text


def table_text(columns, rows, head):
    """Return the text of a CSV file of column names and rows of texts. head: comment lines."""
    return "\n".join([*(f"# {line}" for line in head), *map(",".join, [columns, *rows])]) + "\n"


def blade_text(columns, airfoils, head):
    """Return the text of blade.csv; columns (n, 5): radius, chord, twist (deg), prebend, sweep."""
    more = ("prebend_m", "sweep_m") if np.any(columns[:, 3:]) else ()
    rows = []
    for row, name in zip(columns, airfoils, strict=True):
        cells = [f"{value + 0.0:.8g}" for value in row]
        rows.append([*cells[:3], name, *cells[3 : 3 + len(more)]])
    return table_text(["radius_m", "chord_m", "twist_deg", "airfoil", *more], rows, head)


def tower_text(modes, head):
    """Return the text of the distribution file of a descriptions.tower_modes.TowerBending."""
    return _numbers_text(COLUMNS, [getattr(modes, name) for name in COLUMNS], head)


def structure_text(structure, head):
    """Return the text of the distribution file of a descriptions.blade_structure.BladeStructure."""
    columns = [structure.span_fraction, structure.structural_twist / DEGREE]
    columns += [getattr(structure, name) for name in LARGEST]
    return _numbers_text(STRUCTURE_COLUMNS, columns, head)


def _numbers_text(names, columns, head):
    """Return the text of a CSV file of columns of numbers, to ten digits."""
    rows = [[f"{value + 0.0:.10g}" for value in row] for row in zip(*columns, strict=True)]
    return table_text(names, rows, head)


def polar_text(polar, head):
    """Return the text of a polar's CSV file; polar (m, 4): alpha (deg), cl, cd, cm."""
    rows = [[f"{value + 0.0:.7g}" for value in row] for row in polar]
    return table_text(["alpha_deg", "cl", "cd", "cm"], rows, head)
