"""Formats HTML tables for objects displayed in notebooks."""

from html import escape

CELL = 'style="text-align:left;padding:0.15em 0.8em 0.15em 0"'
NUMBER = 'style="text-align:right;padding:0.15em 0.8em 0.15em 0"'


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
