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
    rows = None if matrix is None else tuple(map(tuple, matrix.tolist()))
    fields = {name: getattr(platform.hydro, name) for name in type(platform.hydro).model_fields}
    hydro = type(platform.hydro)(**fields | {"added_mass": rows})
    return platform.model_copy(update={"hydro": hydro})


def scene_with(matrix):
    return build_scene(platform_with(matrix), fidelity="reference")


def test_without_one_nothing_changes_a_bit():
    x = random_state(np.random.default_rng(1), 15, speed=2.0, turning=0.2)
    plain, zero = scene_with(None), scene_with(np.zeros((6, 6)))
    assert np.array_equal(rates(plain, x), rates(zero, x))
    assert zero.model.hydro.added_inertia is None


def test_accelerations_are_those_of_the_equation_of_motion_with_that_matrix_and_its_momentum():
    """(M + A + A_0) a = (M + A) a_plain - C(A_0) nu, with the rotor row of the mass matrix eliminated."""
    x = random_state(np.random.default_rng(2), 15, speed=2.0, turning=0.2)
    plain, heavy = scene_with(None), scene_with(ROWS)
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


@pytest.mark.parametrize(
    ("row", "column", "value", "words"),
    [(0, 1, 5e8, "symmetric"), (2, 2, -1e9, "positive semidefinite")],
)
def test_a_matrix_that_cannot_be_is_refused(row, column, value, words):
    matrix = ROWS.copy()
    matrix[row, column] = value
    with pytest.raises((InputError, ValueError), match=words):
        platform_with(matrix)
