"""The assembled linear closed loop against the nonlinear plant, and what the gains do to the platform."""

import numpy as np
import pytest

from fowt_env import build_scene, linearize, simulate, trim
from fowt_env.analysis.linear_model import modes
from fowt_env.analysis.trim import AZIMUTHS, mean_derivative, without_fluctuations
from fowt_env.controllers.design.closed_loop import closed_loop_matrix, platform_pitch_damping
from fowt_env.controllers.pi import PISettings
from fowt_env.errors import InputError
from fowt_env.plant.drivetrain import generator_torque
from fowt_env.plant.state import STATE_INDEX, State


@pytest.fixture(scope="module")
def above_rated():
    scene = build_scene("oc3_hywind", wind=18.0, fidelity="reference")
    return scene, linearize(scene, trim(scene))


def nonlinear_closed_loop(scene, settings):
    """z -> dz/dt of plant, filtered speed and integral, continuous in time; and z at the trim."""
    point = trim(scene)
    handle = without_fluctuations(scene).handle()
    rows = list(STATE_INDEX)
    ratio, gk = settings.gear_ratio, settings.gain_schedule_pitch

    def command(blade, filtered, integral):
        error = filtered - settings.rated_speed
        raw = ratio * (settings.KP * error + settings.KI * integral)
        if settings.schedule_on == "measured":
            return raw / (1.0 + blade / gk)
        # beta_c = raw / (1 + beta_c/beta_K): the positive root of the quadratic
        return 0.5 * gk * (np.sqrt(1.0 + 4.0 * raw / gk) - 1.0)

    def rate(z):
        x = point.state.copy()
        x[rows] = z[: len(rows)]
        filtered, integral = z[-2:]
        blade = x[State.BLADE_PITCH]
        u = np.array(
            [generator_torque(ratio * filtered, blade, settings.curve), command(blade, filtered, integral)]
        )
        dx, mean = np.zeros_like(x), np.zeros_like(x)
        mean_derivative(handle, x, u, AZIMUTHS, dx, mean)
        speed = x[State.ROTOR_SPEED]
        return np.r_[
            mean[rows], settings.speed_filter_corner * (speed - filtered), filtered - settings.rated_speed
        ]

    blade = point.state[State.BLADE_PITCH]
    integral = blade * (1.0 + blade / gk) / (ratio * settings.KI)
    return rate, np.r_[point.state[rows], point.state[State.ROTOR_SPEED], integral]


@pytest.mark.parametrize("gain_set", ["oc3", "land"])
@pytest.mark.parametrize("schedule_on", ["commanded", "measured"])
def test_eigenvalues_agree_with_finite_differences_of_the_nonlinear_closed_loop(
    above_rated, gain_set, schedule_on
):
    scene, model = above_rated
    settings = PISettings.published(scene.turbine, gain_set, schedule_on=schedule_on)
    rate, z0 = nonlinear_closed_loop(scene, settings)
    steps = np.full(z0.size, 1e-4)
    steps[[3, 4, 5, 6, 7, 8, 13]] = 1e-5
    steps[9:12] = 1e-7
    numeric = np.empty((z0.size, z0.size))
    for j, step in enumerate(steps):
        e = np.zeros(z0.size)
        e[j] = step
        numeric[:, j] = (rate(z0 + e) - rate(z0 - e)) / (2.0 * step)
    assembled, _ = closed_loop_matrix(model, settings)
    key = lambda v: (round(abs(v), 6), round(v.imag, 6))  # noqa: E731
    ours = sorted(np.linalg.eigvals(assembled), key=key)
    theirs = sorted(np.linalg.eigvals(numeric), key=key)
    np.testing.assert_allclose(ours, theirs, rtol=2e-5, atol=1e-6)


def test_land_gains_take_the_platform_damping_away_and_oc3_gains_keep_it():
    winds = range(12, 25, 2)
    damping = platform_pitch_damping(winds, {"oc3": {"gain_set": "oc3"}, "land": {"gain_set": "land"}})
    assert min(damping["oc3"]) > 0.05
    land = dict(zip(winds, damping["land"], strict=True))
    assert all(land[wind] < 0.0 for wind in (12, 14, 16))
    assert abs(land[18]) < 0.01
    assert all(b > a for a, b in zip(damping["land"], damping["land"][1:], strict=False))


def test_the_nonlinear_run_shows_the_damping_of_the_linear_platform_mode(above_rated):
    """Small platform-pitch decay at 18 m/s under the PI; viscous drag vanishes with the amplitude."""
    scene, model = above_rated
    a, names = closed_loop_matrix(model, PISettings.published(scene.turbine))
    mode = min(modes(a, names, model.cm_height, model.arm), key=lambda m: abs(m.period - 33.4))
    df = simulate(scene, "pi", duration=120.0, initial={"PtfmPitch": model.point["PtfmPitch"] + 0.05})
    time, pitch = df["Time_[s]"].to_numpy(), df["PtfmPitch_[deg]"].to_numpy()
    # the slow surge mode rides below: remove it with a cubic before the peaks are taken
    swing = pitch - np.polyval(np.polyfit(time, pitch, 3), time)
    peaks = [i for i in range(1, swing.size - 1) if swing[i - 1] < swing[i] >= swing[i + 1] and swing[i] > 0]
    late = [i for i in peaks if time[i] > 20.0]
    assert len(late) >= 2
    period = (time[late[-1]] - time[late[0]]) / (len(late) - 1)
    assert period == pytest.approx(mode.period, rel=0.05)
    assert 0.0 < swing[late[1]] < swing[late[0]]


def test_a_loop_that_rests_on_its_limit_is_refused():
    scene = build_scene("oc3_hywind", wind=8.0, fidelity="reference")
    model = linearize(scene, trim(scene))
    with pytest.raises(InputError, match="is at a limit"):
        closed_loop_matrix(model, PISettings.published(scene.turbine))
