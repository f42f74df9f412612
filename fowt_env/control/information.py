"""Checks the information that a controller declares: measurements, wind preview and plant model."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fowt_env.analysis.trim import without_fluctuations
from fowt_env.caches import cached
from fowt_env.descriptions.lidar import Lidar, lidars, read_lidar
from fowt_env.errors import ControllerError, InputError, unknown
from fowt_env.loop.sensing import GIVEN, HIDDEN
from fowt_env.plant.measurement import N_BLADE_MEASUREMENTS, N_MEASUREMENTS, BladeMeasurement, Measurement
from fowt_env.weather.lidar import lidar_preview
from fowt_env.weather.lidar_gates import Gates
from fowt_env.weather.preview import Preview, check_times, exact_preview
from fowt_env.weather.wind_field import profile_field

PRIVILEGED_INPUTS = {  # information that a controller may declare in addition to Measurement fields
    "wind_preview": "the rotor-averaged wind, some seconds before it arrives",
    "lidar": "what a nacelle lidar measures at each of its distances, shot by shot",
    "plant_model": "the equations of the plant: trims, linear models or performance tables of the scene",
}
EXACT = "exact"  # value of the arguments preview and sensors
USUAL_LIDAR = "four_beam_pulsed"  # read by a controller that declares "lidar", unless preview names another


def declares_blades(controller: Any) -> bool:
    """Return whether a controller declares a field of BladeMeasurement."""
    return not set(BladeMeasurement._fields).isdisjoint(controller.information)


def check_pitches(controller: Any, individual: bool) -> None:
    """Raise InputError if a controller needs individual pitch and the scene has one pitch for all blades."""
    if individual:
        return
    lacking = ""
    if getattr(controller, "individual", False):
        lacking = "commands the pitch of each blade"
    elif declares_blades(controller) and getattr(controller, "declared", True):
        name = next(name for name in controller.information if name in BladeMeasurement._fields)
        lacking = f"declares {name!r}, which is measured with individual pitch"
    if lacking:
        raise InputError(
            f"controller {controller.name!r}: {lacking}, and the scene has one pitch for all blades: build it"
            " with pitch='individual'"
        )


@cached(256)
def mask(name: str, information: tuple[str, ...]) -> np.ndarray:
    """Return the read-only mask of fields: GIVEN for declared ones and the time, HIDDEN for all others.

    Shape (N_MEASUREMENTS + N_BLADE_MEASUREMENTS,), the fields of Measurement first.
    Raises: InputError for a name that is neither a field of the two nor a privileged input.
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
    """Return the mask of a run: fields that the controller declares and the chain (name, fields) has.

    individual: whether the scene has individual pitch; else the mask has the N_MEASUREMENTS fields only.
    Raises: InputError for a declared field that the chain or the scene (check_pitches) does not have.
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
    """Return the checked preview_times of a controller, () for none.

    Raises: InputError for unusable times, and if only one of preview_times and "wind_preview" is declared.
    """
    times = tuple(getattr(controller, "preview_times", ()))
    declared = "wind_preview" in controller.information
    if times and "lidar" in controller.information:
        raise InputError(
            f"controller {controller.name!r}: declares 'wind_preview' and 'lidar': one run has one of them"
        )
    if not times and not declared:
        return ()
    if not times:
        raise InputError(
            f"controller {controller.name!r}: declares 'wind_preview' and has no preview_times, the"
            " look-ahead times of the wind (s, increasing)"
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
    """Return the Preview of a run of `duration` (s) from the argument preview of simulate.

    Raises: InputError for an unknown preview, and for a Preview with other leads or shapes.
    """
    if isinstance(preview, str) and preview != EXACT:
        if preview not in lidars():
            raise unknown("preview", preview, (EXACT, *lidars()))
        result = lidar_preview(scene, leads, preview)
    elif isinstance(preview, str):
        if duration > scene.options["duration"]:  # possible for a periodic wind box
            scene = replace(scene, options=scene.options | {"duration": duration})
        result = exact_preview(scene, leads)
    else:
        result = preview(scene, leads) if callable(preview) else preview
    try:
        time, values = (np.ascontiguousarray(part, dtype=np.float64) for part in result[:2])
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
    return Preview(time, values, result[2] if len(result) > 2 else None)


def lidar_of(controller: Any, preview: Any) -> Lidar | None:
    """Return the Lidar that a controller reads, from the argument preview of simulate.

    None if the controller does not declare "lidar". Raises: InputError for anything but a lidar or EXACT.
    """
    if "lidar" not in controller.information:
        return None
    if isinstance(preview, str | Lidar):
        return read_lidar(USUAL_LIDAR if preview == EXACT else preview)
    if isinstance(preview, Gates):
        return preview.lidar
    raise InputError(
        f"preview = {preview!r}: must be a lidar (a name, a file, a Lidar or Gates), because controller"
        f" {controller.name!r} declares 'lidar'"
    )


class Known:
    """Holds turbine and lidar alone, for controllers that do not declare "plant_model"."""

    def __init__(self, turbine: Any, controller: str, lidar: Lidar | None = None) -> None:
        self.turbine, self.lidar = turbine, lidar
        self._controller = controller

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        raise ControllerError(
            f"controller {self._controller!r} reads {name!r} of prepare's scene and does not declare it: add"
            " 'plant_model' to its attribute information",
            controller=self._controller,
            time=0.0,
            returned=None,
        )


def known_scene(scene: Any, controller: Any, preview: Any = EXACT) -> Any:
    """Return the scene for prepare(): the plant in steady rated wind and still water, or the turbine alone.

    Its field lidar is the Lidar of the argument preview of simulate, if the controller declares "lidar".

    The seed is 0, so the scene contains nothing of the run's weather. A wind box, whose mean over time
    depends on the seed, is replaced by the power law of the site.
    """
    if "plant_model" not in controller.information:
        return Known(scene.turbine, controller.name, lidar_of(controller, preview))
    scene = replace(scene, lidar=lidar_of(controller, preview))
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
