"""Defines the protocol of controllers: reset(measurement) and act(measurement).

A plain function of the measurement can replace act: f(measurement) -> (generator torque, blade pitch). A
function with one required argument not called `turbine` is such a control law; one with two arguments,
(turbine, control_dt), or none is a factory, which returns the controller of a run or a control law. The state
of a control law is never reset: use a factory to create the law for every run. The attributes below may be
set on a function too, as f.information = ("wind_speed",). Optional attributes of a controller:

- information, a tuple of the Measurement fields and PRIVILEGED_INPUTS that the controller reads; all others
  are hidden. A compiled law reads NaN in hidden fields, and NaN as the torque or blade pitch in force unless
  generator_torque or blade_pitch is declared. A Python controller receives a Measurement whose hidden fields
  raise a ControllerError. The time is never hidden. A Python controller without the attribute reads the
  fields measured by a turbine's sensors (SENSOR_FIELDS of fowt_env/plant/measurement.py);
- prepare(scene), called once per run before reset. If "plant_model" is declared, the scene is that of the run
  in steady rated wind and still water: the plant's equations without the weather of the run. Otherwise the
  scene has the attribute `turbine` alone;
- preview_times (s, increasing), required by "wind_preview": look-ahead times of the rotor-averaged wind in
  `measurement.wind_preview`, or after the N_MEASUREMENTS entries of a compiled law's array;
- "lidar" in information: raw readings of a nacelle lidar in `measurement.lidar` (a LidarReading), or its
  speeds and then its freshness in the place of the wind preview in a compiled law's array. The scene of
  prepare has the Lidar as its attribute `lidar`;
- declared = False: a field of information that a sensor chain or scene does not have is NaN, not an error;
- finish(), called once at the end of a run, also of a failed one; after it the text console_output, what the
  controller has printed, is kept in attrs["controller_output"] of the run's table;
- individual = True if the controller commands the pitch of each blade: act returns (generator torque, pitch
  of blade 1, of blade 2, of blade 3), and a compiled law writes these four. This needs a scene with
  pitch="individual". In such a scene the command of other controllers applies to all blades, blade_pitch is
  the mean over the blades, and any controller may declare fields of BladeMeasurement, which are in
  `measurement.blades` or follow the wind preview in a compiled law's array. A law that commands each blade
  reads, of the pitches in force, those that it declares (blade_pitch_1 ...).

The built-in controllers depend on the simulator, so the simulator imports none of them: it imports their
package (CATALOGUE) when a run or an environment requests a controller by name.
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
    """Defines the two methods of any object that controls a run (SI, radians)."""

    def reset(self, measurement: Measurement) -> object:
        """Initialise all states from a Measurement, for a first command without a jump (bumpless start)."""

    def act(self, measurement: Measurement) -> tuple[float, ...]:
        """Return (generator torque N m on the high-speed shaft, blade pitch rad), held until the next call.

        With individual = True the pitch of each of the three blades.
        """


@kernel
def _call(law, parameters, memory, measurement, command):
    law(parameters, memory, measurement, command)


def call_law(law, parameters, memory, measurement, command):
    """Run a control law once from Python, either a ControlKernel or its compiled function."""
    _call(getattr(law, "compiled", law), parameters, memory, measurement, command)


class CompiledController:
    """Provides the base class of controllers whose law runs inside the compiled loop.

    A subclass sets `kernel = staticmethod(law)`, with law made by control_kernel, and implements reset().
    parameters and memory are float64 arrays, with entries named by IntEnums in the law's module. The compiled
    loop calls kernel on these arrays; act() calls the same law from Python. A law receives the command in
    force and overwrites it with the next command.
    """

    kernel: Callable[..., None] | None = None
    information: tuple[str, ...] = ()  # Measurement fields and PRIVILEGED_INPUTS that the law reads
    preview_times: tuple[float, ...] = ()  # look-ahead times of the wind preview, s
    individual: bool = False  # whether the law commands the pitch of each blade, not one for all

    def __init__(self, name: str, parameters: npt.ArrayLike, n_memory: int) -> None:
        self.name = str(name)
        self.parameters = np.ascontiguousarray(parameters, dtype=np.float64)
        self.memory = np.zeros(n_memory)
        # command in force, for act(); zero before the first call
        self.command = np.zeros(N_INDIVIDUAL_COMMANDS if self.individual else N_COMMANDS)

    @property
    def law(self) -> Any:
        """Return the compiled kernel."""
        return getattr(self.kernel, "compiled", self.kernel)

    def prepare(self, scene: Any) -> None:
        """Read what the law needs from the scene of the run; called once before reset()."""

    def reset(self, measurement: Measurement) -> None:
        """Initialise the memory from a Measurement, discarding all earlier states."""
        raise NotImplementedError(f"{type(self).__name__} must define reset(measurement)")

    def act(self, measurement: Measurement) -> tuple[float, ...]:
        """Return (generator torque, blade pitch or that of each blade) for a Measurement; update the memory.

        Fields that the law does not declare are NaN, as in the compiled loop.
        """
        blades = values_of_blades(measurement)
        values = np.array([*measurement, *wind_ahead(measurement), *blades], dtype=np.float64)
        leads = len(wind_ahead(measurement)) if "lidar" in self.information else len(self.preview_times)
        shown = mask(self.name, tuple(self.information))
        if not blades and declares_blades(self):
            raise InputError(
                f"controller {self.name!r}: declares fields of single blades, which the measurement lacks"
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
    """Wraps a Python controller and checks each command: two finite numbers, or four if individual."""

    def __init__(self, controller: Any, name: str | None = None) -> None:
        self.controller = controller
        self.name = str(name or getattr(controller, "name", type(controller).__name__))
        self.individual = bool(getattr(controller, "individual", False))
        default = SENSOR_FIELDS + (BLADE_SENSOR_FIELDS if self.individual else ())
        self.information = tuple(getattr(controller, "information", default))
        self.declared = bool(getattr(controller, "declared", hasattr(controller, "information")))
        self.preview_times = tuple(getattr(controller, "preview_times", ()))

    def prepare(self, scene: Any) -> None:
        """Pass the scene of the run to the wrapped controller, if the controller has prepare().

        Raises: ControllerError for any error of the wrapped controller.
        """
        if hasattr(self.controller, "prepare"):
            with named_failure(self.name, "in prepare()"):
                self.controller.prepare(scene)

    @property
    def in_loop(self) -> tuple[Any, npt.NDArray, npt.NDArray] | None:
        """Return (law, parameters, memory) of a wrapped controller that the compiled loop can call, or None.

        The law is a ControlKernel with the effect of act(), after reset().
        """
        return getattr(self.controller, "in_loop", None)

    def failure(self, time: float, command: npt.NDArray) -> BaseException:
        """Return the error of a command that is not finite of a law in the compiled loop at a time, s.

        As in act(), an error of the controller's own code becomes a ControllerError.
        """
        error = self.controller.failure(time)
        if error is None:
            return self._refusal(tuple(command.tolist()), time)
        if isinstance(error, ControllerError | InputError | SimulationStopped):
            return error
        return failure_of(self.name, "in act()", error, time) if isinstance(error, Exception) else error

    @property
    def console_output(self) -> str:
        """Return what the wrapped controller has printed, "" without its text console_output."""
        text = getattr(self.controller, "console_output", "")
        return text if isinstance(text, str) else ""

    def finish(self) -> None:
        """End the run of the wrapped controller, if the controller has finish(). Raises: ControllerError."""
        if callable(finish := getattr(self.controller, "finish", None)):
            with named_failure(self.name, "in finish()"):
                finish()

    def reset(self, measurement: Measurement) -> None:
        """Reset the wrapped controller. Raises: ControllerError for any error of the wrapped controller."""
        shown = self._shown(measurement)
        with named_failure(self.name, "in reset()", float(measurement.time)):
            self.controller.reset(shown)

    def _shown(self, measurement):
        """Return the view of a Measurement with the fields that the controller declares."""
        view = view_class(self.name, self.information, len(self.preview_times))
        return measurement if isinstance(measurement, view) else view.of(measurement)

    def act(self, measurement: Measurement) -> tuple[float, ...]:
        """Return (generator torque, blade pitch or that of each blade) as floats.

        Raises: ControllerError naming the controller, the time and the returned value or the error.
        """
        shown = self._shown(measurement)
        try:  # no context manager, for speed: called in every control period
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
        raise self._refusal(returned, float(measurement.time))

    def _refusal(self, returned, time):
        """Return the ControllerError of anything but a finite command, returned at a time, s."""
        allowed = (
            "four finite numbers, (generator torque in N m on the high-speed shaft, pitch of each blade in"
            " rad)"
            if self.individual
            else "two finite numbers, (generator torque in N m on the high-speed shaft, blade pitch in rad)"
        )
        if hasattr(returned, "act"):
            allowed += "; a function that makes a controller takes two arguments, (turbine, control_dt)"
        return ControllerError(
            f"controller {self.name!r} returned {_shown(returned)} at t = {time:.3f} s: act() must return"
            f" {allowed}",
            controller=self.name,
            time=time,
            returned=returned,
        )


class FunctionController:
    """Wraps a function of the measurement as a controller: act() calls the function, reset() does nothing.

    information, preview_times, individual and prepare are attributes of the function, if set.
    """

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function
        self.name = str(getattr(function, "__name__", type(function).__name__))
        for key in ("information", "preview_times", "individual", "prepare"):
            if hasattr(function, key):
                setattr(self, key, getattr(function, key))

    def reset(self, measurement: Measurement) -> None:
        """Do nothing: a function has no states to initialise."""

    def act(self, measurement: Measurement) -> Any:
        """Return the command that the function returns."""
        return self.function(measurement)


@contextmanager
def named_failure(controller, what, time=None):
    """Return a context that turns errors of a controller into a ControllerError with file and line."""
    try:
        yield
    except (ControllerError, InputError, SimulationStopped):
        raise
    except Exception as error:
        raise failure_of(controller, what, error, time) from error


def failure_of(controller, what, error, time):
    """Return the ControllerError of a controller's error, with file, line and time (None: before the run).

    what: the phase of the error, such as "in act()".
    """
    frames = traceback.extract_tb(error.__traceback__)[1:]  # the first frame is the caller's
    outside = [
        frame
        for frame in frames
        if Path(frame.filename).parent != Path(__file__).parent and "importlib" not in frame.filename
    ]
    inside = [frame for frame in outside if frame.filename == outside[0].filename]  # no library
    position = f", {Path(inside[-1].filename).name} line {inside[-1].lineno}" if inside else ""
    try:
        text = _lacking(error) or str(error)
    except (Exception, SystemExit, GeneratorExit):  # str() of a user-defined error may raise
        text = "its message cannot be read"
    ending = f": {text}" if text else ""
    when = "" if time is None else f" at t = {time:.3f} s"
    return ControllerError(
        f"controller {controller!r} raised {type(error).__name__} {what}{when}{position}{ending}",
        controller=controller,
        time=0.0 if time is None else time,
        returned=None,
    )


def _lacking(error):
    """Return a text on an unknown attribute of a measurement, with similar names; "" for other errors."""
    of_blades = isinstance(getattr(error, "obj", None), BladeMeasurement)
    if not isinstance(error, AttributeError) or not of_blades and not isinstance(error.obj, Measurement):
        return ""
    known = (
        BladeMeasurement._fields if of_blades else (*Measurement._fields, "wind_preview", "lidar", "blades")
    )
    what = "measurement.blades has" if of_blades else "a measurement has"
    if not of_blades and error.name in BladeMeasurement._fields:
        return f"{what} no {error.name!r}: it is measurement.blades.{error.name}"
    hint = did_you_mean(error.name, known, 3)
    return f"{what} no {error.name!r}" + (f".{hint}" if hint else f": it has {', '.join(known)}")


def _shown(value: Any) -> str:
    """Return the repr of a controller's return value, shortened to about 200 characters."""
    short = reprlib.Repr()
    short.maxother = short.maxstring = short.maxlong = 200
    try:
        text = short.repr(value)
    except Exception:  # raised by the repr of an element, which reprlib does not catch
        text = f"<{type(value).__name__}>"
    return f"{text[:200]}..." if len(text) > 200 else text
