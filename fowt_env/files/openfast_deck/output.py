"""The files of an import: text with a source beside each figure, and the coefficients."""

import numpy as np

from fowt_env.descriptions.tower_modes import COLUMNS

WIDTH = 40  # characters of a line before its comment


def number_text(value):
    """A number as TOML has it: ten digits, a float always with a point or an exponent."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    text = f"{float(value) + 0.0:.10g}"
    return text if any(mark in text for mark in ".en") else text + ".0"


def value_text(value):
    """A value of TOML."""
    if isinstance(value, str):
        quoted = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else " " for c in quoted) + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {value_text(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        items = [value_text(item) for item in value]
        if items and isinstance(value[0], (list, tuple, np.ndarray)):
            return "[\n" + "".join(f"    {item},\n" for item in items) + "]"
        return "[" + ", ".join(items) + "]"
    return number_text(value)


def toml_text(tables, head):
    """Text of {table: rows}; lists of rows become a list of tables. head: lines of comment."""
    lines = [f"# {line}" for line in head]
    for name, rows in tables.items():
        several = bool(rows) and isinstance(rows[0], list)
        for one in rows if several else [rows]:
            if name and not one and name in ("lines", "members"):
                continue
            lines.append("")
            if name:
                lines.append(f"[[{name}]]" if several else f"[{name}]")
            lines += [_line(row) for row in one]
    return "\n".join(lines) + "\n"


def _line(row):
    text = f"{row.key} = {value_text(row.value)}"
    comment = "".join(c if c.isprintable() else " " for c in row.comment)
    return f"{text.ljust(WIDTH)} # {comment}" if comment else text


def blade_text(columns, airfoils, head):
    """Text of blade.csv; columns (n, 5): radius, chord, twist (deg), prebend, sweep."""
    shaped = bool(np.any(columns[:, 3:]))
    lines = [f"# {line}" for line in head]
    lines.append("radius_m,chord_m,twist_deg,airfoil" + (",prebend_m,sweep_m" if shaped else ""))
    for row, name in zip(columns, airfoils, strict=True):
        cells = [f"{value + 0.0:.8g}" for value in row]
        lines.append(",".join([*cells[:3], name, *(cells[3:] if shaped else ())]))
    return "\n".join(lines) + "\n"


def tower_text(modes, head):
    """Text of the distribution file of a descriptions.tower_modes.TowerBending."""
    lines = [f"# {line}" for line in head]
    lines.append(",".join(COLUMNS))
    rows = zip(*(getattr(modes, name) for name in COLUMNS), strict=True)
    lines += [",".join(f"{value + 0.0:.10g}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"


def polar_text(polar, head):
    """Text of a polar's CSV file; polar (m, 4): alpha (deg), cl, cd, cm."""
    lines = [f"# {line}" for line in head]
    lines.append("alpha_deg,cl,cd,cm")
    lines += [",".join(f"{value + 0.0:.7g}" for value in row) for row in polar]
    return "\n".join(lines) + "\n"
