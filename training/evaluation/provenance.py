"""What shaped a run: hashes of the sources it imports and of its controller's, versions of packages."""

import hashlib
import importlib
import inspect
import platform as machine
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import fowt_env
from fowt_env.layout import FOLDERS, PACKAGE, installed_path, module_path
from fowt_env.plant.compile.sources import imported_files, in_order, keep_sources, read_source

PACKAGES = ("numpy", "numba", "scipy", "pandas", "rainflow", "rosco", "hipersim")
NO_FIGURES = ("fowt_env", "python", "pandas")  # of the versions: compared otherwise, or shaping no figure
CONTROLLERS = FOLDERS["controllers"]
RUN = FOLDERS["training"] / "evaluation" / "run_case.py"  # what it imports shapes a run
ALWAYS = (CONTROLLERS / "constant.py",)  # of the controllers, what a run without any of them needs
INSTALLED = {"site-packages", "dist-packages"}


def _digest(paths, key=""):
    """Return the hash of files in order, Python's by their code, others by their bytes, and of a key."""
    digest = hashlib.sha256(key.encode())
    for path in map(Path, paths):
        digest.update(read_source(path).code.encode() if path.suffix == ".py" else path.read_bytes())
    keep_sources()
    return digest.hexdigest()[:16]


def plant_files():
    """Return the files that shape a run, in order: sources that it imports and data, not the controllers'."""

    def inside(path):
        return _package_of(path) in ("simulator", "training") or path in ALWAYS

    return in_order([*imported_files([RUN], [PACKAGE.parent], inside), *_data(PACKAGE / "data")])


def plant_code():
    """Return the hash of all sources and data that shape a run, but for the controllers."""
    return _digest(plant_files())


def _data(folder):
    """Return the files beneath a folder that are no sources."""
    found = (path for path in folder.rglob("*") if path.is_file() and path.suffix != ".py")
    return [path for path in found if "__pycache__" not in path.parts]


def controller_code(controller):
    """Return {"name", "code"}: what a controller is called, and a hash of the files that define it.

    A name of CONTROLLERS: its module, what it imports of this project, and the data of the package
    controllers; "design:FILE", "policy:NAME": the file and all controllers; "module:Name", a class or an
    object: the file that it comes from, and what that imports from its own folder and this project; of an
    object with a content_key (a text) that too, as where its file only starts another program.
    """
    from fowt_env.controllers import CONTROLLERS
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
    elif controller.startswith(POLICY_PREFIX):  # its baseline may be any controller
        files = [policy_path(controller.removeprefix(POLICY_PREFIX)), *_package_files(None)]
    else:
        files = _user_files(controller.partition(":")[0])
    return {"name": controller, "code": _digest(files)}


def _package_files(factory):
    """Return the files that a factory of our controllers depends on; those of all for any other."""
    start = getattr(factory, "__module__", None) or ""
    if start.startswith("fowt_env.controllers."):
        starts = [module_path(start).with_suffix(".py")]
    else:
        starts = list(CONTROLLERS.rglob("*.py"))
    return [*_with_own(starts, [PACKAGE.parent]), *sorted(_data(CONTROLLERS))]


def _user_files(module):
    """Return the files that a user's module depends on: of its project, and what they import of this one."""
    file = _module_file(module)
    if file is None:
        return []
    depth = 0 if module == "__main__" else module.count(".") + (file.name == "__init__.py")
    folder = file.parents[depth]
    top = folder / module.partition(".")[0]

    def inside(path):
        own = path.is_relative_to(folder) and _package_of(path) is None
        return path == file or own and (path.is_relative_to(top) or not INSTALLED & set(path.parts))

    return _with_own(imported_files([file], [folder], inside), [folder, PACKAGE.parent])


def _module_file(name):
    """Return the file of a module, which is imported for it; None where there is none."""
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


def _with_own(files, roots):
    """Return the files, and what they import of this project's controllers, and with those of fowt_env."""
    files, registry = set(files), CONTROLLERS / "__init__.py"  # which imports every controller
    for package in ("controllers", "simulator"):

        def inside(path, known=frozenset(files), package=package):
            return path in known or _package_of(path) == package and path != registry

        files |= set(imported_files(files, roots, inside))
    return in_order(files)


def _located(path):
    """Return a file's one path: of this package as it is imported, which may be by a link; else resolved."""
    return path.resolve() if installed_path(path) is None else path


def _package_of(path):
    """Return the part of this project of a file: "controllers", "training", "visual", "simulator" or None.

    visual draws what was computed: environments import it, and it shapes no run.
    """
    place = installed_path(path)
    if place is None:
        return None
    part = place.relative_to(PACKAGE).parts[0]
    return part if part in ("controllers", "training", "visual") else "simulator"


def versions():
    """Return {package: version} of what shapes the figures, Python and processor included."""
    found = {"fowt_env": fowt_env.__version__, "python": machine.python_version()}
    found["machine"] = machine.machine()
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def version_gap(old, new):
    """Return the first package that shapes figures and differs between two mappings, with both; or None.

    One that is missing in a mapping shaped no figure there: its controllers failed.
    """
    for name in sorted(set(old) & set(new) - set(NO_FIGURES)):
        if old[name] != new[name]:
            return f"{name} {old[name]}", f"{name} {new[name]}"
    return None
