"""Accelerations, winds at stations and loads of an elastic turbine, at random states in wild motion.

Against particles on their paths (naive/flexible_turbine.py), for every kind of scene with elastic parts.
"""

import json
from collections import defaultdict
from pathlib import Path

import elastic_cases
import numpy as np
import pytest
from elastic_cases import BENDING, BLADES, SHEAR, TOWERS, WIND, Case, acting
from fresh_python import fresh_python
from naive.bent_stations import station, turning
from naive.flexible_turbine import Path as Course
from naive.flexible_turbine import value_of

STATES = 200  # of each platform
PLATFORMS = ("oc3_hywind", pytest.param("iea15_volturnus_s", marks=pytest.mark.nightly))
KINDS = [
    {"blades": blades, "tower": tower, "shaft": shaft, "fixed": fixed}
    for fixed in ((), ("platform",), ("rotor",))
    for blades in BENDING
    for tower in TOWERS
    for shaft in ("rigid", "torsion")
    if (blades, tower, shaft) != ("rigid", "rigid", "rigid")
]


def errors(case, rng):
    """{quantity: error over its largest value} of a random state."""
    x = case.random(rng)
    now, found = case.at(x), case.evaluate(x, rng)
    twin, air = now.twin, case.air(now, found)
    falling = twin.fall(now.path, elastic_cases.TORQUE, acting(twin), found.added, air, held=case.fixed)
    pairs = {
        what: (found.rates[what], values)
        for what, values in twin.accelerations(falling).items()
        if len(values) and not ("platform" in case.fixed and what in ("platform", "turning"))
    }
    for b in range(BLADES if case.n else 0):
        pairs[f"wind at blade {b}"] = found.winds[b], relative_winds(case, now, b)
        for what, (channels, values) in blade_loads(case, now, falling, air, found, b).items():
            pairs[f"{what} of blade {b}"] = found.channels(channels), values
    for what, (channels, values) in shaft_and_tower(case, twin, falling, air).items():
        pairs[what] = found.channels(channels), values
    return {
        what: np.abs(np.subtract(*pair)).max() / max(np.abs(pair[1]).max(), 1e-9)
        for what, pair in pairs.items()
    }


def relative_winds(case, now, b):
    """(k, 4) wind normal to a station and against its motion, its pitch, and how much of that is bending."""
    carry, aero = now.twin.on_blade(b), case.scene.model.aero
    elements, R, rows = aero.rotor.elements, now.twin.frame(now.path, carry)[0], []
    for j in range(len(elements.radius)):
        place, bending, section = station(
            j, now.q[b], now.v[b], now.pitches[b], elements.shape, elements.modes
        )
        at, velocity, _ = now.twin.point(now.path, carry, place)
        speed = WIND * (at[2] / aero.wind.reference_height) ** SHEAR
        relative = R.T @ ([speed, 0.0, 0.0] - velocity) - bending
        # tangent of the blade pitch that gives a section without bending the same pitch, less the actual one
        turn = np.arctan2(np.sqrt(1.0 - elements.shape.slope[j] ** 2) * np.tan(section.pitch), 1.0)
        change = np.tan(turn - now.pitches[b])
        change -= change**3 / 3.0  # the plant's arc tangent
        rows.append([section.normal @ relative, section.against @ relative, section.pitch, change])
    return np.array(rows)


def blade_loads(case, now, falling, air, plant, b):
    """{what: (channels, values)} of a blade: root, tip, two sections."""
    twin, k, c, s = now.twin, b + 1, np.cos(now.pitches[b]), np.sin(now.pitches[b])
    coned, carry, start = (
        np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]),
        twin.on_blade(b),
        np.zeros(3),
    )
    root = np.array([0.0, 0.0, twin.root])
    load = twin.section_load(falling, carry, root, [f"blade {b}"], [(carry, start, *air[b][:2])])
    tip = np.array([value_of(X, -1) for X in case.beam.bent(twin.of_blade(falling, b))])
    found = {
        "root force": (f"RootFxc{k} RootFyc{k} RootFzc{k}", coned @ load[:3]),
        "root moment": (
            f"RootMxc{k} RootMyc{k} RootMxb{k} RootMyb{k}",
            np.r_[(coned @ load[3:])[:2], load[3:5]],
        ),
        "tip": (
            f"OoPDefl{k} IPDefl{k} TipDzc{k}",
            coned @ (tip - [0.0, 0.0, case.turbine.rotor.tip_radius]),
        ),
    }
    for number, z in enumerate(case.stations):
        section = getattr(case.scene.model.blades, ("inner", "outer")[number])
        wind = case.air(now, plant, (section.outside, section.further))[b]
        at, slopes = case.beam.between(now.q[b], z)
        outer = [(b, case.outer[number])]
        load = twin.section_load(falling, carry, at, [], [(carry, start, *wind[:2])], outer)
        mx, my, _ = turning(*slopes).T @ load[3:]
        c, s = section.cosine, section.sine
        found[f"section {number}"] = (
            f"Spn{number + 1}MLxb{k} Spn{number + 1}MLyb{k}",
            np.array([c * mx - s * my, s * mx + c * my]),
        )
    return found


def shaft_and_tower(case, twin, falling, air):
    """{what: (channels, values)} of shaft, yaw bearing and tower."""
    start, rotor = np.zeros(3), ["hub", *(f"blade {b}" for b in range(BLADES))]
    carried = [(twin.on_blade(b), start, *air[b][:2]) for b in range(BLADES)]

    def on_still_rotor(c, point):
        return twin.on_shaft(c, point, twin.hub, Course(0.0))

    shaft = twin.section_load(falling, on_still_rotor, start, rotor, carried)
    turn = twin.azimuth(falling).value
    c, s = np.cos(turn), np.sin(turn)
    top, aloft = np.array([0.0, 0.0, case.platform.tower.top_height]), [*rotor, "nacelle", "wheel"]
    bearing = twin.section_load(falling, twin.on_nacelle, top, aloft, carried)
    base = np.array([0.0, 0.0, twin.base])
    carried.append(acting(twin)[0])
    load = twin.section_load(falling, twin.on_platform, base, [*aloft, "straight", "tower"], carried)
    acceleration = twin.frame(falling, twin.on_nacelle)[0].T @ twin.point(falling, twin.on_nacelle, top)[2]
    found = {
        "thrust": ("RotThrust", shaft[:1]),
        "shaft moment": ("RotTorq LSSTipMys LSSTipMzs", shaft[3:]),
        "yaw bearing": ("YawBrMxp YawBrMyp YawBrMzp", bearing[3:]),
        "tower base force": ("TwrBsFxt TwrBsFyt TwrBsFzt", load[:3]),
        "tower base moment": ("TwrBsMxt TwrBsMyt TwrBsMzt", load[3:]),
        "nacelle": ("NcIMUTAxs NcIMUTAys", acceleration[:2]),
    }
    if case.n:
        across = np.array([c * shaft[4] + s * shaft[5], c * shaft[5] - s * shaft[4]])
        found["shear force"] = "LSShftFys LSShftFzs", shaft[1:3]
        turned = np.array([c * shaft[1] + s * shaft[2], c * shaft[2] - s * shaft[1]])
        found["shear force of the turning shaft"] = "LSShftFya LSShftFza", turned
        found["moment of the turning shaft"] = "LSSTipMya LSSTipMza", across
    return found


def measured(name, states, seed=1):
    """{quantity: {kind: largest error}} of random states, kinds in turn."""
    rng, cases = np.random.default_rng(seed), {}
    found = defaultdict(lambda: defaultdict(float))
    for k in range(states):
        kind = k % len(KINDS)
        if kind not in cases:
            cases[kind] = Case(name, **KINDS[kind])
        for what, error in errors(cases[kind], rng).items():
            found[what][str(KINDS[kind])] = max(found[what][str(KINDS[kind])], float(error))
    return found


@pytest.mark.parametrize("name", PLATFORMS)
@pytest.mark.parametrize("states", [len(KINDS), pytest.param(STATES, marks=pytest.mark.nightly)])
def test_motion_and_loads_are_those_of_particles_on_their_paths(name, states):
    code = f"import json, test_particles; print(json.dumps(test_particles.measured({name!r}, {states})))"
    here = Path(__file__).parent
    found = json.loads(fresh_python(code, paths=(here, here.parents[1]), NUMBA_DISABLE_JIT="1"))
    wrong = {
        (what, kind): error for what, kinds in found.items() for kind, error in kinds.items() if error > 1e-9
    }
    assert found and not wrong
