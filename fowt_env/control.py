"""What a controller is, and the one place that turns a name into one.

A controller has reset(measurement) and act(measurement). So has a plain function of the measurement, which is
act by itself: f(measurement) -> (generator torque, blade pitch). A function counts as one where a single
argument has to be given to it and that is not called `turbine`; with two, (turbine, control_dt), or with none
it is a factory, which makes the controller of a run, or the function that is one. Nothing resets what a
function remembers: a factory makes it afresh for every run. The attributes below may be set on a function
too, as f.information = ("wind_speed",). Beside its methods a controller may have

- information, a tuple of the Measurement fields that it uses and of its PRIVILEGED_INPUTS. It is given these
  and nothing else. A compiled law reads NaN in every other field, and so it does as the torque or the blade
  pitch in force where it does not declare generator_torque or blade_pitch. A controller in Python is given a
  Measurement whose other fields raise a ControllerError. The time is always given. A Python
  controller that declares nothing is given what a turbine's own sensors show (SENSOR_FIELDS of
  fowt_env/plant/measurement.py);
- prepare(scene), called once per run before reset. Where "plant_model" is declared it is given the scene of
  the run in steady wind (rated) and still water: the plant's equations, and nothing of the weather that is
  coming. Where it is not, the scene has a `turbine` and nothing else;
- preview_times, where "wind_preview" is declared: how far ahead (s, increasing) it is given the
  rotor-averaged wind, as `measurement.wind_preview`, or after the N_MEASUREMENTS entries of a compiled law's
  array;
- individual = True where it commands the pitch of each blade: act returns (generator torque, pitch of blade
  1, of blade 2, of blade 3), and a compiled law writes these four. It needs a scene with pitch="individual".
  In such a scene other controllers have their one pitch given to all blades, blade_pitch is the mean of the
  blades', and any controller may declare fields of BladeMeasurement: `measurement.blades` has them, a
  compiled law's array behind the wind ahead. Of the pitches in force a law that commands each blade sees
  those that it declares (blade_pitch_1 ...).

The built-in controllers are built on the simulator, and so it imports none of them: it knows the name of the
package that has them (CATALOGUE), and imports that when a run or an environment asks for a name.
"""

import importlib
import inspect
import operator
import reprlib
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import isfinite, nan, pi
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from fowt_env.analysis.trim import without_fluctuations
from fowt_env.caches import cached
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.lidar import lidars
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import (
    ControllerError,
    InputError,
    PlantWarning,
    SimulationStopped,
    did_you_mean,
    level_outside,
    unknown,
)
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import (
    BLADE_SENSOR_FIELDS,
    N_BLADE_MEASUREMENTS,
    N_MEASUREMENTS,
    SENSOR_FIELDS,
    BladeMeasurement,
    Measurement,
)
from fowt_env.plant.sensing import GIVEN, HIDDEN
from fowt_env.plant.state import N_COMMANDS, N_INDIVIDUAL_COMMANDS
from fowt_env.weather.lidar import lidar_preview
from fowt_env.weather.preview import Preview, check_times, exact_preview
from fowt_env.weather.wind_field import profile_field

CATALOGUE = "fowt_env.controllers"
PRIVILEGED_INPUTS = {  # what a controller may be given beyond Measurement
    "wind_preview": "the rotor-averaged wind, some seconds before it arrives",
    "plant_model": "the plant's own equations: trims, linear models or performance tables of the scene",
}
EXACT = "exact"  # preview, and sensors
# A command beyond these for a second is one in other units: kN m, MW or degrees. Of rated torque, and of
# rated rotor speed: close to it a law that means N m has more than a hundredth of rated torque, or none.
LITTLE_TORQUE, MUCH_TORQUE, TURNING = 0.01, 2.0, 0.9
LONGEST_CONTROL_DT = 1.0  # s; beyond it the sampled loop no longer resembles the design


@runtime_checkable
class Controller(Protocol):
    """Any object with these two methods can control a run (SI, radians)."""

    def reset(self, measurement: Measurement) -> object:
        """Start afresh from a Measurement, so that the first command does not bump the plant."""

    def act(self, measurement: Measurement) -> tuple[float, ...]:
        """(generator torque N m on the high-speed shaft, blade pitch rad) held until the next call.

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
    preview_times: tuple[float, ...] = ()  # s ahead that it is given the wind
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
        own = SENSOR_FIELDS + (BLADE_SENSOR_FIELDS if self.individual else ())
        self.information = tuple(getattr(controller, "information", own))
        self.declared = hasattr(controller, "information")
        self.preview_times = tuple(getattr(controller, "preview_times", ()))

    def prepare(self, scene: Any) -> None:
        """Hand the scene of the coming run to the controller inside, where it asks for it.

        Raises: ControllerError for whatever that raises.
        """
        if hasattr(self.controller, "prepare"):
            with _named_failure(self.name, "in prepare()"):
                self.controller.prepare(scene)

    def reset(self, measurement: Measurement) -> None:
        """Reset the controller inside. Raises: ControllerError for whatever that raises."""
        given = self._given(measurement)
        with _named_failure(self.name, "in reset()", float(measurement.time)):
            self.controller.reset(given)

    def _given(self, measurement):
        """The part of a Measurement that the controller declares."""
        view = _view_class(self.name, self.information, len(self.preview_times))
        return measurement if isinstance(measurement, view) else view.of(measurement)

    def act(self, measurement: Measurement) -> tuple[float, ...]:
        """(generator torque, blade pitch or that of each blade) as floats.

        Raises: ControllerError naming the controller, the time and what it returned or raised.
        """
        given = self._given(measurement)
        try:  # no context manager: this is called at every control period
            returned = self.controller.act(given)
        except (ControllerError, InputError, SimulationStopped):
            raise
        except Exception as error:
            raise _failure(self.name, "in act()", error, float(measurement.time)) from error
        try:
            values = np.asarray(returned)
            size = N_INDIVIDUAL_COMMANDS if self.individual else N_COMMANDS
            good = values.shape == (size,) and values.dtype.kind in "iuf"
        except ValueError:  # ragged sequences
            good = False
        if good and all(map(isfinite, values)):
            return tuple(float(value) for value in values)
        time = float(measurement.time)
        wanted = (
            "four finite numbers, (generator torque in N m on the high-speed shaft, pitch of each blade in"
            " rad)"
            if self.individual
            else "two finite numbers, (generator torque in N m on the high-speed shaft, blade pitch in rad)"
        )
        if hasattr(returned, "act"):
            wanted += "; a function that makes a controller takes two arguments, (turbine, control_dt)"
        raise ControllerError(
            f"controller {self.name!r} returned {_shown(returned)} at t = {time:.3f} s: act() must return"
            f" {wanted}",
            controller=self.name,
            time=time,
            returned=returned,
        )


class CommandUnits:
    """Warns once of commands that can hardly be in rad and N m, when they have been so for a second."""

    def __init__(self, who: str, turbine: Any, control_dt: float) -> None:
        self._who = who
        self._rated = turbine.torque_law.rated_torque
        self._few, self._many = LITTLE_TORQUE * self._rated, MUCH_TORQUE * self._rated
        self._turning = TURNING * turbine.rated_rotor_speed
        self._needed = max(1, round(1.0 / control_dt))
        self._count = 0
        self.said = ""  # the warning, once there was one

    def see(self, torque: float, blade_pitch: float, rotor_speed: float) -> None:
        """Take note of the command (N m, rad) of one control period at a rotor speed (rad/s)."""
        if -pi <= blade_pitch <= pi and (self._few <= torque <= self._many or torque <= 0.0):
            self._count = 0
        elif -pi <= blade_pitch <= pi and torque < self._few and rotor_speed <= self._turning:
            self._count = 0
        else:
            self._count += 1
            if self._count >= self._needed:
                self.warn(torque, blade_pitch)

    def is_little(self, torque: float) -> bool:
        """Whether a torque (N m) is one that a law in N m has for moments at most."""
        return 0.0 < torque < self._few

    def see_run(self, torque: np.ndarray, rotor_speed: np.ndarray, period: float) -> None:
        """Take note of the torque in force (n,) N m of a whole run, recorded every period (s)."""
        few = (torque > 0.0) & (torque < self._few) & (rotor_speed > self._turning)
        if np.count_nonzero(few) * period >= 1.0:
            self.warn(float(torque[few][0]), 0.0)

    def warn(self, torque: float, blade_pitch: float) -> None:
        """Say what was commanded, once."""
        if self.said:
            return
        if not -pi <= blade_pitch <= pi:
            said = f"blade pitch {blade_pitch:.3g} rad = {blade_pitch / DEGREE:.0f} deg"
        else:
            share = 100.0 * torque / self._rated
            said = f"generator torque {torque:.4g} N m, {share:.3g} % of the rated {self._rated:.0f} N m"
        self.said = (
            f"{self._who}: commanded {said}; commands are (generator torque in N m on the high-speed shaft,"
            " blade pitch in rad)"
        )
        warnings.warn(self.said, PlantWarning, stacklevel=level_outside())


class FunctionController:
    """A function of the measurement as a controller: it is asked as act, and there is nothing to reset.

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
def _named_failure(controller, what, time=None):
    """Context in which what a controller in Python raises becomes a ControllerError that says where."""
    try:
        yield
    except (ControllerError, InputError, SimulationStopped):
        raise
    except Exception as error:
        raise _failure(controller, what, error, time) from error


def _failure(controller, what, error, time):
    """ControllerError that says where and when (None: before the run) a controller raised an error.

    what: what it was doing, as "in act()".
    """
    frames = traceback.extract_tb(error.__traceback__)[1:]  # the first is the caller's own
    own = [frame for frame in frames if frame.filename != __file__ and "importlib" not in frame.filename]
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


class MeasurementView(Measurement):
    """A Measurement that holds what a controller declares and NaN for the rest, which raises when asked for.

    view[i] raises as the attribute does; np.array(view), slices and loops have NaN there.
    """

    _controller = ""
    _information: tuple[str, ...] = ()
    _hidden: frozenset[str] = frozenset()
    _places: tuple[int, ...] = ()  # of the hidden fields
    _foresees = False
    _leads = 0  # how many times the wind is foreseen for
    _blade_class: type
    _ahead: tuple[float, ...] = ()
    _blades: "BladeView | None" = None

    @classmethod
    def take(cls, values: Sequence[float]) -> "MeasurementView":
        """The view of (N_MEASUREMENTS + leads,) values, or with those of BladeMeasurement behind them."""
        rest = N_MEASUREMENTS + cls._leads
        return cls._taken(values[:N_MEASUREMENTS], values[N_MEASUREMENTS:rest], values[rest:])

    @classmethod
    def of(cls, measurement: Any) -> "MeasurementView":
        """The view of a Measurement, with the wind ahead and the blades that it carries."""
        return cls._taken(measurement, wind_ahead(measurement), values_of_blades(measurement))

    @classmethod
    def _taken(cls, values, ahead, blades):
        shown = list(values)
        for place in cls._places:
            shown[place] = nan
        view = cls._make(shown)
        view._ahead = tuple(ahead)
        if len(blades):
            view._blades = cls._blade_class.take(blades, shown[0])
        return view

    @property
    def wind_preview(self) -> tuple[float, ...]:
        """Rotor-averaged wind (m/s) at each of the controller's preview_times."""
        if not self._foresees:
            self._refuse("wind_preview")
        return self._ahead

    @property
    def blades(self) -> "BladeView":
        """BladeMeasurement of a scene whose blades have pitches of their own."""
        if self._blades is None:
            raise ControllerError(
                f"controller {self._controller!r} reads 'blades': the scene has one pitch for all blades;"
                " build it with pitch='individual'",
                controller=self._controller,
                time=float(tuple.__getitem__(self, 0)),
                returned=None,
            )
        return self._blades

    def _replace(self, **changes):
        view = super()._replace(**changes)
        view._ahead, view._blades = self._ahead, self._blades
        return view

    def __getitem__(self, key):
        value = super().__getitem__(key)
        if self._hidden and not isinstance(key, slice):
            name = Measurement._fields[operator.index(key)]
            if name in self._hidden:
                self._refuse(name)
        return value

    def __reduce__(self):
        blades = () if self._blades is None else tuple(self._blades)
        return _view_again, (
            self._controller, self._information, self._leads, tuple(self), self._ahead, blades,
        )  # fmt: skip

    def _refuse(self, name):
        _refuse(self._controller, name, tuple.__getitem__(self, 0))


class BladeView(BladeMeasurement):
    """A BladeMeasurement that holds what a controller declares, as MeasurementView does."""

    _controller = ""
    _information: tuple[str, ...] = ()
    _hidden: frozenset[str] = frozenset()
    _time = 0.0

    @classmethod
    def take(cls, values: Sequence[float], time: float) -> "BladeView":
        """The view of (N_BLADE_MEASUREMENTS,) values at a time (s)."""
        names = BladeMeasurement._fields
        view = cls._make(nan if n in cls._hidden else v for n, v in zip(names, values, strict=True))
        view._time = time
        return view

    def __getitem__(self, key):
        value = super().__getitem__(key)
        if self._hidden and not isinstance(key, slice):
            name = BladeMeasurement._fields[operator.index(key)]
            if name in self._hidden:
                self._refuse(name)
        return value

    def __reduce__(self):
        return _blades_again, (self._controller, self._information, tuple(self), self._time)

    def _refuse(self, name):
        _refuse(self._controller, name, self._time)


def _refuse(controller, name, time):
    """Raise ControllerError: a controller asks at a time (s) for what it does not declare."""
    also = " and give preview_times" if name == "wind_preview" else ""
    raise ControllerError(
        f"controller {controller!r} reads {name!r} at t = {time:.3f} s and does not declare it: add"
        f" {name!r} to its attribute information{also}",
        controller=controller,
        time=float(time),
        returned=None,
    )


def _hiding(name, fields, information):
    """Members of the view class of a controller's name that hide the fields which are not in information."""
    hidden_fields = frozenset(fields) - {"time", *information}
    refusing = {field: property(lambda self, field=field: self._refuse(field)) for field in hidden_fields}
    about = {"_controller": name, "_information": information, "_hidden": hidden_fields}
    return {**about, **refusing}


@cached(256)
def _view_class(name, information, leads):
    """MeasurementView of a controller's name, information and number of preview_times."""
    members = _hiding(name, Measurement._fields, information)
    members |= {
        "_places": tuple(i for i, field in enumerate(Measurement._fields) if field in members["_hidden"]),
        "_foresees": "wind_preview" in information,
        "_leads": leads,
        "_blade_class": type("BladeView", (BladeView,), _hiding(name, BladeMeasurement._fields, information)),
    }
    return type("MeasurementView", (MeasurementView,), members)


def _view_again(name, information, leads, values, ahead, blades):
    """A MeasurementView as it was before it was pickled."""
    return _view_class(name, information, leads)._taken(values, ahead, blades)


def _blades_again(name, information, values, time):
    """A BladeView as it was before it was pickled."""
    return _view_class(name, information, 0)._blade_class.take(values, time)


def view_of(controller: Any) -> Callable[[Sequence[float]], MeasurementView]:
    """What makes the view that a controller is given from its array of readings."""
    return _view_class(controller.name, tuple(controller.information), len(controller.preview_times)).take


def whole_view(values: Sequence[float], wind: Sequence[float] = ()) -> MeasurementView:
    """The view of measured values, of which nothing is hidden, and of the wind (m/s) that is foreseen."""
    everything = (*Measurement._fields, *BladeMeasurement._fields, "wind_preview")
    rest = values[N_MEASUREMENTS:]
    return _view_class("", everything, len(wind)).take([*values[:N_MEASUREMENTS], *wind, *rest])


def with_wind_ahead(measurement: Measurement, wind: Sequence[float]) -> MeasurementView:
    """The measurement with the wind (m/s) that is foreseen, of which nothing else is hidden."""
    return whole_view([*measurement, *values_of_blades(measurement)], wind)


def wind_ahead(measurement: Any) -> tuple[float, ...]:
    """The foreseen wind that a measurement carries; () where it carries none."""
    return getattr(measurement, "_ahead", ())


def values_of_blades(measurement: Any) -> tuple[float, ...]:
    """(N_BLADE_MEASUREMENTS,) the BladeMeasurement that a measurement carries; () where it carries none."""
    blades = getattr(measurement, "_blades", None)
    return () if blades is None else tuple(blades)


def declares_blades(controller: Any) -> bool:
    """Whether a controller declares a field of BladeMeasurement."""
    return not set(BladeMeasurement._fields).isdisjoint(controller.information)


def check_pitches(controller: Any, individual: bool) -> None:
    """Refuse what needs blades with pitches of their own in a scene that has one pitch for all.

    Raises: InputError.
    """
    if individual:
        return
    lacking = ""
    if getattr(controller, "individual", False):
        lacking = "commands the pitch of each blade"
    elif declares_blades(controller):
        name = next(name for name in controller.information if name in BladeMeasurement._fields)
        lacking = f"declares {name!r}, which is measured where every blade has a pitch of its own"
    if lacking:
        raise InputError(
            f"controller {controller.name!r}: {lacking}, and the scene has one pitch for all: build it with"
            " pitch='individual'"
        )


@cached(256)
def mask(name: str, information: tuple[str, ...]) -> np.ndarray:
    """GIVEN for what is declared, and the time, HIDDEN for the rest; read only.

    (N_MEASUREMENTS + N_BLADE_MEASUREMENTS,), the fields of Measurement first.
    Raises: InputError for a name that is neither a field of these nor a privileged input.
    """
    fields = (*Measurement._fields, *BladeMeasurement._fields)
    known = (*fields, *PRIVILEGED_INPUTS)
    for item in information:
        if item not in known:
            raise unknown(f"information of controller {name!r}:", item, known)
    declared = {"time", *information}
    values = np.array([GIVEN if field in declared else HIDDEN for field in fields])
    values.setflags(write=False)
    return values


def hidden(
    controller: Any, chain: tuple[str, Sequence[str]] | None = None, individual: bool = False
) -> np.ndarray:
    """mask of a run: what the controller declares, and the sensor chain (name, fields that it has) shows.

    individual: whether the scene's blades have pitches of their own; else it is of the N_MEASUREMENTS fields.
    Raises: InputError where it declares a field that the chain does not have, or the scene (check_pitches).
    """
    check_pitches(controller, individual)
    size = N_MEASUREMENTS + (N_BLADE_MEASUREMENTS if individual else 0)
    values = mask(controller.name, tuple(controller.information))[:size].copy()
    if chain is None:
        return values
    name, available = chain
    for index, field in enumerate((*Measurement._fields, *BladeMeasurement._fields)[:size]):
        if field == "time" or field in available or np.isnan(values[index]):
            continue
        if getattr(controller, "declared", True):
            raise InputError(
                f"controller {controller.name!r}: declares {field!r}, which the sensor chain {name!r} does"
                f" not have; it has {', '.join(available)}"
            )
        values[index] = HIDDEN
    return values


def preview_leads(controller: Any) -> tuple[float, ...]:
    """The controller's preview_times, checked, () for none.

    Raises: InputError for times that cannot be used, and where times and "wind_preview" do not go together.
    """
    times = tuple(getattr(controller, "preview_times", ()))
    declared = "wind_preview" in controller.information
    if not times and not declared:
        return ()
    if not times:
        raise InputError(
            f"controller {controller.name!r}: declares 'wind_preview' and has no preview_times: how far ahead"
            " it is to be given the wind (s, increasing)"
        )
    if not declared:
        raise InputError(
            f"controller {controller.name!r}: has preview_times = {times!r} and does not declare"
            " 'wind_preview' in its attribute information"
        )
    try:
        return tuple(check_times(times).tolist())
    except InputError as error:
        raise InputError(f"controller {controller.name!r}: {error}") from None


def foreseen(scene: Any, leads: tuple[float, ...], preview: Any, duration: float) -> Preview:
    """Preview of a run of `duration` (s) from what simulate is given: "exact", a lidar, a Preview, ...

    Raises: InputError for anything else, and for a Preview of other leads or shapes.
    """
    if isinstance(preview, str) and preview != EXACT:
        if preview not in lidars():
            raise unknown("preview", preview, (EXACT, *lidars()))
        found = lidar_preview(scene, leads, preview)
    elif isinstance(preview, str):
        if duration > scene.options["duration"]:  # of a box of wind that repeats
            scene = replace(scene, options=scene.options | {"duration": duration})
        found = exact_preview(scene, leads)
    else:
        found = preview(scene, leads) if callable(preview) else preview
    try:
        time, values = (np.ascontiguousarray(part, dtype=np.float64) for part in found[:2])
    except (TypeError, ValueError, IndexError):
        raise InputError(
            f"preview = {preview!r}: must be {EXACT!r}, the name of a lidar, a Preview (time, values), or a"
            " function of (scene, times) that returns one"
        ) from None
    if time.ndim != 1 or not len(time) or values.shape != (len(leads), len(time)):
        raise InputError(
            f"preview: time and values have shapes {time.shape} and {values.shape}: must be (n,) and"
            f" ({len(leads)}, n) for preview_times = {leads}"
        )
    if not (np.isfinite(time).all() and np.isfinite(values).all() and (np.diff(time) > 0.0).all()):
        raise InputError("preview: time must increase, and time and values must be finite")
    return Preview(time, values, found[2] if len(found) > 2 else None)


class Known:
    """What prepare is given of a run by a controller that does not declare "plant_model": the turbine."""

    def __init__(self, turbine: Any, controller: str) -> None:
        self.turbine = turbine
        self._controller = controller

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        raise ControllerError(
            f"controller {self._controller!r} asks prepare's scene for {name!r} and does not declare it: add"
            " 'plant_model' to its attribute information",
            controller=self._controller,
            time=0.0,
            returned=None,
        )


def known_scene(scene: Any, controller: Any) -> Any:
    """What a controller's prepare is given of a scene: its plant in steady rated wind, or its turbine alone.

    The plant is in still water, with the seed 0; nothing of the run's weather can be read from it. In place
    of a box of wind, whose mean over time is the seed's, stands the power law of the site.
    """
    if "plant_model" not in controller.information:
        return Known(scene.turbine, controller.name)
    aero, turbine = scene.model.aero, scene.turbine
    if aero is None:
        return replace(without_fluctuations(scene), sea=None, seed=0)
    speed = float(turbine.rated_wind_speed)
    known = replace(without_fluctuations(scene, speed), wind=speed, sea=None, seed=0, wind_speed=speed)
    if aero.field is None:
        return known
    shear = scene.options["shear_exponent"]
    shear = scene.platform.environment.shear_exponent if shear is None else shear
    hub, diameter = turbine.rotor.hub_height, 2.0 * turbine.rotor.tip_radius
    return known.with_model({"aero.field": profile_field(speed, shear, hub, diameter)})


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
    a file of `fowt design`; "module:Name" with Name a class, a factory, a function or a controller (looked
    for in the working folder too); such a class, factory or function itself; or an object with
    reset(measurement) and act(measurement). Classes and factories are called with (turbine, control_dt) where
    they take two arguments, else with none. A function that needs one argument, not called turbine, is the
    law itself: f(measurement) -> (torque, blade pitch). Compiled controllers come back as they are, others
    inside a CheckedController.
    Raises: InputError for unknown names (with a suggestion), paths that cannot be imported, agents and
    designs that cannot be used, and objects without reset and act; ControllerError for what a module or a
    factory of the user raises, with its line.
    """
    control_dt = check_control_dt(control_dt)
    name = None
    if isinstance(controller, str):
        name = controller
        own = ":" in name and not name.startswith(tuple(catalogue().PREFIXES))
        controller = _imported(name) if own else catalogue().named(name)
    if isinstance(controller, type) or not isinstance(controller, Controller):
        if not _is_law(controller):
            controller = _called(controller, name, turbine, control_dt)
        if _is_law(controller):
            controller = FunctionController(controller)
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
    except InputError:
        raise
    except Exception as error:
        raise _failure(path, "when it was imported", error, None) from error
    finally:
        sys.path.remove("")
    if not hasattr(module, attribute):
        public = [key for key in vars(module) if not key.startswith("_")]
        raise unknown(f"name in module {module_name!r}:", attribute, public)
    return getattr(module, attribute)


def _is_law(given):
    """Whether something is a function of the measurement (FunctionController) and no factory or object."""
    if not callable(given) or isinstance(given, type) or hasattr(given, "act"):
        return False
    try:
        parameters = inspect.signature(given).parameters.values()
    except ValueError:  # some built-in callables have none
        return False
    free = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    needed = [one for one in parameters if one.default is one.empty and one.kind not in free]
    if len(needed) != 1 or needed[0].kind is inspect.Parameter.KEYWORD_ONLY:
        return False
    return needed[0].name != "turbine"


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
        with _named_failure(str(name or getattr(factory, "__name__", factory)), "when it was made"):
            return factory(*arguments)
    raise InputError(
        f"controller {name or factory!r}: must take (turbine, control_dt) or no arguments, or be a function"
        f" of the measurement alone, not {signature}"
    )
