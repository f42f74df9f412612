"""The PI law, the torque law around it, and the printed Eq. (8), against theory.md sections 3 and 4."""

import math

import numpy as np
import pytest
from naive.pi import NaivePI
from naive.turbine import turbine

from fowt_env.controllers.gains import gains
from fowt_env.controllers.pi import PI, Memory, PISettings, schedule_gain
from fowt_env.controllers.printed_eq8 import Eq8Literal, literal_gain
from fowt_env.errors import InputError
from fowt_env.plant.drivetrain import generator_torque
from fowt_env.plant.measurement import Measurement

pytestmark = pytest.mark.installation

TURBINE = turbine()
RATED_SPEED = TURBINE.rated_rotor_speed
BETA_K = 0.1099965
STILL = Measurement(*[0.0] * len(Measurement._fields))._replace(generator_torque=43093.55)

# Linear one-degree-of-freedom rotor at 18 m/s (theory.md, section 4): constant torque, no change of
# aerodynamic torque with speed, power slope over blade pitch from the gain schedule's own fit.
TRIM_PITCH = math.radians(14.92)
INERTIA = 4.38584e7
TORQUE_SLOPE = -25.52e6 * (1.0 + TRIM_PITCH / BETA_K) / RATED_SPEED  # N m/rad


def at_speed(rotor_speed, blade_pitch=0.0, time=0.0, torque=43093.55):
    """Measurement at a rotor speed."""
    return STILL._replace(
        time=time, rotor_speed=rotor_speed, generator_speed=97.0 * rotor_speed, blade_pitch=blade_pitch,
        generator_torque=torque,
    )  # fmt: skip


def oc3(control_dt, **changes):
    """OC3 controller with changed settings."""
    return PI(PISettings.published(TURBINE, **changes), control_dt)


class LinearRotor:
    """The one-degree-of-freedom rotor with a blade-pitch lag (0: none), exact between commands."""

    def __init__(self, lag):
        self.speed, self.pitch, self.lag = RATED_SPEED, TRIM_PITCH, lag

    def advance(self, torque, command, dt, disturbance=0.0):
        left = math.exp(-dt / self.lag) if self.lag > 0.0 else 0.0
        travelled = (command - TRIM_PITCH) * dt + (self.pitch - command) * self.lag * (1.0 - left)
        balance = 97.0 * (43093.55 - torque) + disturbance
        self.speed += (TORQUE_SLOPE * travelled + balance * dt) / INERTIA
        self.pitch = command + (self.pitch - command) * left


def simulate(controller, control_dt, seconds, disturbance, lag=0.2):
    """(n, 2) rotor-speed error and blade pitch of the linear rotor under a controller."""
    rotor = LinearRotor(lag)
    controller.reset(at_speed(rotor.speed, rotor.pitch))
    rows = np.empty((round(seconds / control_dt), 2))
    for k in range(len(rows)):
        time = k * control_dt
        torque, command = controller.act(at_speed(rotor.speed, rotor.pitch, time))
        rotor.advance(torque, command, control_dt, disturbance(time))
        rows[k] = rotor.speed - RATED_SPEED, rotor.pitch
    return rows


PI_STATES = (Memory.FILTERED_SPEED, Memory.PITCH_COMMAND, Memory.INTEGRAL)


def loop_roots(controller, control_dt, lag, time=0.0, states=PI_STATES):
    """Continuous-time roots of the sampled loop about trim, by finite differences of one period."""
    controller.reset(at_speed(RATED_SPEED, TRIM_PITCH))
    controller.act(at_speed(RATED_SPEED, TRIM_PITCH))
    settled = controller.memory.copy()

    def period(z):
        rotor = LinearRotor(lag)
        rotor.speed, rotor.pitch = RATED_SPEED + z[0], TRIM_PITCH + z[1]
        controller.memory[:] = settled
        for entry, change in zip(states, z[2:], strict=False):
            controller.memory[entry] += change
        torque, command = controller.act(at_speed(rotor.speed, rotor.pitch, time))
        rotor.advance(torque, command, control_dt)
        memory = [controller.memory[entry] - settled[entry] for entry in states]
        return np.array([rotor.speed - RATED_SPEED, rotor.pitch - TRIM_PITCH, *memory])

    small = 1e-6 * np.diag([1.0, 1.0, 97.0, 1.0, 1.0][: 2 + len(states)])
    jacobian = np.stack([(period(d) - period(-d)) / (2.0 * d.sum()) for d in small], axis=1)
    factors = np.linalg.eigvals(jacobian)
    return np.log(factors[np.abs(factors) > 1e-9].astype(complex)) / control_dt


def slowest_pair(roots):
    """(natural frequency rad/s, damping ratio) of the oscillation with the lowest frequency."""
    pair = min((r for r in roots if r.imag > 1e-6), key=abs)
    return abs(pair), -pair.real / abs(pair)


def frozen_gain():
    """Unscheduled settings with the gains that the schedule has at the trim pitch."""
    GK = 1.0 / (1.0 + TRIM_PITCH / BETA_K)
    return {"scheduled": False, "KP": GK * 0.006275604, "KI": GK * 0.0008965149}


# --- gains and schedule


@pytest.mark.parametrize(
    "frequency, KP, KI",
    [(0.2, 0.006275604, 0.0008965149), (0.6, 0.01882681, 0.008068634)],
    ids=["oc3", "land"],
)
def test_the_gain_formula_reproduces_the_published_gains(frequency, KP, KI):
    found = gains(frequency, 0.7, 43784725.0, 122.9096 / 97.0, 97.0, -25.52e6)
    assert found == pytest.approx((KP, KI), rel=1e-4)


@pytest.mark.parametrize(
    "key, value",
    [("design_frequency", -0.2), ("damping", float("nan")), ("gear_ratio", 0.0), ("dP_dpitch", 25.52e6)],
)
def test_the_gain_formula_names_what_it_cannot_use(key, value):
    good = {
        "design_frequency": 0.2, "damping": 0.7, "inertia": 4.4e7, "rated_speed": 1.267, "gear_ratio": 97.0,
        "dP_dpitch": -25.52e6,
    }  # fmt: skip
    with pytest.raises(InputError, match=f"{key} = {value}"):
        gains(**(good | {key: value}))


def test_the_schedule_halves_the_gain_at_its_pitch():
    assert schedule_gain(0.0, BETA_K) == 1.0
    assert schedule_gain(BETA_K, BETA_K) == 0.5
    assert schedule_gain(TRIM_PITCH, BETA_K) == pytest.approx(0.2970, abs=5e-5)
    assert schedule_gain(0.7, math.inf) == 1.0


@pytest.mark.parametrize(
    "key, value",
    [
        ("KP", -0.1), ("KI", float("nan")), ("KI", 0.0), ("gain_schedule_pitch", -0.1),
        ("speed_filter_corner", float("nan")), ("pitch_rate_limit", 0.0), ("pitch_maximum", -0.1),
        ("pitch_minimum", -0.1), ("torque_rate_limit", float("inf")),
    ],
)  # fmt: skip
def test_settings_that_make_no_sense_are_named(key, value):
    with pytest.raises(InputError, match=f"{key} = {value}"):
        PISettings.published(TURBINE, **{key: value})


def test_unknown_settings_gain_sets_and_schedules_get_suggestions():
    with pytest.raises(InputError, match="Did you mean 'land'"):
        PISettings.published(TURBINE, "lnd")
    with pytest.raises(InputError, match="Did you mean 'pitch_minimum'"):
        PISettings.published(TURBINE, pitch_minimun=0.0)
    with pytest.raises(InputError, match="Did you mean 'measured'"):
        PISettings.published(TURBINE, schedule_on="measurd")


# --- the law, step by step


@pytest.mark.parametrize("control_dt", [0.0125, 0.1, 1.0])
@pytest.mark.parametrize(
    "settings, naive",
    [
        ({}, {"KP": 0.006275604, "KI": 0.0008965149, "beta_K": BETA_K}),
        ({"scheduled": False}, {"KP": 0.006275604, "KI": 0.0008965149, "beta_K": None}),
        (
            {"gain_set": "land", "region3": "constant_power", "schedule_on": "measured"},
            {"KP": 0.01882681, "KI": 0.008068634, "beta_K": BETA_K, "measured": True, "power_law": True},
        ),
        (
            {"speed_filter_corner": math.inf},
            {"KP": 0.006275604, "KI": 0.0008965149, "beta_K": BETA_K, "corner": math.inf},
        ),
    ],
    ids=["oc3", "unscheduled", "land_power_measured", "unfiltered"],
)
def test_the_compiled_law_equals_its_naive_twin(settings, naive, control_dt):
    rng = np.random.default_rng(5)
    controller, twin = oc3(control_dt, **settings), NaivePI(control_dt=control_dt, **naive)
    for _start in range(10):
        speed, pitch, torque = rng.uniform(60.0, 140.0), rng.uniform(-0.05, 0.5), rng.uniform(0.0, 5e4)
        controller.reset(at_speed(speed / 97.0, pitch, torque=torque))
        twin.start(97.0 * (speed / 97.0), pitch, torque)
        for _ in range(300):
            speed = float(np.clip(speed + rng.normal(0.0, 3.0), 0.0, 160.0))
            pitch = rng.uniform(-0.05, 0.5)
            found = controller.act(at_speed(speed / 97.0, pitch))
            expected = twin.step(97.0 * (speed / 97.0), pitch)
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("control_dt", [0.0125, 0.1, 1.0])
def test_the_speed_filter_is_exact_for_a_held_speed_at_any_period(control_dt):
    controller = oc3(control_dt)
    controller.reset(at_speed(1.2))
    for _ in range(round(5.0 / control_dt)):
        controller.act(at_speed(1.3))
    expected = 97.0 * (1.3 - 0.1 * math.exp(-1.570796 * 5.0))
    assert controller.memory[Memory.FILTERED_SPEED] == pytest.approx(expected, rel=1e-13)


def test_commands_move_no_faster_than_their_rates():
    controller = oc3(0.1)
    controller.reset(at_speed(RATED_SPEED, 0.2))
    rng = np.random.default_rng(6)
    speeds = np.repeat(rng.choice([0.3, 2.5], 40), rng.integers(1, 150, 40))
    commands = [controller.act(at_speed(speed)) for speed in speeds]
    torque_steps, pitch_steps = np.abs(np.diff(commands, axis=0)).T
    assert torque_steps.max() == pytest.approx(1500.0, rel=1e-9)
    assert pitch_steps.max() == pytest.approx(0.01396263, rel=1e-9)


# --- windup, start


def test_a_long_stay_below_rated_does_not_wind_up():
    controller = oc3(0.1, speed_filter_corner=math.inf)
    controller.reset(at_speed(1.0))
    for _ in range(36000):  # an hour
        assert controller.act(at_speed(1.0))[1] == 0.0
    assert controller.memory[Memory.INTEGRAL] == 0.0
    _, pitch = controller.act(at_speed(RATED_SPEED + 0.02))
    assert pitch == pytest.approx(97.0 * (0.006275604 + 0.0008965149 * 0.1) * 0.02, rel=1e-9)


def test_a_long_stay_above_rated_winds_up_no_further_than_feather():
    controller = oc3(0.1, speed_filter_corner=math.inf)
    controller.reset(at_speed(RATED_SPEED, 0.2))
    for _ in range(36000):
        controller.act(at_speed(1.5))
    gain = schedule_gain(1.570796, BETA_K) * 97.0 * 0.0008965149
    assert controller.memory[Memory.INTEGRAL] * gain == pytest.approx(1.570796, rel=1e-12)


@pytest.mark.parametrize("schedule_on", ["commanded", "measured"])
@pytest.mark.parametrize("control_dt", [0.0125, 0.1, 1.0])
def test_the_first_command_is_the_measured_blade_pitch(schedule_on, control_dt):
    controller = oc3(control_dt, schedule_on=schedule_on)
    rng = np.random.default_rng(7)
    for speed, pitch in zip(rng.uniform(1.15, 1.3, 200), rng.uniform(0.1, 0.5, 200), strict=False):
        start = at_speed(speed, pitch)
        controller.reset(start)
        assert controller.bumpless
        assert controller.act(start)[1] == pytest.approx(pitch, rel=1e-12)


def test_a_start_below_rated_leaves_no_integral_behind():
    controller = oc3(0.1)
    start = at_speed(0.9, 0.0)
    controller.reset(start)
    assert controller.bumpless
    assert controller.act(start)[1] == 0.0
    assert controller.memory[Memory.INTEGRAL] == 0.0


def test_a_start_that_cannot_be_bumpless_says_so_and_keeps_the_rate_limit():
    controller = oc3(0.1)
    start = at_speed(1.6, 0.05)  # the proportional term alone asks for 0.14 rad
    controller.reset(start)
    assert not controller.bumpless
    assert controller.act(start)[1] == pytest.approx(0.05 + 0.01396263, rel=1e-12)
    controller.reset(at_speed(RATED_SPEED, 0.2))
    assert controller.bumpless


def test_the_torque_starts_where_it_is_measured_or_at_the_curve():
    controller = oc3(0.1)
    controller.reset(at_speed(1.0, torque=1e4))
    assert controller.act(at_speed(1.0))[0] == pytest.approx(1e4 + 1500.0)
    controller.reset(at_speed(1.0, torque=float("nan")))
    expected = generator_torque(97.0, 0.0, controller.settings.curve)
    assert controller.act(at_speed(1.0))[0] == pytest.approx(expected, rel=1e-12)


# --- closed loop with the linear rotor at 18 m/s


def test_a_constant_disturbance_leaves_no_mean_speed_error():
    for control_dt in (0.05, 0.5):
        rows = simulate(oc3(control_dt), control_dt, 900.0, lambda t: 0.3e6)
        assert abs(np.mean(rows[rows.shape[0] * 2 // 3 :, 0])) < 1e-6
        assert np.abs(rows[:, 0]).max() > 1e-3  # the disturbance was felt
        assert rows[-1, 1] - TRIM_PITCH == pytest.approx(-0.3e6 / TORQUE_SLOPE, rel=1e-6)


def test_the_design_loop_is_0_200_rad_per_s_at_0_70():
    # The design's assumptions: gain held at its trim value, no filter, no lag. 0.1998 and 0.699, not 0.2
    # and 0.7, since the gains were computed for a slightly smaller inertia.
    controller = oc3(0.002, speed_filter_corner=math.inf, **frozen_gain())
    frequency, damping = slowest_pair(loop_roots(controller, 0.002, lag=0.0))
    assert frequency == pytest.approx(0.1998, abs=2e-4)
    assert damping == pytest.approx(0.6994, abs=2e-3)


def test_filter_and_lag_slow_the_loop_as_linear_theory_says():
    controller = oc3(0.005, **frozen_gain())
    found = slowest_pair(loop_roots(controller, 0.005, lag=0.2))
    b = -TORQUE_SLOPE / INERTIA
    s = np.polynomial.Polynomial([0.0, 1.0])
    GK = 1.0 / (1.0 + TRIM_PITCH / BETA_K)
    pi_part = GK * 97.0 * (0.006275604 * s + 0.0008965149) * b
    expected = slowest_pair((s**2 * (0.2 * s + 1.0) * (s / 1.570796 + 1.0) + pi_part).roots())
    # the hold of half a period, 2.5 ms, is not in the polynomial
    assert found == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("schedule_on, lag", [("commanded", 0.0), ("measured", 0.02)])
def test_the_schedule_inside_the_loop_lowers_its_gain_by_2_minus_GK(schedule_on, lag):
    # GK(beta) multiplies the whole integral, so a rise of beta lowers the command that made it:
    # beta (1 + beta/beta_K) = u has the slope 1/(1 + 2 beta/beta_K) = GK/(2 - GK), not GK.
    controller = oc3(0.002, speed_filter_corner=math.inf, schedule_on=schedule_on)
    frequency, damping = slowest_pair(loop_roots(controller, 0.002, lag))
    GK = 1.0 / (1.0 + TRIM_PITCH / BETA_K)
    gain = GK / (2.0 - GK) * -TORQUE_SLOPE / INERTIA
    expected = math.sqrt(gain * 97.0 * 0.0008965149)
    assert frequency == pytest.approx(expected, rel=5e-3)
    assert damping == pytest.approx(gain * 97.0 * 0.006275604 / (2.0 * expected), rel=1e-2)


# --- the printed Eq. (8)


def test_the_printed_gain_grows_with_time():
    parameters = Eq8Literal(PISettings.published(TURBINE), 0.1).parameters
    start = literal_gain(0.0, parameters)
    assert start == pytest.approx(0.608734, rel=1e-6)
    for time, factor in ((60.0, 9.6), (600.0, 86.7), (3600.0, 515.0)):
        assert literal_gain(time, parameters) / start == pytest.approx(factor, rel=5e-3)


def test_the_printed_law_leaves_an_offset_that_fades_like_one_over_time():
    settings = PISettings.published(TURBINE, speed_filter_corner=math.inf)
    rows = simulate(Eq8Literal(settings, 0.01), 0.01, 1800.0, lambda t: 0.3e6 if t > 100.0 else 0.0)
    for start, stop, offset in ((200, 400, 5.9e-4), (800, 1000, 1.9e-4), (1600, 1800, 1.0e-4)):
        mean = np.mean(rows[100 * start : 100 * stop, 0])
        assert mean == pytest.approx(offset, rel=0.05)  # the published offsets have two digits


def test_the_printed_law_goes_unstable_with_time():
    # Routh: with filter corner w and lag tau the proportional loop is stable up to K b = 1/tau + w.
    GK = 1.0 / (1.0 + TRIM_PITCH / BETA_K)
    most = (1.0 / 0.2 + 1.570796) / (-TORQUE_SLOPE / INERTIA * GK)
    limit = 7.0 * (most / 0.608734 - 1.0)
    controller = Eq8Literal(PISettings.published(TURBINE), 0.002)

    def growth(time):
        return loop_roots(controller, 0.002, 0.2, time, PI_STATES[:2]).real.max()

    assert growth(0.9 * limit) < 0.0 < growth(1.1 * limit)


def test_the_printed_law_counts_its_time_from_the_reset():
    settings = PISettings.published(TURBINE, speed_filter_corner=math.inf)
    controller = Eq8Literal(settings, 1.0)
    gain = 0.608734 / (1.0 + 0.3 / BETA_K)
    for elapsed, factor in ((0.0, 1.0), (70.0, 11.0)):  # 1 + t/tau_i with tau_i = 7.0000 s
        controller.reset(at_speed(RATED_SPEED, 0.3, time=50.0))
        _, pitch = controller.act(at_speed(RATED_SPEED + 0.01, 0.3, time=50.0 + elapsed))
        assert pitch - 0.3 == pytest.approx(gain * factor * 0.01, rel=1e-5)
