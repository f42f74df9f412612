"""Provides an environment for the control design of floating offshore wind turbines.

Importing fowt_env registers the environments in Gymnasium; public names are loaded on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fowt_env.layout import check_packages

check_packages()  # before imports that need a complete installation

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

_MODULES = {  # module: its public names, as imported above
    "analysis.linear_model": ("linearize", "natural_periods"),
    "analysis.trim": ("OperatingPoint", "trim"),
    "errors": ("ControllerError", "InputError", "PlantWarning", "SimulationStopped"),
    "plant.compile.notice": ("set_quiet",),
    "plant.measurement": ("Measurement",),
    "plant.user_loads": ("Force", "Motion"),
    "run.simulation": ("simulate",),
    "scene.build": ("build_scene",),
    "scene.scene": ("Scene",),
    "scene.user_loads": ("Load", "load_kernel"),
}
_PUBLIC = {name: module for module, names in _MODULES.items() for name in names}
__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        globals()[name] = getattr(import_module(f"fowt_env.{_PUBLIC[name]}"), name)
        return globals()[name]
    raise AttributeError(  # with these, Python suggests a similar name
        f"module 'fowt_env' has no attribute {name!r}", name=name, obj=import_module("fowt_env")
    )


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


register_environments()
