"""Builds a library with the Bladed interface from a controller, with the C compiler of this machine.

A law that is available in C (native.py) becomes C code; any other controller runs in a process with Python
(served.py), which the library (c/bridge.c) starts and ends. Wheels built on Linux, x86-64, have that library
ready (setup.py): an export writes the settings of the controller into a copy of it.
"""

import importlib.util
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from fowt_env.control import known_scene, make
from fowt_env.controllers.design.saved_files import DESIGN_PREFIX
from fowt_env.controllers.export.hosted import Hosted
from fowt_env.controllers.export.native import TEMPLATES, native_law, write_law
from fowt_env.controllers.export.rosco_input import differences, rosco_text
from fowt_env.controllers.policy.controller import POLICY_PREFIX
from fowt_env.descriptions.platform import read_platform
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.scene.build import build_scene

FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra")
SHARED = ("-shared", "-fPIC")
MARK = b"fowt_env: title, interpreter and settings"  # at the beginning of fowt_settings in bridge.c
SETTINGS_SIZE = 8192  # bytes of fowt_settings
READY = TEMPLATES / "bridge.so"  # of a wheel


def prepared(name, platform, control_dt):
    """Return (controller, turbine) of a name for a platform, ready for reset.

    Raises: InputError as `make` and `build_scene`.
    """
    scene = build_scene(platform, wind=18.0)
    controller = make(name, scene.turbine, control_dt)
    if controller.individual:
        scene = build_scene(platform, wind=18.0, pitch="individual")
    controller.prepare(known_scene(scene, controller))
    return controller, scene.turbine


def hosted(name, platform, control_dt):
    """Return the Hosted of a controller's name, platform and control period (s)."""
    return Hosted(*prepared(name, platform, control_dt), control_dt)


def export_sources(name, folder, platform="oc3_hywind", control_dt=0.1, stem="law"):
    """Write the C code of a law to STEM.h and STEM.c in a folder; return their paths.

    Raises: InputError for a controller without a law in C.
    """
    controller, turbine = prepared(name, platform, control_dt)
    if not native_law(controller):
        raise InputError(
            f"export {name!r}: has no law in C; --dll makes a library that runs the controller in Python"
        )
    texts = write_law(controller, turbine, control_dt, stem, _title(name, platform))
    Path(folder).mkdir(parents=True, exist_ok=True)
    return _write_law(texts, folder, stem)


def export_library(name, path, platform="oc3_hywind", control_dt=0.1, python=False):
    """Build the library of a controller at a path; return "C" or "Python", the language of its law.

    python: run the law in Python even if it is available in C.
    Raises: InputError for a controller that cannot run in a host, and without a C compiler.
    """
    path = Path(path)
    controller, turbine = prepared(name, platform, control_dt)
    Hosted(controller, turbine, control_dt)  # refuses what no host sends
    native = not python and native_law(controller)
    with tempfile.TemporaryDirectory() as folder:
        if native:
            texts = write_law(controller, turbine, control_dt, "law", _title(name, platform))
            *_, source = _write_law(texts, folder, "law")
            with replacing(path) as temporary:
                compile_c([source], temporary, SHARED)
        else:
            bridge = _bridge(folder)
            settings = json.dumps(settings_of(name, platform, control_dt))
            with replacing(path) as temporary:
                temporary.write_bytes(with_settings(bridge.read_bytes(), path.stem, sys.executable, settings))
                temporary.chmod(0o755)
    return "C" if native else "Python"


def export_rosco(name, path, platform="oc3_hywind", control_dt=0.1):
    """Write a PI law as ROSCO's DISCON.IN; return sentences on what ROSCO does differently.

    Raises: InputError for other laws.
    """
    controller, turbine = prepared(name, platform, control_dt)
    density = read_platform(platform).environment.air_density
    _write(Path(path), rosco_text(controller, turbine, density, _title(name, platform)))
    return differences(controller)


def settings_of(name, platform, control_dt):
    """Return the settings of a controller for served.py, with files as absolute paths."""
    for prefix in (DESIGN_PREFIX, POLICY_PREFIX):
        path = Path(name.removeprefix(prefix))
        if name.startswith(prefix) and path.suffix:
            name = f"{prefix}{path.resolve()}"
    if Path(platform).suffix:
        platform = str(Path(platform).resolve())
    return {"controller": name, "platform": platform, "control_dt": control_dt, "folder": os.getcwd()}


def _bridge(folder):
    """Return the path of a library that runs a controller in Python: ready, or built in a folder."""
    if READY.exists() and sys.platform == "linux" and os.uname().machine == "x86_64":
        return READY
    built = Path(folder, "bridge.so")
    compile_c([TEMPLATES / "bridge.c"], built, SHARED)
    return built


def with_settings(library, *texts):
    """Return the bytes of a built bridge.c with its title, Python interpreter and settings written into it.

    Raises: InputError for texts that are longer than the room for them.
    """
    packed = b"".join(text.encode() + b"\0" for text in texts)
    if len(packed) > SETTINGS_SIZE:
        raise InputError(
            f"export: names of files and folders take {len(packed)} bytes: at most {SETTINGS_SIZE}"
        )
    at = library.index(MARK)
    return library[:at] + packed.ljust(SETTINGS_SIZE, b"\0") + library[at + SETTINGS_SIZE :]


def compiler():
    """Return the command of a C compiler: $CC, cc, gcc, clang, or that of the package ziglang.

    Raises: InputError with what to install.
    """
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    raise InputError(
        "export: needs a C compiler: install gcc or clang, or pip install ziglang; $CC names another one"
    )


def compile_c(sources, path, options=()):
    """Compile C files to a path. Raises: InputError with the compiler's messages."""
    command = [*compiler(), *FLAGS, *options, *map(str, sources), "-o", str(path), "-lm"]
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        raise InputError(f"export: the compiler {command[0]!r} does not start: {error}") from None
    if done.returncode:
        raise InputError(f"export: the compiler fails: {shlex.join(command)}\n{done.stderr.strip()[-2000:]}")
    return done.stderr


def _title(name, platform):
    """Return the first line of what is written, in plain characters."""
    text = f"Controller {name} for {platform}".encode("ascii", "replace").decode()
    return "".join(letter for letter in text if letter.isprintable()).replace("*/", "")


def _write_law(texts, folder, stem):
    """Write header and file of a law; return their paths."""
    return tuple(_write(Path(folder, f"{stem}.{end}"), text) for end, text in zip("hc", texts, strict=True))


def _write(path, text):
    """Write a text completely or not at all; return its path."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path
