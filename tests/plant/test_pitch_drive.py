from math import exp, inf

import numpy as np
import pytest
from scipy.linalg import expm

from fowt_env.plant.blade_pitches import BladePitches, advance_pitches, fill_pitch_rates, pitches_jump
from fowt_env.plant.drivetrain import TorqueLag, advance_torque, fill_torque_rate, torque_in_force
from fowt_env.plant.pitch_drive import PitchDrive, drive_acceleration, drive_after, halt_drive, propagator
from fowt_env.plant.state import Command, State
from tests.naive.pitch_drive import NaiveDrive, play

W, ZETA = 11.11, 0.6
RATE = 15  # index of the first pitch rate


def drive(
    w=W, zeta=ZETA, rate=inf, acceleration=inf, deadband=0.0, friction=0.0, low=-9.0, high=9.0, held=None
):
    return PitchDrive(w, zeta, rate, acceleration, deadband, friction, low, high, RATE, held)


def followed(made, commands, dt, parts=1, pitch=0.0):
    """(n, 2) pitch and rate at the end of each command's dt, got in so many steps."""
    rows, rate = [], 0.0
    for command in commands:
        for _ in range(parts):
            pitch, rate = drive_after(pitch, rate, float(command), dt / parts, made)
        rows.append((pitch, rate))
    return np.array(rows)


@pytest.mark.parametrize("zeta", [0.05, 0.6, 0.999999, 1.0, 1.000001, 3.0])
def test_without_limits_it_is_the_matrix_exponential(zeta):
    made, rng = drive(zeta=zeta), np.random.default_rng(1)
    matrix = np.array([[0.0, 1.0], [-(W**2), -2.0 * zeta * W]])
    for pitch, rate, target in rng.normal(0.0, 0.3, (20, 3)):
        for after in (1e-4, 0.0125, 0.1, 1.0):
            error, speed = expm(after * matrix) @ [pitch - target, rate]
            got = drive_after(pitch, rate, target, after, made)
            assert got == pytest.approx((target + error, speed), rel=1e-9, abs=1e-11)


def test_a_step_is_overshot_as_textbooks_say():
    made = drive()
    peak = np.pi / (W * np.sqrt(1.0 - ZETA**2))
    pitch, rate = drive_after(0.0, 0.0, 0.1, peak, made)
    assert pitch == pytest.approx(0.1 * (1.0 + exp(-np.pi * ZETA / np.sqrt(1.0 - ZETA**2))), rel=1e-12)
    assert rate == pytest.approx(0.0, abs=1e-12)


CASES = {  # limits that act in commands that leap by up to 0.3 rad
    "rate": {"rate": 0.14},
    "acceleration": {"acceleration": 0.8},
    "rate and acceleration": {"rate": 0.14, "acceleration": 0.5},
    "friction": {"friction": 0.02},
    "stops": {"low": 0.0, "high": 0.25},
    "all": {"rate": 0.14, "acceleration": 1.0, "friction": 0.004, "low": 0.0, "high": 0.25, "zeta": 0.3},
    "slow and stiff": {"w": 20.0, "zeta": 1.2, "rate": 0.035, "friction": 0.001},
}


@pytest.mark.parametrize("name", CASES)
def test_limits_and_friction_act_as_in_short_steps(name):
    rng = np.random.default_rng(sum(map(ord, name)))
    commands = np.clip(rng.normal(0.12, 0.12, 8), CASES[name].get("low", -9.0), CASES[name].get("high", 9.0))
    naive = NaiveDrive(**{"w": W, "zeta": ZETA} | CASES[name])
    got = followed(drive(**CASES[name]), commands, 0.3)
    for command, (pitch, rate) in zip(commands, got, strict=True):
        naive.advance(command, 0.3, 6000)
        # Euler's error: half a step of 5e-5 s times the accelerations that change, up to W^2 times 0.3 rad
        assert pitch == pytest.approx(naive.pitch, abs=3e-5)
        assert rate == pytest.approx(naive.rate, abs=1e-3)


@pytest.mark.parametrize("step", [0.1, 1.0])
@pytest.mark.parametrize("name", CASES)
def test_what_comes_out_does_not_depend_on_the_step(name, step):
    rng, made = np.random.default_rng(5), drive(**CASES[name])
    commands = np.clip(rng.normal(0.12, 0.12, 60), made.minimum, made.maximum)
    whole = followed(made, commands, step)
    for parts in (2, 7, 40):
        assert followed(made, commands, step, parts) == pytest.approx(whole, abs=1e-11)


@pytest.mark.parametrize("name", CASES)
def test_no_limit_is_passed(name):
    rng, made = np.random.default_rng(6), drive(**CASES[name])
    commands = np.repeat(rng.uniform(made.minimum, made.maximum, 40), 200)
    pitch, rate = followed(made, commands, 0.002).T
    assert np.abs(rate).max() <= made.rate_limit
    assert pitch.min() >= made.minimum and pitch.max() <= made.maximum
    change = np.abs(np.diff(rate)) / 0.002
    running = (pitch[1:] > made.minimum) & (pitch[1:] < made.maximum)  # a stop is met with a shock
    assert change[running].max() <= made.acceleration_limit * 1.002


def test_without_an_acceleration_limit_a_held_command_never_gains_energy():
    rng = np.random.default_rng(7)
    for name in ("rate", "friction", "stops", "slow and stiff"):
        made = drive(**CASES[name])
        low, high = max(made.minimum, -0.5), min(made.maximum, 0.5)
        for _ in range(20):
            target, pitch = rng.uniform(low, high, 2)
            rate = min(made.rate_limit, 1.0) * rng.uniform(-1.0, 1.0)
            energy = (made.natural_frequency * (pitch - target)) ** 2 + rate**2
            for _ in range(30):
                pitch, rate = drive_after(pitch, rate, target, 0.02, made)
                now = (made.natural_frequency * (pitch - target)) ** 2 + rate**2
                assert now <= energy * (1.0 + 1e-12) + 1e-20
                energy = now


def test_the_end_of_a_slewing_is_passed_whatever_rounding_leaves():
    made = drive(w=20.0, zeta=1.2, rate=0.035, friction=0.001)
    target = 0.049268249036087425
    rest = target - made.friction
    end = rest - 2.0 * made.damping * made.rate_limit / made.natural_frequency
    a, b, c, d = propagator(0.1, made)
    for ulps in range(-40, 41):
        pitch = end + ulps * np.spacing(end)
        wanted = rest + a * (pitch - rest) + b * 0.035, c * (pitch - rest) + d * 0.035
        assert drive_after(pitch, 0.035, target, 0.1, made) == pytest.approx(wanted, abs=1e-11)


def test_a_peak_of_the_rate_just_beyond_its_limit_is_cut():
    fastest = max(drive_after(0.0, 0.0, 0.1, t, drive())[1] for t in np.linspace(0.05, 0.15, 2001))
    made = drive(rate=0.9999 * fastest)
    whole = drive_after(0.0, 0.0, 0.1, 0.25, made)
    assert followed(made, [0.1], 0.25, 2000)[0] == pytest.approx(whole, abs=1e-11)
    assert abs(whole[0] - drive_after(0.0, 0.0, 0.1, 0.25, drive())[0]) > 1e-8


def test_a_far_step_slews_at_the_rate_limit_and_lags_by_two_zeta_over_w():
    made = drive(rate=0.14)
    _, rate = drive_after(0.0, 0.0, 2.0, 5.0, made)
    assert rate == 0.14
    at = drive_after(0.5, 0.14, 2.0, 1.0, made)
    assert at == pytest.approx((0.5 + 0.14, 0.14), rel=1e-14)
    ramp = followed(drive(), 0.01 * 0.02 * np.arange(1, 500), 0.02)
    behind = 0.01 * 0.02 * 499 + 0.01 * 0.01 - ramp[-1, 0]  # a staircase is half a step ahead in the mean
    assert behind == pytest.approx(0.01 * 2.0 * ZETA / W, rel=1e-3)


def test_friction_draws_the_loop_of_a_play():
    made = drive(friction=0.01)
    commands = np.concatenate(
        [np.linspace(0, 0.1, 2000), np.linspace(0.1, 0.02, 1600), np.linspace(0.02, 0.1, 1600)]
    )
    pitch = followed(made, commands, 0.1)[:, 0]
    # a command of 5e-5 rad each 0.1 s moves a blade in small leaps, which overshoot by a step of it at most
    assert pitch == pytest.approx(np.array(play(commands, 0.01)), abs=1e-4)
    assert pitch[1999] == pytest.approx(0.09, abs=1e-4) and pitch[3599] == pytest.approx(0.03, abs=1e-4)


def test_a_blade_sticks_until_the_pull_breaks_it_away():
    made = drive(friction=0.01)
    assert drive_after(0.1, 0.0, 0.1099, 1.0, made) == (0.1, 0.0)
    assert drive_acceleration(0.1, 0.0, 0.1099, made) == 0.0
    assert drive_acceleration(0.1, 0.0, 0.12, made) == pytest.approx(W**2 * 0.01)
    assert drive_acceleration(0.1, 1e-9, 0.12, made) == pytest.approx(W**2 * 0.01, rel=1e-6)
    assert drive_after(0.1, 0.0, 0.1101, 1.0, made)[0] > 0.1


# --------------------------------------------------------------------------- in the plant's state


def state(*pitches, held=()):
    """State vector of blades at rest, rates after the others' pitches, then what is held."""
    x = np.zeros(15 + (len(pitches) - 1) + len(pitches) + len(held))
    x[State.BLADE_PITCH], x[15 : 14 + len(pitches)] = pitches[0], pitches[1:]
    if held:
        x[-len(held) :] = held
    return x


def test_changes_within_the_deadband_are_not_followed_and_what_is_held_stays():
    made, x, y = drive(deadband=0.01, held=16), state(0.1, held=(0.1,)), np.zeros(17)
    for command, held in (
        (0.105, 0.1), (0.1099, 0.1), (0.1101, 0.1101), (0.1011, 0.1101), (0.1202, 0.1202), (0.0, 0.0)
    ):  # fmt: skip
        for _ in range(30):
            advance_pitches(x, np.array([0.0, command]), 0.1, made, None, y)
            x[14:] = y[14:]
        assert x[16] == held and x[State.BLADE_PITCH] == pytest.approx(held, abs=1e-6)


def test_each_blade_has_a_drive_of_its_own_with_the_same_limits():
    made = drive(rate=0.035, deadband=0.002, held=20)._replace(rate=17)
    pitches, x = BladePitches(15), state(0.1, 0.2, 0.3, held=(0.1, 0.2, 0.3))
    u, y, dx = np.array([0.0, 0.5, 0.1, 0.301]), x.copy(), np.zeros_like(x)
    advance_pitches(x, u, 1.0, made, pitches, y)
    assert y[[14, 15]] == pytest.approx(
        [drive_after(0.1, 0.0, 0.5, 1.0, made)[0], drive_after(0.2, 0.0, 0.1, 1.0, made)[0]], rel=1e-14
    )
    assert y[17:20] == pytest.approx([0.035, -0.035, 0.0], rel=1e-14)
    assert y[16] == 0.3 and y[20:] == pytest.approx([0.5, 0.1, 0.3])
    moving = y.copy()
    advance_pitches(moving, u, 0.1, made, pitches, y)
    for blade, command in ((1, 0.1), (2, 0.3)):
        wanted = drive_after(moving[14 + blade], moving[17 + blade], command, 0.1, made)
        assert (y[14 + blade], y[17 + blade]) == pytest.approx(wanted, rel=1e-14)
    fill_pitch_rates(y, u, made, pitches, dx)
    assert dx[14:17] == pytest.approx(y[17:20], rel=1e-14) and np.all(dx[17:] == 0.0)
    assert not pitches_jump(x, u, 0.1, made, pitches)


def test_a_blade_that_sticks_loses_its_rate_and_what_it_was_going_to():
    x = state(0.1, held=(0.105,))
    x[RATE] = 0.3
    halt_drive(0, int(State.BLADE_PITCH), x, drive(deadband=0.01, held=16))
    assert x[14:].tolist() == [0.1, 0.0, 0.1]


def test_the_torque_lags_as_an_exponential_of_whatever_step():
    converter, x, u = TorqueLag(0.05, 15), np.zeros(16), np.array([100.0, 0.0])
    whole, parts = x.copy(), x.copy()
    advance_torque(x, u, 0.1, converter, whole)
    for _ in range(8):
        advance_torque(parts, u, 0.0125, converter, parts)
    assert whole[15] == pytest.approx(100.0 * (1.0 - exp(-2.0)), rel=1e-14)
    assert parts[15] == pytest.approx(whole[15], rel=1e-13)
    dx = np.zeros(16)
    fill_torque_rate(whole, u, converter, dx)
    assert dx[15] == pytest.approx((100.0 - whole[15]) / 0.05, rel=1e-13)
    assert torque_in_force(whole, u, converter) == whole[15]
    assert torque_in_force(x, u, None) == u[Command.GENERATOR_TORQUE]
