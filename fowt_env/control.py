"""What a controller is, and the one place that turns a name into one.

A controller has reset(measurement) and act(measurement). Beside these it may have

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
  array.

The built-in controllers are built on the simulator, and so it imports none of them: it knows the name of the
package that has them (CATALOGUE), and imports that when a run or an environment asks for a name.
"""

import importlib
import inspect
import operator
import reprlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite, nan
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from fowt_env.analysis.trim import without_fluctuations
from fowt_env.caches import cached
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.lidar import lidars
from fowt_env.errors import ControllerError, InputError, unknown
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, SENSOR_FIELDS, Measurement
from fowt_env.plant.sensing import GIVEN, HIDDEN
from fowt_env.plant.state import N_COMMANDS
from fowt_env.weather.lidar import lidar_preview
from fowt_env.weather.preview import Preview, check_times, exact_preview

CATALOGUE = "fowt_env.controllers"
PRIVILEGED_INPUTS = {  # what a controller may be given beyond Measurement
    "wind_preview": "the rotor-averaged wind, some seconds before it arrives",
    "plant_model": "the plant's own equations: trims, linear models or performance tables of the scene",
}
EXACT = "exact"  # preview, and sensors
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
    preview_times: tuple[float, ...] = ()  # s ahead that it is given the wind

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
        """(generator torque, blade pitch) for a Measurement; advances the memory by one period.

        What the law does not declare it reads as NaN, as in the compiled loop.
        """
        values = np.array([*measurement, *wind_ahead(measurement)], dtype=np.float64)
        size = N_MEASUREMENTS + len(self.preview_times)
        if values.shape != (size,):
            raise InputError(f"measurement has shape {values.shape}: must be ({size},)")
        values[:N_MEASUREMENTS] += mask(self.name, tuple(self.information))
        call_law(self.law, self.parameters, self.memory, values, self.command)
        return float(self.command[0]), float(self.command[1])


class CheckedController:
    """A Python controller whose every answer is checked to be two finite numbers."""

    def __init__(self, controller: Any, name: str | None = None) -> None:
        self.controller = controller
        self.name = str(name or getattr(controller, "name", type(controller).__name__))
        self.information = tuple(getattr(controller, "information", SENSOR_FIELDS))
        self.declared = hasattr(controller, "information")
        self.preview_times = tuple(getattr(controller, "preview_times", ()))

    def prepare(self, scene: Any) -> None:
        """Hand the scene of the coming run to the controller inside, where it asks for it."""
        if hasattr(self.controller, "prepare"):
            self.controller.prepare(scene)

    def reset(self, measurement: Measurement) -> None:
        """Reset the controller inside."""
        self.controller.reset(self._given(measurement))

    def _given(self, measurement):
        """The part of a Measurement that the controller declares."""
        view = view_of(self)
        if isinstance(measurement, view.__self__):
            return measurement
        return view([*measurement, *wind_ahead(measurement)])

    def act(self, measurement: Measurement) -> tuple[float, float]:
        """(generator torque, blade pitch) as floats.

        Raises: ControllerError naming the controller, the time and what it returned.
        """
        returned = self.controller.act(self._given(measurement))
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


class MeasurementView(Measurement):
    """A Measurement that holds what a controller declares and NaN for the rest, which raises when asked for.

    view[i] raises as the attribute does; np.array(view), slices and loops have NaN there.
    """

    _controller = ""
    _hidden: frozenset[str] = frozenset()
    _places: tuple[int, ...] = ()  # of the hidden fields
    _foresees = False
    _ahead: tuple[float, ...] = ()

    @classmethod
    def take(cls, values: Sequence[float]) -> "MeasurementView":
        """The view of (N_MEASUREMENTS + leads,) values."""
        shown = list(values[:N_MEASUREMENTS])
        for place in cls._places:
            shown[place] = nan
        view = cls._make(shown)
        view._ahead = tuple(values[N_MEASUREMENTS:])
        return view

    @property
    def wind_preview(self) -> tuple[float, ...]:
        """Rotor-averaged wind (m/s) at each of the controller's preview_times."""
        if not self._foresees:
            self._refuse("wind_preview")
        return self._ahead

    def _replace(self, **changes):
        view = super()._replace(**changes)
        view._ahead = self._ahead
        return view

    def __getitem__(self, key):
        value = super().__getitem__(key)
        if self._hidden and not isinstance(key, slice):
            name = Measurement._fields[operator.index(key)]
            if name in self._hidden:
                self._refuse(name)
        return value

    def __reduce__(self):
        return Measurement, tuple(self)

    def _refuse(self, name):
        time = float(tuple.__getitem__(self, 0))
        also = "" if name in Measurement._fields else " and give preview_times"
        raise ControllerError(
            f"controller {self._controller!r} reads {name!r} at t = {time:.3f} s and does not declare it: add"
            f" {name!r} to its attribute information{also}",
            controller=self._controller,
            time=time,
            returned=None,
        )


@cached(256)
def _view_class(name, information):
    """MeasurementView of a controller's name and information."""
    hidden_fields = frozenset(Measurement._fields) - {"time", *information}
    members = {
        "_controller": name,
        "_hidden": hidden_fields,
        "_places": tuple(i for i, field in enumerate(Measurement._fields) if field in hidden_fields),
        "_foresees": "wind_preview" in information,
        **{field: property(lambda self, field=field: self._refuse(field)) for field in hidden_fields},
    }
    return type("MeasurementView", (MeasurementView,), members)


def view_of(controller: Any) -> Callable[[Sequence[float]], MeasurementView]:
    """What makes the view that a controller is given from its array of readings."""
    return _view_class(controller.name, tuple(controller.information)).take


def with_wind_ahead(measurement: Measurement, wind: Sequence[float]) -> MeasurementView:
    """The measurement with the wind (m/s) that is foreseen, of which nothing else is hidden."""
    return _view_class("", (*Measurement._fields, "wind_preview")).take([*measurement, *wind])


def wind_ahead(measurement: Any) -> tuple[float, ...]:
    """The foreseen wind that a measurement carries; () where it carries none."""
    return getattr(measurement, "_ahead", ())


@cached(256)
def mask(name: str, information: tuple[str, ...]) -> np.ndarray:
    """(N_MEASUREMENTS,) GIVEN for what is declared, and the time, HIDDEN for the rest; read only.

    Raises: InputError for a name that is neither a field of Measurement nor a privileged input.
    """
    known = (*Measurement._fields, *PRIVILEGED_INPUTS)
    for item in information:
        if item not in known:
            raise unknown(f"information of controller {name!r}:", item, known)
    declared = {"time", *information}
    values = np.array([GIVEN if field in declared else HIDDEN for field in Measurement._fields])
    values.setflags(write=False)
    return values


def hidden(controller: Any, chain: tuple[str, Sequence[str]] | None = None) -> np.ndarray:
    """mask of a run: what the controller declares, and the sensor chain (name, fields that it has) shows.

    Raises: InputError where it declares a field that the chain does not have.
    """
    values = mask(controller.name, tuple(controller.information)).copy()
    if chain is None:
        return values
    name, available = chain
    for index, field in enumerate(Measurement._fields):
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

    The plant is in still water, with the seed 0; nothing of the run's weather can be read from it.
    """
    if "plant_model" not in controller.information:
        return Known(scene.turbine, controller.name)
    if scene.model.aero is None:
        return replace(without_fluctuations(scene), sea=None, seed=0)
    speed = float(scene.turbine.rated_wind_speed)
    return replace(without_fluctuations(scene, speed), wind=speed, sea=None, seed=0, wind_speed=speed)


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
