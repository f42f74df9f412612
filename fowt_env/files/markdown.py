"""Tables in Markdown: the one writer of those in reports, pages and docstrings."""


def markdown_table(header, rows, aligned=False):
    """Markdown text of a table, without a line end after it.

    header, rows   cells: texts, or what str makes a text of; a bar in one is escaped
    aligned        whether columns are as wide as their widest cell, as in pages that people edit; else the
                   cells stand as they are
    """
    cells = [[str(cell).replace("|", "\\|") for cell in row] for row in (header, *rows)]
    widths = [max(map(len, column)) if aligned else 0 for column in zip(*cells, strict=True)]
    lines = ["| " + " | ".join(map(str.ljust, row, widths)) + " |" for row in cells]
    lines.insert(1, "|" + "|".join("-" * max(3, width + 2) for width in widths) + "|")
    return "\n".join(lines)
