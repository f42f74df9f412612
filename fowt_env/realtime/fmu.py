"""Writes the plant as an FMU: FMI 2.0 for co-simulation. Needs PythonFMU: pip install "fowt-env[fmu]"."""

import json
import sys
import tempfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import fowt_env
from fowt_env.descriptions.channel_meanings import channel_meaning
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.run.stepped import SteppedRun

PLANT = "plant.json"  # resource that describes the plant
SCRIPT = "fowt_plant"  # module that the FMU loads
SOURCE = '''"""The plant of this FMU."""

from fowt_env.realtime.fmu_slave import HELD, FloatingTurbine  # noqa: F401

HELD.append(globals())  # PythonFMU 0.7 releases a borrowed reference to them at each instantiation
'''


def write_fmu(path: str | Path, scene: Mapping[str, Any], run: Mapping[str, Any]) -> Path:
    """Write an FMU of a plant and return its path.

    scene: arguments of build_scene; run: those of SteppedRun (duration, control_dt, initial, protection,
    faults, dt). Both must be JSON. The FMU needs this version of fowt_env in the Python that loads it, and
    the files that the scene names by absolute paths.
    Raises: InputError, also without PythonFMU or for a path that does not end with .fmu.
    """
    path = Path(path)
    if path.suffix != ".fmu":
        raise InputError(f"FMU {str(path)!r}: must end with .fmu")
    if find_spec("pythonfmu") is None:
        raise InputError('an FMU needs PythonFMU: pip install "fowt-env[fmu]"')
    from pythonfmu import FmuBuilder

    plant = SteppedRun(fowt_env.build_scene(**scene), **run)
    described = {
        "fowt_env": fowt_env.__version__,
        "scene": dict(scene),
        "run": dict(run),
        "commands": list(plant.command_columns),
        "start": list(plant.command),
        "outputs": [[c.name, c.unit, channel_meaning(c.name)] for c in plant.scene.channels],
        "values": plant.channels().tolist(),
    }
    folders = list(sys.path)
    with tempfile.TemporaryDirectory() as folder, replacing(path) as temporary:
        script, resource = Path(folder) / f"{SCRIPT}.py", Path(folder) / PLANT
        script.write_text(SOURCE, encoding="utf-8")
        try:
            resource.write_text(json.dumps(described), encoding="utf-8")
        except TypeError as error:
            raise InputError(f"FMU {str(path)!r}: scene and run must be JSON: {error}") from None
        try:
            FmuBuilder.build_FMU(script, temporary, [resource], canHandleVariableCommunicationStepSize=False)
        finally:  # it leaves the folder on the path
            sys.path[:] = folders
            sys.modules.pop(SCRIPT, None)
    return path
