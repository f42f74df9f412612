"""Torque law, shaft balance and pitch actuator against theory.md section 3."""

import numpy as np
import pytest
from naive.pi import oc3_torque
from naive.turbine import torque_law, turbine

from fowt_env.errors import InputError
from fowt_env.plant.drivetrain import build_drivetrain, build_torque_curve, generator_torque, shaft_torque
from fowt_env.plant.pitch_actuator import PitchActuator, build_pitch_actuator, followed_pitch, pitch_rate

pytestmark = pytest.mark.installation


def test_the_parabola_meets_the_slip_line_at_the_published_speed():
    curve = build_torque_curve(torque_law())
    assert curve.region25_start_speed == pytest.approx(119.1127, abs=5e-5)
    assert curve.synchronous_speed == pytest.approx(110.6186, abs=5e-5)


@pytest.mark.parametrize(
    "speed, torque",
    [
        (0.0, 0.0),
        (70.16224, 0.0),
        (80.0, 2.332287 * 91.21091**2 / (91.21091 - 70.16224) * (80.0 - 70.16224)),
        (91.21091, 2.332287 * 91.21091**2),
        (110.0, 2.332287 * 110.0**2),
        (120.0, 43093.55 / (121.6805 - 110.6186) * (120.0 - 110.6186)),
        (121.6805, 43093.55),
        (122.9096, 43093.55),
        (150.0, 43093.55),
    ],
)
def test_oc3_torque_follows_the_table_of_regions(speed, torque):
    # 1e-5: the table rounds the synchronous speed to 7 digits
    assert generator_torque(speed, 0.0, build_torque_curve(torque_law())) == pytest.approx(torque, rel=1e-5)


def test_land_torque_gives_rated_power_above_rated_and_is_capped():
    curve = build_torque_curve(torque_law(), "constant_power")
    for speed in (121.6805, 122.9096, 135.0):
        assert generator_torque(speed, 0.0, curve) * speed == pytest.approx(5296610.0, rel=1e-12)
    assert generator_torque(90.0, 0.1, curve) == 47402.91  # region 3 forced by the blade pitch


@pytest.mark.parametrize("region3", ["constant_torque", "constant_power"])
def test_torque_is_continuous_at_every_region_border(region3):
    curve = build_torque_curve(torque_law(), region3)
    borders = (
        curve.cut_in_speed,
        curve.region2_start_speed,
        curve.region25_start_speed,
        curve.region3_start_speed,
    )
    for speed in borders:
        below, above = (generator_torque(speed * (1.0 + side * 1e-12), 0.0, curve) for side in (-1, 1))
        assert abs(above - below) < 1e-5  # N m; the steepest slope, 3935 N m s, times 2.4e-10 rad/s


def test_blade_pitch_above_its_threshold_forces_region_3():
    curve = build_torque_curve(torque_law())
    assert generator_torque(100.0, 0.0174, curve) == pytest.approx(2.332287 * 100.0**2)
    assert generator_torque(100.0, 0.01745329, curve) == 43093.55


@pytest.mark.parametrize("region3", ["constant_torque", "constant_power"])
def test_a_standing_or_reversed_shaft_gets_no_torque(region3):
    curve = build_torque_curve(torque_law(), region3)
    for speed in (0.0, -1e-9, -50.0):
        for pitch in (0.0, 1.57):
            assert generator_torque(speed, pitch, curve) == 0.0


@pytest.mark.parametrize("power_law", [False, True])
def test_torque_equals_its_naive_twin(power_law):
    curve = build_torque_curve(torque_law(), "constant_power" if power_law else "constant_torque")
    rng = np.random.default_rng(1)
    for speed, pitch in zip(rng.uniform(1.0, 160.0, 2000), rng.uniform(0.0, 0.035, 2000), strict=False):
        expected = oc3_torque(speed, pitch, power_law)
        assert generator_torque(speed, pitch, curve) == pytest.approx(expected, rel=1e-12, abs=1e-9)


def test_a_parabola_that_misses_the_slip_line_is_refused_by_name():
    with pytest.raises(InputError, match="region2_constant = 3.6"):
        build_torque_curve(torque_law(region2_constant=3.6))  # above the line everywhere
    with pytest.raises(InputError, match="region2_constant = 0.0001"):
        build_torque_curve(torque_law(region2_constant=1e-4, region2_start_speed=115.0))


def test_an_unknown_region_3_law_gets_a_suggestion():
    with pytest.raises(InputError, match="Did you mean 'constant_power'"):
        build_torque_curve(torque_law(), "constant_powr")


def test_inertias_are_the_published_ones():
    drivetrain = build_drivetrain(turbine())
    assert drivetrain.inertia_row == pytest.approx(4.38584e7, rel=1e-6)  # model-choices.md, OC3-Hywind
    assert drivetrain.coupling == pytest.approx(3.88847e7, rel=1e-6)


def test_shaft_balances_at_rated_without_losses():
    drivetrain = build_drivetrain(turbine())
    assert shaft_torque(97.0 * 43093.55, 43093.55, 1.267, drivetrain) == pytest.approx(0.0, abs=1e-8)
    assert shaft_torque(1e6, 0.0, 1.267, drivetrain) == 1e6


def test_losses_at_rated_are_their_share_of_the_rated_torque():
    tau_0 = 97.0 * 43093.55
    drivetrain = build_drivetrain(turbine(mesh_loss=0.03, bearing_loss=0.02))
    balance = shaft_torque(0.0, 43093.55, 122.9096 / 97.0, drivetrain)
    assert balance == pytest.approx(-(1.03 + 0.02) * tau_0, rel=1e-12)


def test_losses_never_give_power():
    lossless = build_drivetrain(turbine())
    lossy = build_drivetrain(turbine(mesh_loss=0.05, bearing_loss=0.01))
    rng = np.random.default_rng(2)
    for speed, torque in zip(rng.normal(0.0, 1.0, 500), rng.normal(0.0, 3e4, 500), strict=False):
        lost = shaft_torque(0.0, torque, speed, lossless) - shaft_torque(0.0, torque, speed, lossy)
        assert lost * speed > 0.0


def test_a_motoring_generator_delivers_its_torque_less_the_mesh_loss():
    drivetrain = build_drivetrain(turbine(mesh_loss=0.05))
    assert shaft_torque(0.0, -1e4, 1.0, drivetrain) == pytest.approx(97.0 * 1e4 / 1.05, rel=1e-12)


def test_actuator_lags_by_its_time_constant_and_keeps_its_limits():
    actuator = build_pitch_actuator(turbine().pitch_drive)
    assert pitch_rate(0.1, 0.101, actuator) == pytest.approx(0.001 / 0.2, rel=1e-9)
    assert pitch_rate(0.1, 1.0, actuator) == 0.1396263
    assert pitch_rate(1.0, 0.1, actuator) == -0.1396263
    assert pitch_rate(0.0, -1.0, actuator) == 0.0  # the command is limited, not only the rate
    assert pitch_rate(1.57, 9.9, actuator) == pytest.approx((1.570796 - 1.57) / 0.2)


def test_actuator_rate_equals_the_plain_formula():
    actuator = build_pitch_actuator(turbine().pitch_drive)
    rng = np.random.default_rng(3)
    for pitch, command in rng.uniform(-0.3, 1.9, (500, 2)):
        expected = np.clip((np.clip(command, 0.0, 1.570796) - pitch) / 0.2, -0.1396263, 0.1396263)
        assert pitch_rate(pitch, command, actuator) == pytest.approx(expected, rel=1e-14)


def test_an_actuator_without_lag_follows_at_once_within_its_rate():
    actuator = PitchActuator(time_constant=0.0, rate_limit=0.1, minimum=0.0, maximum=1.5)
    assert pitch_rate(0.2, 0.9, actuator) == 0.0
    assert followed_pitch(0.2, 0.204, 0.05, actuator) == pytest.approx(0.204, rel=1e-15)
    assert followed_pitch(0.2, 0.9, 0.05, actuator) == pytest.approx(0.205, rel=1e-15)
    assert followed_pitch(0.001, -1.0, 0.05, actuator) == 0.0


def test_an_actuator_with_lag_starts_its_step_where_it_was():
    actuator = build_pitch_actuator(turbine().pitch_drive)
    assert followed_pitch(0.2, 0.9, 0.05, actuator) == 0.2
