"""Records what affects a run: hashes of the sources of simulator and controller, and package versions."""

import hashlib
import importlib
import inspect
import platform as machine
import subprocess
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import fowt_env
from fowt_env.layout import FOLDERS, PACKAGE, installed_path, module_path
from fowt_env.plant.compile.sources import imported_files, in_order, keep_sources, read_source

PACKAGES = ("numpy", "numba", "scipy", "pandas", "rainflow", "rosco", "hipersim")
NO_FIGURES = ("fowt_env", "python", "pandas")  # versions that are compared elsewhere or affect no result
CONTROLLERS = FOLDERS["controllers"]
RUN = FOLDERS["training"] / "evaluation" / "run_case.py"  # its imports affect a run
ALWAYS = (CONTROLLERS / "constant.py",)  # controllers that every run needs
INSTALLED = {"site-packages", "dist-packages"}


def _digest(paths, key=""):
    """Return the hash of ordered files (of Python files: their code, of others: their bytes) and of a key."""
    digest = hashlib.sha256(key.encode())
    for path in map(Path, paths):
        digest.update(read_source(path).code.encode() if path.suffix == ".py" else path.read_bytes())
    keep_sources()
    return digest.hexdigest()[:16]


def plant_files(start=RUN):
    """Return the files that affect a run, in order: imported sources and data, without the controllers.

    start: the module that runs it.
    """

    def inside(path):
        return _package_of(path) in ("simulator", "training") or path in ALWAYS

    return in_order([*imported_files([start], [PACKAGE.parent], inside), *_data(PACKAGE / "data")])


def plant_code(start=RUN):
    """Return the hash of all sources and data that affect a run, without the controllers."""
    return _digest(plant_files(start))


def _data(folder):
    """Return the files below a folder that are neither Python sources nor built of sources (setup.py)."""
    paths = (path for path in folder.rglob("*") if path.is_file() and path.suffix not in (".py", ".so"))
    return [path for path in paths if "__pycache__" not in path.parts]


def controller_code(controller):
    """Return {"name", "code"}: the name of a controller, and a hash of the files that define it.

    A name of CONTROLLERS: its module, imports from this project, and the data of the package controllers;
    "design:FILE", "policy:NAME": the file and all controllers; "dll:PATH": library, input file and the code
    that calls it; "module:Name", a class or an object: its
    source file, and imports from the same folder and this project. The content_key (a text) of an object is
    hashed, too, e.g. of one whose file only starts another program.
    """
    from fowt_env.controllers import CONTROLLERS
    from fowt_env.controllers.bladed.controller import DLL_PREFIX, named_library
    from fowt_env.controllers.design import saved_files
    from fowt_env.controllers.policy.controller import POLICY_PREFIX, policy_path

    if not isinstance(controller, str):
        named = inspect.isroutine(controller) or inspect.isclass(controller)
        kind = controller if named else type(controller)
        name = f"{kind.__module__}:{kind.__qualname__}"
        key = getattr(controller, "content_key", "")
        code = _digest(_user_files(kind.__module__), key if isinstance(key, str) else "")
        return {"name": name, "code": code}
    if ":" not in controller:
        files = _package_files(CONTROLLERS.get(controller))
    elif controller.startswith(saved_files.DESIGN_PREFIX):
        files = [controller.removeprefix(saved_files.DESIGN_PREFIX), *_package_files(saved_files.load_design)]
    elif controller.startswith(DLL_PREFIX):
        files = [*named_library(controller).files, *_package_files(named_library)]
    elif controller.startswith(POLICY_PREFIX):  # the policy's baseline may be any controller
        files = [policy_path(controller.removeprefix(POLICY_PREFIX)), *_package_files(None)]
    else:
        files = _user_files(controller.partition(":")[0])
    return {"name": controller, "code": _digest(files)}


def _package_files(factory):
    """Return the files on which a built-in controller factory depends; of all controllers for any other."""
    start = getattr(factory, "__module__", None) or ""
    if start.startswith("fowt_env.controllers."):
        starts = [module_path(start).with_suffix(".py")]
    else:
        starts = list(CONTROLLERS.rglob("*.py"))
    return [*_with_imports(starts, [PACKAGE.parent]), *sorted(_data(CONTROLLERS))]


def _user_files(module):
    """Return the files on which a user's module depends: in its project, and their imports from this one."""
    file = _module_file(module)
    if file is None:
        return []
    depth = 0 if module == "__main__" else module.count(".") + (file.name == "__init__.py")
    folder = file.parents[depth]
    top = folder / module.partition(".")[0]

    def inside(path):
        in_project = path.is_relative_to(folder) and _package_of(path) is None
        return path == file or in_project and (path.is_relative_to(top) or not INSTALLED & set(path.parts))

    return _with_imports(imported_files([file], [folder], inside), [folder, PACKAGE.parent])


def _module_file(name):
    """Return the file of a module, after importing the module; None if there is no file."""
    if name not in sys.modules:
        sys.path.insert(0, "")
        try:
            importlib.import_module(name)
        except Exception:
            return None
        finally:
            sys.path.remove("")
    file = getattr(sys.modules[name], "__file__", None)
    return None if file is None else _located(Path(file))


def _with_imports(files, roots):
    """Return the files with their imports from this project: controllers, then the simulator."""
    files, registry = set(files), CONTROLLERS / "__init__.py"  # imports every controller
    for package in ("controllers", "simulator"):

        def inside(path, known=frozenset(files), package=package):
            return path in known or _package_of(path) == package and path != registry

        files |= set(imported_files(files, roots, inside))
    return in_order(files)


def _located(path):
    """Return the unique path of a file: its import path (may be a link) in this package, else resolved."""
    return path.resolve() if installed_path(path) is None else path


def _package_of(path):
    """Return the part of this project with a file: "controllers", "training", "visual", "simulator" or None.

    visual is separate since environments import it, but plots do not affect a run.
    """
    installed = installed_path(path)
    if installed is None:
        return None
    part = installed.relative_to(PACKAGE).parts[0]
    return part if part in ("controllers", "training", "visual") else "simulator"


def code_commit():
    """Return the git commit of this code, with " with changes" if files differ; "" if it is no checkout."""

    def git(*words):
        words = ["git", "-C", str(PACKAGE.parent), *words]
        return subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip()

    try:
        return git("rev-parse", "HEAD") + (" with changes" if git("status", "--porcelain") else "")
    except OSError:  # no git on this machine
        return ""


def versions():
    """Return {package: version} of all that affects results, including Python and the processor type."""
    result = {"fowt_env": fowt_env.__version__, "python": machine.python_version()}
    result["machine"] = machine.machine()
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            result[name] = version(name)
    return result


def version_gap(old, new):
    """Return both versions of the first package that affects results and differs between mappings; or None.

    A package missing in a mapping affected no result there: controllers that need it failed.
    """
    for name in sorted(set(old) & set(new) - set(NO_FIGURES)):
        if old[name] != new[name]:
            return f"{name} {old[name]}", f"{name} {new[name]}"
    return None
