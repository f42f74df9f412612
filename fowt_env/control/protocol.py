"""The protocol of controllers, and the controller of a name.

A controller has reset(measurement) and act(measurement). So has a plain function of the measurement, which is
act by itself: f(measurement) -> (generator torque, blade pitch). A function counts as one where a single
argument has to be given to it and that is not called `turbine`; with two, (turbine, control_dt), or with none
it is a factory, which makes the controller of a run, or the function that is one. Nothing resets what a
function remembers: a factory makes it afresh for every run. The attributes below may be set on a function
too, as f.information = ("wind_speed",). Beside its methods a controller may have

- information, a tuple of the Measurement fields that it uses and of its PRIVILEGED_INPUTS. It reads these
  and nothing else. A compiled law reads NaN in every other field, and so it does as the torque or the blade
  pitch in force where it does not declare generator_torque or blade_pitch. A controller in Python receives a
  Measurement whose other fields raise a ControllerError. The time is always there. A Python
  controller that declares nothing reads what a turbine's sensors measure (SENSOR_FIELDS of
  fowt_env/plant/measurement.py);
- prepare(scene), called once per run before reset. Where "plant_model" is declared it receives the scene of
  the run in steady wind (rated) and still water: the plant's equations, and nothing of the weather that is
  coming. Where it is not, the scene has a `turbine` and nothing else;
- preview_times, where "wind_preview" is declared: how far ahead (s, increasing) it reads the
  rotor-averaged wind, as `measurement.wind_preview`, or after the N_MEASUREMENTS entries of a compiled law's
  array;
- individual = True where it commands the pitch of each blade: act returns (generator torque, pitch of blade
  1, of blade 2, of blade 3), and a compiled law writes these four. It needs a scene with pitch="individual".
  In such a scene the pitch of other controllers goes to all blades, blade_pitch is the mean of the
  blades', and any controller may declare fields of BladeMeasurement: `measurement.blades` has them, a
  compiled law's array behind the wind ahead. Of the pitches in force a law that commands each blade sees
  those that it declares (blade_pitch_1 ...).

The built-in controllers are built on the simulator, and so it imports none of them: it knows the name of the
package that has them (CATALOGUE), and imports that when a run or an environment asks for a name.
"""

import reprlib
import traceback
from collections.abc import Callable
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from fowt_env.control.information import declares_blades, mask
from fowt_env.control.views import values_of_blades, view_class, wind_ahead
from fowt_env.errors import ControllerError, InputError, SimulationStopped, did_you_mean
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import (
    BLADE_SENSOR_FIELDS,
    N_MEASUREMENTS,
    SENSOR_FIELDS,
    BladeMeasurement,
    Measurement,
)
from fowt_env.plant.state import N_COMMANDS, N_INDIVIDUAL_COMMANDS


@runtime_checkable
class Controller(Protocol):
    """Any object with these two methods can control a run (SI, radians)."""

    def reset(self, measurement: Measurement) -> object:
        """Start afresh from a Measurement, so that the first command does not bump the plant."""

    def act(self, measurement: Measurement) -> tuple[float, ...]:
        """(generator torque N m on the high-speed shaft, blade pitch rad) constant until the next call.

        With individual = True the pitch of each of the three blades.
        """


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
    preview_times: tuple[float, ...] = ()  # s ahead of the wind that it reads
    individual: bool = False  # whether the law commands the pitch of each blade, else one for all

    def __init__(self, name: str, parameters: npt.ArrayLike, n_memory: int) -> None:
        self.name = str(name)
        self.parameters = np.ascontiguousarray(parameters, dtype=np.float64)
        self.memory = np.zeros(n_memory)
        # in force, for act(); a first call must not rely on it
        self.command = np.zeros(N_INDIVIDUAL_COMMANDS if self.individual else N_COMMANDS)

    @property
    def law(self) -> Any:
        """The kernel, compiled."""
        return getattr(self.kernel, "compiled", self.kernel)

    def prepare(self, scene: Any) -> None:
        """Take what the law needs of the scene of the coming run; called once before reset()."""

    def reset(self, measurement: Measurement) -> None:
        """Set memory from a Measurement, forgetting everything before."""
        raise NotImplementedError(f"{type(self).__name__} must define reset(measurement)")

    def act(self, measurement: Measurement) -> tuple[float, ...]:
        """(generator torque, blade pitch or that of each blade) for a Measurement; advances the memory.

        What the law does not declare it reads as NaN, as in the compiled loop.
        """
        blades = values_of_blades(measurement)
        values = np.array([*measurement, *wind_ahead(measurement), *blades], dtype=np.float64)
        leads, shown = len(self.preview_times), mask(self.name, tuple(self.information))
        if not blades and declares_blades(self):
            raise InputError(
                f"controller {self.name!r}: the measurement has no fields of single blades, which it declares"
            )
        if values.shape != (N_MEASUREMENTS + leads + len(blades),):
            size = N_MEASUREMENTS + leads + len(blades)
            raise InputError(f"measurement has shape {values.shape}: must be ({size},)")
        values[:N_MEASUREMENTS] += shown[:N_MEASUREMENTS]
        if blades:
            values[N_MEASUREMENTS + leads :] += shown[N_MEASUREMENTS:]
        call_law(self.law, self.parameters, self.memory, values, self.command)
        return tuple(self.command.tolist())


class CheckedController:
    """A Python controller whose every answer is checked to be two finite numbers, or four if individual."""

    def __init__(self, controller: Any, name: str | None = None) -> None:
        self.controller = controller
        self.name = str(name or getattr(controller, "name", type(controller).__name__))
        self.individual = bool(getattr(controller, "individual", False))
        default = SENSOR_FIELDS + (BLADE_SENSOR_FIELDS if self.individual else ())
        self.information = tuple(getattr(controller, "information", default))
        self.declared = hasattr(controller, "information")
        self.preview_times = tuple(getattr(controller, "preview_times", ()))

    def prepare(self, scene: Any) -> None:
        """Hand the scene of the coming run to the controller inside, where it asks for it.

        Raises: ControllerError for whatever that raises.
        """
        if hasattr(self.controller, "prepare"):
            with named_failure(self.name, "in prepare()"):
                self.controller.prepare(scene)

    def reset(self, measurement: Measurement) -> None:
        """Reset the controller inside. Raises: ControllerError for whatever that raises."""
        shown = self._shown(measurement)
        with named_failure(self.name, "in reset()", float(measurement.time)):
            self.controller.reset(shown)

    def _shown(self, measurement):
        """The part of a Measurement that the controller declares."""
        view = view_class(self.name, self.information, len(self.preview_times))
        return measurement if isinstance(measurement, view) else view.of(measurement)

    def act(self, measurement: Measurement) -> tuple[float, ...]:
        """(generator torque, blade pitch or that of each blade) as floats.

        Raises: ControllerError naming the controller, the time and what it returned or raised.
        """
        shown = self._shown(measurement)
        try:  # no context manager: this is called at every control period
            returned = self.controller.act(shown)
        except (ControllerError, InputError, SimulationStopped):
            raise
        except Exception as error:
            raise failure_of(self.name, "in act()", error, float(measurement.time)) from error
        try:
            values = np.asarray(returned)
            size = N_INDIVIDUAL_COMMANDS if self.individual else N_COMMANDS
            good = values.shape == (size,) and values.dtype.kind in "iuf"
        except ValueError:  # ragged sequences
            good = False
        if good and all(map(isfinite, values)):
            return tuple(float(value) for value in values)
        time = float(measurement.time)
        allowed = (
            "four finite numbers, (generator torque in N m on the high-speed shaft, pitch of each blade in"
            " rad)"
            if self.individual
            else "two finite numbers, (generator torque in N m on the high-speed shaft, blade pitch in rad)"
        )
        if hasattr(returned, "act"):
            allowed += "; a function that makes a controller takes two arguments, (turbine, control_dt)"
        raise ControllerError(
            f"controller {self.name!r} returned {_shown(returned)} at t = {time:.3f} s: act() must return"
            f" {allowed}",
            controller=self.name,
            time=time,
            returned=returned,
        )


class FunctionController:
    """A function of the measurement as a controller: called as act, without reset.

    information, preview_times, individual and prepare are the function's attributes, where it has them.
    """

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function
        self.name = str(getattr(function, "__name__", type(function).__name__))
        for key in ("information", "preview_times", "individual", "prepare"):
            if hasattr(function, key):
                setattr(self, key, getattr(function, key))

    def reset(self, measurement: Measurement) -> None:
        """Nothing to start."""

    def act(self, measurement: Measurement) -> Any:
        """What the function returns."""
        return self.function(measurement)


@contextmanager
def named_failure(controller, what, time=None):
    """Return a context that turns errors of a controller into a ControllerError with their place."""
    try:
        yield
    except (ControllerError, InputError, SimulationStopped):
        raise
    except Exception as error:
        raise failure_of(controller, what, error, time) from error


def failure_of(controller, what, error, time):
    """Return the ControllerError of a controller's error, with place and time (None: before the run).

    what: what it was doing, as "in act()".
    """
    frames = traceback.extract_tb(error.__traceback__)[1:]  # the first is the caller's
    own = [
        frame
        for frame in frames
        if Path(frame.filename).parent != Path(__file__).parent and "importlib" not in frame.filename
    ]
    inside = [frame for frame in own if frame.filename == own[0].filename]  # not a library that it calls
    place = f", {Path(inside[-1].filename).name} line {inside[-1].lineno}" if inside else ""
    try:
        text = _lacking(error) or str(error)
    except (Exception, SystemExit, GeneratorExit):  # it may be a controller's own, and so may be its text
        text = "its message cannot be read"
    said = f": {text}" if text else ""
    when = "" if time is None else f" at t = {time:.3f} s"
    return ControllerError(
        f"controller {controller!r} raised {type(error).__name__} {what}{when}{place}{said}",
        controller=controller,
        time=0.0 if time is None else time,
        returned=None,
    )


def _lacking(error):
    """Words on an attribute that a measurement does not have, with the nearest; "" for other errors."""
    of_blades = isinstance(getattr(error, "obj", None), BladeMeasurement)
    if not isinstance(error, AttributeError) or not of_blades and not isinstance(error.obj, Measurement):
        return ""
    known = BladeMeasurement._fields if of_blades else (*Measurement._fields, "wind_preview", "blades")
    what = "measurement.blades has" if of_blades else "a measurement has"
    if not of_blades and error.name in BladeMeasurement._fields:
        return f"{what} no {error.name!r}: it is measurement.blades.{error.name}"
    hint = did_you_mean(error.name, known, 3)
    return f"{what} no {error.name!r}" + (f".{hint}" if hint else f": it has {', '.join(known)}")


def _shown(value: Any) -> str:
    """repr of a controller's answer in some 200 characters, whatever it is."""
    short = reprlib.Repr()
    short.maxother = short.maxstring = short.maxlong = 200
    try:
        text = short.repr(value)
    except Exception:  # of an element, which reprlib asks as it is
        text = f"<{type(value).__name__}>"
    return f"{text[:200]}..." if len(text) > 200 else text
