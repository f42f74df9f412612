"""Describes flexible blades and the torsion of the shaft in turbine files.

As in ElastoDyn: distributed mass and stiffness, polynomial mode shapes of the blade clamped at its root, and
sums over equal elements.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from fowt_env.descriptions.files import column, raise_problems, read_table
from fowt_env.descriptions.records import FloatArray, NonNegative, Positive, Record
from fowt_env.descriptions.rotor_mass import BLADE_MASSES, BladeMass, blade_mass
from fowt_env.descriptions.tower_modes import END, Ratio, Shape
from fowt_env.descriptions.units import DEGREE

SHAPES = ("flap_1", "flap_2", "edge_1")
COLUMNS = (
    "span_fraction", "structural_twist_deg", "mass_density", "flapwise_stiffness", "edgewise_stiffness",
)  # fmt: skip
LARGEST = {"mass_density": 1e9, "flapwise_stiffness": 1e18, "edgewise_stiffness": 1e18}
MASS = 0.01  # largest deviation of the distributed mass and its moments from those of the rotor, relative


class BladeModes(Record):
    """Holds the table [blade_structure] except the distribution."""

    flap_1: Shape  # coefficients of x^2 to x^6, x from 0 at the root to 1 at the tip
    flap_2: Shape
    edge_1: Shape
    damping_ratio: tuple[Ratio, Ratio, Ratio]  # structural, of flap 1, flap 2, edge 1, without tip mass
    flap_tuner: tuple[Positive, Positive] = (1.0, 1.0)  # factor on the stiffness of each flapwise mode
    tip_mass: NonNegative = 0.0  # kg, of each blade, part of the rotor's blade_mass
    # number of equal elements, evaluated at midpoints, as ElastoDyn's BldNodes
    elements: Annotated[int, Field(strict=True, ge=1, le=999)] = 50

    def _problems(self):
        for name in SHAPES:
            total = sum(getattr(self, name))
            if abs(total - 1.0) > END:
                yield f"{name}: adds up to {total:g}; must be 1 (within {END}), at the tip"


class BladeStructure(BladeModes):
    """Holds the distributed properties of a flexible blade, linear between span fractions, and its modes."""

    span_fraction: FloatArray  # (n,) of the blade's length, from 0 at the root to 1 at the tip
    structural_twist: FloatArray  # (n,) rad, of the principal axes, positive towards feather
    mass_density: FloatArray  # (n,) kg/m
    flapwise_stiffness: FloatArray  # (n,) EI, N m2
    edgewise_stiffness: FloatArray  # (n,) EI, N m2

    def _problems(self):
        yield from super()._problems()
        names = ("span_fraction", "structural_twist", *LARGEST)
        sizes = [len(getattr(self, name)) for name in names]
        if len(set(sizes)) != 1 or sizes[0] < 2:
            yield f"{', '.join(names)} need the same length, at least 2; got {sizes}"
            return
        span = self.span_fraction
        if span[0] != 0.0 or span[-1] != 1.0 or not (np.diff(span) > 0.0).all():
            yield f"span_fraction: goes from {span[0]:g} to {span[-1]:g}; must increase from 0 to 1"
        for name, largest in LARGEST.items():
            values = getattr(self, name)
            wrong = ~((values > 0.0) & (values <= largest))
            if wrong.any():
                first = int(np.argmax(wrong))
                yield f"{name}.{first + 1} = {values[first]:g}: must be > 0 and <= {largest:g}"

    def lumps(self, hub_radius, tip_radius):
        """Return the BladeMass of the elements and, as the last lump, the tip mass."""
        blade = blade_mass(self.span_fraction, self.mass_density, hub_radius, tip_radius, self.elements)
        return BladeMass(np.append(blade.radius, tip_radius), np.append(blade.mass, self.tip_mass))


class Shaft(Record):
    """Describes the torsion of the shaft between hub and generator, referred to the low-speed side.

    Gear ratio and inertia of the generator are those of the Drivetrain.
    """

    stiffness: Positive  # N m/rad, DTTorSpr
    damping: NonNegative  # N m s/rad, DTTorDmp


def mass_problems(structure, rotor):
    """Yield the problems if a BladeStructure contradicts the blade masses of a Rotor."""
    if rotor.blade_mass is None:
        yield f"rotor.{BLADE_MASSES[0]}: is missing; [blade_structure] needs {', '.join(BLADE_MASSES)}"
        return
    lumps = structure.lumps(rotor.hub_radius, rotor.tip_radius)
    span = lumps.radius - rotor.hub_radius
    for power, key in enumerate(BLADE_MASSES):
        found, known = float(lumps.mass @ span**power), getattr(rotor, key)
        if abs(found - known) > MASS * known:
            yield (
                f"blade_structure.distribution: makes {key} = {found:.6g} with tip_mass; must be the rotor's"
                f" {known:.6g} within {MASS:.0%}"
            )


class StructureTable(BladeModes):
    """Holds the table [blade_structure] of a turbine file."""

    distribution: str  # a CSV file with COLUMNS, relative to the turbine file or among the built-in ones


def read_blade_structure(table: StructureTable, path: Path) -> BladeStructure:
    """Return the BladeStructure of a table and of the file (path) of its distribution.

    Raises: InputError naming the file, the line and what is allowed.
    """
    rows, problems = read_table(path, "blade structure", COLUMNS), []
    span = column(rows, "span_fraction", problems, 0.0, 1.0, open_ends=False, increasing=True)
    twist = column(rows, "structural_twist_deg", problems, -180.0, 180.0, open_ends=False)
    values = {"span_fraction": span, "structural_twist": DEGREE * twist}
    values |= {name: column(rows, name, problems, 0.0, largest) for name, largest in LARGEST.items()}
    if not problems and (len(span) < 2 or span[0] != 0.0 or span[-1] != 1.0):
        problems.append(f"span_fraction: goes from {span[0]:g} to {span[-1]:g}; must go from 0 to 1")
    raise_problems(f"blade structure file {str(path)!r}", problems)
    settings = {name: getattr(table, name) for name in table.model_fields_set if name != "distribution"}
    return BladeStructure(**settings, **values)
