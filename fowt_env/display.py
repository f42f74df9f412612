"""Formats numbers of tables, and HTML tables for objects displayed in notebooks."""

from html import escape
from numbers import Integral

CELL = 'style="text-align:left;padding:0.15em 0.8em 0.15em 0"'
NUMBER = 'style="text-align:right;padding:0.15em 0.8em 0.15em 0"'


def number_text(value):
    """Return the text of a value: integers in full, other numbers with four significant digits.

    Numbers below 1e9 have no exponent: 19790 kN-m.
    """
    if isinstance(value, str | Integral):
        return str(value)
    text = f"{value or 0.0:.4g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(value) < 1e9 else text


def html_table(title, headings, rows):
    """Return the HTML of a table with a title, headings (may be empty) and rows of text and numbers, escaped.

    Numbers are right-aligned with four significant digits; the notebook sets the colours.
    """
    head = f"<tr>{''.join(f'<th {CELL}>{escape(text)}</th>' for text in headings)}</tr>" if headings else ""
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    return f"<div><b>{escape(title)}</b><table>{head}{body}</table></div>"


def _cell(value):
    """Return the HTML of one table cell."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f"<td {NUMBER}>{value:.4g}</td>"
    return f"<td {CELL}>{escape(str(value))}</td>"
