"""fowt_env: control-design environment for floating offshore wind turbines.

Public names are loaded on first use, so that importing the package costs nothing.
"""

from importlib import import_module

from fowt_env_registration import register_with_gymnasium

__version__ = "0.1.0"

_PUBLIC = {
    "build_scene": "fowt_env.scene",
    "Scene": "fowt_env.scene",
    "trim": "fowt_env.steady",
    "OperatingPoint": "fowt_env.steady",
    "simulate": "fowt_env.simulation",
    "linearize": "fowt_env.linear_model",
    "natural_periods": "fowt_env.linear_model",
    "Measurement": "fowt_env.measurement",
    "InputError": "fowt_env.errors",
    "SimulationStopped": "fowt_env.errors",
    "ControllerError": "fowt_env.errors",
}
__all__ = sorted(_PUBLIC)


def __getattr__(name):
    if name in _PUBLIC:
        value = getattr(import_module(_PUBLIC[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'fowt_env' has no attribute {name!r}")


def __dir__():
    return sorted({*globals(), *__all__})


register_with_gymnasium()  # for those who did not install the package; costs nothing, see there
