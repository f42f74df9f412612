"""Describes turbines (nacelle, rotor, drivetrain, blade with polars) and reads them from TOML files."""

import math
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from fowt_env.descriptions.blade_structure import (
    BladeStructure,
    Shaft,
    StructureTable,
    mass_problems,
    read_blade_structure,
)
from fowt_env.descriptions.checks import is_number
from fowt_env.descriptions.files import DATA, column, locate, noted, raise_problems, read_table, read_toml
from fowt_env.descriptions.protection import Protection
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
from fowt_env.descriptions.rotor_mass import BLADE_MASSES
from fowt_env.errors import InputError, unknown

Vector3 = tuple[Finite, Finite, Finite]
Inertia = tuple[NonNegative, NonNegative, NonNegative]


class Nacelle(Record):
    """Holds nacelle masses, generator rotor locked; positions relative to tower axis and still water."""

    mass: NonNegative
    cm_downwind: Finite
    cm_height: Finite
    inertia: Inertia  # about the centre of mass
    cm_left: Finite = 0.0


BLADE_SLACK = 1.01  # tolerance for rounded values of a turbine file, or bent blades


class Rotor(Record):
    """Holds rotor masses and geometry; the rotor centre is the intersection of the blades' pitch axes."""

    blades: Annotated[int, Field(strict=True, ge=1, le=6)] = 3
    mass: Positive
    overhang: Finite  # rotor centre upwind of the tower axis, positive length
    hub_height: Positive
    hub_radius: Positive
    tip_radius: Positive
    inertia: Positive  # about the shaft
    inertia_diameter: Positive  # about a diameter through the rotor's centre of mass
    shaft_tilt: bounded(gt=-0.5, lt=0.5) = 0.0  # rad, positive: the upwind end points up
    cone: bounded(gt=-0.5, lt=0.5) = 0.0  # rad, positive: blades lean upwind, away from the tower
    cm_offset: Finite = 0.0  # centre of mass from the rotor centre along the shaft, downwind, m
    blade_mass: NonNegative | None = None  # of one blade, kg; blade outputs need mass and moments
    blade_first_moment: NonNegative | None = None  # kg m, about the blade's root, along the pitch axis
    blade_second_moment: NonNegative | None = None  # kg m2, about the blade's root

    def _problems(self):
        if self.tip_radius <= self.hub_radius:
            yield f"tip_radius = {self.tip_radius}: must exceed hub_radius = {self.hub_radius}"
            return
        values = {key: getattr(self, key) for key in BLADE_MASSES}
        missing = [key for key, value in values.items() if value is None]
        if missing and len(missing) < len(values):
            yield f"{missing[0]}: is missing; {', '.join(BLADE_MASSES)} are required together"
        if missing:
            return
        mass, first, second = values.values()
        if self.blades * mass > self.mass * BLADE_SLACK:
            yield f"blade_mass = {mass:g}: must be <= mass/blades = {self.mass / self.blades:g}"
        longest = mass * (self.tip_radius - self.hub_radius)
        if first > longest * BLADE_SLACK:
            yield f"blade_first_moment = {first:g}: must be <= {longest:g}, blade_mass at the tip"
        if first * first > mass * second * BLADE_SLACK:  # a product overflows to inf, a power raises
            least = first * first / mass if mass else math.inf
            yield f"blade_second_moment = {second:g}: must be >= blade_first_moment**2/blade_mass = {least:g}"
        about_shaft = second + 2.0 * self.hub_radius * first + self.hub_radius * self.hub_radius * mass
        about_shaft *= self.blades * np.cos(self.cone) ** 2
        if about_shaft > self.inertia * BLADE_SLACK:
            yield (
                f"blade_second_moment = {second:g}: about the blade's root; all blades together have"
                f" {about_shaft:g} about the shaft, must be <= inertia = {self.inertia:g}"
            )


class Drivetrain(Record):
    """Describes a rigid shaft with gearbox; losses as in theory.md Eq. (7)."""

    gear_ratio: Positive
    generator_inertia: NonNegative  # about the high-speed shaft
    mesh_loss: NonNegative = 0.0  # zeta_m
    bearing_loss: NonNegative = 0.0  # zeta_v
    generator_efficiency: Fraction
    torque_time_constant: Positive | None = None  # s, of generator and converter; None: no lag


class SecondOrderDrive(Record):
    """Describes a second-order blade-pitch drive: frequency, damping ratio, optional nonlinearities."""

    natural_frequency: bounded(gt=0, le=100)  # w, rad/s
    damping: bounded(gt=0, le=5)  # zeta
    acceleration_limit: Positive | None = None  # rad/s2
    deadband: NonNegative = 0.0  # rad, change of the command that is ignored
    friction: NonNegative = 0.0  # rad, distance from the command at which a blade at rest begins to move


class PitchDrive(SecondOrderDrive):
    """Describes a blade-pitch drive: first order by time_constant, second by natural_frequency and damping.

    time_constant 0: no lag. second_order is an alternative drive of the same turbine, selected by the option
    pitch_drive of a scene.
    """

    time_constant: NonNegative | None = None  # tau_p, s
    rate_limit: Positive  # rad/s
    minimum: Finite  # rad
    maximum: Finite  # rad
    natural_frequency: bounded(gt=0, le=100) | None = None
    damping: bounded(gt=0, le=5) | None = None
    second_order: SecondOrderDrive | None = None

    def _problems(self):
        if self.maximum <= self.minimum:
            yield f"maximum = {self.maximum}: must exceed minimum = {self.minimum}"
        if self.natural_frequency is None and self.time_constant is None:
            yield (
                "time_constant is missing: must be a number >= 0; or natural_frequency and damping of a"
                " second-order drive"
            )
        if (self.natural_frequency is None) != (self.damping is None):
            missing = "damping" if self.damping is None else "natural_frequency"
            yield f"{missing} is missing: natural_frequency and damping are required together, each > 0"
        if self.natural_frequency is not None and self.time_constant is not None:
            yield (
                f"time_constant = {self.time_constant:g}: conflicts with natural_frequency and damping;"
                " allowed: time_constant (first order) or the other two (second order)"
            )
        for key in ("acceleration_limit", "deadband", "friction"):
            value = getattr(self, key)
            if self.natural_frequency is None and value:
                yield f"{key} = {value:g}: needs natural_frequency and damping"

    @property
    def lag(self):
        """Return the time constant (s) of the first-order lag with the same delay to a slow command."""
        if self.natural_frequency is None:
            return self.time_constant
        return 2.0 * self.damping / self.natural_frequency

    def slowed(self, factor):
        """Return a copy with the lag multiplied by factor."""
        if self.natural_frequency is None:
            return self.model_copy(update={"time_constant": factor * self.time_constant})
        return self.model_copy(update={"natural_frequency": self.natural_frequency / factor})


def with_second_order_drive(turbine):
    """Return the turbine with the drive of [pitch_drive.second_order]; unchanged if second-order already.

    Raises: InputError if the turbine file has no such table.
    """
    drive = turbine.pitch_drive
    if drive.natural_frequency is not None:
        return turbine
    if drive.second_order is None:
        raise InputError(
            f"pitch_drive = 'second_order': the turbine {turbine.name!r} has no [pitch_drive.second_order]"
            " with natural_frequency (rad/s) and damping in its file; allowed here 'file'"
        )
    settings = drive.second_order.model_dump() | {"time_constant": None}
    return turbine.model_copy(update={"pitch_drive": drive.model_copy(update=settings)})


class TorqueLaw(Record):
    """Describes generator torque against filtered high-speed-shaft speed (theory.md, section 3).

    A turbine file may omit derived values (with_torque_defaults), and may specify minimum_speed, as
    VS_MinOMSpd in a DISCON.IN of ROSCO, in place of cut_in_speed and region2_start_speed.
    """

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

    def _problems(self):
        if not self.cut_in_speed < self.region2_start_speed < self.transition_speed <= self.rated_speed:
            yield (
                f"cut_in_speed = {self.cut_in_speed}, region2_start_speed = {self.region2_start_speed}, "
                f"transition_speed = {self.transition_speed}, rated_speed = {self.rated_speed}: "
                "must be cut_in_speed < region2_start_speed < transition_speed <= rated_speed"
            )
        if self.max_torque < self.rated_torque:
            yield f"max_torque = {self.max_torque}: must be >= rated_torque = {self.rated_torque}"


REGION15 = 0.05  # of the minimum speed, the width of region 1.5
# Defaults of a torque law: key, the keys that its value is computed from, and the formula. The fractions are
# those of the NREL 5 MW turbine (NREL/TP-500-38060).
TORQUE_DEFAULTS = (
    ("rated_speed", ("rated_rotor_speed", "gear_ratio"), lambda rotor, ratio: rotor * ratio),
    ("rated_torque", ("rated_power", "rated_speed"), lambda power, speed: power / speed),
    ("rated_power", ("rated_torque", "rated_speed"), lambda torque, speed: torque * speed),
    ("cut_in_speed", ("minimum_speed",), lambda speed: speed),
    ("region2_start_speed", ("minimum_speed",), lambda speed: (1.0 + REGION15) * speed),
    # region 3: at 99 % of rated speed, or just below the speed where region 2 reaches rated torque if lower
    ("transition_speed", ("rated_speed", "rated_torque", "region2_constant"),
     lambda speed, torque, constant: min(0.99 * speed, 0.999 * (torque / constant) ** 0.5)),
    ("slip_percent", (), lambda: 10.0),
    ("region3_min_pitch", (), lambda: 0.01745329),  # rad, 1 deg
    ("max_torque", ("rated_torque",), lambda torque: 1.1 * torque),
    ("max_torque_rate", ("rated_torque",), lambda torque: 0.348 * torque),  # per second
    ("speed_filter_corner", ("rated_rotor_speed",), lambda rotor: 1.24 * rotor),  # 0.25 Hz
)  # fmt: skip


def with_torque_defaults(data):
    """Return the entries of a turbine (SI) with missing entries of torque_law computed by TORQUE_DEFAULTS.

    Values computed from anything but positive numbers stay missing.
    Raises: ValueError if minimum_speed is combined with a speed that it replaces.
    """
    law, drive = data.get("torque_law"), data.get("drivetrain")
    if not isinstance(law, dict):
        return data
    ratio = drive.get("gear_ratio") if isinstance(drive, dict) else getattr(drive, "gear_ratio", None)
    law, others = dict(law), {"rated_rotor_speed": data.get("rated_rotor_speed"), "gear_ratio": ratio}
    if "minimum_speed" in law:
        slowest = others["minimum_speed"] = law.pop("minimum_speed")
        conflicting = [key for key in ("cut_in_speed", "region2_start_speed") if key in law]
        if conflicting:
            raise ValueError(f"torque_law.{conflicting[0]}: conflicts with minimum_speed, which replaces it")
        if not (is_number(slowest) and slowest > 0.0):
            raise ValueError(f"torque_law.minimum_speed = {slowest!r}: must be a number > 0")
    for key, needs, value in TORQUE_DEFAULTS:
        known = [others.get(name, law.get(name)) for name in needs]
        if key not in law and all(is_number(number) and number > 0.0 for number in known):
            law[key] = value(*known)
    return data | {"torque_law": law}


class PitchGains(Record):
    """Holds published PI gains on generator speed and the gain schedule."""

    KP: Positive  # s
    KI: Positive  # -
    gain_schedule_pitch: Positive  # beta_K, rad


class Blade(Record):
    """Holds the blade stations (increasing radius) with one polar each.

    The aerodynamics are evaluated at these stations. The line loads fall to zero at the hub and tip radius of
    the Rotor, which are not stations.
    """

    radius: FloatArray  # (n,) m from the rotor centre along the pitch axis
    chord: FloatArray  # (n,) m
    twist: FloatArray  # (n,) rad, positive towards feather
    airfoil: tuple[str, ...]  # (n,)
    polars: dict[str, np.ndarray]  # name -> (m, 4): alpha rad from -pi to pi, cl, cd, cm
    prebend: FloatArray | None = None  # (n,) m, blade axis downwind of the pitch axis at zero pitch
    sweep: FloatArray | None = None  # (n,) m, blade axis from the pitch axis in the rotor plane, as BlSwpAC

    def _problems(self):
        sizes = [len(values) for values in (self.radius, self.chord, self.twist, self.airfoil)]
        sizes += [len(values) for values in (self.prebend, self.sweep) if values is not None]
        if len(set(sizes)) != 1 or sizes[0] < 2:
            yield f"radius, chord, twist, airfoil need the same length, at least 2; got {sizes}"
            return
        for name, bad, rule in (
            ("radius", ~(np.diff(self.radius, prepend=0.0) > 0), "increasing, > 0"),
            ("chord", ~(np.isfinite(self.chord) & (self.chord > 0)), "finite, > 0"),
            ("twist", ~np.isfinite(self.twist), "finite"),
        ):
            if bad.any():
                first = int(np.argmax(bad))
                yield f"{name}.{first + 1} = {getattr(self, name)[first]}: must be {rule}"
        for name in dict.fromkeys(self.airfoil):
            if name not in self.polars:
                yield str(unknown("airfoil", name, self.polars))
        for name, polar in self.polars.items():
            if problem := _polar_problem(polar):
                yield f"polars.{name}: {problem}"


def _polar_problem(polar):
    """Return the problem of a (m, 4) polar in rad as a text; None without one."""
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
    """Describes a wind turbine: rotor, nacelle, drivetrain, actuators and published controller data."""

    name: str
    rated_rotor_speed: Positive  # rad/s
    rated_wind_speed: Positive
    cut_in_wind_speed: Positive
    cut_out_wind_speed: Positive
    overspeed: Positive  # rad/s, failure threshold of environments
    rotor: Rotor
    nacelle: Nacelle
    drivetrain: Drivetrain
    pitch_drive: PitchDrive
    torque_law: TorqueLaw
    gains: dict[str, PitchGains] = {}  # published ones; without any, derived (controllers/gains.py)
    protection: Protection = Protection()
    blade: Blade
    blade_structure: BladeStructure | None = None  # of blades that bend; None: rigid blades alone
    shaft_torsion: Shaft | None = None  # None: a rigid shaft alone
    discon: str | None = None  # path of a DISCON.IN of ROSCO for this turbine
    source: str = ""

    @model_validator(mode="before")
    @classmethod
    def _torque_defaults(cls, data):
        return with_torque_defaults(data) if isinstance(data, dict) else data

    def _problems(self):
        if not self.cut_in_wind_speed < self.rated_wind_speed < self.cut_out_wind_speed:
            yield (
                f"rated_wind_speed = {self.rated_wind_speed}: must be between cut_in_wind_speed = "
                f"{self.cut_in_wind_speed} and cut_out_wind_speed = {self.cut_out_wind_speed}"
            )
        if self.overspeed <= self.rated_rotor_speed:
            yield f"overspeed = {self.overspeed:g}: must be > rated_rotor_speed = {self.rated_rotor_speed:g}"
        hub, tip = self.rotor.hub_radius, self.rotor.tip_radius
        for i, radius in enumerate(self.blade.radius, 1):
            if not hub < radius < tip:
                allowed = f"must be > hub_radius = {hub} and < tip_radius = {tip} m"
                yield f"blade.radius.{i} = {radius:g}: {allowed}"
        if self.blade_structure is not None:
            yield from mass_problems(self.blade_structure, self.rotor)


def turbine_file(name):
    """Return the path of the TOML file of a built-in turbine."""
    return DATA / "turbines" / name / "turbine.toml"


def turbine_names():
    """Return the sorted names of the built-in turbines."""
    return sorted(path.parent.name for path in (DATA / "turbines").glob("*/turbine.toml"))


def read_turbine(name_or_path: str | Path) -> Turbine:
    """Return the Turbine from a built-in name (turbine_names()) or a user's TOML file.

    blade.stations, blade.polars and blade_structure.distribution are paths relative to the file or, if not
    there, to the folder of the built-in turbines ("nrel5mw/blade.csv", "nrel5mw/polars"); so is discon.
    """
    path = locate("turbine", name_or_path, turbine_names(), turbine_file)
    problems = []
    data, origin = to_si(read_toml(path, "turbine"), problems)
    blade, blade_problems = validate(_BladeFile, {"blade": data.pop("blade")} if "blade" in data else {})
    if blade is not None:
        with noted(blade_problems):
            data["blade"] = _read_blade(blade.blade, path.parent)
    if "blade_structure" in data:
        structure, wrong = validate(_StructureFile, {"blade_structure": data.pop("blade_structure")}, origin)
        problems += wrong
        if structure is not None:
            table = structure.blade_structure
            with noted(problems):
                distribution = _beside(path.parent, table.distribution)
                data["blade_structure"] = read_blade_structure(table, distribution)
    if isinstance(data.get("discon"), str):
        with noted(problems):
            discon = _beside(path.parent, data["discon"])
            if not discon.is_file():
                allowed = "must be a file, relative to the turbine file's folder"
                raise InputError(f"discon = {data['discon'][:60]!r}: {allowed}")
            data["discon"] = str(discon.absolute())
    turbine, invalid = validate(Turbine, data, origin)
    if blade_problems:  # these problems explain why the record has no blade
        invalid = [problem for problem in invalid if not problem.startswith("blade is missing")]
    raise_problems(f"turbine file {str(path)!r}", problems + invalid + blade_problems)
    return turbine


class _BladeTable(Record):
    stations: str
    polars: str


class _BladeFile(Record):
    blade: _BladeTable


class _StructureFile(Record):
    blade_structure: StructureTable


def _beside(folder, text):
    """Return the path relative to folder or else to the built-in turbines; the first if neither exists."""
    try:
        mine = folder / Path(text).expanduser()
        builtin = DATA / "turbines" / text
        return builtin if builtin.exists() and not mine.exists() else mine
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"path {text[:60]!r} cannot be used: {error}") from None


def _read_blade(table, folder):
    """Return the Blade from the station file and polar folder that a turbine file names."""
    path = _beside(folder, table.stations)
    rows = read_table(
        path, "blade", ("radius_m", "chord_m", "twist_deg", "airfoil"), optional=("prebend_m", "sweep_m")
    )
    problems = []
    radius = column(rows, "radius_m", problems, 0.0, increasing=True)
    chord = column(rows, "chord_m", problems, 0.0)
    twist = np.deg2rad(column(rows, "twist_deg", problems, -180.0, 180.0, open_ends=False))
    if len(rows) < 2:
        problems.append("has 1 row; allowed: at least 2")
    polar_folder = _beside(folder, table.polars)
    try:
        files = {file.stem: file for file in sorted(polar_folder.glob("*.csv"))}
    except (OSError, ValueError) as error:
        raise InputError(f"polars folder {str(polar_folder)!r} cannot be read: {error}") from None
    if not files:
        raise InputError(f"blade.polars = {table.polars!r}: no CSV files in a folder {str(polar_folder)!r}")
    shapes = [name for name in ("prebend", "sweep") if f"{name}_m" in rows[0][1]]
    shape = {name: column(rows, f"{name}_m", problems) for name in shapes}
    airfoils = tuple(row["airfoil"] for _, row in rows)
    polars = {}
    for (number, _), name in zip(rows, airfoils, strict=True):
        if name not in files:
            problems.append(f"line {number}: {unknown('airfoil', name, files)}")
        elif name not in polars:
            polars[name] = _read_polar(files[name])
    raise_problems(f"blade file {str(path)!r}", problems)
    return Blade(radius=radius, chord=chord, twist=twist, airfoil=airfoils, polars=polars, **shape)


def _read_polar(path):
    """Return the (m, 4) array alpha (rad), cl, cd, cm of a polar file."""
    rows = read_table(path, "polar", ("alpha_deg", "cl", "cd", "cm"))
    problems = []
    alpha = column(rows, "alpha_deg", problems, -180.0, 180.0, open_ends=False)
    coefficients = [column(rows, name, problems) for name in ("cl", "cd", "cm")]
    polar = np.column_stack([np.deg2rad(alpha), *coefficients])
    if not problems and (problem := _polar_problem(polar)):
        problems.append(problem)
    raise_problems(f"polar file {str(path)!r}", problems)
    return polar
