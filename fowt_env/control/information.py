"""Information that a controller declares: measured quantities, the wind ahead, the plant model."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fowt_env.analysis.trim import without_fluctuations
from fowt_env.caches import cached
from fowt_env.descriptions.lidar import lidars
from fowt_env.errors import ControllerError, InputError, unknown
from fowt_env.loop.sensing import GIVEN, HIDDEN
from fowt_env.plant.measurement import N_BLADE_MEASUREMENTS, N_MEASUREMENTS, BladeMeasurement, Measurement
from fowt_env.weather.lidar import lidar_preview
from fowt_env.weather.preview import Preview, check_times, exact_preview
from fowt_env.weather.wind_field import profile_field

PRIVILEGED_INPUTS = {  # what a controller may read beside Measurement
    "wind_preview": "the rotor-averaged wind, some seconds before it arrives",
    "plant_model": "the equations of the plant: trims, linear models or performance tables of the scene",
}
EXACT = "exact"  # preview, and sensors


def declares_blades(controller: Any) -> bool:
    """Whether a controller declares a field of BladeMeasurement."""
    return not set(BladeMeasurement._fields).isdisjoint(controller.information)


def check_pitches(controller: Any, individual: bool) -> None:
    """Refuse what needs individual pitch in a scene with one pitch for all blades.

    Raises: InputError.
    """
    if individual:
        return
    lacking = ""
    if getattr(controller, "individual", False):
        lacking = "commands the pitch of each blade"
    elif declares_blades(controller):
        name = next(name for name in controller.information if name in BladeMeasurement._fields)
        lacking = f"declares {name!r}, which is measured with individual pitch"
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

    individual: whether the scene has individual pitch; else it is of the N_MEASUREMENTS fields.
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
            " it reads the wind (s, increasing)"
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
    """Preview of a run of `duration` (s) from the argument of simulate: "exact", a lidar, a Preview, ...

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
    """Known part of a run for a controller that does not declare "plant_model": the turbine."""

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
    """Return the known part of a scene for prepare: its plant in steady rated wind, or its turbine alone.

    The plant is in still water, with the seed 0; nothing of the run's weather can be read from it. A box
    of wind, whose mean over time is the seed's, is replaced by the power law of the site.
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
