"""Motion feedback on top of the PI law: what it feeds back, when, and that it damps the platform."""

from math import exp, inf, pi

import numpy as np
import pytest
from naive.turbine import turbine

from fowt_env import build_scene, simulate
from fowt_env.controllers import make
from fowt_env.controllers.floating_feedback import FeedbackSettings, FloatingFeedback
from fowt_env.controllers.pi import PISettings
from fowt_env.controllers.pi import pi as make_pi
from fowt_env.controllers.tuned import tuned
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement

TURBINE = turbine()
DT = 0.1
STILL = Measurement(*[0.0] * len(Measurement._fields))
RATED = STILL._replace(
    rotor_speed=1.267109, generator_speed=122.9096, generator_torque=43093.55, blade_pitch=0.25
)
BETA_K = 0.1099965


def fed(**settings):
    """A controller with this feedback on an unscheduled PI law, reset at rated speed and 0.25 rad."""
    law = FloatingFeedback(PISettings.published(TURBINE, scheduled=False), FeedbackSettings(**settings), DT)
    law.reset(RATED)
    return law


def answers(law, motion, signal="nacelle_velocity"):
    """(n, 2) commands at rated speed while a signal moves."""
    return np.array([law.act(RATED._replace(time=DT * k, **{signal: v})) for k, v in enumerate(motion)])


def test_without_gain_it_is_the_pi_law():
    plain = make_pi(TURBINE, DT)
    law = FloatingFeedback(plain.settings, FeedbackSettings(pitch_gain=0.0), DT)
    plain.reset(RATED)
    law.reset(RATED)
    rng = np.random.default_rng(3)
    for k in range(300):
        speed, motion = 122.9 + 8.0 * rng.standard_normal(), rng.standard_normal()
        m = RATED._replace(time=DT * k, generator_speed=speed, nacelle_velocity=motion)
        assert law.act(m) == plain.act(m)


def test_the_blades_follow_the_motion_through_the_filters_that_are_named():
    high, low = 0.02, 0.4
    motion = np.sin(2.0 * pi / 30.0 * DT * np.arange(2000))
    law = fed(pitch_gain=0.02, high_pass=high, low_pass=low)
    slow = one = two = 0.0
    expected = []
    for value in motion:
        slow = (1.0 - exp(-DT * high)) * value + exp(-DT * high) * slow
        one = (1.0 - exp(-DT * low)) * (value - slow) + exp(-DT * low) * one
        two = (1.0 - exp(-DT * low)) * one + exp(-DT * low) * two
        expected.append(0.25 + 0.02 * two)
    commands = answers(law, motion)
    np.testing.assert_allclose(commands[:, 1], expected, rtol=0.0, atol=1e-9)
    assert commands[:, 1].max() > 0.255  # and not by standing still
    np.testing.assert_array_equal(commands[:, 0], commands[0, 0])


def test_the_motion_at_reset_is_taken_as_the_mean_one():
    law = FloatingFeedback(PISettings.published(TURBINE), FeedbackSettings(pitch_gain=0.05), DT)
    law.reset(RATED._replace(nacelle_velocity=0.8))
    assert answers(law, [0.8] * 50)[:, 1] == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize("pitch", [0.05, 0.1099965, 0.3])
def test_a_scheduled_gain_follows_the_schedule_of_the_pi_law(pitch):
    moved = {}
    for scheduled in (False, True):
        law = FloatingFeedback(
            PISettings.published(TURBINE),
            FeedbackSettings(pitch_gain=0.002, high_pass=0.0, low_pass=inf, scheduled=scheduled),
            DT,
        )
        law.reset(RATED._replace(blade_pitch=pitch))
        moved[scheduled] = law.act(RATED._replace(blade_pitch=pitch, nacelle_velocity=1.0))[1] - pitch
    assert moved[False] == pytest.approx(0.002)
    assert moved[True] == pytest.approx(0.002 / (1.0 + pitch / BETA_K))


def test_the_torque_channel_takes_its_share_within_the_limits_of_the_drive():
    # the commands of torque move by at most 1,500 N m in 0.1 s
    law = fed(pitch_gain=0.0, torque_gain=1000.0, high_pass=0.0, low_pass=inf)
    torque = answers(law, [0.0, 0.5, -0.5, 0.0])[:, 0] - 43093.55
    assert torque == pytest.approx([0.0, 500.0, -500.0, 0.0], abs=1e-6)
    law = fed(pitch_gain=0.0, torque_gain=1e5, high_pass=0.0, low_pass=inf)
    torque = answers(law, [5.0] * 100)[:, 0]
    assert np.diff(torque).max() <= 1500.0 + 1e-6 and torque[-1] == pytest.approx(47402.91)


def test_below_rated_nothing_is_fed_back():
    plain = make_pi(TURBINE, DT)
    law = FloatingFeedback(plain.settings, FeedbackSettings(pitch_gain=0.1, torque_gain=1e4), DT)
    start = RATED._replace(generator_speed=100.0, blade_pitch=0.0, generator_torque=25000.0)
    plain.reset(start)
    law.reset(start)
    for k in range(100):
        m = start._replace(time=DT * k, nacelle_velocity=np.sin(0.2 * DT * k))
        assert law.act(m) == plain.act(m)


def test_platform_pitch_rate_can_be_fed_back_instead():
    law = fed(signal="platform_pitch_rate", pitch_gain=1.0, high_pass=0.0, low_pass=inf)
    assert answers(law, [0.01], "platform_pitch_rate")[0, 1] == pytest.approx(0.26)
    assert "platform_pitch_rate" in law.information and "nacelle_velocity" not in law.information


@pytest.fixture(scope="module")
def windy():
    return build_scene("oc3_hywind", wind=18.0, duration=300.0, fidelity="standard")


def left_swing(scene, controller):
    """Standard deviation (deg) of the platform pitch from 100 to 200 s after a start at 6 deg."""
    frame = simulate(scene, controller, duration=200.0, initial={"PtfmPitch": 6.0})
    return frame["PtfmPitch_[deg]"].iloc[1000:].std()


def test_more_gain_damps_more_and_the_wrong_sign_drives_the_platform(windy):
    best = tuned("floating_feedback")
    published = PISettings.published(windy.turbine)
    laws = [
        FloatingFeedback(published, FeedbackSettings(**best | {"pitch_gain": gain}), DT)
        for gain in (0.03, 0.01, 0.0, -0.02)
    ]
    swings = [left_swing(windy, law) for law in laws]
    assert left_swing(windy, "floating_feedback") < 0.5 * swings[2]
    assert swings == sorted(swings) and swings[0] < 0.8 * swings[2] and swings[3] > 1.2 * swings[2]


def test_settings_out_of_range_are_named():
    for key, value in (
        ("signal", "nacelle_velocty"), ("pitch_gain", float("nan")), ("torque_gain", inf),
        ("high_pass", -0.1), ("low_pass", 0.02), ("low_pass", float("nan")),
    ):  # fmt: skip
        with pytest.raises(InputError, match=key):
            FeedbackSettings(**{key: value})


def test_the_controller_of_that_name_has_the_tuned_settings():
    law = make("floating_feedback", read_turbine("nrel5mw"), DT)
    assert law.feedback == FeedbackSettings(**tuned("floating_feedback"))
