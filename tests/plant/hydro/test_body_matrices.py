"""Constant matrices of a linear body: in inertial axes, those of the heading or those of the body."""

import numpy as np
import pytest
from plant_helpers import random_state, rates

from fowt_env import build_scene, trim
from fowt_env.descriptions.platform import AdditionalLoads, read_platform
from fowt_env.plant.hydro.body_matrices import add_body_matrices, build_body_matrices
from fowt_env.plant.state import N_RIGID, NO_LOAD, State, pose_of

RNG = np.random.default_rng(5)
SCALE = np.outer([1e6, 1e6, 1e6, 3e7, 3e7, 3e7], [1.0, 1.0, 1.0, 30.0, 30.0, 30.0])
VELOCITY = slice(State.VX, State.WZ + 1)


def matrix():
    return RNG.normal(size=(6, 6)) * SCALE


def mass_like():
    a = RNG.normal(size=(6, 6)) / 6.0 + np.eye(6)
    s = np.diag([3e3, 3e3, 3e3, 1e5, 1e5, 1e5])
    return s @ a @ a.T @ s


PRELOAD, BUOYANCY, ADDED = RNG.normal(size=6) * 1e6, RNG.normal(size=6) * 1e6, mass_like()
STIFFNESS, LINEAR, QUADRATIC, WATER = matrix(), matrix(), matrix(), matrix()[2:5, 2:5]
for damping in (LINEAR, QUADRATIC):
    np.fill_diagonal(damping, np.abs(np.diag(damping)))


def with_loads(**loads):
    """OC3-Hywind in still water with AdditionalLoads."""
    rows = {name: tuple(map(tuple, value)) if np.ndim(value) == 2 else value for name, value in loads.items()}
    return build_scene(
        read_platform("oc3_hywind").model_copy(update={"additional": AdditionalLoads(**rows)}),
        fidelity="reference",
    )


def rotation(x):
    p = pose_of(x)
    return np.array([[p.r11, p.r12, p.r13], [p.r21, p.r22, p.r23], [p.r31, p.r32, p.r33]])


def test_accelerations_are_those_of_the_matrices_each_in_its_axes():
    """Twin in plain numpy, HydroDyn's axes: stiffness inertial, hydrostatics by heading, damping of the body.

    The mass is on the accelerations R (v' + w x v) and R w'.
    """
    scene = build_scene("oc3_hywind", fidelity="reference")
    linear = with_loads(
        preload=PRELOAD, stiffness=STIFFNESS, linear_damping=LINEAR, quadratic_damping=QUADRATIC
    ).with_model({
        "hydro.matrices.added_mass": ADDED, "hydro.matrices.buoyancy": BUOYANCY,
        "hydro.matrices.water_stiffness": WATER,
    })  # fmt: skip
    x = random_state(np.random.default_rng(2), 15, speed=2.0, turning=0.2)
    handle = scene.handle(data := scene.data())
    plain, other = rates(scene, x, handle=handle)[VELOCITY], rates(linear, x)[VELOCITY]
    body = scene.model.rigid_body
    mass = body.mass_matrix + data.added_mass
    mass[3, 3] -= body.coupling**2 / body.rotor_row
    turn = rotation(x)
    both = np.kron(np.eye(2), turn)
    v, w = x[State.VX : State.VZ + 1], x[State.WX : State.WZ + 1]
    q, rate = x[:6], np.r_[v, w]
    damping = LINEAR @ rate + QUADRATIC @ (np.abs(rate) * rate)
    c, s = np.cos(x[State.YAW]), np.sin(x[State.YAW])
    heading = np.kron(np.eye(2), [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    upright = BUOYANCY.copy()
    upright[2:5] -= WATER @ q[2:5]
    force = PRELOAD - STIFFNESS @ q + heading @ upright
    force -= ADDED @ np.r_[turn @ np.cross(w, v), np.zeros(3)]
    turned = both.T @ ADDED @ both
    expected = np.linalg.solve(mass + turned, mass @ plain + both.T @ force - damping)
    assert other == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_a_preload_moves_a_floater_to_where_its_stiffness_balances_it():
    """K^-1 (F, M), but for the give of lines and water, a part in 10,000 of this stiffness."""
    spring = np.diag([1e9, 1e9, 1e10, 1e14, 1e14, 1e13])
    spring[0, 4] = spring[4, 0] = -3e10
    preload = np.array([2e8, 0.0, 0.0, 0.0, 4e12, 0.0])
    free, pushed = (trim(with_loads(stiffness=spring, preload=load)) for load in (np.zeros(6), preload))
    moved = pushed.state[:6] - free.state[:6]
    assert moved == pytest.approx(np.linalg.solve(spring, preload), rel=1e-3, abs=1e-4)


def test_buoyancy_acts_at_the_centre_of_buoyancy_of_the_undisplaced_body():
    class Body:
        volume, centre_of_buoyancy = 2.0, (3.0, 5.0)
        stiffness, added_mass_infinite = np.zeros((6, 6)), np.eye(6)

    part = build_body_matrices(Body, None, density=1000.0, gravity=10.0)
    force = np.array([0.0, 0.0, 2e4])
    assert part.buoyancy == pytest.approx(np.r_[force, np.cross([3.0, 5.0, 0.0], force)])


def test_a_body_that_is_pitched_about_its_own_axis_is_not_driven_in_roll_at_any_heading():
    """A round waterplane restores along the line of steepest tilt, whatever the yaw."""

    class Body:
        volume, centre_of_buoyancy = 2e4, (0.0, 0.0)
        stiffness, added_mass_infinite = np.diag([0.0, 0.0, 4e6, 2e9, 2e9, 0.0]), np.zeros((6, 6))

    part = build_body_matrices(Body, None, density=1025.0, gravity=9.81)
    for yaw in (0.0, -0.4, 2.0):
        x = np.zeros(N_RIGID)
        x[State.PLATFORM_PITCH], x[State.YAW] = 0.1, yaw
        load = add_body_matrices(pose_of(x), x, NO_LOAD, part, np.zeros((6, 6)))
        assert (load.mx, load.my) == pytest.approx((0.0, -2e8), abs=1.0)
