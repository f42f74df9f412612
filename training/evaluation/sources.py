"""Which files a program depends on, by the imports that stand in them, at their top or inside a function."""

import ast
from pathlib import Path

from fowt_env.caches import cached
from fowt_env.layout import FOLDERS, PACKAGE, installed_path


def imported_files(starts, roots, inside):
    """Return the files `starts` and the Python files that they import, directly or not, in order.

    roots    folders that top-level modules lie in; the first that has one counts
    inside   inside(path) -> whether a file belongs to them: others are neither in it nor followed
    """
    found, left = set(), [Path(path) for path in starts]
    while left:
        path = left.pop()
        if path in found or not inside(path):
            continue
        found.add(path)
        for level, name in _imports(path, path.stat().st_mtime_ns):
            if level:
                folder = path.parents[level - 1]
                left += _module_files(folder, name)
            else:
                left += next(filter(None, (_module_files(root, name) for root in roots)), [])
    return in_order(found)


def in_order(paths):
    """Return files sorted by their paths, those of this package by the paths they have once installed."""
    return sorted(paths, key=lambda path: installed_path(path) or path)


@cached(4096)
def _imports(path, stamp):
    """(level, module) of every import in a file, of `from a import b` also a.b; none of what is no Python."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError, RecursionError):
        return ()
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {(0, alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            names.add((node.level, module))
            names |= {(node.level, f"{module}.{alias.name}".strip(".")) for alias in node.names}
    return tuple(sorted(names))


def _module_files(folder, name):
    """Files of a dotted module beneath a folder, those of its packages included, as far as there are any."""
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
