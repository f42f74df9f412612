import numpy as np
import pytest
from plant_helpers import rates

import fowt_env
from fowt_env.analysis.linear_model import LEAST_LAG, WAKE, linearize, natural_periods
from fowt_env.analysis.reduced_model import residualised
from fowt_env.analysis.trim import trim
from fowt_env.errors import InputError
from fowt_env.plant.aero.blade_elements import blade_section
from fowt_env.plant.aero.wake import time_constants
from fowt_env.plant.state import STATE_INDEX, State

PERIODS = {"surge": 124.0, "sway": 124.0, "heave": 30.8, "roll": 29.9, "platform_pitch": 29.9, "yaw": 8.28}
CHANNELS = {  # motion: (channel, unit, initial offset)
    "surge": ("PtfmSurge", "m", 1.0),
    "sway": ("PtfmSway", "m", 1.0),
    "heave": ("PtfmHeave", "m", 0.3),
    "roll": ("PtfmRoll", "deg", 0.5),
    "platform_pitch": ("PtfmPitch", "deg", 0.5),
    "yaw": ("PtfmYaw", "deg", 1.0),
}


@pytest.fixture(scope="module")
def periods(still_scene):
    return natural_periods(still_scene)


def test_natural_periods_are_those_of_theory(periods, platform):
    assert list(periods) == list(PERIODS)
    for motion, expected in PERIODS.items():
        assert periods[motion] == pytest.approx(expected, rel=5e-3)
    published = platform.published["natural_periods"]
    for motion, key in zip(PERIODS, ("surge", "sway", "heave", "roll", "pitch", "yaw"), strict=True):
        assert periods[motion] == pytest.approx(published[key], rel=5e-3)


@pytest.mark.parametrize("motion", PERIODS)
def test_free_decay_has_the_natural_period(motion, periods, still_scene):
    channel, unit, offset = CHANNELS[motion]
    rest = fowt_env.trim(still_scene)[channel]
    frame = fowt_env.simulate(
        still_scene, controller=None, duration=5.0 * round(periods[motion]), initial={channel: rest + offset}
    )
    t, y = frame["Time_[s]"].to_numpy(), frame[f"{channel}_[{unit}]"].to_numpy() - rest
    falling = np.flatnonzero((y[:-1] > 0.0) & (y[1:] <= 0.0))
    crossings = t[falling] + y[falling] / (y[falling] - y[falling + 1]) * (t[1] - t[0])
    assert crossings.size >= 4
    measured = (crossings[-1] - crossings[0]) / (crossings.size - 1)
    assert measured == pytest.approx(periods[motion], rel=5e-3)
    peaks = [np.abs(y[a:b]).max() for a, b in zip(falling[:-1], falling[1:], strict=True)]
    assert np.all(np.diff(peaks) < 0.0)


@pytest.mark.nightly
def test_motions_without_restoring_have_no_period(platform):
    periods = natural_periods(fowt_env.build_scene("oc3_hywind", mooring=False, fidelity="reference"))
    assert periods["surge"] == periods["sway"] == np.inf
    assert 20.0 < periods["heave"] < 40.0
    assert periods["yaw"] == pytest.approx(PERIODS["yaw"], rel=0.1)  # the delta lines' spring


def test_linear_model_predicts_small_motions(still_scene):
    # |u| u has no slope at rest, but a difference quotient gives it one of the size of its step
    scene = still_scene.with_model({"hydro.strips.shape.drag_coefficient": 0.0})
    model = linearize(scene)
    point, rows = model.point, list(STATE_INDEX)
    rng = np.random.default_rng(0)
    for _ in range(10):
        change = rng.normal(size=len(rows)) * 1e-5
        up, down = point.state.copy(), point.state.copy()
        up[rows] += change
        down[rows] -= change
        half = 0.5 * (rates(scene, up, point.command) - rates(scene, down, point.command))[rows]
        predicted = model.A @ change
        for block in (slice(0, 6), slice(6, 12)):
            size = np.abs(predicted[block]).max()
            assert np.abs(half - predicted)[block].max() < 1e-5 * size


def test_positions_follow_velocities_and_nothing_follows_the_blades_without_air(still_scene):
    model = linearize(still_scene)
    A = model.A
    lean = model.point.state[State.PLATFORM_PITCH]
    assert A[model.index("surge"), model.index("vx")] == pytest.approx(np.cos(lean), rel=1e-9)
    assert np.all(A[:6, :3] == 0.0)
    assert np.abs(A[:12, model.index("blade_pitch")]).max() < 1e-9


def test_modes_are_the_damped_platform_motions(still_scene, periods):
    modes = linearize(still_scene).modes()
    assert {mode.name for mode in modes} == set(PERIODS)
    assert [mode.period for mode in modes] == sorted((mode.period for mode in modes), reverse=True)
    for mode in modes:
        assert 0.0 < mode.damping_ratio < 0.1
        assert 2.0 * np.pi / mode.frequency == pytest.approx(periods[mode.name], rel=2e-3)


def test_inputs_act_where_they_should(storm_scene, turbine):
    model = linearize(storm_scene)
    row, ratio = storm_scene.model.rigid_body.rotor_row, turbine.drivetrain.gear_ratio
    i = model.index("rotor_speed")
    # the roll inertia takes a share H^2/(I_rx M44) of 1e-3
    assert model.B[i, 0] == pytest.approx(-ratio / row, rel=2e-3)
    assert model.B[model.index("blade_pitch"), 1] == pytest.approx(1.0 / turbine.pitch_drive.time_constant)
    # slopes of the public rotor table at 18 m/s and 12.1 rpm, of a rotor with tilt and cone: up to 2.3 % off
    assert model.B[i, 2] == pytest.approx(1.1957e6 / row, rel=0.01)
    assert model.A[i, model.index("blade_pitch")] == pytest.approx(-5.1768e7 / row, rel=0.03)
    assert model.A[i, i] == pytest.approx(-1.0552e7 / row, rel=0.03)
    assert model.B[model.index("vx"), 2] > 0.0


def test_blades_that_follow_at_once_lag_by_the_least_lag():
    """A drive without lag sets its state between steps: differences of the plant alone see no command."""
    plain = linearize(fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard"))
    turbine = plain.scene.turbine
    drive = turbine.pitch_drive.model_copy(update={"time_constant": 0.0})
    turbine = turbine.model_copy(update={"pitch_drive": drive})
    scene = fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard", turbine=turbine)
    model = linearize(scene)
    blade, command = model.index("blade_pitch"), model.inputs.index("blade_pitch_command")
    assert model.A[blade, blade] == -1.0 / LEAST_LAG and model.B[blade, command] == 1.0 / LEAST_LAG
    omega, row = 0.2, model.output_index("rotor_speed")
    lagged, whole = model.response(omega)[0, row, command], plain.response(omega)[0, row, command]
    assert lagged * (1.0 + 1j * omega * LEAST_LAG) == pytest.approx(whole * (1.0 + 0.2j * omega), rel=1e-4)


def test_linear_model_of_a_fixed_platform_has_no_platform_motion(storm_scene):
    model = linearize(storm_scene, fowt_env.trim(storm_scene, platform="fixed"))
    assert np.all(model.A[6:12] == 0.0) and np.all(model.B[6:12] == 0.0)
    assert model.A[model.index("rotor_speed"), model.index("rotor_speed")] < 0.0


def test_the_wind_of_the_operating_point_can_be_named(storm_scene, still_scene):
    model = linearize(storm_scene, wind=15.0)
    expected = linearize(storm_scene.with_weather(15.0, storm_scene.sea, 9))
    assert model.point.wind_speed == 15.0
    assert np.array_equal(model.A, expected.A) and np.array_equal(model.B, expected.B)
    with pytest.raises(InputError, match="wind = 15.0: an operating point has a wind already"):
        linearize(storm_scene, model.point, wind=15.0)
    with pytest.raises(InputError, match="wind = -1.0: "):
        linearize(storm_scene, wind=-1.0)
    with pytest.raises(InputError, match="wind = 15.0: a scene cannot gain or lose its aerodynamics"):
        linearize(still_scene, wind=15.0)


def test_unknown_state_name_is_refused(still_scene):
    with pytest.raises(InputError, match="Did you mean 'surge'"):
        linearize(still_scene).index("surg")


@pytest.mark.nightly
def test_the_wake_decays_at_its_own_lags_and_at_rest_is_the_quasi_steady_one():
    wind, settings = 18.0, {"fidelity": "standard", "shear_exponent": 0.0}
    scene = fowt_env.build_scene(wind=wind, dynamic_inflow=True, **{"fidelity": "reference"} | settings)
    point = trim(scene, "fixed")
    model = linearize(scene, point)
    rotor = scene.model.aero.rotor.elements
    lags = []
    for j, radius in enumerate(rotor.radius):
        in_plane = point.state[State.ROTOR_SPEED] * radius
        a = blade_section(wind, in_plane, point.state[State.BLADE_PITCH], j, 1.0, rotor).a
        lags.append(time_constants(a, wind, radius, rotor.tip_radius, scene.model.aero.rotor.wake))
    wake = [i for i, name in enumerate(model.states) if name.startswith(WAKE)]
    decay = -1.0 / np.diag(model.A)[wake].reshape(-1, 4)
    assert decay[:, ::2] == pytest.approx(np.array(lags)[:, [0, 0]], rel=2e-3)
    assert decay[:, 1::2] == pytest.approx(np.array(lags)[:, [1, 1]], rel=2e-3)
    assert not any(mode.name.startswith(WAKE) for mode in model.modes())

    plain = linearize(fowt_env.build_scene(wind=wind, **{"fidelity": "reference"} | settings))
    settled = residualised(linearize(scene))
    thrust = plain.output_index("rotor_thrust")
    inputs = ("blade_pitch_command", "wind_speed")
    omega = 2.0 * np.pi * np.array([0.01, 0.05, 0.2])
    slow, quick = (m.response(omega, inputs)[:, thrust] for m in (settled, plain))
    assert settled.states == plain.states
    # two tables: 3e-3 in the slope over the blade pitch, whose rows are 0.25 deg apart
    assert np.abs(slow / quick - 1.0).max() < 5e-3
    lagging = linearize(scene).response(omega, inputs)[:, thrust]
    assert 0.06 < abs(lagging[1, 0] / quick[1, 0] - 1.0) < 0.1
