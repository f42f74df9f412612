"""Trips, stops and faults of a run against what its rows say, and against a wrapper around the controller."""

import numpy as np
import pandas as pd
import pytest
from laws import Delegate
from naive.faults import Overridden

import fowt_env
from fowt_env.controllers import make
from fowt_env.controllers.constant import Constant
from fowt_env.descriptions.faults import KINDS, SENSOR_FAULTS, Fault
from fowt_env.descriptions.protection import Protection
from fowt_env.errors import InputError
from fowt_env.run.simulation import guard_of

DT = 0.1
TIME, SPEED, PITCH, TORQUE = "Time_[s]", "RotSpeed_[rpm]", "BldPitch1_[deg]", "GenTq_[kN-m]"
NO_TRIPS = dict.fromkeys(("overspeed", "overpower", "acceleration", "pitch_deviation"), False)
RATED, RATED_TORQUE = 12.1, 43.09355


@pytest.fixture(scope="module")
def scene():
    gust = {"kind": "eog", "speed": 18.0, "start": 5.0}
    return fowt_env.build_scene("oc3_hywind", wind=gust, fidelity="standard")


@pytest.fixture(scope="module")
def three():
    """Blades with a pitch each."""
    return fowt_env.build_scene("oc3_hywind", wind=16.0, fidelity="standard", pitch="individual")


def run(scene, controller="pi", duration=30.0, **options):
    return fowt_env.simulate(scene, controller, duration=duration, **options)


def watched(frame, trip):
    """What a trip watches, at each row; the torque is the one that was in force until then."""
    if trip == "overspeed":
        return frame[SPEED] / RATED
    if trip == "overpower":
        torque = frame[TORQUE].shift(1, fill_value=frame[TORQUE].iloc[0])
        return frame[SPEED] * torque / (RATED * RATED_TORQUE)
    return np.hypot(frame["NcIMUTAxs_[m/s^2]"], frame["NcIMUTAys_[m/s^2]"])


def first_time(time, beyond, lasting):
    """The first time at which something has been beyond its limit for so long, without a break."""
    since = None
    for t, now in zip(time, beyond, strict=True):
        since = (t if since is None else since) if now else None
        if since is not None and t - since >= lasting - 1e-9:
            return t
    return None


LOUD = {  # runs in which each is moved: by more than the rotor speed, and to the side too
    "overspeed": {},
    "overpower": {"controller": "pi_land_power"},
    "acceleration": {"initial": {"PtfmRoll": 4.0}},
}


@pytest.mark.parametrize("trip", LOUD)
@pytest.mark.parametrize("lasting", [0.0, 0.8])
def test_a_trip_comes_when_its_limit_has_been_passed_for_its_time(scene, trip, lasting):
    free = run(scene, **LOUD[trip])
    values = watched(free, trip)
    limit = float(np.quantile(values, 0.95))
    at = first_time(free[TIME], values > limit, lasting)
    # the acceleration passes its limit twice, first too shortly: a clock that went on would trip then
    broken = first_time(free[TIME], values > limit, 0.0) + lasting < at - DT
    assert broken == (trip == "acceleration" and lasting > 0.0)
    table = NO_TRIPS | {trip: {"limit": limit, "time": lasting, "stop": "normal"}}
    if trip != "acceleration":
        assert limit > 1.0
    frame = run(scene, protection=table, **LOUD[trip])
    assert frame.attrs["tripped"] == pytest.approx(at, abs=1e-9)
    assert (frame.attrs["trip"], frame.attrs["stop"]) == (trip, "normal")
    before = frame[TIME] < at
    pd.testing.assert_frame_equal(frame[before], free[before], check_exact=True)
    higher = run(scene, protection=NO_TRIPS | {trip: {"limit": float(values.max()) * 1.001}}, **LOUD[trip])
    assert higher.attrs["tripped"] is None
    pd.testing.assert_frame_equal(higher, free, check_exact=True)


@pytest.mark.parametrize(("towards", "sign"), [("fine", -1.0), ("feather", 1.0)])
def test_a_pitch_that_runs_away_trips_once_it_is_off_by_the_limit_for_its_time(scene, towards, sign):
    fault = {"kind": "pitch_runaway", "time": 3.0, "towards": towards}
    held = Constant(torque=1e3 * RATED_TORQUE, blade_pitch=np.radians(16.0))
    frame = run(scene, held, protection="turbine", faults=fault)
    off = np.abs(frame[PITCH] - 16.0) > 5.0
    assert frame.attrs["trip"] == "pitch_deviation" and frame.attrs["stop"] == "emergency"
    assert frame.attrs["tripped"] == pytest.approx(first_time(frame[TIME], off, 1.0), abs=1e-9)
    end = frame[PITCH].iloc[-1]
    assert end == pytest.approx(0.0 if sign < 0 else 90.0, abs=0.1)  # no stop moves it
    saved = run(scene, held, protection="turbine", faults=fault | {"backup": True})
    assert saved.attrs["tripped"] == frame.attrs["tripped"]
    assert saved[PITCH].iloc[-1] == pytest.approx(90.0, abs=0.1)  # its own energy store does


def test_a_normal_stop_feathers_at_its_rate_and_lets_the_torque_go_with_the_speed(scene):
    frame = run(scene, faults={"kind": "normal_stop", "time": 2.0}, duration=60.0)
    after = frame[frame[TIME] >= 2.0 - 1e-9]
    rate = np.diff(after[PITCH]) / DT
    assert np.median(rate) == pytest.approx(0.9, rel=1e-6) and rate.max() < 0.9 + 1e-6
    begun, off = after.iloc[0], 0.3 * RATED
    before = frame[TORQUE][frame[TIME] < 2.0 - 1e-9].iloc[-1]
    share = np.clip((after[SPEED] - off) / (begun[SPEED] - off), 0.0, 1.0)
    gone = np.maximum.accumulate(after[SPEED] <= off)
    np.testing.assert_allclose(after[TORQUE], np.where(gone, 0.0, before * share), rtol=1e-9, atol=1e-9)
    assert gone.iloc[-1] and frame.attrs["tripped"] is None and frame.attrs["stop"] == "normal"


def test_no_stop_feathers_faster_than_the_drive_can(scene):
    """Else the command runs away from the blades, and they seem to be off it."""
    fast = {"normal_rate_deg_per_s": 12.0, "pitch_deviation": {"limit_deg": 2.0}}  # the drive can do 8 deg/s
    frame = run(scene, protection=NO_TRIPS | fast, faults={"kind": "normal_stop", "time": 2.0}, duration=15.0)
    assert np.diff(frame[PITCH]).max() == pytest.approx(0.8, rel=1e-3) and frame.attrs["tripped"] is None
    large = fowt_env.build_scene("iea15_volturnus_s", fidelity="reference")  # whose drive can do 0.0349 rad/s
    rates = guard_of(large, Protection(normal_rate=0.01), [], DT).rates
    assert rates == pytest.approx([0.01 * DT, 0.0349 * DT], rel=1e-9)


def test_an_emergency_takes_over_from_a_normal_stop_and_not_the_other_way(scene):
    stop = {"kind": "normal_stop", "time": 2.0}
    stuck = {"kind": "stuck_pitch", "time": 3.0, "backup": True}
    frame = run(scene, protection="turbine", faults=[stop, stuck])
    at = frame.attrs["tripped"]
    # the command leaves the blades at 0.9 deg/s: 5 deg off after 5.6 s, a second before it trips
    assert at == pytest.approx(3.0 + 5.0 / 0.9 + 1.0, abs=0.3) and frame.attrs["stop"] == "emergency"
    late = frame[TIME] > at + 0.5
    assert np.diff(frame[PITCH][late])[:20] / DT == pytest.approx(8.0, abs=0.01)
    assert not frame[TORQUE][late].any()
    emergency = {"kind": "emergency_stop", "time": 1.0}
    both = run(scene, faults=[emergency, stop])
    pd.testing.assert_frame_equal(both, run(scene, faults=emergency), check_exact=True)


OVERRIDING = [
    {"kind": "grid_loss", "time": 5.0},
    {"kind": "grid_loss", "time": 5.0, "delay": 0.5, "rate": 4.0},
    {"kind": "emergency_stop", "time": 5.0},
    {"kind": "stuck_pitch", "time": 5.0},
]


@pytest.mark.parametrize("fault", OVERRIDING, ids=lambda fault: "_".join(map(str, fault.values())))
def test_a_fault_is_a_controller_whose_commands_are_overridden(scene, turbine, fault):
    fault = Fault(**fault)
    frame = run(scene, faults=fault)
    wrapped = Overridden(make("pi", turbine, DT), fault, turbine.pitch_drive.maximum, DT)
    loss = {"kind": "grid_loss", "time": fault.grid_loss}
    twin = run(scene, wrapped, faults=None if fault.grid_loss is None else loss)
    pd.testing.assert_frame_equal(frame, twin, check_exact=True)
    assert not frame.equals(run(scene))


EVERY = [
    *OVERRIDING,
    {"kind": "normal_stop", "time": 5.0},
    {"kind": "pitch_runaway", "time": 5.0, "towards": "fine"},
    {"kind": "pitch_offset", "time": 5.0, "offset": 2.0},
    {"kind": "sensor_bias", "time": 5.0, "field": "generator_speed", "value": -12.0},
    {"kind": "sensor_freeze", "time": 5.0, "field": "generator_speed"},
    {"kind": "sensor_loss", "time": 5.0, "field": "blade_pitch"},
    {"kind": "line_loss", "time": 5.0, "line": 2},
    {"kind": "flooded_compartment", "time": 5.0, "mass": 8e4, "point": [3.0, 0.0, -60.0]},
    {"kind": "start_up", "time": 5.0},
]


OF_BLADES = {"kind": "pitch_offset", "time": 2.0, "blades": [2, 3], "offset": -1.0}


@pytest.mark.parametrize("fault", [*EVERY, OF_BLADES], ids=lambda fault: "_".join(map(str, fault.values())))
def test_compiled_and_in_python_a_fault_has_the_same_bits(scene, three, turbine, fault):
    where = three if "blades" in fault else scene
    options = {"faults": fault, "protection": "turbine", "sensors": "standard", "duration": 12.0}
    options |= {"initial": "parked"} if fault["kind"] == "start_up" else {}
    compiled = run(where, **options)
    python = run(where, Delegate(turbine, DT), **options)
    pd.testing.assert_frame_equal(compiled, python, check_exact=True)
    assert compiled.attrs == python.attrs
    assert {fault["kind"] for fault in EVERY} == set(KINDS)


@pytest.mark.parametrize("kind", SENSOR_FAULTS)
def test_a_failed_sensor_reads_what_it_should_and_only_that_one(scene, turbine, kind):
    fault = {"kind": kind, "time": 2.0, "field": "generator_speed"}
    if kind == "sensor_bias":
        fault["value"] = 3.0
    controller = Delegate(turbine, DT)
    frame = run(scene, controller, duration=5.0, faults=fault)
    read = np.array(controller.read)
    true = frame[SPEED].to_numpy()[:-1] * np.pi / 30.0 * turbine.drivetrain.gear_ratio
    late = read[:, 0] >= 2.0 - 1e-9
    wrong = {
        "sensor_bias": true + 3.0,
        "sensor_freeze": np.full_like(true, true[20]),
        "sensor_loss": 0.0 * true,
    }
    np.testing.assert_allclose(read[:, 1], np.where(late, wrong[kind], true), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(read[:, 3], np.radians(frame["PtfmPitch_[deg]"][:-1]), rtol=1e-12)


def test_an_offset_blade_is_off_and_its_encoder_does_not_show_it(scene, turbine):
    held = Delegate(turbine, DT)
    held.act = lambda measurement: (held.read.append(measurement.blade_pitch), (4e4, 0.26))[1]
    fault = {"kind": "pitch_offset", "time": 2.0, "offset": 1.5}
    only = NO_TRIPS | {"pitch_deviation": {"limit_deg": 1.0, "time": 2.0}}
    frame = run(scene, held, duration=8.0, faults=fault, protection=only)
    assert frame[PITCH].iloc[-1] == pytest.approx(np.degrees(0.26) + 1.5, abs=1e-6)
    assert np.degrees(held.read[-1]) == pytest.approx(np.degrees(0.26), abs=1e-6)
    assert frame.attrs["tripped"] is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"faults": {"kind": "fire", "time": 1.0}}, "kind"),
        ({"faults": {"kind": "grid_loss"}}, "time is missing"),
        ({"faults": {"kind": "grid_loss", "time": -1.0}}, "time = -1"),
        ({"faults": {"kind": "pitch_runaway", "time": 1.0}}, "towards is missing"),
        ({"faults": {"kind": "stuck_pitch", "time": 1.0, "rate": 2.0}}, "rate: is not a key of stuck_pitch"),
        ({"faults": {"kind": "sensor_loss", "time": 1.0, "field": "rotorspeed"}}, "rotor_speed"),
        ({"faults": {"kind": "stuck_pitch", "time": 1.0, "blades": [1, 1]}}, "each once"),
        ({"faults": {"kind": "stuck_pitch", "time": 1.0, "blades": [1]}}, "pitch='individual'"),
        ({"faults": "grid_loss"}, "must be a Fault"),
        ({"faults": {"kind": "grid_loss", "time": 1.0}, "controller": None}, "controller=None"),
        ({"protection": "own"}, "must be 'turbine'"),
        ({"protection": {"overspeed": {"limit": 0.9}}}, "must be > 1"),
        ({"protection": {"overspeed": {"limit": 1.2, "stop": "gentle"}}}, "stop"),
        ({"protection": {"overspede": {"limit": 1.2}}}, "Did you mean 'overspeed'"),
    ],
)
def test_wrong_faults_and_trips_are_refused_before_anything_runs(scene, options, message):
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        run(scene, **options)


# Blades of their own


PITCHES = ["BldPitch1_[deg]", "BldPitch2_[deg]", "BldPitch3_[deg]"]


def test_a_stop_with_one_stuck_blade_leaves_it_and_stands_on_the_others(three):
    stuck = {"kind": "stuck_pitch", "time": 2.0, "blades": [2]}
    stop = {"kind": "emergency_stop", "time": 4.0}
    frame = run(three, duration=60.0, faults=[stuck, stop], protection="turbine")
    first, second, third = (frame[name].to_numpy() for name in PITCHES)
    assert second[-1] == pytest.approx(second[20], abs=0.05)
    np.testing.assert_array_equal(first, third)
    assert first[-1] == pytest.approx(90.0, abs=0.1) and frame[SPEED].iloc[-1] < 4.0
    assert frame["PtfmYaw_[deg]"].abs().max() > 2.0 * run(three, faults=stop)["PtfmYaw_[deg]"].abs().max()


@pytest.mark.parametrize("blade", [1, 2, 3])
def test_a_blade_that_runs_away_trips_by_its_deviation(three, blade):
    fault = {"kind": "pitch_runaway", "time": 2.0, "blades": [blade], "towards": "fine"}
    frame = run(three, protection="turbine", faults=fault)
    assert frame.attrs["trip"] == "pitch_deviation"
    command = frame[PITCHES[blade % 3]]  # the others follow it
    off = np.abs(frame[PITCHES[blade - 1]] - command) > 5.0
    assert frame.attrs["tripped"] == pytest.approx(first_time(frame[TIME], off, 1.0), abs=0.2)
    assert frame[PITCHES[blade - 1]].iloc[-1] == pytest.approx(0.0, abs=0.05)


class Aside:
    """Asks each blade from 3 s on for an angle (deg) off the pitch at the start."""

    individual, information = True, ("blade_pitch",)

    def __init__(self, *angles):
        self.angles = np.radians(angles)

    def reset(self, measurement):
        self.begun = measurement.blade_pitch

    def act(self, measurement):
        return 4e4, *(self.begun + (measurement.time > 2.95) * self.angles)


@pytest.mark.parametrize(
    ("angles", "trips"),
    [((0, 3, -3), True), ((-3, 3, 3), True), ((0, 2, -2), False), ((3, 3, 3), False), ((0, -4, 0), False)],
)
def test_blades_that_are_apart_trip_where_none_is_off_by_the_limit(three, angles, trips):
    stuck = {"kind": "stuck_pitch", "time": 2.0}
    frame = run(three, Aside(*angles), duration=6.0, protection="turbine", faults=stuck)  # 5 deg for 1 s
    assert frame.attrs["trip"] == ("pitch_deviation" if trips else None)
    if trips:  # commanded at 3 s, seen at the next control instant
        assert frame.attrs["tripped"] == pytest.approx(3.0 + DT + 1.0, abs=1e-9)


def test_an_offset_blade_is_seen_by_the_mean_of_true_pitches_alone(three):
    fault = {"kind": "pitch_offset", "time": 2.0, "blades": [3], "offset": 1.0}
    controller = Delegate(three.turbine, DT)
    frame = run(three, controller, duration=6.0, faults=fault, protection="turbine")
    assert frame[PITCHES[2]].iloc[-1] == pytest.approx(frame[PITCHES[0]].iloc[-1] + 1.0, abs=0.02)
    assert frame.attrs["tripped"] is None
    mean = np.radians(frame[PITCHES].mean(axis=1).to_numpy()[:-1])
    late = frame[TIME].to_numpy()[:-1] >= 2.0 - 1e-9
    read = np.array(controller.read)[:, 2]
    np.testing.assert_allclose(read, mean - late * np.radians(1.0) / 3.0, rtol=1e-9)
