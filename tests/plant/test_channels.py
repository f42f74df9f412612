import numpy as np
import pytest
from naive import rigid_body
from plant_helpers import leaning, random_state, rates

import fowt_env
from fowt_env.plant.advance import observe, output_row
from fowt_env.plant.channels import FIXED_CHANNELS, channels, rotor_wind, to_units
from fowt_env.plant.measurement import N_MEASUREMENTS, Measurement
from fowt_env.plant.rigid_body import gravity_load
from fowt_env.plant.state import State, pose_of
from fowt_env.scene.mass import build_layout
from fowt_env.weather.wind_field import read_box

COMMAND = np.array([3e4, 0.2])


def moving(scene, seed=0):
    """(state, derivative, {channel: value in SI}) of a scene in rough motion."""
    x = random_state(np.random.default_rng(seed), scene.n_state, speed=2.0, turning=0.1)
    row = output_row(scene.handle(), x, COMMAND, 5.0, len(scene.channels))
    return x, rates(scene, x, COMMAND, 5.0), dict(zip((c.name for c in scene.channels), row, strict=True))


def vector(row, *names):
    return np.array([row[name] for name in names])


def test_channel_names_are_unique_and_time_comes_first():
    names = [channel.name for channel in channels(3)]
    assert names[0] == "Time" and len(names) == len(set(names)) == len(FIXED_CHANNELS) + 6
    assert names[-6:] == ["FAIRTEN1", "FAIRTEN2", "FAIRTEN3", "ANCHTEN1", "ANCHTEN2", "ANCHTEN3"]
    assert channels(0) == FIXED_CHANNELS


def test_units_are_those_in_the_column_names():
    factors = {"deg": 180 / np.pi, "deg/s": 180 / np.pi, "deg/s^2": 180 / np.pi, "rpm": 30 / np.pi,
               "kN": 1e-3, "kN-m": 1e-3, "kW": 1e-3}  # fmt: skip
    ones = to_units(np.ones((2, len(channels(3)))), 3)
    for channel, value in zip(channels(3), ones[1], strict=True):
        assert channel.column == f"{channel.name}_[{channel.unit}]"
        assert value == pytest.approx(factors.get(channel.unit, 1.0), rel=1e-15)


@pytest.fixture(scope="module")
def leaning_scene(platform, turbine):
    """As bare_scene with a tilted shaft, and centres of mass off the shaft and beside the plane."""
    platform, turbine = leaning(platform, turbine)
    return fowt_env.build_scene(
        platform, turbine=turbine, hydrodynamics=False, mooring=False, fidelity="reference"
    )


@pytest.fixture(params=["bare_scene", "leaning_scene"])
def empty_scene(request):
    return request.getfixturevalue(request.param)


def test_tower_base_load_is_that_of_the_bodies_above_it(empty_scene):
    # Newton and Euler for tower, nacelle shell, generator rotor and rotor, about the tower base
    bare_scene, platform, turbine = empty_scene, empty_scene.platform, empty_scene.turbine
    base = np.array([0.0, 0.0, platform.tower.base_height])
    parts = rigid_body.bodies(platform, turbine)[1:]
    for seed in range(10):
        x, dx, row = moving(bare_scene, seed)
        v, w, speed = x[7:10], x[10:13], x[State.ROTOR_SPEED]
        down = -platform.environment.gravity * rigid_body.rotation(*x[3:6])[2]
        force, moment = np.zeros(3), np.zeros(3)
        for body in parts:
            f = body.mass * (down - body.acceleration(v, w, dx[7:10], dx[10:13]))
            W = body.turning(w, speed)
            turning = body.turning_rate(w, speed, dx[10:13], dx[State.ROTOR_SPEED])
            force += f
            moment += np.cross(body.centre - base, f) - body.inertia @ turning
            moment -= np.cross(W, body.inertia @ W)
        got = vector(row, "TwrBsFxt", "TwrBsFyt", "TwrBsFzt")
        assert np.abs(got - force).max() < 1e-10 * np.abs(force).max()
        got = vector(row, "TwrBsMxt", "TwrBsMyt", "TwrBsMzt")
        assert np.abs(got - moment).max() < 1e-10 * np.abs(moment).max()


def test_shaft_loads_are_those_of_the_rotor_body(empty_scene):
    platform, turbine = empty_scene.platform, empty_scene.turbine
    rotor = rigid_body.bodies(platform, turbine)[4]
    x, dx, row = moving(empty_scene)
    v, w = x[7:10], x[10:13]
    down = -platform.environment.gravity * rigid_body.rotation(*x[3:6])[2]
    thrust = rotor.mass * (down - rotor.acceleration(v, w, dx[7:10], dx[10:13])) @ rotor.axis
    assert row["RotThrust"] == pytest.approx(thrust, rel=1e-10)
    turning = rotor.turning_rate(w, x[State.ROTOR_SPEED], dx[10:13], dx[State.ROTOR_SPEED]) @ rotor.axis
    assert row["RotTorq"] == pytest.approx(-turbine.rotor.inertia * turning, rel=1e-10)
    assert row["RtFldFxh"] == row["RtFldMxh"] == 0.0
    ratio = turbine.drivetrain.gear_ratio
    assert row["GenSpeed"] == pytest.approx(ratio * x[State.ROTOR_SPEED], rel=1e-15)
    assert row["GenPwr"] == pytest.approx(0.944 * ratio * x[State.ROTOR_SPEED] * COMMAND[0], rel=1e-14)


def test_platform_and_nacelle_accelerations_are_those_of_their_points(wave_scene, platform):
    x, dx, row = moving(wave_scene)
    v, w, dv, dw = x[7:10], x[10:13], dx[7:10], dx[10:13]
    R = rigid_body.rotation(*x[3:6])
    assert np.allclose(vector(row, "PtfmTVxi", "PtfmTVyi", "PtfmTVzi"), R @ v, rtol=0, atol=1e-14)
    assert np.allclose(vector(row, "PtfmRVxi", "PtfmRVyi", "PtfmRVzi"), R @ w, rtol=0, atol=1e-14)
    origin = R @ (dv + np.cross(w, v))
    assert np.allclose(vector(row, "PtfmTAxi", "PtfmTAyi", "PtfmTAzi"), origin, rtol=0, atol=1e-12)
    assert np.allclose(vector(row, "PtfmRAxi", "PtfmRAyi", "PtfmRAzi"), R @ dw, rtol=0, atol=1e-13)
    top = rigid_body.Body(1.0, np.array([0.0, 0.0, platform.tower.top_height]), np.eye(3))
    expected = top.acceleration(v, w, dv, dw)
    assert np.allclose(vector(row, "NcIMUTAxs", "NcIMUTAys"), expected[:2], rtol=0, atol=1e-12)


def test_hydrodynamic_load_closes_the_momentum_balance(wave_scene, platform, turbine):
    # weight and water accelerate the five bodies; nothing else does
    scene = fowt_env.build_scene("oc3_hywind", sea=wave_scene.sea, mooring=False, fidelity="reference")
    scene = scene.with_model({"hydro.damping": type(scene.model.hydro.damping)(*(0.0,) * 7)})
    x, dx, row = moving(scene)
    R = rigid_body.rotation(*x[3:6])
    parts = rigid_body.bodies(platform, turbine)
    rate = rigid_body.inertia_forces(
        parts, x[7:10], x[10:13], x[State.ROTOR_SPEED], dx[7:10], dx[10:13], dx[State.ROTOR_SPEED]
    )
    weight = np.array(gravity_load(pose_of(x), scene.model.rigid_body))
    expected = rate[:6] - weight
    got = np.r_[
        R.T @ vector(row, "HydroFxi", "HydroFyi", "HydroFzi"),
        R.T @ vector(row, "HydroMxi", "HydroMyi", "HydroMzi"),
    ]
    assert np.abs(got - expected)[:3].max() < 1e-9 * np.abs(weight).max()
    assert np.abs(got - expected)[3:].max() < 1e-9 * np.abs(rate[3:6]).max()


def test_measurement_holds_rates_of_the_inertial_position(storm_scene):
    x = random_state(np.random.default_rng(3), storm_scene.n_state)
    dx, values = np.zeros(storm_scene.n_state), np.zeros(N_MEASUREMENTS)
    observe(storm_scene.handle(), x, COMMAND, 2.5, dx, values)
    measured = Measurement(*values)
    assert measured.time == 2.5 and measured.generator_torque == COMMAND[0]
    assert measured.generator_speed == 97.0 * measured.rotor_speed
    names = ("surge", "sway", "heave", "roll", "platform_pitch", "yaw")
    for i, name in enumerate(names):
        assert getattr(measured, name) == x[i]
        assert getattr(measured, f"{name}_rate") == dx[i]
    assert measured.blade_pitch == x[State.BLADE_PITCH]
    assert measured.wind_speed == pytest.approx(18.0, rel=1e-12)
    _, _, row = moving(storm_scene)
    assert row["Wind1VelX"] == pytest.approx(18.0, rel=1e-12)


def test_the_rotor_s_wind_is_the_mean_over_its_blades_relative_to_the_moving_hub(storm_scene, turbine):
    x, _, row = moving(storm_scene)
    hub = np.array([-turbine.rotor.overhang, 0.0, turbine.rotor.hub_height])
    radius = turbine.rotor.tip_radius * (np.arange(200) + 0.5) / 200
    height = 1.0 + np.outer(radius, np.sin(np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False))) / hub[2]
    assert storm_scene.model.aero.wind.shear_exponent > 0.0
    mean = 18.0 * np.mean(height**storm_scene.model.aero.wind.shear_exponent)
    relative = rigid_body.rotation(*x[3:6])[0] * mean - x[7:10] - np.cross(x[10:13], hub)
    assert row["RtVAvgxh"] == pytest.approx(relative[0], rel=1e-6)


@pytest.mark.parametrize(("tilt", "cone"), [(0.0, 0.0), (0.12, 0.08)])
def test_the_rotor_s_wind_in_a_box_is_read_along_the_blades_where_they_are(
    storm_scene, platform, turbine, tilt, cone
):
    rotor = turbine.rotor.model_copy(update={"shaft_tilt": tilt, "cone": cone})
    layout = build_layout(platform, turbine.model_copy(update={"rotor": rotor}))
    x = random_state(np.random.default_rng(5), storm_scene.n_state, speed=2.0, turning=0.1)
    R, shaft = rigid_body.rotation(*x[3:6]), rigid_body.rotation(0.0, tilt, 0.0)
    y, z = np.linspace(-100.0, 100.0, 21), np.linspace(5.0, 205.0, 21)
    u, v, w = np.random.default_rng(6).standard_normal((3, 40, z.size, y.size))
    spec = {"kind": "box", "u": u + 12.0, "v": v, "w": w, "y": y, "z": z, "dt": 0.5, "speed": 12.0}
    box = read_box({**spec, "periodic": True}, hub_height=90.0, rotor_diameter=126.0)
    aero = storm_scene.model.aero._replace(field=box.field())
    found = rotor_wind(3.0, pose_of(x), x[State.AZIMUTH], aero, layout)
    wind, hub = np.zeros(3), np.array([-rotor.overhang, 0.0, rotor.hub_height])
    for blade in range(3):
        psi = x[State.AZIMUTH] + 2.0 * np.pi * blade / 3
        coned = shaft @ rigid_body.rotation(psi, 0.0, 0.0) @ rigid_body.rotation(0.0, -cone, 0.0)
        for distance in layout.span:
            wind += box.at(3.0, *(x[:3] + R @ (hub + distance * coned[:, 2])))[0] / (3 * len(layout.span))
    own = x[7:10] + np.cross(x[10:13], hub)
    assert found == pytest.approx((R.T @ wind - own) @ shaft[:, 0], rel=1e-5)
    assert layout.span[0] > 1.5 and layout.span[-1] < 63.0 and np.ptp(np.diff(layout.span)) < 1e-9
