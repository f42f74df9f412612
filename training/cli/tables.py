"""Prints the tables of the command line, without a frame and with all digits at any terminal width.

If a table is wider than the terminal, its headings and then its prose are wrapped; if this is not enough, the
table is printed in blocks of columns that repeat the first columns. A file or a pipe gets full lines, unless
COLUMNS is set.
"""

import os
import textwrap

from rich.box import Box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fowt_env.display import number_text

out = Console(emoji=False, highlight=False, soft_wrap=True)  # no emoji for a controller module:Name:
GAP = 2
LONG_WORD = 16  # characters; least width of a column of prose with longer words
RULED = Box("    \n    \n ── \n    \n    \n    \n    \n    \n")


def table_width():
    """Return the width of the terminal in characters; infinite for a file or a pipe."""
    return out.width if out.is_terminal or os.environ.get("COLUMNS", "").isdigit() else float("inf")


def print_table(headings, rows, title=None, keys=1, left=(0,), prose=(), red=()):
    """Print rows (sequences of texts and numbers) below headings, with numbers aligned right.

    keys   number of first columns that every block repeats
    left   indices of left-aligned columns; prose: of columns whose texts may be wrapped
    red    indices of red rows
    """
    width, rows = table_width(), [list(map(number_text, row)) for row in rows]
    columns = [[row[i] for row in rows] for i in range(len(headings))]
    heads = list(headings)
    if _total(_longest([head, *column]) for head, column in zip(heads, columns, strict=True)) > width:
        heads = [_wrapped(head, column) for head, column in zip(heads, columns, strict=True)]
    sizes = [_longest([head, *column]) for head, column in zip(heads, columns, strict=True)]
    least = [
        max(min(LONG_WORD, _longest(" ".join(columns[i]).split())), _longest([heads[i]]))
        if i in prose
        else size
        for i, size in enumerate(sizes)
    ]
    if title:
        out.print(Text(title, style="italic"))
    for number, block in enumerate(_blocks(least, keys, width)):
        if number:
            out.print()
        table = Table(
            box=RULED, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0), border_style="dim",
            width=int(min(max(width, _total(least[i] for i in block)), _total(sizes[i] for i in block))),
        )  # fmt: skip
        tall = max(heads[i].count("\n") for i in block)
        for i in block:
            head = Text("\n" * (tall - heads[i].count("\n")) + heads[i], style="bold")
            side = "left" if i in left or i in prose else "right"
            table.add_column(head, justify=side, no_wrap=i not in prose, overflow="fold")
        for index, row in enumerate(rows):
            table.add_row(*(Text(row[i]) for i in block), style="red" if index in red else "")
        out.print(table)


def show(frame, title=None):
    """Print a DataFrame, with columns of texts aligned left."""
    texts = [i for i, name in enumerate(frame.columns) if frame[name].map(type).eq(str).any()]
    keys = max([i + 1 for i in texts if i < 2], default=1)
    print_table(list(frame.columns), frame.itertuples(index=False), title, keys, left=texts)


def _longest(texts):
    """Return the width of the longest line of some texts."""
    return max((cell_len(line) for text in texts for line in text.split("\n")), default=0)


def _total(sizes):
    """Return the width of columns side by side."""
    sizes = list(sizes)
    return sum(sizes) + GAP * (len(sizes) - 1)


def _wrapped(head, column):
    """Return a heading wrapped to the width of its column or of its longest word."""
    words = head.replace("_", " ")
    size = max(_longest(column), _longest(words.split()))
    return head if "\n" in head or not words else textwrap.fill(words, size, break_on_hyphens=False)


def _blocks(sizes, keys, width):
    """Return [column indices] of each block: the first `keys` and as many more as fit, at least one."""
    blocks = [list(range(keys))]
    for i in range(keys, len(sizes)):
        if len(blocks[-1]) > keys and _total(sizes[j] for j in (*blocks[-1], i)) > width:
            blocks.append(list(range(keys)))
        blocks[-1].append(i)
    return blocks
