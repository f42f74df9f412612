"""Writes description files of a platform and turbine scaled by Froude's law.

Lengths scale with L, speeds and times with sqrt(L), masses and forces with L^3 (same water and air), power
with L^3.5: 10 MW from 5 MW is L = 2^(1/3.5) = 1.219. Blade twist, polars and all coefficients are unchanged.

The result is similar to the original, not a design: masses of real turbines grow less than L^3, rated wind
speed does not grow with size, and no such turbine exists. Without settings (--help) the built-in
oc3_froude_10mw is written.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.platform import DATA, read_platform
from fowt_env.descriptions.protection import TripLimit
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing

PLATFORM, TURBINE = "oc3_hywind", "nrel5mw"
POWER_EXPONENT = 3.5
SAME, TIME, SPEED, RATE = 0.0, 0.5, 0.5, -0.5  # exponents of the scale; RATE: per time
LENGTH, MASS, FORCE, INERTIA, MOMENT = 1.0, 3.0, 3.0, 5.0, 4.0
MASSIVE = 2.0  # smallest exponent of a quantity proportional to mass
SECOND_ORDER = {  # of a pitch drive
    "natural_frequency": RATE, "damping": SAME, "acceleration_limit": 2.0 * RATE, "deadband": SAME,
    "friction": SAME,
}  # fmt: skip
EXPONENTS = {  # record: {field: exponent of the scale, or one for each entry}
    "environment": {
        "gravity": SAME, "water_density": SAME, "air_density": SAME, "water_depth": LENGTH,
        "shear_exponent": SAME,
    },
    "ballast": {
        "mass": MASS, "cm_depth": LENGTH, "cm_downwind": LENGTH, "cm_left": LENGTH, "inertia": INERTIA,
    },
    "hull": {"z": LENGTH, "diameter": LENGTH},
    "hydro": {
        "added_mass_coefficient": SAME, "drag_coefficient": SAME, "heave_added_mass": MASS,
        "axial_drag_coefficient": SAME, "yaw_stiffness": MOMENT,
        "linear_damping": (*[FORCE - SPEED] * 3, *[MOMENT - RATE] * 3),
        "added_mass": [[MASS] * 3 + [MASS + LENGTH] * 3] * 3 + [[MASS + LENGTH] * 3 + [INERTIA] * 3] * 3,
    },
    "tower": {
        "mass": MASS, "cm_height": LENGTH, "inertia": INERTIA, "base_height": LENGTH, "top_height": LENGTH,
        "base_diameter": LENGTH, "top_diameter": LENGTH, "drag_coefficient": SAME,
    },
    "lines": {
        "anchor": LENGTH, "fairlead": LENGTH, "length": LENGTH, "wet_weight": FORCE - LENGTH, "EA": FORCE,
        "seabed_friction": SAME,
    },
    "turbine": {
        "rated_rotor_speed": RATE, "rated_wind_speed": SPEED, "cut_in_wind_speed": SPEED,
        "cut_out_wind_speed": SPEED, "overspeed": RATE,
    },
    "rotor": {
        "blades": SAME, "mass": MASS, "overhang": LENGTH, "hub_height": LENGTH, "hub_radius": LENGTH,
        "tip_radius": LENGTH, "inertia": INERTIA, "inertia_diameter": INERTIA, "shaft_tilt": SAME,
        "cone": SAME, "cm_offset": LENGTH, "blade_mass": MASS, "blade_first_moment": MASS + LENGTH,
        "blade_second_moment": INERTIA,
    },
    "nacelle": {
        "mass": MASS, "cm_downwind": LENGTH, "cm_left": LENGTH, "cm_height": LENGTH, "inertia": INERTIA,
    },
    "drivetrain": {  # same gear ratio: generator speed falls with rotor speed
        "gear_ratio": SAME, "generator_inertia": INERTIA, "mesh_loss": SAME, "bearing_loss": SAME,
        "generator_efficiency": SAME, "torque_time_constant": TIME,
    },
    "pitch_drive": {
        "time_constant": TIME, "rate_limit": RATE, "minimum": SAME, "maximum": SAME, **SECOND_ORDER,
        "second_order": SAME,
    },
    "second_order": SECOND_ORDER,
    "protection": {
        "overspeed": SAME, "overpower": SAME, "acceleration": SAME, "pitch_deviation": SAME,
        "normal_rate": RATE, "emergency_rate": RATE, "off_speed": SAME, "start_rate": RATE,
        "connect_speed": SAME,
    },
    "trip": {"limit": SAME, "time": TIME, "stop": SAME},
    "torque_law": {
        "rated_torque": MOMENT, "rated_power": POWER_EXPONENT, "rated_speed": RATE, "cut_in_speed": RATE,
        "region2_start_speed": RATE, "region2_constant": MOMENT - 2.0 * RATE, "transition_speed": RATE,
        "slip_percent": SAME, "region3_min_pitch": SAME, "max_torque": MOMENT,
        "max_torque_rate": MOMENT - TIME, "speed_filter_corner": RATE,
    },
    "gains": {"KP": TIME, "KI": SAME, "gain_schedule_pitch": SAME},
}  # fmt: skip
PUBLISHED = {  # published values that are scaled; others are not copied
    "displaced_volume": 3.0, "total_mass": MASS, "weight": FORCE, "buoyancy": FORCE, "mooring_preload": FORCE,
    "waterplane_stiffness": 2.0,
}  # fmt: skip
LABEL = """\
# FROUDE-SCALED FROM {origin}, NOT A REAL {what}: every value is that of {origin} times a power of
# the scale {scale:.6g}, lengths by the first, times and speeds by its root, masses and forces by the third.
# It was neither designed nor built; a turbine of this power would be lighter and reach its rated power at
# less wind. SI units (kg, m, s, N, rad). Written by training/studies/froude_model/scale.py."""


def toml_value(value):
    """Return a TOML value as text, numbers to 10 digits."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return (
        f'"{value}"' if isinstance(value, str) else f"{value}" if isinstance(value, int) else f"{value:.10g}"
    )


def entries(values):
    """Return the lines of a TOML table without its heading."""
    return [f"{key} = {toml_value(value)}" for key, value in values.items()]


def toml_table(heading, values):
    """Return an empty line and the lines of a TOML table."""
    return ["", f"[{heading}]", *entries(values)]


def write_files(texts):
    """Write {path: text}, each file atomically."""
    for file, text in texts.items():
        with replacing(file) as temporary:
            temporary.write_text(text)


def scaled(record, name, scale, density=1.0):
    """Return {field: value} of the fields set in a record, multiplied by powers of the scale.

    name: key of EXPONENTS; density: ratio of water densities, which multiplies quantities with an exponent of
    MASSIVE or more (proportional to mass). Fields with a separate table are omitted.
    """
    result = {}
    for field, value in record.model_dump(exclude_unset=True, exclude_none=True).items():
        if field not in EXPONENTS[name] or isinstance(value, dict):
            continue
        exponent = EXPONENTS[name][field]
        if isinstance(value, float):
            value = value * scale**exponent * (density if exponent >= MASSIVE else 1.0)
        elif not isinstance(value, int | str):
            factor = scale ** np.asarray(exponent) * np.where(np.asarray(exponent) >= MASSIVE, density, 1.0)
            value = (np.asarray(value) * factor).tolist()
        result[field] = value
    return result


def turbine_text(turbine, name, scale, polars="polars"):
    """Return the text of the turbine file of a scaled Turbine. polars: folder of the polars."""
    lines = [LABEL.format(origin=turbine.name, what="TURBINE", scale=scale), "", f'name = "{name}"']
    lines.append(f'source = "{turbine.name} by Froude\'s law, scale {scale:.6g}; not a real turbine"')
    lines += entries(scaled(turbine, "turbine", scale))
    for part in ("rotor", "nacelle", "drivetrain", "pitch_drive", "protection", "torque_law"):
        lines += toml_table(part, scaled(getattr(turbine, part), part, scale))
    if (drive := turbine.pitch_drive.second_order) is not None:
        lines += toml_table("pitch_drive.second_order", scaled(drive, "second_order", scale))
    for which, trip in turbine.protection:
        if isinstance(trip, TripLimit) and which in turbine.protection.model_fields_set:
            lines += toml_table(f"protection.{which}", scaled(trip, "trip", scale))
    for gain_set, gains in turbine.gains.items():
        lines += toml_table(f"gains.{gain_set}", scaled(gains, "gains", scale))
    lines += toml_table("blade", {"stations": "blade.csv", "polars": polars})
    return "\n".join(lines) + "\n"


def platform_text(platform, name, turbine_name, scale):
    """Return the text of the platform file of a scaled Platform."""
    lines = [LABEL.format(origin=platform.name, what="PLATFORM", scale=scale), ""]
    lines += [f'name = "{name}"', f'turbine = "{turbine_name}"']
    lines.append(f'source = "{platform.name} by Froude\'s law, scale {scale:.6g}; not a real platform"')
    for part in ("environment", "ballast", "hull", "hydro", "tower"):
        lines += toml_table(part, scaled(getattr(platform, part), part, scale))
    for line in platform.lines:
        lines += ["", "[[lines]]", *entries(scaled(line, "lines", scale))]
    published = platform.published
    results = {key: published[key] * scale**power for key, power in PUBLISHED.items() if key in published}
    periods = {key: value * scale**TIME for key, value in published.get("natural_periods", {}).items()}
    tables = {"options": platform.options, "published": results, "published.natural_periods": periods}
    for heading, values in tables.items():
        if values:
            lines += toml_table(heading, values)
    return "\n".join(lines) + "\n"


def stations_text(blade, scale, words, digits=10):
    """Return the text of a scaled blade file; words: first line."""
    rows = [words, "radius_m,chord_m,twist_deg,airfoil"]
    columns = (blade.radius * scale, blade.chord * scale, blade.twist / DEGREE, blade.airfoil)
    for *values, airfoil in zip(*columns, strict=True):
        rows.append(",".join([*(f"{value:.{digits}g}" for value in values), airfoil]))
    return "\n".join(rows) + "\n"


def polar_files(turbine, words, angle_digits=10, digits=10):
    """Return {file name: text} of the polars of a turbine; words: follow the name in the first line."""
    files = {}
    for name, polar in turbine.blade.polars.items():
        rows = [f"# {name} {words}", "alpha_deg,cl,cd,cm"]
        for alpha, *values in polar:
            rows.append(f"{alpha / DEGREE:.{angle_digits}g}," + ",".join(f"{v:.{digits}g}" for v in values))
        files[f"{name}.csv"] = "\n".join(rows) + "\n"
    return files


def write(scale, folder, name, platform=PLATFORM, turbine=TURBINE):
    """Write folder/platforms/<name>.toml and folder/turbines/<name>; return the path of the platform file.

    scale: of lengths, > 0; platform, turbine: originals, as in read_platform and read_turbine.
    Raises: InputError for an invalid scale or description.
    """
    check_number("scale", scale, 0.001, 100.0)
    folder = Path(folder)
    machine = read_turbine(turbine)
    home = folder / "turbines" / name
    words = f"# Blade of {machine.name}, lengths times {scale:.6g}, twist unchanged (froude_model/scale.py)."
    texts = {home / "blade.csv": stations_text(machine.blade, scale, words)}
    polars = "polars"
    if (DATA / "turbines" / str(turbine) / polars).is_dir():
        polars = f"{turbine}/polars"  # polars of a built-in turbine are accessible from any folder
    else:
        files = polar_files(machine, f"of {machine.name}, unchanged (froude_model/scale.py).")
        texts |= {home / polars / file: text for file, text in files.items()}
    texts[home / "turbine.toml"] = turbine_text(machine, name, scale, polars)
    path = folder / "platforms" / f"{name}.toml"
    where = name if folder == DATA else f"../turbines/{name}/turbine.toml"
    texts[path] = platform_text(read_platform(platform), name, where, scale)
    write_files(texts)
    return path


def scale_of_power(power, turbine=TURBINE):
    """Return the scale of lengths at which the turbine's rated electrical power becomes `power` (W)."""
    machine = read_turbine(turbine)
    original = machine.torque_law.rated_power * machine.drivetrain.generator_efficiency
    check_number("power", power, 0.0, low_open=True, allowed="a positive number of watts")
    return float((power / original) ** (1.0 / POWER_EXPONENT))


def main(
    power: Annotated[float, typer.Option(help="Rated electrical power, MW.")] = 10.0,
    name: Annotated[str, typer.Option(help="Name of the platform and turbine.")] = "oc3_froude_10mw",
    out: Annotated[str | None, typer.Option(help="Folder; default: the built-in descriptions.")] = None,
    platform: Annotated[str, typer.Option(help="Original platform.")] = PLATFORM,
    turbine: Annotated[str, typer.Option(help="Original turbine.")] = TURBINE,
) -> None:
    """Write a Froude-scaled platform and turbine as description files."""
    try:
        scale = scale_of_power(power * 1e6, turbine)
        path = write(scale, DATA if out is None else out, name, platform, turbine)
    except InputError as error:
        raise SystemExit(f"Error: {error}") from None
    print(f"{path}: scale {scale:.6g}")


if __name__ == "__main__":
    typer.run(main)
