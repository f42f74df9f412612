"""Computes rotor thrust and torque with slopes from a coefficient table, for the prediction of MPC."""

from typing import NamedTuple

import numpy as np

from fowt_env.caches import Cache
from fowt_env.plant.aero.blade_elements import build_blade_elements, elements_key
from fowt_env.plant.aero.coefficient_table import performance
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.drivetrain import clamp

RATIOS = np.linspace(1.5, 16.0, 146)  # tip-speed ratio
PITCHES = np.radians(np.linspace(-2.0, 40.0, 169))
SLOWEST = 3.0  # m/s, lower limit of the wind at the rotor


class RotorTable(NamedTuple):
    """Holds coefficients over tip-speed ratio and blade pitch (rad), both evenly spaced."""

    values: np.ndarray  # (6, n, m): thrust, its slopes over ratio and over pitch, the same of torque
    first_ratio: float
    ratio_step: float
    first_pitch: float
    pitch_step: float
    radius: float  # m
    area_density: float  # rho pi R^2/2, kg/m


_tables = Cache(16)  # (elements_key, tip radius) -> RotorTable: each scene reads its turbine again


def rotor_table(turbine, density):
    """Return the RotorTable of a turbine's blade elements in air of a density, kg/m3, cached by values."""
    elements, radius = build_blade_elements(turbine, density), float(turbine.rotor.tip_radius)

    def make():
        _, thrust, torque = performance(elements, RATIOS, PITCHES)
        parts = []
        for values in (thrust, torque):
            parts += [values, *np.gradient(values, RATIOS, PITCHES)]
        grid = (RATIOS[0], RATIOS[1] - RATIOS[0], PITCHES[0], PITCHES[1] - PITCHES[0])
        numbers = map(float, (*grid, radius, 0.5 * density * np.pi * radius**2))
        return RotorTable(np.ascontiguousarray(parts), *numbers)

    return _tables.get((elements_key(elements), radius), make)


@kernel
def rotor_loads(wind, rotor_speed, blade_pitch, table, loads):
    """Fill loads (8,): thrust (N) and its slopes over wind, rotor speed and blade pitch; torque likewise."""
    v = max(wind, SLOWEST)
    ratio = rotor_speed * table.radius / v
    rows, columns = table.values.shape[1:]
    position = clamp((ratio - table.first_ratio) / table.ratio_step, 0.0, rows - 1.0)
    i = min(int(position), rows - 2)
    f = position - i
    position = clamp((blade_pitch - table.first_pitch) / table.pitch_step, 0.0, columns - 1.0)
    j = min(int(position), columns - 2)
    g = position - j
    for load in range(2):
        k = 3 * load
        c = _between(table.values, k, i, j, f, g)
        by_ratio = _between(table.values, k + 1, i, j, f, g)
        by_pitch = _between(table.values, k + 2, i, j, f, g)
        scale = table.area_density * (table.radius if load == 1 else 1.0)
        loads[4 * load] = scale * v * v * c
        loads[4 * load + 1] = scale * v * (2.0 * c - ratio * by_ratio)
        loads[4 * load + 2] = scale * v * table.radius * by_ratio
        loads[4 * load + 3] = scale * v * v * by_pitch


@kernel
def _between(values, k, i, j, f, g):
    """Return entry k of the table by bilinear interpolation in the cell (i, j)."""
    low = (1.0 - g) * values[k, i, j] + g * values[k, i, j + 1]
    high = (1.0 - g) * values[k, i + 1, j] + g * values[k, i + 1, j + 1]
    return (1.0 - f) * low + f * high
