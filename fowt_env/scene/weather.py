"""Builds wind and sea of a scene from specifications of the user."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fowt_env.descriptions.sea_state import SeaState, sea_state_of
from fowt_env.descriptions.wind import wind_of
from fowt_env.errors import InputError
from fowt_env.plant.aero.wind import WindSeries
from fowt_env.scene.options import ROTORS
from fowt_env.weather.waves import build_waves
from fowt_env.weather.wind import build_wind, make_series, nominal_speed
from fowt_env.weather.wind_field import WindBox, hub_speed, is_field, read_box, rotor_average

# specifications of wind and sea, see build_scene
Wind = float | str | Path | dict[str, Any] | WindSeries | WindBox | None
Sea = str | Path | Mapping[str, Any] | SeaState | None
IN_PLANE = 1e-9  # fraction of a vector out of the plane of a planar scene that rounding may leave


class Air(NamedTuple):
    """Holds the wind of a scene: specification (or the wind box), parts, and mean hub wind for a trim."""

    spec: object
    series: object  # WindSeries or None
    field: object  # WindField or None
    speed: float | None


def build_air(wind, seed, turbine, rotor, shear, duration):
    """Return the Air of a wind specification. Raises: InputError."""
    wind = wind_of(wind)
    hub, diameter = turbine.rotor.hub_height, 2.0 * turbine.rotor.tip_radius
    common = {"rotor_diameter": diameter, "shear_exponent": shear, "seed": seed, "duration": duration}
    if not is_field(wind):
        series = build_wind(wind, reference_height=hub, **common)
        return Air(wind, series, None, None if series is None else nominal_speed(wind))
    box = read_box(wind, hub_height=hub, **common)
    speed = hub_speed(box, hub)
    site = {"reference_height": hub, "reference_length": diameter, "shear_exponent": 0.0}
    if not ROTORS[rotor].full_field:
        period = box.velocity.shape[0] * box.dt if box.periodic else 0.0
        return Air(box, make_series(*rotor_average(box, hub, diameter), period=period, **site), None, speed)
    mean = make_series(np.zeros(1), np.array([[speed, 0.0, 0.0, 0.0, 0.0]]), **site)
    return Air(box, mean, box.field(), speed)


def build_weather(wind, sea, seed, platform, turbine, rotor, options):
    """Return (Air, Waves or None) of a wind and sea specification. Raises: InputError."""
    site = platform.environment
    shear = site.shear_exponent if options["shear_exponent"] is None else options["shear_exponent"]
    air = build_air(wind, seed, turbine, rotor, shear, options["duration"])
    if options["planar"]:
        air = _in_plane(air)
    state = sea_state_of(sea)
    if state.height > site.water_depth:
        raise InputError(
            f"sea: wave height {state.height:g} m: must not exceed the water depth of {site.water_depth:g} m"
        )
    if not options["hydrodynamics"]:
        return air, None
    waves = build_waves(
        state,
        depth=site.water_depth,
        density=site.water_density,
        gravity=site.gravity,
        seed=seed,
        duration=options["duration"],
        components=options["wave_components"],
    )
    if options["planar"] and waves is not None and np.abs(waves.sin_heading).max() > IN_PLANE:
        raise InputError("sea: the heading must be 0 or 180 deg in a planar scene")
    return air, waves


def _in_plane(air):
    """Return the Air of a planar scene, without lateral turbulence. Raises: InputError for cross wind."""
    if air.series is None:
        return air
    if air.field is not None:
        averaging = " or ".join(repr(name) for name, model in ROTORS.items() if not model.full_field)
        raise InputError(
            f"wind: a box of full-field wind is not planar; use rotor = {averaging} or planar = False"
        )
    value = air.series.value.copy()
    across = np.abs(value[:, [1, 4]]).max()
    if across <= IN_PLANE * np.abs(value[:, 0]).max():
        return air
    kind = air.spec.get("kind") if isinstance(air.spec, dict) else getattr(air.spec, "kind", None)
    if kind not in ("ntm", "etm") or abs(value[:, 1].mean()) > 1e-3 * abs(value[:, 0].mean()):
        raise InputError(
            f"wind: cross wind or horizontal shear of up to {across:g} m/s; a planar scene must have"
            " none (planar = False)"
        )
    value[:, [1, 4]] = 0.0
    return air._replace(series=air.series._replace(value=value))
