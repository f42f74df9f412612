"""Which sources of this project a module imports at its top: what a kernel in it can depend on.

A kernel freezes what its module's globals hold when it is compiled, and an import inside a function adds
nothing to these. Statements are found by a pattern, as this runs at every start and a parser takes ten times
as long; the project has no relative imports, and none in a condition that a kernel could see.
"""

import re
from functools import cache

from fowt_env.layout import module_path

MODULE = r"(fowt_env(?:\.\w+)*)"
STATEMENT = re.compile(rf"^(?:from {MODULE} import (\([^)]*\)|.*)|import {MODULE})", re.MULTILINE)
COMMENT = re.compile("#.*")
NAME = re.compile(r"(\w+)(?: as \w+)?")


def imported_at_top(path, but):
    """Return the paths of a source of fowt_env and of all that it imports of this project.

    but: a folder whose sources are neither followed nor among them.
    """
    found, left = set(), [path]
    while left:
        path = left.pop()
        if path in found or but in path.parents:
            continue
        found.add(path)
        left += _imported(path)
    return found


@cache  # some twenty modules with kernels of their own import much the same
def _imported(path):
    """Sources that the statements of one source name."""
    found = []
    for source, names, module in STATEMENT.findall(path.read_text(encoding="utf-8")):
        inner = NAME.findall(COMMENT.sub("", names))
        for dotted in (source or module, *(f"{source}.{name}" for name in inner)):
            found += _files(dotted)
    return tuple(found)


@cache
def _files(module):
    """Source of a module; nothing for what is no module. The packages around it give it no name to use."""
    place = module_path(module)
    return [file for file in (place / "__init__.py", place.with_suffix(".py")) if file.is_file()]
