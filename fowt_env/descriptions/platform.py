"""Platform and turbine descriptions: text files in, checked frozen objects out.

A built-in name or a path to a user's own file works everywhere. Every wrong value is reported with
the file, the key, the value and the allowed range, all of them at once. Sea states: sea_state.py.
"""

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from fowt_env.descriptions.files import DATA, column, locate, raise_problems, read_table, read_toml
from fowt_env.descriptions.records import (
    Finite,
    FloatArray,
    Fraction,
    NonNegative,
    Positive,
    Record,
    bounded,
    to_si,
    validate,
)
from fowt_env.descriptions.sea_state import (
    SeaState,
    iec_gamma,
    joint_sea_state,
    joint_tables,
    read_sea_state,
    sea_state_of,
    sea_states,
)
from fowt_env.errors import InputError, unknown

__all__ = [  # the one place to import descriptions from
    "Ballast",
    "Blade",
    "Drivetrain",
    "Environment",
    "Hull",
    "HydroCoefficients",
    "Line",
    "MooringSpread",
    "Nacelle",
    "PitchDrive",
    "PitchGains",
    "Platform",
    "Rotor",
    "SeaState",
    "TorqueLaw",
    "Tower",
    "Turbine",
    "iec_gamma",
    "joint_sea_state",
    "joint_tables",
    "names",
    "read_platform",
    "read_sea_state",
    "read_turbine",
    "sea_state_of",
    "sea_states",
]

Vector3 = tuple[Finite, Finite, Finite]
Inertia = tuple[NonNegative, NonNegative, NonNegative]
SixNumbers = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
SixBySix = tuple[SixNumbers, SixNumbers, SixNumbers, SixNumbers, SixNumbers, SixNumbers]
SixDamping = tuple[NonNegative, NonNegative, NonNegative, NonNegative, NonNegative, NonNegative]


class Environment(Record):
    """Site and fluid constants (SI)."""

    gravity: Positive = 9.80665
    water_density: Positive = 1025.0
    air_density: NonNegative = 1.225
    water_depth: Positive
    shear_exponent: bounded(ge=0, le=1) = 0.14


class Ballast(Record):
    """Floater with its ballast, as one rigid body."""

    mass: Positive
    cm_depth: Finite  # below still water, positive downwards, m
    inertia: Inertia  # about its own centre of mass, kg m2


class Hull(Record):
    """Outer shape: diameters linear between heights, keel first, ending above the water."""

    # far beyond any structure, so that volumes and their moments are finite
    z: tuple[bounded(ge=-1e4, le=1e4), ...]  # m, body frame, increasing
    diameter: tuple[bounded(gt=0, le=1e4), ...]  # m, the last two equal (the water-piercing cylinder)

    @model_validator(mode="after")
    def _shape(self):
        if len(self.z) != len(self.diameter) or len(self.z) < 2:
            raise ValueError(
                f"z and diameter need the same length, at least 2; got {len(self.z)} and {len(self.diameter)}"
            )
        if any(b <= a for a, b in zip(self.z[:-1], self.z[1:], strict=True)):
            raise ValueError(f"z = {list(self.z)}: must increase from the keel upwards")
        if not self.z[0] < 0.0 < self.z[-1]:
            raise ValueError(f"z = {list(self.z)}: must start below 0 and end above 0 (still water)")
        if self.diameter[-1] != self.diameter[-2] or self.z[-2] >= 0.0:
            raise ValueError(
                f"diameter = {list(self.diameter)}: the section through the water line must be a cylinder"
            )
        return self


class HydroCoefficients(Record):
    """Strip coefficients, axial terms and the additional linear terms of the platform."""

    added_mass_coefficient: NonNegative  # C_A, transverse
    drag_coefficient: NonNegative  # C_D, transverse
    heave_added_mass: NonNegative  # A33, kg
    axial_drag_coefficient: NonNegative = 0.0  # C_Dz on the keel plate
    linear_damping: SixDamping = (0.0,) * 6  # surge, sway, heave N/(m/s); roll, pitch, yaw N m/(rad/s)
    yaw_stiffness: NonNegative = 0.0  # delta lines, N m/rad
    added_mass: SixBySix | None = None  # further constant one about the body origin, kg, kg m, kg m2

    @model_validator(mode="after")
    def _added_mass(self):
        if self.added_mass is not None:
            matrix = np.array(self.added_mass)
            scale = np.abs(matrix).max()
            if np.abs(matrix - matrix.T).max() > 1e-6 * scale:
                raise ValueError("added_mass: must be symmetric, 6 rows of 6 numbers")
            if np.linalg.eigvalsh(matrix)[0] < -1e-9 * scale:
                raise ValueError("added_mass: must be positive semidefinite: it has a negative eigenvalue")
        return self


class Tower(Record):
    """Rigid tower, with the taper that its drag needs."""

    mass: NonNegative
    cm_height: Finite
    inertia: Inertia  # about its own centre of mass
    base_height: Finite
    top_height: Finite
    base_diameter: Positive
    top_diameter: Positive
    drag_coefficient: NonNegative = 1.0

    @model_validator(mode="after")
    def _heights(self):
        if self.top_height <= self.base_height:
            raise ValueError(f"top_height = {self.top_height}: must be > base_height = {self.base_height} m")
        return self


class Line(Record):
    """One mooring line. anchor in inertial, fairlead in body coordinates, m."""

    anchor: Vector3
    fairlead: Vector3
    length: Positive  # unstretched, m
    wet_weight: Positive  # per length, N/m
    EA: Positive  # N
    seabed_friction: NonNegative = 0.0  # C_B


class Platform(Record):
    """A floating platform with its tower and moorings; names its turbine."""

    name: str
    turbine: str
    environment: Environment
    ballast: Ballast
    hull: Hull
    hydro: HydroCoefficients
    tower: Tower
    lines: tuple[Line, ...] = ()
    options: dict = Field(default_factory=dict)  # defaults of build_scene's options
    published: dict = Field(default_factory=dict)  # figures that tests compare with
    source: str = ""

    @model_validator(mode="after")
    def _depths(self):
        depth = self.environment.water_depth
        problems = []
        for i, line in enumerate(self.lines, 1):
            key = f"lines.{i}.anchor z = {line.anchor[2]}"
            if not -depth - 1e-6 <= line.anchor[2] <= 0.0:
                problems.append(f"{key}: must be between -water_depth = {-depth} and 0 m")
            if line.anchor[2] >= line.fairlead[2]:
                problems.append(f"{key}: must be below its fairlead at {line.fairlead[2]} m")
        if self.hull.z[0] < -depth:
            problems.append(f"hull.z.1 = {self.hull.z[0]}: must be >= -water_depth = {-depth} m")
        if problems:
            raise ValueError("\n".join(problems))
        return self


class MooringSpread(Record):
    """Equal lines around the tower axis, as platform files may give them."""

    azimuth: tuple[Finite, ...]  # of the anchors, rad from +x towards +y
    anchor_radius: Positive
    anchor_z: Finite
    fairlead_radius: NonNegative
    fairlead_z: Finite
    length: Positive
    wet_weight: Positive
    EA: Positive
    seabed_friction: NonNegative = 0.0

    def lines(self):
        """One Line per azimuth; directions are rounded to 14 decimals to keep symmetric spreads symmetric."""
        directions = [(round(math.cos(angle), 14), round(math.sin(angle), 14)) for angle in self.azimuth]
        return tuple(
            Line(
                anchor=(self.anchor_radius * x, self.anchor_radius * y, self.anchor_z),
                fairlead=(self.fairlead_radius * x, self.fairlead_radius * y, self.fairlead_z),
                length=self.length,
                wet_weight=self.wet_weight,
                EA=self.EA,
                seabed_friction=self.seabed_friction,
            )
            for x, y in directions
        )


class Nacelle(Record):
    """Nacelle with the generator rotor locked; positions relative to the tower axis and still water."""

    mass: NonNegative
    cm_downwind: Finite
    cm_height: Finite
    inertia: Inertia  # about its own centre of mass


class Rotor(Record):
    """Rotor masses and geometry at zero tilt and cone."""

    blades: Annotated[int, Field(strict=True, ge=1, le=6)] = 3
    mass: Positive
    overhang: Finite  # rotor centre upwind of the tower axis, positive length
    hub_height: Positive
    hub_radius: Positive
    tip_radius: Positive
    inertia: Positive  # about the shaft
    inertia_diameter: Positive  # about a diameter

    @model_validator(mode="after")
    def _radii(self):
        if self.tip_radius <= self.hub_radius:
            raise ValueError(f"tip_radius = {self.tip_radius}: must exceed hub_radius = {self.hub_radius}")
        return self


class Drivetrain(Record):
    """Rigid shaft with gearbox; losses as in theory.md Eq. (7)."""

    gear_ratio: Positive
    generator_inertia: NonNegative  # about the high-speed shaft
    mesh_loss: NonNegative = 0.0  # zeta_m
    bearing_loss: NonNegative = 0.0  # zeta_v
    generator_efficiency: Fraction


class PitchDrive(Record):
    """Blade-pitch actuator. time_constant 0: the command is followed at once."""

    time_constant: NonNegative  # tau_p, s
    rate_limit: Positive  # rad/s
    minimum: Finite  # rad
    maximum: Finite  # rad

    @model_validator(mode="after")
    def _limits(self):
        if self.maximum <= self.minimum:
            raise ValueError(f"maximum = {self.maximum}: must exceed minimum = {self.minimum}")
        return self


class TorqueLaw(Record):
    """Generator torque against filtered high-speed-shaft speed (theory.md, section 3)."""

    rated_torque: Positive  # N m, high-speed shaft
    rated_power: Positive  # mechanical, W
    rated_speed: Positive  # rad/s, high-speed shaft
    cut_in_speed: Positive
    region2_start_speed: Positive
    region2_constant: Positive  # N m/(rad/s)^2
    transition_speed: Positive  # region 2.5 to 3
    slip_percent: Positive
    region3_min_pitch: NonNegative  # rad
    max_torque: Positive
    max_torque_rate: Positive
    speed_filter_corner: Positive  # rad/s

    @model_validator(mode="after")
    def _order(self):
        if not self.cut_in_speed < self.region2_start_speed < self.transition_speed <= self.rated_speed:
            raise ValueError(
                f"cut_in_speed = {self.cut_in_speed}, region2_start_speed = {self.region2_start_speed}, "
                f"transition_speed = {self.transition_speed}, rated_speed = {self.rated_speed}: "
                "must be cut_in_speed < region2_start_speed < transition_speed <= rated_speed"
            )
        if self.max_torque < self.rated_torque:
            raise ValueError(f"max_torque = {self.max_torque}: must be >= rated_torque = {self.rated_torque}")
        return self


class PitchGains(Record):
    """Published PI gains on generator speed, and their schedule."""

    KP: Positive  # s
    KI: Positive  # -
    gain_schedule_pitch: Positive  # beta_K, rad


class Blade(Record):
    """Blade stations (increasing radius) with one polar each.

    The stations are those where the aerodynamics are evaluated. The line loads fall to zero at the hub and
    tip radius of the Rotor, which are not stations.
    """

    radius: FloatArray  # (n,) m from the rotor axis
    chord: FloatArray  # (n,) m
    twist: FloatArray  # (n,) rad, positive towards feather
    airfoil: tuple[str, ...]  # (n,)
    polars: dict[str, np.ndarray]  # name -> (m, 4): alpha rad from -pi to pi, cl, cd, cm

    @model_validator(mode="after")
    def _stations(self):
        sizes = [len(values) for values in (self.radius, self.chord, self.twist, self.airfoil)]
        if len(set(sizes)) != 1 or sizes[0] < 2:
            raise ValueError(f"radius, chord, twist, airfoil need the same length, at least 2; got {sizes}")
        for name, bad, rule in (
            ("radius", ~(np.diff(self.radius, prepend=0.0) > 0), "increasing, > 0"),
            ("chord", ~(np.isfinite(self.chord) & (self.chord > 0)), "finite, > 0"),
            ("twist", ~np.isfinite(self.twist), "finite"),
        ):
            if bad.any():
                first = int(np.argmax(bad))
                raise ValueError(f"{name}.{first + 1} = {getattr(self, name)[first]}: must be {rule}")
        for name in self.airfoil:
            if name not in self.polars:
                raise ValueError(str(unknown("airfoil", name, self.polars)))
        for name, polar in self.polars.items():
            if problem := _polar_problem(polar):
                raise ValueError(f"polars.{name}: {problem}")
        return self


def _polar_problem(polar):
    """What is wrong with a (m, 4) polar in rad, in words; None if nothing is."""
    if polar.ndim != 2 or polar.shape[0] < 2 or polar.shape[1] != 4 or not np.isfinite(polar).all():
        return f"shape {polar.shape}: must be finite numbers, (m >= 2, 4)"
    degrees = np.degrees(polar[:, 0])
    steps = np.diff(degrees)
    if (steps <= 0).any():
        first = int(np.argmax(steps <= 0))
        return f"alpha = {degrees[first + 1]:g} deg after {degrees[first]:g} deg: must increase"
    if abs(degrees[0] + 180.0) > 1e-6 or abs(degrees[-1] - 180.0) > 1e-6:
        return f"alpha covers {degrees[0]:g} to {degrees[-1]:g} deg: must cover -180 to 180 deg"
    return None


class Turbine(Record):
    """A wind turbine: rotor, nacelle, drivetrain, actuator and its published controller data."""

    name: str
    rated_rotor_speed: Positive  # rad/s
    rated_wind_speed: Positive
    cut_in_wind_speed: Positive
    cut_out_wind_speed: Positive
    overspeed: Positive  # rad/s: failure threshold of the environment
    rotor: Rotor
    nacelle: Nacelle
    drivetrain: Drivetrain
    pitch_drive: PitchDrive
    torque_law: TorqueLaw
    gains: dict[Literal["oc3", "land"], PitchGains]
    blade: Blade
    source: str = ""

    @model_validator(mode="after")
    def _consistent(self):
        problems = []
        if not self.cut_in_wind_speed < self.rated_wind_speed < self.cut_out_wind_speed:
            problems.append(
                f"rated_wind_speed = {self.rated_wind_speed}: must be between cut_in_wind_speed = "
                f"{self.cut_in_wind_speed} and cut_out_wind_speed = {self.cut_out_wind_speed}"
            )
        if self.overspeed <= self.rated_rotor_speed:
            problems.append(
                f"overspeed = {self.overspeed:g}: must be > rated_rotor_speed = {self.rated_rotor_speed:g}"
            )
        hub, tip = self.rotor.hub_radius, self.rotor.tip_radius
        for i, radius in enumerate(self.blade.radius, 1):
            if not hub < radius < tip:
                problems.append(
                    f"blade.radius.{i} = {radius:g}: must be > hub_radius = {hub} and < tip_radius = {tip} m"
                )
        if problems:
            raise ValueError("\n".join(problems))
        return self


# --------------------------------------------------------------------------- readers


def names(kind):
    """Sorted built-in names of a kind: "platforms", "turbines", "sea_states" or "joint_tables"."""
    if kind == "platforms":
        return sorted(path.stem for path in (DATA / "platforms").glob("*.toml"))
    if kind == "turbines":
        return sorted(path.parent.name for path in (DATA / "turbines").glob("*/turbine.toml"))
    if kind == "sea_states":
        return sorted(sea_states())
    if kind == "joint_tables":
        return sorted(joint_tables())
    raise unknown("kind of description", kind, ("platforms", "turbines", "sea_states", "joint_tables"))


def _platform_file(name):
    return DATA / "platforms" / f"{name}.toml"


def _turbine_file(name):
    return DATA / "turbines" / name / "turbine.toml"


def read_platform(name_or_path: str | Path) -> Platform:
    """Platform from a built-in name (names("platforms")) or a user's TOML file.

    The turbine of the result is a built-in name or an absolute path; in the file it is relative to the file.
    """
    path = locate("platform", name_or_path, names("platforms"), _platform_file)
    data = read_toml(path, "platform")
    problems = []
    free = {key: data.pop(key) for key in ("options", "published") if key in data}
    data, origin = to_si(data, problems)
    if "mooring" in data:
        if "lines" in data:
            problems.append("lines: given twice, also as [mooring]; allowed: one of them")
        group, found = validate(_MooringFile, {"mooring": data.pop("mooring")}, origin)
        problems += found
        data["lines"] = group.mooring.lines() if group else ()
    if isinstance(data.get("lines"), list):
        data["lines"] = tuple(data["lines"])
    if isinstance(data.get("turbine"), str):
        try:
            turbine = locate("turbine", data["turbine"], names("turbines"), _turbine_file, path.parent)
            if data["turbine"] not in names("turbines"):
                data["turbine"] = str(turbine.resolve())
        except InputError as error:
            problems.append(f"turbine: {error}")
    platform, found = validate(Platform, {**data, **free}, origin)
    raise_problems(f"platform file {str(path)!r}", problems + found)
    return platform


class _MooringFile(Record):
    mooring: MooringSpread


def read_turbine(name_or_path: str | Path) -> Turbine:
    """Turbine from a built-in name (names("turbines")) or a user's TOML file.

    blade.stations and blade.polars are paths relative to the file or, if not there, to the folder of the
    built-in turbines ("nrel5mw/blade.csv", "nrel5mw/polars").
    """
    path = locate("turbine", name_or_path, names("turbines"), _turbine_file)
    problems = []
    data, origin = to_si(read_toml(path, "turbine"), problems)
    blade, blade_problems = validate(_BladeFile, {"blade": data.pop("blade")} if "blade" in data else {})
    if blade is not None:
        try:
            data["blade"] = _read_blade(blade.blade, path.parent)
        except InputError as error:
            blade_problems.append(str(error))
    turbine, found = validate(Turbine, data, origin)
    if blade_problems:  # which say why the record has no blade
        found = [problem for problem in found if not problem.startswith("blade is missing")]
    raise_problems(f"turbine file {str(path)!r}", problems + found + blade_problems)
    return turbine


class _BladeTable(Record):
    stations: str
    polars: str


class _BladeFile(Record):
    blade: _BladeTable


def _beside(folder, text):
    """Path relative to folder or else to the built-in turbines; the first if neither exists."""
    try:
        mine = folder / Path(text).expanduser()
        builtin = DATA / "turbines" / text
        return builtin if builtin.exists() and not mine.exists() else mine
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"path {text[:60]!r} cannot be used: {error}") from None


def _read_blade(table, folder):
    """Blade from the station file and polar folder that a turbine file names."""
    path = _beside(folder, table.stations)
    rows = read_table(path, "blade", ("radius_m", "chord_m", "twist_deg", "airfoil"))
    problems = []
    radius = column(rows, "radius_m", problems, 0.0)
    chord = column(rows, "chord_m", problems, 0.0)
    twist = np.deg2rad(column(rows, "twist_deg", problems, -180.0, 180.0, open_ends=False))
    for (number, row), before, here in zip(rows[1:], radius[:-1], radius[1:], strict=True):
        if here <= before:
            problems.append(f"line {number}: radius_m = {row['radius_m']}: must increase from row to row")
    if len(rows) < 2:
        problems.append("has 1 row; allowed: at least 2")
    polar_folder = _beside(folder, table.polars)
    try:
        files = {file.stem: file for file in sorted(polar_folder.glob("*.csv"))}
    except (OSError, ValueError) as error:
        raise InputError(f"polars folder {str(polar_folder)!r} cannot be read: {error}") from None
    if not files:
        raise InputError(f"blade.polars = {table.polars!r}: no CSV files in a folder {str(polar_folder)!r}")
    airfoils = tuple(row["airfoil"] for _, row in rows)
    polars = {}
    for (number, _), name in zip(rows, airfoils, strict=True):
        if name not in files:
            problems.append(f"line {number}: {unknown('airfoil', name, files)}")
        elif name not in polars:
            polars[name] = _read_polar(files[name])
    raise_problems(f"blade file {str(path)!r}", problems)
    return Blade(radius=radius, chord=chord, twist=twist, airfoil=airfoils, polars=polars)


def _read_polar(path):
    """(m, 4) array alpha (rad), cl, cd, cm of a polar file."""
    rows = read_table(path, "polar", ("alpha_deg", "cl", "cd", "cm"))
    problems = []
    alpha = column(rows, "alpha_deg", problems, -180.0, 180.0, open_ends=False)
    coefficients = [column(rows, name, problems) for name in ("cl", "cd", "cm")]
    polar = np.column_stack([np.deg2rad(alpha), *coefficients])
    if not problems and (problem := _polar_problem(polar)):
        problems.append(problem)
    raise_problems(f"polar file {str(path)!r}", problems)
    return polar
