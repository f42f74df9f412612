"""Caches the operating points at which episodes start, within the process."""

import hashlib
import pickle
from dataclasses import replace
from math import floor

from fowt_env.analysis.trim import trim, water_key
from fowt_env.caches import Cache
from fowt_env.descriptions.records import Record
from fowt_env.plant.line_dynamics import rest_lines

GRID = 0.25  # m/s between exact trims; between them the state is linear in the wind speed
_TRIMS = Cache(4096)  # (plant, water, shear exponent, wind speed) -> (state, command)


def plant_key(scene):
    """Return the hash of all inputs of a trim except the wind; the same in every process."""
    weather = ("duration", "wave_components")
    options = {name: _values(value) for name, value in scene.options.items() if name not in weather}
    loads = tuple(load.key() for load in scene.loads)
    parts = (_values(scene.platform), _values(scene.turbine), scene.rotor, options, loads)
    return hashlib.sha256(pickle.dumps(parts)).hexdigest()


def _values(part):
    """Return a record as plain values: its pickle contains a set, whose order differs between processes."""
    return part.model_dump() if isinstance(part, Record) else part


def cached_trim(scene, key, speed):
    """Return (state, command) of trim() at a mean wind speed (m/s); computed once per process.

    The arrays are shared: copy before writing. The trim in a box of wind is not cached, because the profile
    differs between boxes.
    """
    if scene.model.aero.field is not None:
        return _state_and_command(trim(scene))
    entry = (key, water_key(scene), scene.model.aero.wind.shear_exponent, float(speed))
    return _TRIMS.get(entry, lambda: _state_and_command(trim(replace(scene, wind_speed=float(speed)))))


def _state_and_command(point):
    return point.state, point.command


def interpolated_trim(scene, key, speed):
    """Return (state, command) at a mean wind speed (m/s), linear between exact trims GRID apart.

    The state is exact in the cell that contains the cut-out wind speed, where the operating point jumps.
    """
    cell = floor(speed / GRID)
    weight = speed / GRID - cell
    if weight == 0.0 or cell * GRID <= scene.turbine.cut_out_wind_speed < (cell + 1) * GRID:
        return cached_trim(scene, key, speed)
    low = cached_trim(scene, key, cell * GRID)
    high = cached_trim(scene, key, (cell + 1) * GRID)
    state, command = ((1.0 - weight) * a + weight * b for a, b in zip(low, high, strict=True))
    rest_lines(scene, state)  # a mean of two equilibria stretches a line
    return state, command
