"""Evaluates the loads of water and mooring lines at every second step of a turbine with bending blades.

Waves, buoyancy and lines change as slowly as the platform moves, while bending blades need steps of half the
length. At the steps between, these loads and the added mass are extrapolated by the cubic through their last
four evaluations, an error of the order of the step's own (Adams-Bashforth 4).
"""

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.hydro.flooding import with_floods
from fowt_env.plant.hydro.load import HydroLoad, hydro_load
from fowt_env.plant.line_dynamics import lines_load
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import NO_LOAD, Wrench

HYDRO, MOORING, ADDED_MASS, N_SLOW = 0, 6, 12, 48  # entries of a row of Data.slow
# of the cubic through values at 0, -1, -2 and -3, latest first, at 1/2
WEIGHTS = (35.0 / 16.0, -35.0 / 16.0, 21.0 / 16.0, -5.0 / 16.0)
FIRST = 7  # steps before four evaluations exist


@inlined_kernel
def _evaluated(t, pose, x, model, data):
    hydro = hydro_load(t, pose, x, model.hydro, data)
    hydro = with_floods(pose, hydro, model.rigid_body.gravity, data.flood, data.added_mass)
    return hydro, lines_load(pose, x, model.mooring, data.lines, data.counters)


@kernel
def _extrapolated(entry, slow):
    a, b, c, d = WEIGHTS
    return a * slow[0, entry] + b * slow[1, entry] + c * slow[2, entry] + d * slow[3, entry]


@kernel
def _wrench(entry, slow):
    return Wrench(
        _extrapolated(entry, slow), _extrapolated(entry + 1, slow), _extrapolated(entry + 2, slow),
        _extrapolated(entry + 3, slow), _extrapolated(entry + 4, slow), _extrapolated(entry + 5, slow),
    )  # fmt: skip


@inlined_kernel
def _by_kind(pose, x, model, dynamics, data):
    if dynamics is None:
        return _wrench(MOORING, data.slow)
    return lines_load(pose, x, model.mooring, data.lines, data.counters)  # moving lines are not slow


@inlined_kernel
def _lines(pose, x, model, mooring, data):
    if mooring is None:
        return NO_LOAD
    return _by_kind(pose, x, model, mooring.dynamics, data)


@inlined_kernel
def slow_loads(t, pose, x, model, blades, data):
    """Return (HydroLoad, Wrench of the lines) at a state, evaluated or extrapolated; fill data.added_mass."""
    if blades is None:
        return _evaluated(t, pose, x, model, data)
    if data.cache[LoadCache.SLOW] < 0.5:
        return _evaluated(t, pose, x, model, data)
    for i in range(6):
        for j in range(6):
            data.added_mass[i, j] = _extrapolated(ADDED_MASS + 6 * i + j, data.slow)
    hydro = HydroLoad(NO_LOAD, _wrench(HYDRO, data.slow), NO_LOAD)
    return hydro, _lines(pose, x, model, model.mooring, data)


@kernel
def begin_slow(steps, blades, data):
    """Set whether the evaluation at a step extrapolates; steps: number of steps before."""
    if blades is None:
        return
    data.cache[LoadCache.SLOW] = 1.0 if steps >= FIRST and steps % 2 == 1 else 0.0


@kernel
def keep_slow(steps, blades, data):
    """Insert the loads of the last evaluation before those of past steps, at every second step.

    Every evaluation until the next step is exact: loads for outputs, and at corrected steps.
    """
    if blades is None:
        return
    cache, slow = data.cache, data.slow
    cache[LoadCache.SLOW] = 0.0
    if steps % 2 == 1:
        return
    for k in range(3, 0, -1):
        for i in range(N_SLOW):
            slow[k, i] = slow[k - 1, i]
    for i in range(6):
        slow[0, HYDRO + i], slow[0, MOORING + i] = cache[LoadCache.HYDRO + i], cache[LoadCache.MOORING + i]
        for j in range(6):
            slow[0, ADDED_MASS + 6 * i + j] = data.added_mass[i, j]
