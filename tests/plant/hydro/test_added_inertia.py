"""A constant added mass of a platform file, six by six."""

import numpy as np
import pytest
from plant_helpers import random_state, rates

from fowt_env import build_scene
from fowt_env.descriptions.platform import read_platform
from fowt_env.errors import InputError
from fowt_env.plant.state import State

ROWS = np.array(
    [
        [8.0, 0.5, -0.2, 3.0, -400.0, 20.0],
        [0.5, 7.0, 0.1, 380.0, 5.0, -30.0],
        [-0.2, 0.1, 9.0, 4.0, -6.0, 2.0],
        [3.0, 380.0, 4.0, 6e4, 90.0, -50.0],
        [-400.0, 5.0, -6.0, 90.0, 7e4, 40.0],
        [20.0, -30.0, 2.0, -50.0, 40.0, 9e3],
    ]
) * 1e6  # fmt: skip


def platform_with(matrix):
    platform = read_platform("oc3_hywind")
    hydro = platform.hydro.model_dump() | {"added_mass": None if matrix is None else matrix.tolist()}
    return platform.model_copy(update={"hydro": type(platform.hydro).model_validate(_tuples(hydro))})


def _tuples(value):
    """Lists within a mapping as tuples, which strict records take."""
    if isinstance(value, dict):
        return {key: _tuples(item) for key, item in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def test_without_one_nothing_changes_a_bit():
    x = random_state(np.random.default_rng(1), 15, speed=2.0, turning=0.2)
    plain, zero = (
        rates(build_scene(platform_with(m), fidelity="reference"), x) for m in (None, np.zeros((6, 6)))
    )
    assert np.array_equal(plain, zero)
    assert (
        build_scene(platform_with(np.zeros((6, 6))), fidelity="reference").model.hydro.added_inertia is None
    )


def test_accelerations_are_those_of_the_equation_of_motion_with_that_matrix_and_its_momentum():
    """(M + A + A_0) a = (M + A) a_plain - C(A_0) nu, with the rotor row of the mass matrix eliminated."""
    x = random_state(np.random.default_rng(2), 15, speed=2.0, turning=0.2)
    plain, heavy = (
        build_scene(platform_with(None), fidelity="reference"),
        build_scene(platform_with(ROWS), fidelity="reference"),
    )
    a, b = rates(plain, x), rates(heavy, x)
    body = plain.model.rigid_body
    handle = plain.handle(data := plain.data())
    rates(plain, x, handle=handle)
    mass = body.mass_matrix + data.added_mass
    mass[3, 3] -= body.coupling**2 / body.rotor_row
    v, w = x[State.VX : State.VZ + 1], x[State.WX : State.WZ + 1]
    p, k = np.split(ROWS @ np.r_[v, w], 2)
    momentum_rate = np.r_[np.cross(w, p), np.cross(v, p) + np.cross(w, k)]
    rows = slice(State.VX, State.WZ + 1)
    expected = np.linalg.solve(mass + ROWS, mass @ a[rows] - momentum_rate)
    assert b[rows] == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_it_has_kinetic_energy_and_neither_gives_nor_takes_any():
    """d/dt of nu' A_0 nu / 2 is what the load takes: its velocity-dependent part does no work."""
    x = random_state(np.random.default_rng(3), 15, speed=2.0, turning=0.2)
    nu = x[State.VX : State.WZ + 1]
    v, w = np.split(nu, 2)
    p, k = np.split(ROWS @ nu, 2)
    assert np.r_[np.cross(w, p), np.cross(v, p) + np.cross(w, k)] @ nu == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [((0, 1, 5e8), "symmetric"), ((2, 2, -1e9), "positive semidefinite")],
)
def test_a_matrix_that_cannot_be_is_refused(tmp_path, change, words):
    matrix = ROWS.copy()
    matrix[change[0], change[1]] = change[2]
    with pytest.raises(Exception, match=words) as caught:
        platform_with(matrix)
    assert isinstance(caught.value, (InputError, ValueError))
