"""Views of a measurement that hold what a controller declares, and refuse the rest."""

import operator
from collections.abc import Callable, Sequence
from math import nan
from typing import Any

from fowt_env.caches import cached
from fowt_env.errors import ControllerError
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasurement, Measurement


class MeasurementView(Measurement):
    """Measurement of the fields that a controller declares; the other ones are NaN and raise when read.

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
        """BladeMeasurement of a scene with individual pitch."""
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
    """Raise ControllerError: a controller reads at a time (s) what it does not declare."""
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
def view_class(name, information, leads):
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
    return view_class(name, information, leads)._taken(values, ahead, blades)


def _blades_again(name, information, values, time):
    """A BladeView as it was before it was pickled."""
    return view_class(name, information, 0)._blade_class.take(values, time)


def view_of(controller: Any) -> Callable[[Sequence[float]], MeasurementView]:
    """Return the function that makes the view of a controller from its array of readings."""
    return view_class(controller.name, tuple(controller.information), len(controller.preview_times)).take


def whole_view(values: Sequence[float], wind: Sequence[float] = ()) -> MeasurementView:
    """The view of measured values, of which nothing is hidden, and of the wind (m/s) that is foreseen."""
    everything = (*Measurement._fields, *BladeMeasurement._fields, "wind_preview")
    rest = values[N_MEASUREMENTS:]
    return view_class("", everything, len(wind)).take([*values[:N_MEASUREMENTS], *wind, *rest])


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
