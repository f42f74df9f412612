"""fowt_env: control-design environment for floating offshore wind turbines.

Its import registers the environments at Gymnasium. Public names are loaded on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fowt_env.layout import check_packages

check_packages()  # ahead of what only an installation has

from fowt_env.registration import register_environments  # noqa: E402

if TYPE_CHECKING:  # the names below, for editors and type checkers
    from fowt_env.analysis.linear_model import linearize as linearize
    from fowt_env.analysis.linear_model import natural_periods as natural_periods
    from fowt_env.analysis.trim import OperatingPoint as OperatingPoint
    from fowt_env.analysis.trim import trim as trim
    from fowt_env.errors import ControllerError as ControllerError
    from fowt_env.errors import InputError as InputError
    from fowt_env.errors import PlantWarning as PlantWarning
    from fowt_env.errors import SimulationStopped as SimulationStopped
    from fowt_env.plant.compile.notice import set_quiet as set_quiet
    from fowt_env.plant.measurement import Measurement as Measurement
    from fowt_env.plant.user_loads import Force as Force
    from fowt_env.plant.user_loads import Motion as Motion
    from fowt_env.run.simulation import simulate as simulate
    from fowt_env.scene.build import build_scene as build_scene
    from fowt_env.scene.scene import Scene as Scene
    from fowt_env.scene.user_loads import Load as Load
    from fowt_env.scene.user_loads import load_kernel as load_kernel

__version__ = "0.2.0"

_PUBLIC = {
    "build_scene": "fowt_env.scene.build",
    "Scene": "fowt_env.scene.scene",
    "trim": "fowt_env.analysis.trim",
    "OperatingPoint": "fowt_env.analysis.trim",
    "simulate": "fowt_env.run.simulation",
    "linearize": "fowt_env.analysis.linear_model",
    "natural_periods": "fowt_env.analysis.linear_model",
    "Measurement": "fowt_env.plant.measurement",
    "Load": "fowt_env.scene.user_loads",
    "Force": "fowt_env.plant.user_loads",
    "Motion": "fowt_env.plant.user_loads",
    "load_kernel": "fowt_env.scene.user_loads",
    "set_quiet": "fowt_env.plant.compile.notice",
    "InputError": "fowt_env.errors",
    "SimulationStopped": "fowt_env.errors",
    "PlantWarning": "fowt_env.errors",
    "ControllerError": "fowt_env.errors",
}
__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        value = getattr(import_module(_PUBLIC[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'fowt_env' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


register_environments()
