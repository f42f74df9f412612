"""Writes Markdown tables for reports, pages and docstrings."""


def markdown_table(header, rows, aligned=False):
    """Return the Markdown text of a table, without a trailing newline.

    header, rows   cells, converted by str; bars in cells are escaped
    aligned        whether to pad columns to their widest cell, for pages that are edited by hand
    """
    cells = [[str(cell).replace("|", "\\|") for cell in row] for row in (header, *rows)]
    widths = [max(map(len, column)) if aligned else 0 for column in zip(*cells, strict=True)]
    lines = ["| " + " | ".join(map(str.ljust, row, widths)) + " |" for row in cells]
    lines.insert(1, "|" + "|".join("-" * max(3, width + 2) for width in widths) + "|")
    return "\n".join(lines)
