"""Steady states and linear models of a turbine whose tower bends."""

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.analysis.linear_model import TOWER, linearize, natural_periods
from fowt_env.analysis.reduced_model import platform_frequency, residualised
from fowt_env.analysis.statics import Evaluation
from fowt_env.analysis.tower_frequencies import bending
from fowt_env.analysis.trim import _Steady, trim, without_fluctuations
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import MOTIONS, STATES, State
from fowt_env.run.initial_conditions import initial_state
from fowt_env.scene.mass import top_mass_matrix


@pytest.fixture(scope="module")
def scene():
    return build_scene("iea15_volturnus_s", wind=18.0, fidelity="fast", tower="modes")


def test_at_rest_in_wind_the_tower_bends_as_thrust_and_weight_bend_it(scene):
    point = trim(scene)
    evaluation, tower = Evaluation(scene), scene.model.tower
    evaluation.u[:] = point.command
    rotor = evaluation.at(point.state.copy(), LoadCache.ROTOR)
    rates = np.r_[
        evaluation.mean[State.VX : State.WZ + 1], evaluation.mean[tower.first + 2 : tower.first + 4]
    ]
    assert np.abs(rates).max() < 1e-8 and abs(evaluation.mean[State.ROTOR_SPEED]) < 1e-8
    # by hand, fore-aft: the rotor's force and moment at the top, the weight of a leaning turbine, and drag
    own, top = bending(scene.platform, scene.turbine, 1), top_mass_matrix(scene.platform, scene.turbine)
    slope, gravity = tower.slope[0], scene.platform.environment.gravity
    aside = -top[2, 4] / top[0, 0]  # of the centre of mass of nacelle and rotor, downwind
    force = rotor[0] + slope * (rotor[4] - tower.top_height * rotor[0] + gravity * top[0, 0] * aside)
    force -= own.weight[State.PLATFORM_PITCH, 0] * point.state[State.PLATFORM_PITCH]
    drag, hub = scene.model.aero.tower, scene.turbine.rotor.hub_height
    wind = 18.0 * (drag.z / hub) ** scene.platform.environment.shear_exponent
    force += np.sum(drag.factor * wind**2 * tower.drag_shape[:, 0])
    assert point["TTDspFA"] == pytest.approx(force / own.stiffness[0, 0], rel=2e-3)
    assert point["TTDspFA"] == pytest.approx(point.state[tower.first], rel=1e-12)
    assert point["TTDspFA"] > 0.05


def test_with_the_platform_held_the_deflections_are_found_too(scene):
    held, free = trim(scene, "fixed"), trim(scene)
    assert not held.state[: State.AZIMUTH].any()
    assert held["RotSpeed"] == pytest.approx(free["RotSpeed"], rel=1e-6)
    assert (
        0.2 * free["TTDspFA"] < held["TTDspFA"] < 0.8 * free["TTDspFA"]
    )  # a platform that leans adds weight


def test_a_rotor_finds_its_balance_while_the_tower_is_far_from_its_own(scene):
    """A top that accelerates to the side turns the rotor, which is no lack of torque."""
    point = trim(scene, "fixed")
    body = scene.model.rigid_body._replace(platform_fixed=True)
    steady = _Steady(without_fluctuations(scene).with_model(rigid_body=body))
    steady.x[:] = point.state
    steady.x[scene.model.tower.first + 1] += 0.05
    found = steady.rotor_acceleration(point.state[State.ROTOR_SPEED], point.state[State.BLADE_PITCH])
    assert abs(steady.mean[State.ROTOR_SPEED]) > 1e-3
    assert abs(found) < 1e-3 * abs(steady.mean[State.ROTOR_SPEED])


@pytest.mark.parametrize("wind", [9.0, 10.74])
def test_a_trim_ends_where_a_slow_rotor_is_tried_on_a_bent_tower(scene, wind):
    below = build_scene("iea15_volturnus_s", wind=wind, fidelity="fast", tower="modes")
    assert trim(below)["RotSpeed"] == pytest.approx(7.56 * min(wind / 10.9, 1.0), rel=0.02)


def test_a_run_begins_with_the_tower_straight_as_in_trim_or_as_given(scene):
    rows = slice(scene.model.tower.first, scene.model.tower.first + 2)
    assert not initial_state(scene, "zero")[0][rows].any()
    assert initial_state(scene)[0][rows] == pytest.approx(trim(scene).state[rows])
    assert list(initial_state(scene, initial={"TTDspSS": 0.1})[0][rows]) == [0.0, 0.1]


def test_the_linear_model_has_openfast_s_frequency_of_the_tower(scene):
    """Free decay of OpenFAST v5.0.0, rotor parked; wind damps the mode and hardly moves it."""
    model = linearize(scene)
    assert model.states[14:18] == (*TOWER[:2], "tower_fore_aft_rate", "tower_side_side_rate")
    assert model.x0[14:18] == pytest.approx(model.point.state[15:19])
    modes = {mode.name: mode for mode in model.modes()}
    measured = scene.platform.published["tower_frequency"]
    assert modes["tower_fore_aft"].frequency / (2.0 * np.pi) == pytest.approx(measured, rel=0.01)
    assert 0.02 < modes["tower_fore_aft"].damping_ratio < 0.1
    assert 0.003 < modes["tower_side_side"].damping_ratio < 0.01
    periods = natural_periods(scene)
    assert 1.0 / periods["tower_fore_aft"] == pytest.approx(measured, rel=0.005)
    assert list(periods) == [*MOTIONS, *TOWER[:2]]
    at_rest = scene.platform.published["natural_periods"]["pitch"]
    assert periods["platform_pitch"] == pytest.approx(at_rest, rel=0.03)


def test_a_model_of_rigid_bodies_answers_to_the_wind_as_the_one_whose_tower_bends(scene):
    """Within 5 %: the square of a frequency over the tower's, and radiation memory beside its frequency."""
    model = linearize(scene)
    reduced, own = residualised(model), platform_frequency(model)
    assert reduced.states == STATES
    assert own == pytest.approx(platform_frequency(reduced), rel=0.02)  # with the mass on the tower
    for omega in (0.5 * own, 1.5 * own, 0.5):
        found, whole = (one.response(omega, ("wind_speed",))[0, :, 0] for one in (reduced, model))
        for name in ("rotor_speed", "platform_pitch", "nacelle_velocity", "nacelle_acceleration"):
            row = model.output_index(name)
            assert abs(found[row] / whole[row] - 1.0) < 0.05, (omega, name)
