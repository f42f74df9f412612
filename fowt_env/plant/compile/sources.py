"""Computes the hash of a source file's code and lists the modules that the file imports.

The hash covers the syntax tree without comments, docstrings and the metadata of `Annotated`. Parsing takes
some ms per file, so results are stored in a file of the cache folder, keyed by a hash of the source's bytes.
"""

import ast
import hashlib
import json
import stat
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

from fowt_env.caches import cached
from fowt_env.folders import cache_root, distrust, make_private, replaced_privately
from fowt_env.layout import FOLDERS, PACKAGE, installed_path, module_path

MOST_KEPT = 1000  # sources in the file of results, the latest
_unsaved: set[str] = set()  # keys of sources parsed since the file was written
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


class Source(NamedTuple):
    """Holds the code hash and the imports of one Python source file."""

    code: str  # hash of its code, 32 hexadecimal digits
    top: tuple[str, ...]  # modules of this project imported at module level
    imports: tuple[str, ...]  # modules of every import, also inside functions; relative ones with their dots


def read_source(path):
    """Return the Source of a file; for a file that is not valid Python, code is a hash of its bytes."""
    path = Path(path)
    status = path.stat()
    return _read_source(path, status.st_mtime_ns, status.st_size)


@cached(4096)
def _read_source(path, time, size):
    content = path.read_bytes()
    known = _kept_sources()
    key = hashlib.sha256(sys.version.encode() + content).hexdigest()[:32]
    if key not in known:
        known[key] = _parsed_source(content)
        _unsaved.add(key)
    code, top, imports = known[key]
    return Source(code, tuple(top), tuple(imports))


def _parsed_source(content):
    """Return [hash of the code, top, imports] of a file's bytes, as in Source; no imports if not Python."""
    try:
        tree = ast.parse(content)
    except (SyntaxError, ValueError, RecursionError):
        return [hashlib.sha256(content).hexdigest()[:32], [], []]
    top = sorted(name for name in _imported_names(tree.body) if name.partition(".")[0] == PACKAGE.name)
    imports = sorted(_imported_names(ast.walk(tree)))
    return [hashlib.sha256(code_text(tree).encode()).hexdigest()[:32], top, imports]


def code_text(tree):
    """Return a syntax tree as text; sources that differ only in docstrings, comments and layout agree."""
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
        elif isinstance(node, ast.AnnAssign) and isinstance(kind := node.annotation, ast.Subscript):
            if getattr(kind.value, "id", "") == "Annotated" and isinstance(kind.slice, ast.Tuple):
                node.annotation = kind.slice.elts[0]
    return ast.dump(tree)


def _imported_names(nodes):
    """Return the modules of the import statements in nodes; `from .a import b` gives .a and .a.b."""
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            dots, module = "." * node.level, node.module or ""
            names.add(dots + module)
            names |= {dots + f"{module}.{alias.name}".strip(".") for alias in node.names}
    return names


def imported_files(starts, roots, inside):
    """Return the sorted Python files that `starts` import, directly or indirectly, including `starts`.

    Imports inside functions count too, as do the parent packages of a module.
    roots    folders searched for top-level modules, in this order
    inside   inside(path) -> whether to include a file; imports of excluded files are not followed
    """

    return in_order(_followed(map(Path, starts), inside, lambda path: _imported_by(path, tuple(roots))))


def _imported_by(path, roots):
    """Return the files of the modules that a file imports, and of their parent packages."""
    return _imported_by_source(path, roots) if installed_path(path) else _found(path, roots)


@cached(4096)  # sources of this project do not change during a run
def _imported_by_source(path, roots):
    return _found(path, roots)


def _found(path, roots):
    files = []
    for dotted in read_source(path).imports:
        name = dotted.lstrip(".")
        level = len(dotted) - len(name)
        folders = [path.parents[level - 1]] if level else roots
        files += next(filter(None, (_module_files(folder, name) for folder in folders)), [])
    return list(dict.fromkeys(files))


def imported_at_top(path, but):
    """Return a source of this project and its direct and indirect module-level imports outside `but`."""
    return _followed([path], lambda file: True, lambda file: _imported_at_top(file, but))


@cache  # some twenty modules with kernels outside the plant share most imports
def _imported_at_top(path, but):
    """Return the source files outside `but` imported by a source at module level, without parent packages."""
    return [file for file in map(_project_file, read_source(path).top) if but not in file.parents]


@cache  # modules of this project do not change during a run
def _project_file(name):
    """Return the file of a module of this project, or of the package or module that an object is from."""
    while name != PACKAGE.name:
        path = module_path(name)
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file():
                return _same(file)
        name = name.rpartition(".")[0]
    return _same(PACKAGE / "__init__.py")


@cache  # sets compare a path with another object of it by its parts, and with itself at once
def _same(path):
    return path


def _followed(starts, inside, imported):
    """Return the set of files reached from starts through imported(path), limited to those inside(path)."""
    reached, pending = set(), list(starts)
    while pending:
        path = pending.pop()
        if path not in reached and inside(path):
            reached.add(path)
            pending += imported(path)
    return reached


def in_order(paths):
    """Return files sorted by path, with files of this package sorted by their installed paths."""
    return sorted(paths, key=lambda path: installed_path(path) or path)


def _module_files(folder, name):
    """Return the existing files of a dotted module in a folder, and of its parent packages."""
    in_project = folder == PACKAGE.parent and name.partition(".")[0] == PACKAGE.name
    return _project_files(name) if in_project else _existing_files(folder, name)


@cache  # modules of this project do not change during a run
def _project_files(name):
    return _existing_files(PACKAGE.parent, name)


def _existing_files(folder, name):
    files = [folder / "__init__.py"] if not name and (folder / "__init__.py").is_file() else []
    for part in filter(None, name.split(".")):
        if folder == PACKAGE and part in FOLDERS:
            folder = FOLDERS[part].parent
        package, module = folder / part / "__init__.py", folder / f"{part}.py"
        if package.is_file() or module.is_file():
            files.append(package if package.is_file() else module)
        elif not (folder / part).is_dir():
            break
        folder = folder / part
    return files


def _store():
    """Return the path of the file that stores parsed sources; None without a cache folder."""
    root = cache_root()
    return root and root / "sources" / "parsed.json"


@cache
def _kept_sources():
    """Return {hash of a source's bytes: [code, top, imports]} as on disk; {} if the file is unusable."""
    path = _store()
    try:
        if path is None or distrust(path.parent) or distrust(path, stat.S_ISREG):
            return {}
        return {
            str(key): [str(code), list(map(str, top)), list(map(str, imports))]
            for key, (code, top, imports) in json.loads(path.read_bytes()).items()
        }
    except (OSError, ValueError, TypeError, AttributeError):  # the file is missing or broken
        return {}


def keep_sources():
    """Write newly parsed sources to the file in the cache folder, if possible."""
    known, path = _kept_sources(), _store()
    if not _unsaved or path is None:
        return
    _unsaved.clear()
    try:
        make_private(path.parent)
        if not distrust(path.parent):
            with replaced_privately(path) as file:
                file.write(json.dumps(dict(list(known.items())[-MOST_KEPT:])).encode())
    except OSError:  # the disk is full or read-only
        return
