"""Advances the deflections of bending blades by Adams-Bashforth 4, stable against the damping by the wind.

The wind damps flapping at 10 to 20 1/s, and Adams-Bashforth 4 alone is stable to 0.3 over its step. The
damping D of a rotor at rated speed is known well enough: for the part -D v of the forces the explicit formula
is replaced by Adams-Moulton 4, which is linear in the new velocities. With D dt as large as the actual
damping the limit becomes 0.3 + 0.8 D dt, also where the wind damps less, and the order stays 4.
"""

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.elastic.blades import BladeModes
from fowt_env.plant.state import BLADES

IMPLICIT = 251.0 / 720.0  # factor on the fourth difference of a force: Adams-Moulton 4 less Adams-Bashforth 4


@kernel
def _nothing_to_damp(dt, history, blades, work, y):
    return


@kernel
def _extrapolated(i, history):
    """Return the rate of state i at the end of a step, by the cubic through the last four."""
    return 4.0 * (history[0, i] + history[2, i]) - 6.0 * history[1, i] - history[3, i]


@inlined_kernel
def _damp(dt, history, blades, work, y):
    n, a, b = len(blades.beam.count), work.mass, work.probe_rest
    size = BLADES * n
    for number in range(BLADES):
        q = blades.first + n * number
        for i in range(n):
            b[i] = y[size + q + i] - _extrapolated(q + i, history)
            for j in range(n):
                a[i, j] = IMPLICIT * dt * blades.decay[i, j]
            a[i, i] += 1.0
        for i in range(n):  # Gauss elimination: diagonally dominant
            for k in range(i + 1, n):
                factor = a[k, i] / a[i, i]
                for j in range(i + 1, n):
                    a[k, j] -= factor * a[i, j]
                b[k] -= factor * b[i]
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, n):
                b[i] -= a[i, j] * b[j]
            b[i] /= a[i, i]
            y[size + q + i] = b[i] + _extrapolated(q + i, history)


# (dt, history, blades, work, y): velocities of the deflections in y, by Adams-Bashforth 4, corrected; history
# of the derivatives of four steps, latest first
damp_blades = chosen_by_class("blades", {type(None): _nothing_to_damp, BladeModes: _damp})
