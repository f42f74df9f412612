"""What stands in the pages of the documentation and in sources, for the tests that compare them."""

import ast
import re
import shlex
from pathlib import Path
from typing import NamedTuple

from typer.testing import CliRunner

from fowt_env.training.cli import app as cli

DOCS = Path(__file__).resolve().parent.parent / "docs"
FENCE = re.compile(r"^```(\w*)(?: title=\"([^\"]+)\")?\n(.*?)^```$", re.S | re.M)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


class Block(NamedTuple):
    """A fenced block: its language, the file it is to be saved as (or ""), its text, the heading above it."""

    language: str
    file: str
    text: str
    heading: str


def blocks(page):
    """Blocks of a page of docs/ in order."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = []
    for match in FENCE.finditer(text):
        headings = re.findall(r"^#+ (.*)$", FENCE.sub("", text[: match.start()]), re.M)
        found.append(Block(match[1], match[2] or "", match[3], headings[-1]))
    return found


def defined(path):
    """Names that a source gives a meaning: functions, classes, assigned names, fields and parameters."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
    return names


def fowt(line):
    """Run one line of a shell that starts with fowt; it must end well. Returns what it printed."""
    result = CliRunner().invoke(cli.app, shlex.split(line, comments=True)[1:], env={"COLUMNS": "200"})
    assert result.exit_code == 0, f"{line}\n{result.stdout}\n{result.stderr}\n{result.exception!r}"
    return result.stdout


def assert_printed(printed, shown, rel=0.02):
    """Raise unless both texts are the same words with nearly the same numbers.

    The pages round to a digit, and another machine's last bits may turn one over: 1.1 of the last digit.
    """
    assert NUMBER.sub("#", printed).split() == NUMBER.sub("#", shown).split(), printed
    for a, b in zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=True):
        last = 10.0 ** -len(b.partition(".")[2])
        assert abs(float(a) - float(b)) <= max(min(1.1 * last, 0.11), rel * abs(float(b))), printed
