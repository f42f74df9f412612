"""A spar, its strips, seas and motions for the tests of the loads of the water."""

import itertools

import numpy as np
from naive.rigid_body import rotation

from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.plant.hydro.strips import GAUSS_OFFSET, build_strips, wet_cell
from fowt_env.weather.waves import build_waves

STILL = (np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
SWITCHES = list(itertools.product(("instantaneous", "fixed"), ("instantaneous", "swl"), ("wheeler", "none")))
SEAS = {
    "mild": {"kind": "jonswap", "Hs": 2.5, "Tp": 7.0, "gamma": 1.0, "heading": 20.0},
    "rough": {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0, "gamma": 3.3},
    "storm": {"kind": "jonswap", "Hs": 17.0, "Tp": 17.0, "gamma": 2.0, "heading": -130.0},
    "regular": {"kind": "regular", "H": 3.0, "T": 5.0},
    "swell": {"kind": "regular", "H": 6.0, "T": 20.0, "heading": 45.0},
}


def strips_of(platform, position="instantaneous", surface="instantaneous", stretching="wheeler", **options):
    """Return the strips of a spar."""
    site = platform.environment
    return build_strips(
        platform.hull, platform.hydro, density=site.water_density, depth=site.water_depth,
        position=position, surface=surface, stretching=stretching, **options,
    )  # fmt: skip


def waves_of(sea, site, seed=0, duration=600.0):
    """Return waves: of a mapping, or of rows of (omega, amplitude, phase, heading in rad)."""
    if not isinstance(sea, dict):
        omega, amplitude, phase, heading = np.array(sea, dtype=float).T
        sea = {"kind": "components", "omega": omega, "amplitude": amplitude, "phase": phase}
        sea["heading"] = np.degrees(heading)
    return build_waves(
        sea_state_of(sea), depth=site.water_depth, density=site.water_density, gravity=site.gravity,
        seed=seed, duration=duration,
    )  # fmt: skip


def motion(rng, tilt=0.08, heave=0.7):
    """Return position (m), rotation matrix, velocity (m/s) and rate (rad/s) of a platform at sea."""
    r = rng.normal(size=3) * [9.0, 9.0, heave]
    R = rotation(*(rng.uniform(-1.0, 1.0, 3) * [tilt, tilt, 3.0]))
    return r, R, rng.normal(size=3), rng.normal(size=3) * 0.05


def nodes_of(strips, top):
    """Return (z, weight, diameter, dA/dz) of the strips' nodes below a surface at body z = top."""
    rows = []
    for section, bottom in enumerate(strips.section_bottom):
        start, height = wet_cell(section, top, strips)
        for cell in range(strips.cells[section]):
            for offset in (GAUSS_OFFSET, 1.0 - GAUSS_OFFSET):
                z = start - height * (cell + offset)
                d = strips.diameter_bottom[section] + strips.diameter_slope[section] * (z - bottom)
                rows.append((z, 0.5 * height, d, 0.5 * np.pi * d * strips.diameter_slope[section]))
    return np.array(rows).T
