"""Writes the 1:50 model of the paper as description files: Froude-scaled OC3-Hywind, identified mooring.

The paper gives neither masses nor mooring. Identified from the six computed periods of Table 1: stiffness EA,
anchor radius and length of the taut lines (theory.md Eqs. (18)(19)), pitch inertia of the floater, and its
mass, which balances weight, lines and buoyancy at the design draft. A factor on the polars gives the
Froude-scaled rated thrust in the rated condition of the paper (LC2), whose wind is twice the Froude-scaled
one: at the Reynolds number of the model, airfoils have less lift.
"""

from math import cos, hypot, pi, sin

import numpy as np
from scipy.optimize import brentq, fsolve

from fowt_env.analysis.linear_model import natural_periods
from fowt_env.analysis.trim import trim_prescribed
from fowt_env.descriptions.platform import DATA, Line, read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.plant.mooring import catenary
from fowt_env.scene.build import build_scene
from fowt_env.training.studies.froude_model.scale import (
    entries,
    polar_files,
    scaled,
    stations_text,
    toml_table,
    write_files,
)

NAME = "liu_1_50"
TURBINE = NAME
SCALE = 1.0 / 50.0
WATER = 1000.0  # kg/m3: fresh water assumed; not stated in the paper
DEPTH = 4.0  # m: 200 m at full scale, depth of the tests by Koo et al., the source of the paper's mooring
PERIODS = {  # s, Table 1, computed
    "surge": 10.24, "sway": 10.24, "heave": 3.66, "roll": 4.27, "platform_pitch": 4.27, "yaw": 3.15,
}  # fmt: skip
AZIMUTHS = (0.0, 120.0, 240.0)  # deg, of the anchors, as in OC3
BRIDLE = 60.0  # deg to either side: hull points of a delta, half-way to the next line
WET_WEIGHT = 0.02  # N/m, a thin wire: its sag (below 0.3 % of the span) does not matter; assumed
RATED_WIND = 3.36  # m/s, LC2
RATED_SPEED = 85.6 * RPM  # rad/s, LC2
RATED_THRUST = 703e3  # N at full scale: NREL 5 MW at 11.4 m/s, blade pitch 0
START = (110.0, 3.4, 0.93, 13.5)  # EA N, anchor radius m, length over span, pitch inertia kg m2


GEARED = {  # exponent of the gear ratio that converts a quantity from high-speed shaft to rotor
    "rated_torque": 1, "rated_speed": -1, "cut_in_speed": -1, "region2_start_speed": -1,
    "region2_constant": 3, "transition_speed": -1, "max_torque": 1, "max_torque_rate": 1, "KP": 1, "KI": 1,
}  # fmt: skip
PARTS = ("environment", "ballast", "hull", "hydro", "tower")  # of the platform file


def model_scaled(record, name):
    """Return {field: value} of a record of OC3-Hywind or its turbine at model scale and in model water."""
    density = WATER / read_platform("oc3_hywind").environment.water_density
    return scaled(record, name, SCALE, density)


def lines(EA, anchor_radius, stretch, fairlead_radius, fairlead_z):
    """Return six Line records: each of three mooring lines is a pair to two hull points.

    stretch: unstretched length over the straight distance at rest.
    """

    def point(radius, azimuth, z):
        return round(radius * cos(azimuth * DEGREE), 12), round(radius * sin(azimuth * DEGREE), 12), z

    result = []
    for azimuth in AZIMUTHS:
        anchor = point(anchor_radius, azimuth, -DEPTH)
        for side in (-BRIDLE, BRIDLE):
            fairlead = point(fairlead_radius, azimuth + side, fairlead_z)
            length = stretch * float(np.linalg.norm(np.subtract(anchor, fairlead)))
            ends = {"anchor": anchor, "fairlead": fairlead}
            result.append(Line(**ends, length=length, wet_weight=WET_WEIGHT, EA=EA))
    return tuple(result)


def pull_at_rest(line):
    """Return the catenary of a line with the platform at its design position."""
    dx, dy, dz = np.subtract(line.fairlead, line.anchor)
    return catenary(hypot(dx, dy), dz, line.length, line.wet_weight, line.EA, 0.0, 0.0)


def model_turbine():
    """Return {table: {key: value}} of the NREL 5 MW at model scale, with direct drive."""
    full = read_turbine("nrel5mw")

    def on_rotor(record, name):
        values = model_scaled(record, name)
        return {k: v * full.drivetrain.gear_ratio ** GEARED.get(k, 0) for k, v in values.items()}

    return {
        "name": TURBINE,
        **model_scaled(full, "turbine"),
        "rotor": model_scaled(full.rotor, "rotor"),
        "nacelle": model_scaled(full.nacelle, "nacelle"),
        "drivetrain": {"gear_ratio": 1.0, "generator_inertia": 0.0, "generator_efficiency": 1.0},
        "pitch_drive": {
            "time_constant": 0.0, "rate_limit": model_scaled(full.pitch_drive, "pitch_drive")["rate_limit"],
            "minimum_deg": 0.0, "maximum_deg": 90.0,
        },
        "torque_law": on_rotor(full.torque_law, "torque_law"),
        **{f"gains.{name}": on_rotor(record, "gains") for name, record in full.gains.items()},
        "blade": {"stations": "blade.csv", "polars": "polars"},
    }  # fmt: skip


def froude_platform(turbine):
    """Return the Platform of OC3-Hywind at model scale, without moorings."""
    full = read_platform("oc3_hywind")
    chosen = {
        "environment": {"water_density": WATER, "water_depth": DEPTH, "shear_exponent": 0.0},
        "hydro": {"yaw_stiffness": 0.0},
        "tower": {"modes": None},
    }
    parts = {"name": NAME, "turbine": turbine, "lines": (), "published": {}}
    for name in PARTS:
        values = model_scaled(getattr(full, name), name)
        values = {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
        parts[name] = getattr(full, name).model_copy(update=values | chosen.get(name, {}))
    return full.model_copy(update=parts)


def candidate(base, above, unknowns):
    """Return the Platform for unknowns (as START); ballast balances buoyancy and lines. above: mass, kg."""
    EA, anchor_radius, stretch, inertia = unknowns
    full, hull, environment = read_platform("oc3_hywind").lines[0].fairlead, base.hull, base.environment
    moorings = lines(EA, anchor_radius, stretch, full[0] * SCALE, full[2] * SCALE)
    down = sum(pull_at_rest(line).V for line in moorings)
    ends = zip(hull.z[:-1], [*hull.z[1:-1], 0.0], hull.diameter[:-1], hull.diameter[1:], strict=True)
    volume = sum((high - low) * pi / 12.0 * (a * a + a * b + b * b) for low, high, a, b in ends)
    mass = environment.water_density * volume - down / environment.gravity - above
    changes = {"mass": mass, "inertia": (inertia, inertia, base.ballast.inertia[2])}
    return base.model_copy(update={"lines": moorings, "ballast": base.ballast.model_copy(update=changes)})


def identify(turbine=TURBINE):
    """Identify the four unknowns from the periods of Table 1 and return the Platform."""
    base, machine = froude_platform(turbine), read_turbine(turbine)
    above = base.tower.mass + machine.nacelle.mass + machine.rotor.mass

    def misses(logarithms):
        platform = candidate(base, above, np.exp(logarithms))
        periods = natural_periods(build_scene(platform, fidelity="reference"))
        motions = ("surge", "heave", "yaw", "platform_pitch")
        return [np.log(periods[name] / PERIODS[name]) for name in motions]

    solution, _, status, text = fsolve(misses, np.log(START), xtol=1e-9, full_output=True)
    if status != 1:
        raise RuntimeError(f"identification of the periods of Table 1 failed: {text}")
    return candidate(base, above, np.exp(solution))


def with_polars(turbine, polars, factor=1.0):
    """Return the turbine with polars whose coefficients are multiplied by a factor."""
    polars = {name: polar * np.array([1.0, *[factor] * 3]) for name, polar in polars.items()}
    return turbine.model_copy(update={"blade": turbine.blade.model_copy(update={"polars": polars})})


def polar_factor(platform):
    """Return the factor on the full-scale polars for the scaled rated thrust in LC2, platform fixed."""
    turbine, full = read_turbine(TURBINE), read_turbine("nrel5mw")
    density = WATER / read_platform("oc3_hywind").environment.water_density
    target = RATED_THRUST * density * SCALE**3

    def excess(factor):
        weak = with_polars(turbine, full.blade.polars, factor)
        scene = build_scene(platform, wind=RATED_WIND, turbine=weak, fidelity="reference")
        point = trim_prescribed(scene, RATED_SPEED, 0.0, platform="fixed")
        return 1e3 * point["RotThrust"] - target

    return brentq(excess, 0.2, 1.0, xtol=1e-9)


TURBINE_HEADER = """\
# NREL 5 MW turbine at the paper's model scale of 1:50, by Froude's law from nrel5mw (masses also by
# 1000/1025, the ratio of water densities). The as-built rotor is not published. Direct drive by a
# motor: no gearbox, generator inertia, pitch actuator. Torque law and gains are scaled with the rest but
# unused in the paper's tests, where rotor speed and blade pitch are prescribed. Polars: full scale,
# coefficients times one identified factor, see polars/. Written by training/studies/froude_model/identify.py.
# SI units (kg, m, s, N, rad) unless the key says otherwise (_deg).
"""
PLATFORM_HEADER = """\
# The 1:50 model of Liu et al. (2023), J. Vib. Eng. 36(4) 892-902, SI units (kg, m, s, N, rad) at
# model scale. Written by training/studies/froude_model/identify.py. Marks, by table:
#   given       printed in the paper: scale 1:50, taut lines without touchdown, the periods of Table 1
#   Froude      OC3-Hywind by Froude's law; the built model is not published
#   identified  here, so that natural_periods() gives the computed periods of Table 1
#   choice      neither printed nor identified: fresh water, depth 4 m (200 m full scale), wire weight, bridle
"""
MARKS = {
    "environment": "gravity, air density: Froude; fresh water, depth, no wind shear: choice",
    "ballast": "mass and pitch (= roll) inertia: identified; cm_depth and yaw inertia: Froude",
    "hull": "Froude",
    "hydro": "Froude: coefficients as at full scale; yaw is held by the lines, not by a stiffness",
    "tower": "Froude",
    "published": "model scale, s: given (Table 1, computed)",
}


def write_turbine(factor):
    """Write the folder of the turbine, with full-scale polars multiplied by a factor."""
    folder, full = DATA / "turbines" / TURBINE, read_turbine("nrel5mw")
    words = f"of nrel5mw, all coefficients times {factor:.8g} (froude_model/identify.py)."
    polars = polar_files(with_polars(full, full.blade.polars, factor), words, 6, 8)
    words = "# Blade of nrel5mw at 1:50, lengths by Froude's law; twist and airfoils unchanged."
    files = {folder / "polars" / name: text for name, text in polars.items()}
    files[folder / "blade.csv"] = stations_text(full.blade, SCALE, words, 8)
    tables = model_turbine()
    parts = {name: table for name, table in tables.items() if isinstance(table, dict)}
    text = [TURBINE_HEADER, *entries({key: value for key, value in tables.items() if key not in parts})]
    for name, table in parts.items():
        text += toml_table(name, table)
    files[folder / "turbine.toml"] = "\n".join(text) + "\n"
    write_files(files)


def write():
    """Identify the model, write turbine and platform, and return the path of the platform file."""
    write_turbine(1.0)
    platform = identify()
    factor = polar_factor(platform)
    write_turbine(factor)
    text = [PLATFORM_HEADER, f'name = "{NAME}"', f'turbine = "{TURBINE}"']
    text.append('source = "Liu et al. 2023, J. Vib. Eng. 36(4) 892-902; OC3-Hywind by Froude\'s law"')
    for name in PARTS:
        values = getattr(platform, name).model_dump(exclude_unset=True, exclude_none=True)
        heading, *rest = toml_table(name, values)[1:]
        text += ["", f"{heading}  # {MARKS[name]}", *rest]
    text.append(
        "\n# Three taut lines, each a pair from anchor to two points of the hull, 60 deg to either side: that"
        "\n# stands for the delta connection. EA (wire, spring), length, anchor radius: identified; fairlead"
        "\n# radius and depth: Froude; wet weight, anchor depth, bridle angle: choice."
    )
    for line in platform.lines:
        text += ["\n[[lines]]", *entries(line.model_dump())]
    text += [
        "\n[published]",
        f"polar_factor = {factor:.8g}  # identified, already in the polars: Froude-scaled 703 kN in LC2",
        f"\n[published.natural_periods]  # {MARKS['published']}",
        *(f"{key.removeprefix('platform_')} = {value}" for key, value in PERIODS.items()),
    ]
    path = DATA / "platforms" / f"{NAME}.toml"
    write_files({path: "\n".join(text) + "\n"})
    return path


if __name__ == "__main__":
    print(write())
