"""Provides views of a measurement with the declared fields; reading another field raises an error."""

import operator
from collections.abc import Callable, Sequence
from math import nan
from typing import Any, NamedTuple

from fowt_env.caches import cached
from fowt_env.errors import ControllerError
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasurement, Measurement


class LidarReading(NamedTuple):
    """Holds what a nacelle lidar measures at its distances, from the nearest to the farthest.

    speed: wind speed at each distance, m/s, the mean over the beams of their last successful shots; without a
    new shot the value stays. fresh: fraction of beams whose latest shot succeeded, from 0 to 1.
    """

    speed: tuple[float, ...]
    fresh: tuple[float, ...]


class MeasurementView(Measurement):
    """Holds the measured fields that a controller declares; reading another field raises ControllerError.

    view[i] raises as the attribute does; np.array(view), slices and loops contain NaN instead.
    """

    _controller = ""
    _information: tuple[str, ...] = ()
    _hidden: frozenset[str] = frozenset()
    _indices: tuple[int, ...] = ()  # of the hidden fields
    _foresees = False
    _ranges = False  # whether the controller reads a lidar
    _leads = 0  # number of values after the Measurement: preview_times, or speeds and freshness of a lidar
    _blade_class: type
    _ahead: tuple[float, ...] = ()
    _blades: "BladeView | None" = None

    @classmethod
    def take(cls, values: Sequence[float]) -> "MeasurementView":
        """Return the view of (N_MEASUREMENTS + leads,) values, optionally followed by blade measurements."""
        rest = N_MEASUREMENTS + cls._leads
        return cls._taken(values[:N_MEASUREMENTS], values[N_MEASUREMENTS:rest], values[rest:])

    @classmethod
    def of(cls, measurement: Any) -> "MeasurementView":
        """Return the view of a Measurement, with its wind preview or lidar and blade measurements."""
        return cls._taken(measurement, wind_ahead(measurement), values_of_blades(measurement))

    @classmethod
    def _taken(cls, values, ahead, blades):
        shown = list(values)
        for index in cls._indices:
            shown[index] = nan
        view = cls._make(shown)
        view._ahead = tuple(ahead)
        if len(blades):
            view._blades = cls._blade_class.take(blades, shown[0])
        return view

    @property
    def wind_preview(self) -> tuple[float, ...]:
        """Return the rotor-averaged wind (m/s) at each of the controller's preview_times."""
        if not self._foresees:
            self._refuse("wind_preview")
        return self._ahead

    @property
    def lidar(self) -> LidarReading:
        """Return the LidarReading of a controller that declares "lidar"."""
        if not self._ranges:
            self._refuse("lidar")
        gates = len(self._ahead) // 2
        return LidarReading(self._ahead[:gates], self._ahead[gates:])

    @property
    def blades(self) -> "BladeView":
        """Return the BladeMeasurement of a scene with individual pitch."""
        if self._blades is None:
            raise ControllerError(
                f"controller {self._controller!r} reads 'blades': the scene has one pitch for all blades;"
                " build the scene with pitch='individual'",
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
    """Holds the fields of a BladeMeasurement that a controller declares, like MeasurementView."""

    _controller = ""
    _information: tuple[str, ...] = ()
    _hidden: frozenset[str] = frozenset()
    _time = 0.0

    @classmethod
    def take(cls, values: Sequence[float], time: float) -> "BladeView":
        """Return the view of (N_BLADE_MEASUREMENTS,) values at a time (s)."""
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
    """Raise ControllerError: a controller reads an undeclared field at a time (s)."""
    also = " and give preview_times" if name == "wind_preview" else ""
    raise ControllerError(
        f"controller {controller!r} reads {name!r} at t = {time:.3f} s and does not declare it: add"
        f" {name!r} to its attribute information{also}",
        controller=controller,
        time=float(time),
        returned=None,
    )


def _hiding(name, fields, information):
    """Return the members of a controller's view class, which hide all fields that are not in information."""
    hidden_fields = frozenset(fields) - {"time", *information}
    refusing = {field: property(lambda self, field=field: self._refuse(field)) for field in hidden_fields}
    about = {"_controller": name, "_information": information, "_hidden": hidden_fields}
    return {**about, **refusing}


@cached(256)
def view_class(name, information, leads):
    """Return the subclass of MeasurementView for a controller's name, information and number of _leads."""
    members = _hiding(name, Measurement._fields, information)
    members |= {
        "_indices": tuple(i for i, field in enumerate(Measurement._fields) if field in members["_hidden"]),
        "_foresees": "wind_preview" in information,
        "_ranges": "lidar" in information,
        "_leads": leads,
        "_blade_class": type("BladeView", (BladeView,), _hiding(name, BladeMeasurement._fields, information)),
    }
    return type("MeasurementView", (MeasurementView,), members)


def _view_again(name, information, leads, values, ahead, blades):
    """Return an unpickled MeasurementView."""
    return view_class(name, information, leads)._taken(values, ahead, blades)


def _blades_again(name, information, values, time):
    """Return an unpickled BladeView."""
    return view_class(name, information, 0)._blade_class.take(values, time)


def view_of(controller: Any, leads: int | None = None) -> Callable[[Sequence[float]], MeasurementView]:
    """Return the function that makes the view of a controller from an array of readings.

    leads: number of values of wind preview or lidar in the array; None: that of the preview_times.
    """
    leads = len(controller.preview_times) if leads is None else leads
    return view_class(controller.name, tuple(controller.information), leads).take


def whole_view(values: Sequence[float], wind: Sequence[float] = ()) -> MeasurementView:
    """Return a view of measured values and of the wind preview (m/s) without hidden fields.

    wind: the wind preview, or speeds and then freshness of a lidar.
    """
    everything = (*Measurement._fields, *BladeMeasurement._fields, "wind_preview", "lidar")
    rest = values[N_MEASUREMENTS:]
    return view_class("", everything, len(wind)).take([*values[:N_MEASUREMENTS], *wind, *rest])


def with_wind_ahead(measurement: Measurement, wind: Sequence[float]) -> MeasurementView:
    """Return a view of a measurement with the wind of whole_view, without hidden fields."""
    return whole_view([*measurement, *values_of_blades(measurement)], wind)


def wind_ahead(measurement: Any) -> tuple[float, ...]:
    """Return the wind preview, or speeds and freshness of the lidar, of a measurement; () without one."""
    return getattr(measurement, "_ahead", ())


def values_of_blades(measurement: Any) -> tuple[float, ...]:
    """Return the (N_BLADE_MEASUREMENTS,) blade values of a measurement; () without any."""
    blades = getattr(measurement, "_blades", None)
    return () if blades is None else tuple(blades)
