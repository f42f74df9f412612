"""Describes platforms and reads them from TOML files into checked, frozen records.

A built-in name or a path to a user's file is accepted everywhere. All wrong values of a file are reported
together, each with file, key, value and allowed range.
"""

import math
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from fowt_env.descriptions.files import DATA, locate, noted, raise_problems, read_toml
from fowt_env.descriptions.potential_flow import PotentialFlow, read_potential_flow
from fowt_env.descriptions.records import (
    Finite,
    FloatArray,
    NonNegative,
    Position,
    Positive,
    Record,
    bounded,
    to_si,
    validate,
)
from fowt_env.descriptions.tower_modes import TowerBending, mass_problem, read_tower_modes
from fowt_env.descriptions.turbine import Inertia, Turbine, Vector3, read_turbine, turbine_names
from fowt_env.errors import InputError

SixNumbers = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
SixBySix = tuple[SixNumbers, SixNumbers, SixNumbers, SixNumbers, SixNumbers, SixNumbers]
SixDamping = tuple[NonNegative, NonNegative, NonNegative, NonNegative, NonNegative, NonNegative]


class Environment(Record):
    """Holds the site and fluid constants (SI)."""

    gravity: Positive = 9.80665
    water_density: Positive = 1025.0
    air_density: NonNegative = 1.225
    water_depth: Positive
    shear_exponent: bounded(ge=0, le=1) = 0.14


class Ballast(Record):
    """Holds the mass properties of the floater with its ballast, as one rigid body."""

    mass: Positive
    cm_depth: Position  # below still water, positive downwards, m
    inertia: Inertia  # about the centre of mass, kg m2
    cm_downwind: Position = 0.0  # of the tower axis, m
    cm_left: Position = 0.0  # looking downwind, m


class Hull(Record):
    """Holds the outer shape: diameters linear between heights, from the keel to above the water."""

    # far larger than any structure, so that volumes and their moments are finite
    z: tuple[bounded(ge=-1e4, le=1e4), ...]  # m, body frame, increasing
    diameter: tuple[bounded(gt=0, le=1e4), ...]  # m, the last two equal (the water-piercing cylinder)

    def _problems(self):
        if len(self.z) != len(self.diameter) or len(self.z) < 2:
            sizes = f"{len(self.z)} and {len(self.diameter)}"
            yield f"z and diameter need the same length, at least 2; got {sizes}"
            return
        if any(b <= a for a, b in zip(self.z[:-1], self.z[1:], strict=True)):
            yield f"z = {list(self.z)}: must increase from the keel upwards"
        if not self.z[0] < 0.0 < self.z[-1]:
            yield f"z = {list(self.z)}: must start below 0 and end above 0 (still water)"
        if self.diameter[-1] != self.diameter[-2] or self.z[-2] >= 0.0:
            yield f"diameter = {list(self.diameter)}: the section through the water line must be a cylinder"


class HydroCoefficients(Record):
    """Holds strip coefficients, axial terms and the additional linear terms of the platform."""

    added_mass_coefficient: NonNegative  # C_A, transverse
    drag_coefficient: NonNegative  # C_D, transverse
    heave_added_mass: NonNegative  # A33, kg
    axial_drag_coefficient: NonNegative = 0.0  # C_Dz on the keel plate
    linear_damping: SixDamping = (0.0,) * 6  # surge, sway, heave N/(m/s); roll, pitch, yaw N m/(rad/s)
    yaw_stiffness: NonNegative = 0.0  # delta lines, N m/rad
    added_mass: SixBySix | None = None  # additional constant matrix about the body origin, kg, kg m, kg m2

    def _problems(self):
        if self.added_mass is not None:
            matrix = np.array(self.added_mass)
            scale = np.abs(matrix).max()
            if np.abs(matrix - matrix.T).max() > 1e-6 * scale:
                yield "added_mass: must be symmetric, 6 rows of 6 numbers"
            elif np.linalg.eigvalsh(matrix)[0] < -1e-9 * scale:
                yield "added_mass: must be positive semidefinite: it has a negative eigenvalue"


class AdditionalLoads(Record):
    """Holds constant and linear load terms about the body origin, and quadratic damping.

    Load = preload - stiffness q in inertial axes, with q surge to yaw, and - linear_damping nu -
    quadratic_damping |nu| nu in body axes: HydroDyn's AddF0, AddCLin, AddBLin and AddBQuad.
    """

    preload: SixNumbers = (0.0,) * 6  # N, N m
    stiffness: SixBySix | None = None  # N/m, N/rad, N m/m, N m/rad
    linear_damping: SixBySix | None = None  # N/(m/s) ...
    quadratic_damping: SixBySix | None = None  # N/(m/s)^2 ...

    def _problems(self):
        for name in ("linear_damping", "quadratic_damping"):
            rows = getattr(self, name)
            for i, row in enumerate(rows or ()):
                if row[i] < 0.0:
                    yield f"{name}.{i + 1}.{i + 1} = {row[i]:g}: must be >= 0 to dissipate energy"


class Straight(Record):
    """Provides the base of parts between two points of the body."""

    start: Vector3  # m
    end: Vector3

    def _problems(self):
        if math.dist(self.start, self.end) < 1e-6:
            yield f"start = {list(self.start)}: must differ from end"


class Member(Straight):
    """Describes a straight cylinder of the hull, of any direction and taper, for strip (Morison) loads.

    start, end in body axes; end 1 is the start. The coefficients multiply 1/2 rho D |v| v, rho A a and, on
    an end that is an outer face of the hull, 1/2 rho A |v| v and the added mass of a half sphere.
    """

    diameter: tuple[Positive, Positive]  # m, at start and end
    drag_coefficient: tuple[NonNegative, NonNegative]
    added_mass_coefficient: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    pressure_coefficient: tuple[NonNegative, NonNegative] = (1.0, 1.0)  # of the undisturbed wave pressure
    axial_drag_coefficient: tuple[NonNegative, NonNegative] = (0.0, 0.0)  # of the ends
    axial_added_mass_coefficient: tuple[NonNegative, NonNegative] = (0.0, 0.0)
    axial_pressure_coefficient: tuple[NonNegative, NonNegative] = (1.0, 1.0)
    potential_flow: bool = False  # part of the potential-flow body: drag alone, no inertia or buoyancy


class Shape(Straight):
    """Describes a straight part of the hull for pictures, round or a box of horizontal axis, without loads.

    For hulls with loads from another model, such as a radiation database or a cylinder of equal drag.
    """

    diameter: Positive | None = None  # m
    section: tuple[Positive, Positive] | None = None  # m, width and height of a box

    def _problems(self):
        yield from super()._problems()
        if (self.diameter is None) == (self.section is None):
            yield "diameter: must be given if section is not, and only then"


class TowerSections(Record):
    """Describes the tower at heights above still water, for its influence on the wind of the blades."""

    height: FloatArray  # m, increasing
    diameter: FloatArray  # m
    drag_coefficient: FloatArray
    turbulence_intensity: FloatArray  # in the tower's wake

    def _problems(self):
        heights = self.height
        if len(heights) < 2 or (np.diff(heights) <= 0.0).any():
            yield f"height = {heights.tolist()}: must be two or more increasing numbers"
        for key, (low, high) in SECTION_LIMITS.items():
            values = getattr(self, key)
            if len(values) != len(heights):
                yield f"{key}: has {len(values)} values; must be one for each height, {len(heights)}"
            elif not ((values >= low) & (values <= high)).all():
                yield f"{key} = {values.tolist()}: each must be in [{low:g}, {high:g}]"


SECTION_LIMITS = {
    "diameter": (0.01, 50.0),
    "drag_coefficient": (0.0, 10.0),
    "turbulence_intensity": (0.05, 1.0),
}
TURBULENCE = 0.1  # turbulence intensity in the tower's wake of a platform file without sections


def tower_sections(tower):
    """Return (height, diameter, drag coefficient, turbulence intensity), each (k,), of a Tower."""
    if tower.sections is not None:
        sections = tower.sections
        return sections.height, sections.diameter, sections.drag_coefficient, sections.turbulence_intensity
    return (
        np.array([tower.base_height, tower.top_height]),
        np.array([tower.base_diameter, tower.top_diameter]),
        np.full(2, tower.drag_coefficient),
        np.full(2, TURBULENCE),
    )


class Tower(Record):
    """Describes the tower as one rigid body, with taper for the wind drag and optional bending modes."""

    mass: NonNegative
    cm_height: Position
    inertia: Inertia  # about the centre of mass
    base_height: Position
    top_height: Position
    base_diameter: Positive
    top_diameter: Positive
    drag_coefficient: NonNegative = 1.0
    modes: TowerBending | None = None
    sections: TowerSections | None = None  # for its influence on the wind; None: the taper

    def _problems(self):
        if self.top_height <= self.base_height:
            yield f"top_height = {self.top_height}: must be > base_height = {self.base_height} m"
        elif self.modes is not None:
            yield from mass_problem(self.modes, self.mass, self.top_height - self.base_height)


class MovingLine(Record):
    """Holds what a moving line of lumped masses needs beyond a catenary, as MoorDyn does.

    Coefficients multiply 1/2 rho D |v| v across the line, 1/2 rho pi D |v| v along it and the displaced mass.
    """

    segments: Annotated[int, Field(strict=True, ge=4, le=500)] = 20
    diameter: Positive  # of a cylinder with the displaced volume, m; the mass follows from wet_weight
    drag_coefficient: NonNegative
    axial_drag_coefficient: NonNegative = 0.0
    added_mass_coefficient: NonNegative = 1.0
    axial_added_mass_coefficient: NonNegative = 0.0
    damping_ratio: NonNegative = 1.0  # of a segment along the line, MoorDyn's -BA
    seabed_stiffness: Positive = 3e6  # per area of diameter times length, Pa/m
    seabed_damping: NonNegative = 3e5  # Pa s/m


class LineProperties(Record):
    """Holds the properties of a mooring line."""

    length: Positive  # unstretched, m
    wet_weight: Positive  # per length, N/m
    EA: Positive  # N
    seabed_friction: NonNegative = 0.0  # C_B
    dynamics: MovingLine | None = None  # for mooring = "dynamic"; None: the platform's line_dynamics


class Line(LineProperties):
    """Describes a mooring line; anchor in inertial, fairlead in body coordinates, m."""

    anchor: Vector3
    fairlead: Vector3


class Platform(Record):
    """Describes a floating platform with its tower and moorings; names its turbine."""

    name: str
    turbine: str
    environment: Environment
    ballast: Ballast
    tower: Tower
    hull: Hull | None = None  # a slender spar, with the coefficients of its strips in hydro
    hydro: HydroCoefficients | None = None
    potential_flow: PotentialFlow | None = None
    additional: AdditionalLoads | None = None
    members: tuple[Member, ...] = ()
    shapes: tuple[Shape, ...] = ()  # drawn in place of hull and members
    lines: tuple[Line, ...] = ()
    line_dynamics: MovingLine | None = None  # of lines without their own dynamics
    options: dict = Field(default_factory=dict)  # defaults of the options of build_scene
    published: dict = Field(default_factory=dict)  # values that tests compare with
    source: str = ""

    @property
    def draft(self) -> float:
        """Return the depth of the lowest part of the hull, m; an estimate if no file specifies the draft."""
        if self.hull is not None:
            return -self.hull.z[0]
        if self.potential_flow is not None and self.potential_flow.draft is not None:
            return self.potential_flow.draft
        depths = [-point[2] for member in self.members for point in (member.start, member.end)]
        depths += [-line.fairlead[2] for line in self.lines]
        if self.potential_flow is not None:
            depths.append(self.potential_flow.volume ** (1.0 / 3.0) / 3.0)
        return max(depths)

    def _problems(self):
        if (self.hull is None) != (self.hydro is None):
            yield _missing_half("hydro" if self.hydro is None else "hull")
        elif self.hull is not None and self.potential_flow is not None:
            yield "potential_flow: a platform has potential_flow or hull, not both"
        elif self.hull is None and self.potential_flow is None and not self.members:
            yield "hull is missing: a platform needs hull and hydro, potential_flow or members"
        depth = self.environment.water_depth
        for i, line in enumerate(self.lines, 1):
            key = f"lines.{i}.anchor z = {line.anchor[2]}"
            if not -depth - 1e-6 <= line.anchor[2] <= 0.0:
                yield f"{key}: must be between -water_depth = {-depth} and 0 m"
            if line.anchor[2] >= line.fairlead[2]:
                yield f"{key}: must be below its fairlead at {line.fairlead[2]} m"
        if self.hull is not None and self.hull.z[0] < -depth:
            yield f"hull.z.1 = {self.hull.z[0]}: must be >= -water_depth = {-depth} m"


def _missing_half(name):
    """Return the problem line for a hull without strip coefficients, or vice versa."""
    return f"{name} is missing: must be a table; a platform has hull and hydro, or neither"


class MooringSpread(LineProperties):
    """Describes equal mooring lines around the tower axis, a short form in platform files."""

    azimuth: tuple[Finite, ...]  # of the anchors, rad from +x towards +y
    anchor_radius: Positive
    anchor_z: Finite
    fairlead_radius: NonNegative
    fairlead_z: Finite

    def lines(self):
        """Return a Line per azimuth, with directions rounded so that symmetric spreads stay symmetric."""
        directions = [(round(math.cos(angle), 14), round(math.sin(angle), 14)) for angle in self.azimuth]
        return tuple(
            Line(
                anchor=(self.anchor_radius * x, self.anchor_radius * y, self.anchor_z),
                fairlead=(self.fairlead_radius * x, self.fairlead_radius * y, self.fairlead_z),
                **{key: getattr(self, key) for key in LineProperties.model_fields},
            )
            for x, y in directions
        )


# --------------------------------------------------------------------------- readers


def platform_names():
    """Return the sorted names of the built-in platforms."""
    return sorted(path.stem for path in (DATA / "platforms").glob("*.toml"))


def read_platform(name_or_path: str | Path) -> Platform:
    """Return the Platform from a built-in name (platform_names()) or a user's TOML file.

    The turbine of the result is a built-in name or an absolute path; in the file it is relative to the file.
    """
    folder = DATA / "platforms"
    path = locate("platform", name_or_path, platform_names(), lambda name: folder / f"{name}.toml")
    if path.suffix.lower() == ".fst":
        raise InputError(f"platform file {str(path)!r} is an OpenFAST deck: `fowt import` it first")
    data = read_toml(path, "platform")
    problems = []
    free = {key: data.pop(key) for key in ("options", "published") if key in data}
    data, origin = to_si(data, problems)
    if "mooring" in data:
        if "lines" in data:
            problems.append("lines: given twice, also as [mooring]; allowed: one of them")
        group, invalid = validate(_MooringFile, {"mooring": data.pop("mooring")}, origin)
        problems += invalid
        data["lines"] = group.mooring.lines() if group else ()
    for key in ("lines", "members", "shapes"):
        if isinstance(data.get(key), list):
            data[key] = tuple(data[key])
    if "potential_flow" in data:
        site, _ = validate(Environment, data.get("environment"))
        gravity, density = (9.80665, 1025.0) if site is None else (site.gravity, site.water_density)
        table = data.pop("potential_flow")
        with noted(problems, "potential_flow: "):
            data["potential_flow"] = read_potential_flow(table, path.parent, gravity, density)
    tower = data.get("tower")
    if isinstance(tower, dict) and "modes" in tower:
        data["tower"] = {key: value for key, value in tower.items() if key != "modes"}
        with noted(problems):
            data["tower"]["modes"] = read_tower_modes(tower["modes"], path.parent)
    if isinstance(name := data.get("turbine"), str) and name not in turbine_names():
        with noted(problems, "turbine: "):
            data["turbine"] = str(locate("turbine", name, turbine_names(), folder=path.parent).resolve())
    if ("hull" in data) != ("hydro" in data):
        problems.append(_missing_half("hydro" if "hull" in data else "hull"))
    platform, invalid = validate(Platform, {**data, **free}, origin)
    raise_problems(f"platform file {str(path)!r}", list(dict.fromkeys(problems + invalid)))
    return platform


class _MooringFile(Record):
    mooring: MooringSpread


def turbine_of(platform, turbine=None):
    """Return the Turbine of a platform or its replacement `turbine`; each a name, a path or a record."""
    if turbine is None:
        turbine = (platform if isinstance(platform, Platform) else read_platform(platform)).turbine
    return turbine if isinstance(turbine, Turbine) else read_turbine(turbine)
