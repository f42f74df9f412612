import numpy as np
import pytest
from plant_helpers import random_state

from fowt_env.descriptions.platform import HydroCoefficients
from fowt_env.plant.hydro.linear_damping import LinearDamping, build_damping, damping_load
from fowt_env.plant.state import NO_LOAD, State, pose_of

pytestmark = pytest.mark.installation

NOTHING = HydroCoefficients(added_mass_coefficient=1.0, drag_coefficient=0.6, heave_added_mass=0.0)


def test_no_coefficients_no_part_no_load():
    x = random_state(np.random.default_rng(0))
    assert build_damping(NOTHING) is None
    assert damping_load(pose_of(x), x, None) == NO_LOAD


def test_damping_opposes_the_motion_and_the_spring_the_yaw_angle(platform):
    damping = build_damping(platform.hydro)
    assert damping == LinearDamping(1e5, 1e5, 1.3e5, 0.0, 0.0, 1.3e7, 98.34e6)
    rng = np.random.default_rng(1)
    for _ in range(50):
        x = random_state(rng)
        load = np.array(damping_load(pose_of(x), x, damping))
        v = x[State.VX : State.WZ + 1]
        spring = np.array([0, 0, 0, 0, 0, -98.34e6 * x[State.YAW]])
        assert np.allclose(load, -np.array([1e5, 1e5, 1.3e5, 0, 0, 1.3e7]) * v + spring, rtol=1e-14, atol=0.0)
        assert (load - spring) @ v <= 0.0
