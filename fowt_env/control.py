"""What a controller is, and the one place that turns a name into one.

A controller has reset(measurement) and act(measurement). Beside these it may have

- prepare(scene), called once per run before reset: for what a measurement does not carry, such as steady
  operating points, a preview of the wind or the rotor's performance table;
- information, a tuple of the Measurement fields that it uses and of its PRIVILEGED_INPUTS, so that a
  comparison can say who knew what.

The built-in controllers are built on the simulator, and so it imports none of them: it knows the name of the
package that has them (CATALOGUE), and imports that when a run or an environment asks for a name.
"""

import importlib
import inspect
import reprlib
import sys
from collections.abc import Callable
from math import isfinite
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import ControllerError, InputError, unknown
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, Measurement
from fowt_env.plant.state import N_COMMANDS

CATALOGUE = "fowt_env.controllers"
PRIVILEGED_INPUTS = {  # what a controller may be given beyond Measurement
    "wind_preview": "the rotor-averaged wind, some seconds before it arrives",
    "plant_model": "the plant's own equations: trims, linear models or performance tables of the scene",
}
LONGEST_CONTROL_DT = 1.0  # s; beyond it the sampled loop no longer resembles the design


@runtime_checkable
class Controller(Protocol):
    """Any object with these two methods can control a run (SI, radians)."""

    def reset(self, measurement: Measurement) -> object:
        """Start afresh from a Measurement, so that the first command does not bump the plant."""

    def act(self, measurement: Measurement) -> tuple[float, float]:
        """(generator torque N m on the high-speed shaft, blade pitch rad) held until the next call."""


@kernel
def _call(law, parameters, memory, measurement, command):
    law(parameters, memory, measurement, command)


def call_law(law, parameters, memory, measurement, command):
    """Run a law once, a ControlKernel or compiled; the way to it from Python."""
    _call(getattr(law, "compiled", law), parameters, memory, measurement, command)


class CompiledController:
    """Base of the controllers whose law runs inside the compiled loop.

    A subclass sets `kernel = staticmethod(law)`, with law made by control_kernel, and
    writes reset(). parameters and memory are float64 arrays; IntEnums beside the law name their
    entries. The compiled loop calls kernel on these arrays; act() calls the same law from Python.
    A law is handed the command in force, which it overwrites with the next one.
    """

    kernel: Callable[..., None] | None = None
    information: tuple[str, ...] = ()  # what the law uses: Measurement fields and PRIVILEGED_INPUTS

    def __init__(self, name: str, parameters: npt.ArrayLike, n_memory: int) -> None:
        self.name = str(name)
        self.parameters = np.ascontiguousarray(parameters, dtype=np.float64)
        self.memory = np.zeros(n_memory)
        self.command = np.zeros(N_COMMANDS)  # in force, for act(); a first call must not rely on it

    @property
    def law(self) -> Any:
        """The kernel, compiled."""
        return getattr(self.kernel, "compiled", self.kernel)

    def prepare(self, scene: Any) -> None:
        """Take what the law needs of the scene of the coming run; called once before reset()."""

    def reset(self, measurement: Measurement) -> None:
        """Set memory from a Measurement, forgetting everything before."""
        raise NotImplementedError(f"{type(self).__name__} must define reset(measurement)")

    def act(self, measurement: Measurement) -> tuple[float, float]:
        """(generator torque, blade pitch) for a Measurement; advances the memory by one period."""
        values = np.array(measurement, dtype=np.float64)
        if values.shape != (N_MEASUREMENTS,):
            raise InputError(f"measurement has shape {values.shape}: must be ({N_MEASUREMENTS},)")
        call_law(self.law, self.parameters, self.memory, values, self.command)
        return float(self.command[0]), float(self.command[1])


class CheckedController:
    """A Python controller whose every answer is checked to be two finite numbers."""

    def __init__(self, controller: Any, name: str | None = None) -> None:
        self.controller = controller
        self.name = str(name or getattr(controller, "name", type(controller).__name__))
        self.information = tuple(getattr(controller, "information", ()))

    def prepare(self, scene: Any) -> None:
        """Hand the scene of the coming run to the controller inside, where it asks for it."""
        if hasattr(self.controller, "prepare"):
            self.controller.prepare(scene)

    def reset(self, measurement: Measurement) -> None:
        """Reset the controller inside."""
        self.controller.reset(measurement)

    def act(self, measurement: Measurement) -> tuple[float, float]:
        """(generator torque, blade pitch) as floats.

        Raises: ControllerError naming the controller, the time and what it returned.
        """
        returned = self.controller.act(measurement)
        try:
            values = np.asarray(returned)
            good = values.shape == (N_COMMANDS,) and values.dtype.kind in "iuf"
        except ValueError:  # ragged sequences
            good = False
        if good and isfinite(values[0]) and isfinite(values[1]):
            return float(values[0]), float(values[1])
        time = float(measurement.time)
        raise ControllerError(
            f"controller {self.name!r} returned {_shown(returned)} at t = {time:.3f} s: act() must return two"
            " finite numbers, (generator torque in N m on the high-speed shaft, blade pitch in rad)",
            controller=self.name,
            time=time,
            returned=returned,
        )


def _shown(value: Any) -> str:
    """repr of a controller's answer in some 200 characters, whatever it is."""
    short = reprlib.Repr()
    short.maxother = short.maxstring = short.maxlong = 200
    try:
        text = short.repr(value)
    except Exception:  # of an element, which reprlib asks as it is
        text = f"<{type(value).__name__}>"
    return f"{text[:200]}..." if len(text) > 200 else text


def check_control_dt(control_dt: float) -> float:
    """The control period as a float. Raises: InputError outside (0, 1] s."""
    allowed = f"in (0, {LONGEST_CONTROL_DT:g}] s"
    return check_number("control_dt", control_dt, 0.0, LONGEST_CONTROL_DT, low_open=True, allowed=allowed)


def catalogue() -> Any:
    """The package of the built-in controllers: CONTROLLERS, PREFIXES, named(name), WindEstimator."""
    return importlib.import_module(CATALOGUE)


def make(controller: Any, turbine: Any, control_dt: float) -> Any:
    """Controller ready for a run, from a name, an import path or an object.

    controller: a built-in name ("pi"); "policy:NAME" or "policy:PATH" of a trained agent; "design:FILE" with
    a file of `fowt design`; "module:Name" with Name a class, a factory or a controller (looked for in
    the working folder too); such a class or factory itself; or an object with reset(measurement) and
    act(measurement). Classes and factories are called with (turbine, control_dt) where they take two
    arguments, else with none. Compiled controllers come back as they are, others inside a
    CheckedController.
    Raises: InputError for unknown names (with a suggestion), paths that cannot be imported, agents and
    designs that cannot be used, and objects without reset and act.
    """
    control_dt = check_control_dt(control_dt)
    name = None
    if isinstance(controller, str):
        name = controller
        own = ":" in name and not name.startswith(tuple(catalogue().PREFIXES))
        controller = _imported(name) if own else catalogue().named(name)
    if isinstance(controller, type) or not isinstance(controller, Controller):
        controller = _called(controller, name, turbine, control_dt)
    for method in ("reset", "act"):
        if not callable(getattr(controller, method, None)):
            raise InputError(
                f"controller {name or controller!r} has no method {method}(measurement): a controller has"
                " reset(measurement) and act(measurement) -> (generator_torque, blade_pitch)"
            )
    if isinstance(controller, CompiledController | CheckedController):
        return controller
    return CheckedController(controller, name)


def _imported(path):
    """What "module:Name" points at."""
    module_name, _, attribute = path.partition(":")
    if not module_name or not attribute:
        raise InputError(f"controller {path!r}: an import path is 'module:Name'")
    sys.path.insert(0, "")  # a console script has its own folder on the path, not the user's
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise InputError(f"controller {path!r}: cannot import {module_name!r}: {error}") from error
    finally:
        sys.path.remove("")
    if not hasattr(module, attribute):
        public = [key for key in vars(module) if not key.startswith("_")]
        raise unknown(f"name in module {module_name!r}:", attribute, public)
    return getattr(module, attribute)


def _called(factory, name, turbine, control_dt):
    """What a class or factory makes; anything that cannot be called comes back as it is."""
    if not callable(factory):
        return factory
    try:
        signature = inspect.signature(factory)
    except ValueError:  # some built-in callables have none
        return factory
    for arguments in ((turbine, control_dt), ()):
        try:
            signature.bind(*arguments)
        except TypeError:
            continue
        return factory(*arguments)
    raise InputError(
        f"controller {name or factory!r}: must take (turbine, control_dt) or no arguments, not {signature}"
    )
