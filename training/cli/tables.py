"""Tables of the command line: without a frame, and with all digits in a terminal of any width.

If a table is wider than the terminal, its headings are wrapped; if it still is, it is printed in blocks of
columns, each beginning with the first ones. A file or a pipe gets full lines, unless COLUMNS is set.
"""

import os
import re
from numbers import Integral

from rich.cells import cell_len
from rich.text import Text

GAP = "  "
BREAK = "\u200b"  # allows a line break within a long word of prose
LONG_WORD = re.compile(r"\S{17,}")


def table_width(console):
    """Return the characters in a line of a console; None: no limit (a file or a pipe)."""
    if console.is_terminal or os.environ.get("COLUMNS", "").isdigit():
        return console.width
    return None


def figure(value):
    """Return the text of a value: integers in full, other numbers with four significant digits."""
    return str(value) if isinstance(value, str | Integral) else f"{value or 0.0:.4g}"


def print_table(console, headings, rows, title=None, keys=1, left=(0,), prose=(), red=()):
    """Print rows (sequences of texts) below headings, numbers to the right.

    keys   number of first columns that every block repeats
    left   numbers of left-aligned columns; prose: of those whose texts may take several lines
    red    numbers of red rows
    """
    width = table_width(console)
    columns = [
        [(_breakable(row[i]) if i in prose else row[i]).split("\n") for row in rows]
        for i in range(len(headings))
    ]
    heads = [heading.split("\n") for heading in headings]
    if _total(map(_size, heads, columns)) > (width or float("inf")):
        heads = [
            head if len(head) > 1 else _filled(re.split(r"[\s_]+", head[0]), _size([""], column))
            for head, column in zip(heads, columns, strict=True)
        ]
        columns = _folded(heads, columns, prose, width)
    sizes = [_size(head, column) for head, column in zip(heads, columns, strict=True)]
    if title:
        console.print(Text(title, style="italic"), soft_wrap=True)
    for block, chosen in enumerate(_blocks(sizes, keys, width)):
        if block:
            console.print()
        ways = [(sizes[i], i in left or i in prose) for i in chosen]
        tall = max(len(heads[i]) for i in chosen)
        _print_lines(console, [[""] * (tall - len(heads[i])) + heads[i] for i in chosen], ways, "bold")
        console.print(Text("─" * _total(size for size, _ in ways), style="dim"), soft_wrap=True)
        for row in range(len(rows)):
            _print_lines(console, [columns[i][row] for i in chosen], ways, "red" if row in red else "")


def _print_lines(console, cells, ways, style):
    """Print one row; cells: lines of each, ways: (size, whether left-aligned) of each."""
    for line in range(max(map(len, cells))):
        texts = []
        for lines, (size, left) in zip(cells, ways, strict=True):
            text = (lines[line] if line < len(lines) else "").replace(BREAK, "")
            padding = " " * (size - cell_len(text))
            texts.append(text + padding if left else padding + text)
        console.print(Text(GAP.join(texts).rstrip(), style=style), soft_wrap=True)


def _longest(lines):
    """Return the width of the widest of some lines."""
    return max(map(cell_len, lines))


def _size(head, column):
    """Return the width of a column with its heading."""
    return max(map(_longest, [head, *column]))


def _total(sizes):
    """Return the width of columns side by side."""
    sizes = list(sizes)
    return sum(sizes) + len(GAP) * (len(sizes) - 1)


def _filled(words, size):
    """Return lines of words, each filled up to `size` or the longest word."""
    size = max([size, *map(cell_len, words)])
    lines = [words[0]]
    for word in words[1:]:
        gap = "" if lines[-1].endswith(BREAK) else " "
        if cell_len(lines[-1]) + len(gap) + cell_len(word) <= size:
            lines[-1] += gap + word
        else:
            lines.append(word)
    return lines


def _breakable(text):
    """Return a text with BREAK after each slash and underscore of its long words, such as paths."""
    return LONG_WORD.sub(lambda match: re.sub(r"([/_])(?=\w)", rf"\1{BREAK}", match.group()), text)


def _words(text):
    """Return the words of a text, split at spaces and after each BREAK."""
    return [word for word in re.split(rf"\s+|(?<={BREAK})", text) if word]


def _folded(heads, columns, prose, width):
    """Return the columns, with prose over more lines until they fit the width."""
    columns = list(columns)
    while _total(map(_size, heads, columns)) > width:
        able = [i for i in prose if _size([""], columns[i]) > max(_least(columns[i]), _longest(heads[i]))]
        if not able:
            break
        widest = max(able, key=lambda i: _size([""], columns[i]))
        size = _size([""], columns[widest]) - 1
        columns[widest] = [
            _filled(_words(_joined(lines)), size) if lines[0] else lines for lines in columns[widest]
        ]
    return columns


def _joined(lines):
    """Return the text of some lines."""
    return " ".join(lines).replace(f"{BREAK} ", BREAK)


def _least(column):
    """Return the width of the longest word of a column."""
    return max(cell_len(word) for lines in column for line in lines for word in (_words(line) or [""]))


def _blocks(sizes, keys, width):
    """Return [numbers of columns] of each block: the first `keys` and as many more as fit, at least one."""
    blocks, most = [list(range(keys))], float("inf") if width is None else width
    for i in range(keys, len(sizes)):
        if len(blocks[-1]) > keys and _total(sizes[j] for j in (*blocks[-1], i)) > most:
            blocks.append(list(range(keys)))
        blocks[-1].append(i)
    return blocks
