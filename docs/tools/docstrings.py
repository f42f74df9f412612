"""Docstrings as markdown: their aligned lists of names become lists, everything else stays as it is.

The docstrings are written to be read by help(), as

    name      what it means,
              over as many lines as it takes

which markdown would run into one paragraph.
"""

import re

from griffe import Extension

NAMES = r"(?P<names>[A-Za-z_][\w.*]*(?:, [A-Za-z_][\w.*]*)*)"
ENTRY = re.compile(NAMES + r"(?: {2,}|: )(?P<text>\S.*)")
LONGEST = re.compile(NAMES + r" (?P<text>\S.*)")  # the longest name of a list has one blank after it
INDENT = re.compile(r" *")
WORDS = {"Raises", "Source", "Sources", "Returns", "Attributes", "Needs", "Equation"}


def as_markdown(text):
    """The docstring with every aligned list of names as a markdown list, and nothing else of markdown's."""
    blocks = re.split(r"\n[ \t]*\n", text)
    return "\n\n".join(block if _is_code(block) else _literal(_paragraph(block)) for block in blocks)


def _is_code(block):
    """Whether a paragraph is indented as a program is."""
    return all(line.startswith("    ") for line in block.splitlines())


def _literal(text):
    """The text with the signs of links, emphasis and HTML taken as they are, but for lists and code."""
    pieces = re.split(r"(`[^`]*`)", text)
    return "".join(
        piece if i % 2 else re.sub(r"([\[\]*])", r"\\\1", piece).replace("<", "&lt;")
        for i, piece in enumerate(pieces)
    )


def _paragraph(block):
    """One paragraph; a list where its first line and all others of that indentation name something.

    What follows an aligned list without a blank line becomes a paragraph of its own.
    """
    lines = block.splitlines()
    depth = min(len(INDENT.match(line).group()) for line in lines)
    lines = [line[depth:] for line in lines]
    first = ENTRY.fullmatch(lines[0])
    if first is None or first.group("names") in WORDS:
        return block
    column = first.start("text")
    items = []
    for number, line in enumerate(lines):
        if line.startswith(" "):
            items[-1] += " " + line.strip()
            continue
        entry = ENTRY.fullmatch(line) or LONGEST.fullmatch(line)
        if entry is None or (entry.re is LONGEST and entry.start("text") != column):
            if first.string[first.end("names")] == ":":
                return block
            return "\n".join(items) + "\n\n" + "\n".join(lines[number:])
        names = ", ".join(f"`{name}`" for name in entry.group("names").split(", "))
        items.append(f"- {names}: {entry.group('text')}")
    return "\n".join(items)


class AlignedLists(Extension):
    """Griffe's view of the docstrings, turned into markdown."""

    def on_object(self, *, obj, **_):
        """Rewrite the docstring of one module, class, function or attribute."""
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)
