"""Feedforward of the foreseen wind: its slope, its timing, and the winds that it can look into."""

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.control import view_of
from fowt_env.controllers import make
from fowt_env.controllers.pi import PISettings
from fowt_env.controllers.preview import Preview, PreviewSettings, steady_pitch
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement
from fowt_env.weather.preview import exact_preview, rotor_wind_series

DT = 0.1
STILL = Measurement(*[0.0] * len(Measurement._fields))


def previewing(scene, **settings):
    law = Preview(PISettings.published(scene.turbine), PreviewSettings(**settings), DT)
    law.prepare(scene)
    return law


def measured(scene, pitch):
    turbine = scene.turbine
    return STILL._replace(
        rotor_speed=turbine.rated_rotor_speed,
        generator_speed=turbine.rated_rotor_speed * turbine.drivetrain.gear_ratio,
        generator_torque=turbine.torque_law.rated_torque,
        blade_pitch=pitch,
    )


def given(law, scene, measurement):
    """The measurement as a run gives it to the law, with the wind that is then ahead."""
    time, values = exact_preview(scene, law.preview_times)[:2]
    return view_of(law)([*measurement, *(np.interp(measurement.time, time, row) for row in values)])


def foreseen(scene, settings, times):
    """(n,) what the steady schedule asks for, filtered as a whole: series first, then the low passes."""
    from scipy.signal import lfilter

    time, speed, period = rotor_wind_series(scene)
    seen = np.interp(times + settings.preview_time, time, speed, period=period)
    pitch = settings.gain * np.interp(seen, *steady_pitch(scene))
    decay = np.exp(-2.0 * DT / (settings.preview_time - scene.turbine.pitch_drive.time_constant - 0.5 * DT))
    for _ in range(2):
        pitch, _ = lfilter([1.0 - decay], [1.0, -decay], pitch, zi=[decay * pitch[0]])
    return pitch


@pytest.fixture(scope="module")
def step_scene():
    """The wind steps from 17.5 to 18.5 m/s at 60 s."""
    wind = {"kind": "steps", "speeds": [17.5, 18.5], "every": 60.0, "ramp": 0.01}
    return build_scene("oc3_hywind", wind=wind, duration=120.0, fidelity="standard")


@pytest.mark.parametrize("gain", [0.5, 1.0])
def test_a_step_of_the_wind_turns_the_blades_by_what_the_steady_schedule_says(step_scene, gain):
    speeds, pitches = steady_pitch(step_scene)
    wanted = gain * (np.interp(18.5, speeds, pitches) - np.interp(17.5, speeds, pitches))
    law = previewing(step_scene, gain=gain)
    start = measured(step_scene, np.interp(17.5, speeds, pitches))
    law.reset(given(law, step_scene, start))
    time = DT * np.arange(1100)
    pitch = np.array([law.act(given(law, step_scene, start._replace(time=t)))[1] for t in time])
    moved = pitch - start.blade_pitch
    # no speed error ever: all that moves the blades is the feedforward
    assert moved[:560] == pytest.approx(0.0, abs=1e-5)
    assert moved[-1] == pytest.approx(wanted, rel=0.02)


def test_the_steady_schedule_rises_from_rated_and_is_where_runs_settle(step_scene):
    speeds, pitches = steady_pitch(step_scene)
    slope = np.diff(pitches) / np.diff(speeds)
    rated = speeds[:-1] > step_scene.turbine.rated_wind_speed
    assert (slope >= 0.0).all() and (slope[rated] > 0.0).all() and slope[0] == 0.0
    for wind in (14.0, 24.0):
        scene = build_scene("oc3_hywind", wind=wind, duration=100.0, fidelity="standard")
        settled = simulate(scene, "pi", duration=100.0)["BldPitch1_[deg]"].iloc[-1]
        # apart by the lean of the floating platform, which the schedule leaves out
        assert np.degrees(np.interp(wind, speeds, pitches)) == pytest.approx(settled, abs=0.2)


def test_it_starts_before_the_wind_comes_and_has_turned_by_then(step_scene):
    law = previewing(step_scene)
    times = DT * np.arange(1170)
    law.reset(given(law, step_scene, STILL))
    series = []
    for t in times:
        law.act(given(law, step_scene, STILL._replace(time=t)))
        series.append(law.memory[-1])
    series = np.array(series)
    np.testing.assert_allclose(series, foreseen(step_scene, law.preview, times), rtol=1e-9)
    share = (series - series[0]) / (series[-1] - series[0])
    assert share[times <= 57.0 - 1e-9].max() < 1e-9 < share[times > 57.3].min()
    assert 0.5 < np.interp(60.0, times, share) < 0.7  # two equal poles with that mean delay


def test_gusts_cost_less_speed_than_without_preview():
    gust = {"kind": "eog", "speed": 18.0, "start": 60.0}
    scene = build_scene("oc3_hywind", wind=gust, duration=100.0, fidelity="standard")
    most = {}
    for name in ("pi", "preview"):
        most[name] = simulate(scene, name, duration=100.0)["RotSpeed_[rpm]"].max() - 12.1
    assert most["preview"] < 0.7 * most["pi"]


@pytest.mark.nightly
def test_of_a_full_field_it_sees_the_rotor_average():
    """A wave of wind that repeats every 64 s, and a shear over the rotor that averages out."""
    grid = np.linspace(-80.0, 80.0, 9)
    wave = 18.0 + np.sin(2.0 * np.pi * 0.5 * np.arange(128) / 64.0)
    u = wave[:, None, None] + 0.02 * grid[None, :, None] + 0.01 * grid[None, None, :]
    box = {"kind": "box", "u": u, "y": grid, "z": 90.0 + grid, "dt": 0.5, "speed": 18.0, "periodic": True}
    scene = build_scene("oc3_hywind", wind=box, duration=60.0, fidelity="standard")
    time, speed, period = rotor_wind_series(scene)
    assert period == pytest.approx(64.0)
    assert time == pytest.approx(0.5 * np.arange(128) - 80.0 / 18.0)
    assert speed == pytest.approx(wave, abs=1e-4)  # the box holds single precision
    frame = simulate(scene, "preview", duration=60.0)
    assert frame["BldPitch1_[deg]"].std() > 0.1


def test_a_run_without_wind_preparation_or_preview_is_refused(step_scene):
    still = build_scene("oc3_hywind", fidelity="reference")
    with pytest.raises(InputError, match="needs a scene with wind"):
        make("preview", still.turbine, DT).prepare(still)
    with pytest.raises(InputError, match=r"call prepare\(scene\)"):
        make("preview", still.turbine, DT).reset(STILL)
    with pytest.raises(InputError, match="has 0 winds ahead: must be 1, at 3 s"):
        previewing(step_scene).reset(STILL)


def test_settings_out_of_range_are_named():
    for key, value in (("preview_time", 0.4), ("preview_time", 61.0), ("gain", -0.1), ("gain", 2.1)):
        with pytest.raises(InputError, match=key):
            PreviewSettings(**{key: value})
