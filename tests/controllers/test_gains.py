"""Gains of turbines without published ones, against those that are published for the NREL 5 MW turbine."""

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.controllers.gains import (
    derived_gains,
    floating_frequency,
    land_frequency,
    platform_frequency,
    power_slope,
    published_set,
    with_gains,
)
from fowt_env.controllers.pi import PI, PISettings, pi, pi_land
from fowt_env.errors import InputError

SLOPE, DOUBLING = -25.52e6, 0.1099965  # W/rad, rad: the published line (NREL/TP-500-38060, 7.4)


@pytest.fixture(scope="module")
def scene():
    return build_scene("oc3_hywind", wind=18.0, duration=100.0, fidelity="standard")


@pytest.fixture(scope="module")
def nameless(scene):
    """The scene with a turbine that has no published gains."""
    turbine = scene.turbine.model_copy(update={"gains": {}})
    return build_scene("oc3_hywind", wind=18.0, duration=100.0, fidelity="standard", turbine=turbine)


@pytest.mark.parametrize("pitch", [5.0, 10.0, 15.0, 20.0])
def test_the_slope_of_power_over_blade_pitch_is_the_published_one(scene, pitch):
    """Other blade data and losses than the report's: its own slopes scatter by 4 % about its line."""
    found, pitch = power_slope(scene.turbine), np.radians(pitch)
    assert found.at_zero * (1.0 + pitch / found.doubling) == pytest.approx(
        SLOPE * (1.0 + pitch / DOUBLING), rel=0.06
    )


def test_the_gains_of_both_sets_are_near_the_published_ones(scene, nameless):
    """Scheduled at 10 deg, where the fitted lines agree best; at zero pitch a line is extrapolated."""
    for name, published in scene.turbine.gains.items():
        found = published_set(with_gains(nameless), name)
        pitch = np.radians(10.0)
        for key in ("KP", "KI"):
            scheduled = [getattr(g, key) / (1.0 + pitch / g.gain_schedule_pitch) for g in (found, published)]
            assert scheduled[0] == pytest.approx(scheduled[1], rel=0.06)


def test_the_floating_loop_is_slower_than_the_platform(scene):
    assert floating_frequency(scene) == pytest.approx(0.2, rel=0.005)  # OC3-Hywind's
    assert floating_frequency(scene) < platform_frequency(scene)
    assert land_frequency(scene.turbine) == pytest.approx(0.6, rel=1e-6)


def test_published_gains_are_taken_where_there_are_any(scene):
    assert with_gains(scene) is scene.turbine
    assert PISettings.published(scene.turbine).derived == ""
    assert pi(scene.turbine, 0.1).information == PI.inputs


def test_derived_gains_need_the_plant_and_take_its_platform(nameless):
    controller = pi(nameless.turbine, 0.1)
    assert "plant_model" in controller.information
    before = controller.parameters.copy()
    controller.prepare(nameless)
    gains = published_set(with_gains(nameless), "floating")
    changed = np.flatnonzero(before != controller.parameters)
    assert changed.size
    expected = PISettings.published(with_gains(nameless)).parameters(0.1)
    assert controller.parameters == pytest.approx(expected)
    assert gains.KI < published_set(with_gains(nameless), "land").KI


def test_factors_on_gains_stay_when_the_platform_is_known(nameless):
    published = PISettings.published(nameless.turbine)
    changed = PISettings.published(nameless.turbine, KI=0.5 * published.KI)
    here = PISettings.published(with_gains(nameless))
    assert changed.for_scene(nameless).KI == pytest.approx(0.5 * here.KI)
    assert changed.for_scene(nameless).KP == pytest.approx(here.KP)


@pytest.mark.parametrize("factory", [pi, pi_land])
def test_a_turbine_without_published_gains_is_held_at_rated_speed(nameless, factory):
    frame = simulate(nameless, controller=factory, duration=100.0)
    assert frame["RotSpeed_[rpm]"].iloc[-200:].mean() == pytest.approx(12.1, rel=0.01)


def test_an_unknown_set_is_refused(scene):
    with pytest.raises(InputError, match=r"gain set 'sea'.*floating"):
        PISettings.published(scene.turbine, "sea")


def test_a_rotor_that_never_reaches_rated_torque_is_refused(scene):
    law = scene.turbine.torque_law
    weak = scene.turbine.model_copy(
        update={"torque_law": law.model_copy(update={"rated_torque": 50.0 * law.rated_torque})}
    )
    with pytest.raises(InputError, match="does not reach rated torque"):
        derived_gains(weak, 0.2)


@pytest.mark.nightly
def test_on_a_tower_that_bends_the_platform_pitches_as_slowly():
    """With the mass of nacelle and rotor; radiation memory is held, which makes it 3 % quicker."""
    scene = build_scene("iea15_volturnus_s", wind=18.0, fidelity="fast", tower="modes")
    period = 2.0 * np.pi / platform_frequency(scene)
    assert period == pytest.approx(scene.platform.published["natural_periods"]["pitch"], rel=0.05)
