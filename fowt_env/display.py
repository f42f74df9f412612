"""Tables in HTML, for objects that a notebook shows."""

from html import escape

CELL = 'style="text-align:left;padding:0.15em 0.8em 0.15em 0"'
NUMBER = 'style="text-align:right;padding:0.15em 0.8em 0.15em 0"'


def html_table(title, headings, rows):
    """HTML of a table: a title, headings (or none) and rows of texts and numbers, everything escaped.

    Numbers stand to the right with four significant digits. The colours are the notebook's own.
    """
    head = f"<tr>{''.join(f'<th {CELL}>{escape(text)}</th>' for text in headings)}</tr>" if headings else ""
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    return f"<div><b>{escape(title)}</b><table>{head}{body}</table></div>"


def _cell(value):
    """HTML of one cell."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f"<td {NUMBER}>{value:.4g}</td>"
    return f"<td {CELL}>{escape(str(value))}</td>"
