"""The paper's 1:50 model as description files: Froude-scaled OC3-Hywind with an identified mooring.

The paper prints neither masses nor mooring. Hull, tower, rotor and hydrodynamic constants are OC3-Hywind by
Froude's law. Identified, so that the six computed periods of Table 1 come out: stiffness EA, anchor radius
and length of the taut lines (theory.md Eqs. (18)(19)), the floater's pitch inertia, and its mass, which
keeps the weight, the pull of the lines and the buoyancy in balance at the design draft. One factor on
the polars gives the Froude-scaled rated thrust in the rated condition of the paper (LC2), whose wind is
twice the Froude-scaled one: at the model's Reynolds number airfoils lift less.

`python -m fowt_env.training.studies.froude_model.identify` writes the files anew.
"""

from math import cos, hypot, pi, sin, sqrt

import numpy as np
from scipy.optimize import brentq, fsolve

from fowt_env.analysis.linear_model import natural_periods
from fowt_env.analysis.trim import trim_prescribed
from fowt_env.descriptions.platform import DATA, Line, read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.files.atomic import replacing
from fowt_env.plant.mooring import catenary
from fowt_env.scene.build import build_scene

NAME = "liu_1_50"
TURBINE = NAME
SCALE = 50.0
WATER = 1000.0  # kg/m3: a fresh-water tank, a choice; the paper does not say
DEPTH = 4.0  # m: 200 m at full scale, the depth of the tests by Koo et al. that the paper's mooring is from
PERIODS = {  # s, Table 1, computed
    "surge": 10.24, "sway": 10.24, "heave": 3.66, "roll": 4.27, "platform_pitch": 4.27, "yaw": 3.15,
}  # fmt: skip
AZIMUTHS = (0.0, 120.0, 240.0)  # deg, of the anchors, as in OC3
BRIDLE = 60.0  # deg to either side: the hull points of a delta, half-way to the next line's
WET_WEIGHT = 0.02  # N/m, a thin wire: its sag (below 0.3 % of the span) does not matter, a choice
RATED_WIND = 3.36  # m/s, LC2
RATED_SPEED = 85.6 * RPM  # rad/s, LC2
RATED_THRUST = 703e3  # N at full scale: NREL 5 MW at 11.4 m/s, blade pitch 0
START = (110.0, 3.4, 0.93, 13.5)  # EA N, anchor radius m, length over span, pitch inertia kg m2


class Froude:
    """Factors from full scale to the model; forces and masses also scale with the water density."""

    length = 1.0 / SCALE
    time = 1.0 / sqrt(SCALE)
    speed = 1.0 / sqrt(SCALE)

    def __init__(self, full_water):
        density = WATER / full_water
        self.mass = density / SCALE**3
        self.inertia = density / SCALE**5
        self.force = density / SCALE**3
        self.moment = density / SCALE**4
        self.linear_damping = density / SCALE**2.5  # N/(m/s)
        self.angular_damping = density / SCALE**4.5  # N m/(rad/s)


def lines(EA, anchor_radius, stretch, fairlead_radius, fairlead_z):
    """Six Line records: each of three mooring lines is a pair from its anchor to two points of the hull.

    stretch: unstretched length over the straight distance at rest.
    """
    result = []
    for azimuth in AZIMUTHS:
        anchor = _point(anchor_radius, azimuth, -DEPTH)
        for side in (-BRIDLE, BRIDLE):
            fairlead = _point(fairlead_radius, azimuth + side, fairlead_z)
            span = float(np.linalg.norm(np.subtract(anchor, fairlead)))
            result.append(
                Line(anchor=anchor, fairlead=fairlead, length=stretch * span, wet_weight=WET_WEIGHT, EA=EA)
            )
    return tuple(result)


def _point(radius, azimuth, z):
    angle = azimuth * DEGREE
    return (round(radius * cos(angle), 12), round(radius * sin(angle), 12), z)


def pull_at_rest(line):
    """Catenary of a line with the platform at its design position."""
    dx, dy, dz = np.subtract(line.fairlead, line.anchor)
    return catenary(hypot(dx, dy), dz, line.length, line.wet_weight, line.EA, 0.0, 0.0)


def displaced_volume(hull):
    """m3 below still water."""
    total = 0.0
    tops = [*hull.z[1:-1], 0.0]
    for low, high, a, b in zip(hull.z[:-1], tops, hull.diameter[:-1], hull.diameter[1:], strict=True):
        total += (high - low) * pi / 12.0 * (a * a + a * b + b * b)
    return total


def model_turbine():
    """The NREL 5 MW turbine at model scale, driven directly: no gearbox, no generator inertia."""
    full = read_turbine("nrel5mw")
    f = Froude(read_platform("oc3_hywind").environment.water_density)
    rotor, nacelle, law, gear = full.rotor, full.nacelle, full.torque_law, full.drivetrain.gear_ratio
    power = f.force * f.speed
    torque, speed = f.moment * gear, 1.0 / (f.time * gear)  # from the high-speed shaft to the model's own
    scaled = {
        "name": TURBINE,
        "rated_rotor_speed": full.rated_rotor_speed / f.time,
        "rated_wind_speed": full.rated_wind_speed * f.speed,
        "cut_in_wind_speed": full.cut_in_wind_speed * f.speed,
        "cut_out_wind_speed": full.cut_out_wind_speed * f.speed,
        "overspeed": full.overspeed / f.time,
        "rotor": {
            "blades": rotor.blades,
            "mass": rotor.mass * f.mass,
            "overhang": rotor.overhang * f.length,
            "hub_height": rotor.hub_height * f.length,
            "hub_radius": rotor.hub_radius * f.length,
            "tip_radius": rotor.tip_radius * f.length,
            "inertia": rotor.inertia * f.inertia,
            "inertia_diameter": rotor.inertia_diameter * f.inertia,
            "blade_mass": rotor.blade_mass * f.mass,
            "blade_first_moment": rotor.blade_first_moment * f.mass * f.length,
            "blade_second_moment": rotor.blade_second_moment * f.inertia,
        },
        "nacelle": {
            "mass": nacelle.mass * f.mass,
            "cm_downwind": nacelle.cm_downwind * f.length,
            "cm_height": nacelle.cm_height * f.length,
            "inertia": [value * f.inertia for value in nacelle.inertia],
        },
        "drivetrain": {"gear_ratio": 1.0, "generator_inertia": 0.0, "generator_efficiency": 1.0},
        "pitch_drive": {
            "time_constant": 0.0,
            "rate_limit": full.pitch_drive.rate_limit / f.time,
            "minimum_deg": 0.0,
            "maximum_deg": 90.0,
        },
        "torque_law": {
            "rated_torque": law.rated_torque * torque,
            "rated_power": law.rated_power * power,
            "rated_speed": law.rated_speed * speed,
            "cut_in_speed": law.cut_in_speed * speed,
            "region2_start_speed": law.region2_start_speed * speed,
            "region2_constant": law.region2_constant * torque / speed**2,
            "transition_speed": law.transition_speed * speed,
            "slip_percent": law.slip_percent,
            "region3_min_pitch": law.region3_min_pitch,
            "max_torque": law.max_torque * torque,
            "max_torque_rate": law.max_torque_rate * torque / f.time,
            "speed_filter_corner": law.speed_filter_corner / f.time,
        },
    }
    for name, gains in full.gains.items():
        scaled[f"gains.{name}"] = {
            "KP": gains.KP / speed,
            "KI": gains.KI / (speed * f.time),
            "gain_schedule_pitch": gains.gain_schedule_pitch,
        }
    scaled["blade"] = {"stations": "blade.csv", "polars": "polars"}
    return scaled


def froude_platform(turbine):
    """(Platform without moorings, Froude) of OC3-Hywind at model scale."""
    full = read_platform("oc3_hywind")
    f = Froude(full.environment.water_density)
    hull = full.hull.model_copy(
        update={
            "z": tuple(z * f.length for z in full.hull.z),
            "diameter": tuple(d * f.length for d in full.hull.diameter),
        }
    )
    tower = full.tower
    heights = ("cm_height", "base_height", "top_height", "base_diameter", "top_diameter")
    damping = (*[f.linear_damping] * 3, *[f.angular_damping] * 3)
    hydro = full.hydro.model_copy(
        update={
            "heave_added_mass": full.hydro.heave_added_mass * f.mass,
            "linear_damping": tuple(
                value * factor for value, factor in zip(full.hydro.linear_damping, damping, strict=True)
            ),
            "yaw_stiffness": 0.0,
        }
    )
    platform = full.model_copy(
        update={
            "name": NAME,
            "turbine": turbine,
            "environment": full.environment.model_copy(
                update={"water_density": WATER, "water_depth": DEPTH, "shear_exponent": 0.0}
            ),
            "ballast": full.ballast.model_copy(
                update={
                    "mass": full.ballast.mass * f.mass,
                    "cm_depth": full.ballast.cm_depth * f.length,
                    "inertia": tuple(value * f.inertia for value in full.ballast.inertia),
                }
            ),
            "hull": hull,
            "hydro": hydro,
            "tower": tower.model_copy(
                update={
                    "mass": tower.mass * f.mass,
                    "inertia": tuple(value * f.inertia for value in tower.inertia),
                    **{name: getattr(tower, name) * f.length for name in heights},
                    "modes": None,
                }
            ),
            "lines": (),
            "published": {},
        }
    )
    return platform, f


def candidate(base, above, f, unknowns):
    """Platform with the unknowns put in, ballast balancing buoyancy and lines. above: kg above the hull."""
    EA, anchor_radius, stretch, inertia = unknowns
    full = read_platform("oc3_hywind").lines[0].fairlead
    moorings = lines(EA, anchor_radius, stretch, full[0] * f.length, full[2] * f.length)
    down = sum(pull_at_rest(line).V for line in moorings)
    environment = base.environment
    mass = environment.water_density * displaced_volume(base.hull) - down / environment.gravity - above
    ballast = base.ballast.model_copy(
        update={"mass": mass, "inertia": (inertia, inertia, base.ballast.inertia[2])}
    )
    return base.model_copy(update={"lines": moorings, "ballast": ballast})


def identify(turbine=TURBINE):
    """(Platform, {motion: period s}) with the four unknowns that give the periods of Table 1."""
    base, f = froude_platform(turbine)
    machine = read_turbine(turbine)
    above = base.tower.mass + machine.nacelle.mass + machine.rotor.mass
    wanted = ("surge", "heave", "yaw", "platform_pitch")

    def misses(logarithms):
        platform = candidate(base, above, f, np.exp(logarithms))
        periods = natural_periods(build_scene(platform, fidelity="reference"))
        return [np.log(periods[name] / PERIODS[name]) for name in wanted]

    solution, _, found, text = fsolve(misses, np.log(START), xtol=1e-9, full_output=True)
    if found != 1:
        raise RuntimeError(f"the periods of Table 1 are not reached: {text}")
    platform = candidate(base, above, f, np.exp(solution))
    return platform, natural_periods(build_scene(platform, fidelity="reference"))


def weakened(turbine, factor):
    """The turbine with the coefficients of all its polars times a factor."""
    scale = np.array([1.0, factor, factor, factor])
    polars = {name: polar * scale for name, polar in turbine.blade.polars.items()}
    return turbine.model_copy(update={"blade": turbine.blade.model_copy(update={"polars": polars})})


def polar_factor(platform):
    """Factor on the full-scale polars that gives the Froude-scaled rated thrust in LC2, platform fixed."""
    turbine = read_turbine(TURBINE)
    turbine = turbine.model_copy(
        update={"blade": turbine.blade.model_copy(update={"polars": read_turbine("nrel5mw").blade.polars})}
    )
    target = RATED_THRUST * Froude(read_platform("oc3_hywind").environment.water_density).force

    def excess(factor):
        options = {"turbine": weakened(turbine, factor), "fidelity": "reference"}
        scene = build_scene(platform, wind=RATED_WIND, **options)
        point = trim_prescribed(scene, RATED_SPEED, 0.0, platform="fixed")
        return 1e3 * point["RotThrust"] - target

    return brentq(excess, 0.2, 1.0, xtol=1e-9)


def toml_value(value):
    """A TOML value, numbers to 10 digits."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    return repr(value) if isinstance(value, int) else f"{float(value):.10g}"


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


def write_polars(folder, factor):
    """Write the full-scale polars times a factor."""
    for name, polar in read_turbine("nrel5mw").blade.polars.items():
        lines_of_text = [
            f"# {name} of nrel5mw, all coefficients times {factor:.8g} (froude_model/identify.py).",
            "alpha_deg,cl,cd,cm",
        ]
        for alpha, *coefficients in polar:
            values = ",".join(f"{factor * value:.8g}" for value in coefficients)
            lines_of_text.append(f"{alpha / DEGREE:.6g},{values}")
        with replacing(folder / f"{name}.csv") as path:
            path.write_text("\n".join(lines_of_text) + "\n")


def write_turbine(factor):
    """Write the turbine's folder."""
    folder = DATA / "turbines" / TURBINE
    write_polars(folder / "polars", factor)
    full = read_turbine("nrel5mw").blade
    rows = [
        "# Blade of nrel5mw at 1:50, lengths by Froude's law; twist and airfoils as they are.",
        "radius_m,chord_m,twist_deg,airfoil",
    ]
    rows += [
        f"{r / SCALE:.8g},{c / SCALE:.8g},{t / DEGREE:.8g},{name}"
        for r, c, t, name in zip(full.radius, full.chord, full.twist, full.airfoil, strict=True)
    ]
    with replacing(folder / "blade.csv") as path:
        path.write_text("\n".join(rows) + "\n")
    tables = model_turbine()
    text = [TURBINE_HEADER]
    text += [f"{key} = {toml_value(value)}" for key, value in tables.items() if not isinstance(value, dict)]
    for name, table in tables.items():
        if isinstance(table, dict):
            text += [f"\n[{name}]", *(f"{key} = {toml_value(value)}" for key, value in table.items())]
    with replacing(folder / "turbine.toml") as path:
        path.write_text("\n".join(text) + "\n")


def write():
    """Path of the platform file, after identifying everything and writing turbine and platform anew."""
    write_turbine(1.0)
    platform, _ = identify()
    factor = polar_factor(platform)
    write_turbine(factor)
    text = [PLATFORM_HEADER, f'name = "{NAME}"', f'turbine = "{TURBINE}"']
    text.append('source = "Liu et al. 2023, J. Vib. Eng. 36(4) 892-902; OC3-Hywind by Froude\'s law"')
    for name in ("environment", "ballast", "hull", "hydro", "tower"):
        text.append(f"\n[{name}]  # {MARKS[name]}")
        values = getattr(platform, name).model_dump()
        text += [f"{key} = {toml_value(value)}" for key, value in values.items() if value is not None]
    text.append(
        "\n# Three taut lines, each a pair from anchor to two points of the hull, 60 deg to either side: that"
        "\n# stands for the delta connection. EA (wire, spring), length, anchor radius: identified; fairlead"
        "\n# radius and depth: Froude; wet weight, anchor depth, bridle angle: choice."
    )
    for line in platform.lines:
        text += ["\n[[lines]]", *(f"{key} = {toml_value(value)}" for key, value in line.model_dump().items())]
    text += [
        "\n[published]",
        f"polar_factor = {factor:.8g}  # identified, already in the polars: Froude-scaled 703 kN in LC2",
        f"\n[published.natural_periods]  # {MARKS['published']}",
        *(f"{key.removeprefix('platform_')} = {value}" for key, value in PERIODS.items()),
    ]
    path = DATA / "platforms" / f"{NAME}.toml"
    with replacing(path) as temporary:
        temporary.write_text("\n".join(text) + "\n")
    return path


if __name__ == "__main__":
    print(write())
