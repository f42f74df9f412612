"""Platform and turbine descriptions: text files in, checked frozen objects out.

A built-in name or a path to a user's own file works everywhere. Every wrong value is reported with
the file, the key, the value and the allowed range, all of them at once. Sea states: sea_state.py.
"""

import math
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from fowt_env.descriptions.files import DATA, locate, raise_problems, read_toml
from fowt_env.descriptions.records import (
    Finite,
    NonNegative,
    Positive,
    Record,
    bounded,
    to_si,
    validate,
)
from fowt_env.descriptions.turbine import Inertia, Vector3, turbine_file, turbine_names
from fowt_env.errors import InputError

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


# --------------------------------------------------------------------------- readers


def _platform_file(name):
    return DATA / "platforms" / f"{name}.toml"


def platform_names():
    """Sorted names of the built-in platforms."""
    return sorted(path.stem for path in (DATA / "platforms").glob("*.toml"))


def read_platform(name_or_path: str | Path) -> Platform:
    """Platform from a built-in name (platform_names()) or a user's TOML file.

    The turbine of the result is a built-in name or an absolute path; in the file it is relative to the file.
    """
    path = locate("platform", name_or_path, platform_names(), _platform_file)
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
            turbine = locate("turbine", data["turbine"], turbine_names(), turbine_file, path.parent)
            if data["turbine"] not in turbine_names():
                data["turbine"] = str(turbine.resolve())
        except InputError as error:
            problems.append(f"turbine: {error}")
    platform, found = validate(Platform, {**data, **free}, origin)
    raise_problems(f"platform file {str(path)!r}", problems + found)
    return platform


class _MooringFile(Record):
    mooring: MooringSpread
