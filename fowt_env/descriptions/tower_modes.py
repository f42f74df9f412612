"""Describes a flexible tower in platform files: distributed mass and stiffness, and mode shapes.

As in ElastoDyn: polynomial shapes over the height, each of the tower clamped at the base, and sums over
equal elements.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from fowt_env.descriptions.files import DATA, column, raise_problems, read_table
from fowt_env.descriptions.records import Finite, NonNegative, Positive, Record, bounded, checked_record

COLUMNS = ("height_fraction", "mass_density", "fore_aft_stiffness", "side_side_stiffness")
POWERS = np.arange(2, 7)  # of the height fraction, in a shape
END = 0.0015  # largest deviation of a shape from 1 at the top, as in ElastoDyn; removed by scaling
MASS = 0.01  # largest deviation of the distributed mass from the tower's mass, relative
LARGEST = {"mass_density": 1e9, "fore_aft_stiffness": 1e18, "side_side_stiffness": 1e18}

Shape = tuple[Finite, Finite, Finite, Finite, Finite]
Ratio = bounded(ge=0, lt=1)


class ModeShapes(Record):
    """Holds the table [tower.modes] except the distribution: one or two modes each way, lowest first."""

    fore_aft: tuple[Shape, ...]  # coefficients of x^2 to x^6, x from 0 at the base to 1 at the top
    side_side: tuple[Shape, ...]
    fore_aft_damping: tuple[Ratio, ...]  # structural damping ratio per mode, without tower-top mass
    side_side_damping: tuple[Ratio, ...]
    fore_aft_tuner: tuple[Positive, ...] | None = None  # factor on the stiffness of each mode
    side_side_tuner: tuple[Positive, ...] | None = None
    top_mass: NonNegative = 0.0  # kg, point mass at the top, part of the tower's mass, as the yaw bearing
    # number of equal elements, evaluated at midpoints, as ElastoDyn's TwrNodes
    elements: Annotated[int, Field(strict=True, ge=1, le=999)] = 20

    def _problems(self):
        count = len(self.fore_aft)
        if count not in (1, 2):
            yield f"fore_aft: has {count} shapes; must be 1 or 2"
        for name in (
            "side_side", "fore_aft_damping", "side_side_damping", "fore_aft_tuner", "side_side_tuner",
        ):  # fmt: skip
            values = getattr(self, name)
            if values is not None and len(values) != count:
                yield f"{name}: has {len(values)} entries; must be {count}, as many as fore_aft"
        for name in ("fore_aft", "side_side"):
            for i, shape in enumerate(getattr(self, name), 1):
                if abs(sum(shape) - 1.0) > END:
                    yield f"{name}.{i}: adds up to {sum(shape):g}; must be 1 (within {END}), at the top"


class TowerBending(ModeShapes):
    """Holds the distributed mass and stiffness of a tower, linear between heights, and the mode shapes."""

    height_fraction: tuple[Finite, ...]  # of the tower's height, from 0 to 1
    mass_density: tuple[Positive, ...]  # kg/m
    fore_aft_stiffness: tuple[Positive, ...]  # EI, N m2
    side_side_stiffness: tuple[Positive, ...]

    def mass(self, height):
        """Return the mass (kg) of a tower of a height (m), summed over the elements."""
        line = np.interp(self.middles(), self.height_fraction, self.mass_density)
        return float(line.mean()) * height + self.top_mass

    def middles(self):
        """Return the height fractions (elements,) of the midpoints of the elements."""
        return (np.arange(self.elements) + 0.5) / self.elements


def mass_problem(modes, mass, height):
    """Yield the problem if a TowerBending contradicts the mass (kg) of a tower of a height (m)."""
    total = modes.mass(height)
    if abs(total - mass) > MASS * mass:
        yield (
            f"modes.distribution: has a mass of {total:.6g} kg with top_mass; must be the tower's mass ="
            f" {mass:.6g} kg within {MASS:.0%}"
        )


class _ModesTable(ModeShapes):
    """Holds the table [tower.modes] of a platform file."""

    distribution: str  # a CSV file with COLUMNS, relative to the platform file or among the built-in ones


def read_tower_modes(table, folder):
    """Return the TowerBending of the table [tower.modes] of a platform file in this folder.

    Raises: InputError naming the file, the key and what is allowed.
    """
    record = checked_record(_ModesTable, table, "tower.modes")
    path = folder / Path(record.distribution).expanduser()
    if not path.exists() and (builtin := DATA / "platforms" / record.distribution).is_file():
        path = builtin
    rows, problems = read_table(path, "tower", COLUMNS), []
    height = column(rows, "height_fraction", problems, 0.0, 1.0, open_ends=False, increasing=True)
    values = {"height_fraction": height}
    values |= {name: column(rows, name, problems, 0.0, largest) for name, largest in LARGEST.items()}
    if not problems and (height[0] != 0.0 or height[-1] != 1.0):
        problems.append(f"height_fraction: goes from {height[0]:g} to {height[-1]:g}; must go from 0 to 1")
    raise_problems(f"tower file {str(path)!r}", problems)
    settings = {name: getattr(record, name) for name in record.model_fields_set if name != "distribution"}
    return TowerBending(**settings, **{name: tuple(map(float, value)) for name, value in values.items()})
