"""Steps of the twist with blades in phase: the propagator, against a matrix exponential."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from fowt_env.plant.elastic.in_phase import N_IN_PHASE, fill_propagator

FACTORIALS = (1.0, 1.0, 2.0, 6.0)


def exact(A, B, dt):
    """(2 N, 6 N) of z'' = g - A z - B z' in the units of work.propagator, by one matrix exponential."""
    n = len(A)
    rates = np.zeros((6 * n, 6 * n))  # of z, dt z', then dt2 g and its derivatives over s
    rates[:n, n : 2 * n] = rates[n : 2 * n, 2 * n : 3 * n] = np.eye(n)
    rates[n : 2 * n, :n], rates[n : 2 * n, n : 2 * n] = -A * dt**2, -B * dt
    for power in range(3):
        rates[(2 + power) * n : (3 + power) * n, (3 + power) * n : (4 + power) * n] = np.eye(n)
    out = expm(rates)[: 2 * n]
    for power, factor in enumerate(FACTORIALS):
        out[:, (2 + power) * n : (3 + power) * n] *= factor
    return out


@pytest.mark.parametrize("stiffness", [40.0, 4e4])
def test_the_propagator_is_exact_for_soft_and_stiff_shafts(stiffness):
    rng, n, dt = np.random.default_rng(2), 4, 0.05
    turn = rng.normal(size=(n, n)) + 2.0 * np.eye(n)
    A = turn @ np.diag([stiffness, 150.0, 45.0, 20.0]) @ np.linalg.inv(turn)
    B = turn @ np.diag([0.5 * np.sqrt(stiffness), 1.0, 12.0, 8.0]) @ np.linalg.inv(turn)
    work = SimpleNamespace(
        in_phase_matrix=np.array([A, B]),
        propagator=np.zeros((2, 2 * n, 6 * n)),
        in_phase=np.zeros((N_IN_PHASE, n)),
    )
    getattr(fill_propagator, "py_func", fill_propagator)(dt, work)
    wanted = exact(A, B, dt)
    assert work.propagator[0] == pytest.approx(wanted, rel=1e-9, abs=1e-12 * np.abs(wanted).max())
