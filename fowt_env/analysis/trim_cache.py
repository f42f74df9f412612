"""Operating points to start episodes from, remembered within the process."""

import hashlib
import pickle
from dataclasses import replace
from math import floor

from fowt_env.analysis.trim import trim
from fowt_env.caches import Cache
from fowt_env.descriptions.records import Record

GRID = 0.25  # m/s between exact trims; between them the state is linear in the wind speed
_TRIMS = Cache(4096)  # (plant, water, shear exponent, wind speed) -> (state, command)


def plant_key(scene):
    """Return the hash of all that a trim depends on, apart from the wind; the same in every process."""
    weather = ("duration", "wave_components")
    options = {name: _values(value) for name, value in scene.options.items() if name not in weather}
    loads = tuple(load.key() for load in scene.loads)
    parts = (_values(scene.platform), _values(scene.turbine), scene.rotor, options, loads)
    return hashlib.sha256(pickle.dumps(parts)).hexdigest()


def water_key(scene):
    """What a trim's last bits depend on beside the plant: the form and the nodes of strips in a current."""
    hydro = scene.model.hydro
    quadrature = None if hydro is None else getattr(hydro.strips, "quadrature", None)
    return scene.weather_kind, None if quadrature is None else quadrature.table.shape


def _values(part):
    """Return a record as plain values: as an object it carries a set, whose order is each process's own."""
    return part.model_dump() if isinstance(part, Record) else part


def cached_trim(scene, key, speed):
    """Return (state, command) of trim() at a mean wind speed (m/s); computed once per process.

    The arrays are shared: copy before writing. A box of wind has a profile of its own, so that its
    trim is not remembered.
    """
    if scene.model.aero.field is not None:
        return _state_and_command(trim(scene))
    entry = (key, water_key(scene), scene.model.aero.wind.shear_exponent, float(speed))
    return _TRIMS.get(entry, lambda: _state_and_command(trim(replace(scene, wind_speed=float(speed)))))


def _state_and_command(point):
    return point.state, point.command


def interpolated_trim(scene, key, speed):
    """Return (state, command) at a mean wind speed (m/s), linear between exact trims GRID apart.

    Exact in the cell that holds the cut-out wind, where the operating point jumps.
    """
    cell = floor(speed / GRID)
    weight = speed / GRID - cell
    if weight == 0.0 or cell * GRID <= scene.turbine.cut_out_wind_speed < (cell + 1) * GRID:
        return cached_trim(scene, key, speed)
    low = cached_trim(scene, key, cell * GRID)
    high = cached_trim(scene, key, (cell + 1) * GRID)
    return tuple((1.0 - weight) * a + weight * b for a, b in zip(low, high, strict=True))
