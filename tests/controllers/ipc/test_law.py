"""Individual pitch control on a rotor of three stiff blades that answer at once, written out here."""

from math import cos, exp, hypot, pi, sin
from types import SimpleNamespace

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.control import make, whole_view
from fowt_env.controllers.ipc.design import BANDWIDTH, drive_lag, lead_time, root_slope
from fowt_env.controllers.ipc.law import (
    IPC,
    CyclicMemory,
    FlapwiseIPC,
    IPCSettings,
    greatest_amplitude,
    ipc,
    ipc_constrained,
    notch_coefficients,
)
from fowt_env.controllers.pi import PISettings
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.measurement import BladeMeasure, Measurement

TURBINE = read_turbine("nrel5mw")
DT, SUBSTEPS = 0.1, 10
SPEED, MEAN = 1.267109, 0.25  # rad/s, rad
STILL = Measurement(*[0.0] * len(Measurement._fields))._replace(
    rotor_speed=SPEED, generator_speed=122.9096, generator_torque=43093.55, blade_pitch=MEAN
)


def slope_at(pitch):
    """Slope G that the law takes, N m/rad."""
    found = root_slope(TURBINE)
    return found.at_zero * (1.0 + pitch / found.doubling)


def prepared(law):
    """A controller that has been told of the turbine and starts at STILL with equal pitches."""
    law.prepare(SimpleNamespace(turbine=TURBINE))
    blades = np.zeros(len(BladeMeasure))
    blades[BladeMeasure.BLADE_PITCH_1 : BladeMeasure.BLADE_PITCH_1 + 3] = MEAN
    law.reset(whole_view([*STILL, *blades]))
    return law


def custom(**settings):
    """A prepared controller with these settings; its mean pitch stays where it is."""
    return prepared(IPC(PISettings.published(TURBINE), IPCSettings(**settings), DT))


def run(law, load, seconds=60.0, time_constant=0.2, measured=STILL, weight=0.0):
    """(n, 4) of hub tilt and yaw moment (N m) and of the cyclic pitch in force (rad), at control instants.

    load(t): (tilt, yaw) moment without cyclic pitch, and the moment of a blade beyond that as a function of
    its azimuth; weight: in-plane moment of a level blade, N m. The blades follow their commands with a
    first-order lag.
    """
    gain, azimuth = slope_at(MEAN), 0.3
    pitch, rows = np.full(3, MEAN), []
    decay = exp(-DT / SUBSTEPS / time_constant)
    for step in range(round(seconds / DT)):
        psi = azimuth + 2.0 * pi / 3.0 * np.arange(3)
        tilt, yaw, further = load(step * DT)
        moment = 4e6 + tilt * np.cos(psi) + yaw * np.sin(psi) + further(psi) + gain * (pitch - MEAN)
        values = np.concatenate([measured._replace(time=step * DT), np.zeros(len(BladeMeasure))])
        blades = values[len(STILL) :]
        blades[BladeMeasure.BLADE_PITCH_1 : BladeMeasure.BLADE_PITCH_1 + 3] = pitch
        blades[BladeMeasure.AZIMUTH] = azimuth % (2.0 * pi)
        blades[BladeMeasure.ROOT_OUT_OF_PLANE_1 : BladeMeasure.ROOT_OUT_OF_PLANE_1 + 3] = moment
        blades[BladeMeasure.ROOT_IN_PLANE_1 : BladeMeasure.ROOT_IN_PLANE_1 + 3] = weight * np.sin(psi)
        found = [2.0 / 3.0 * np.sum(v * f(psi)) for v in (moment, pitch) for f in (np.cos, np.sin)]
        rows.append(found)
        command = np.array(law.act(whole_view(values)))
        for _ in range(SUBSTEPS):
            pitch = command[1:] + decay * (pitch - command[1:])
            azimuth += SPEED * DT / SUBSTEPS
    return np.array(rows)


def steady(tilt, yaw, third=0.0):
    """Load of constant tilt and yaw moments, and of a second harmonic in the blades, in N m."""
    return lambda t: (tilt, yaw, lambda psi: third * np.cos(2.0 * psi))


def test_steady_tilt_and_yaw_moments_are_taken_away_at_the_stated_bandwidth():
    rows = run(custom(), steady(1.5e6, -0.8e6))
    assert np.abs(rows[-1, :2]).max() < 1e3
    assert rows[-1, 2:] == pytest.approx([1.5e6 / -slope_at(MEAN), -0.8e6 / -slope_at(MEAN)], rel=1e-2)
    size = np.hypot(rows[:, 0], rows[:, 1]) / hypot(1.5e6, 0.8e6)
    time = DT * np.arange(len(rows))
    early = (size < 0.6) & (size > 0.05)
    rate = -np.polyfit(time[early], np.log(size[early]), 1)[0]
    # the lags of drive and notch make it faster than a lag of first order
    assert rate == pytest.approx(BANDWIDTH * SPEED, rel=0.2)


def test_flapwise_control_cancels_the_part_of_the_weight_about_the_chord():
    weight, mean_moment = 4e6, 4e6  # N m, the latter that of run
    law = prepared(FlapwiseIPC(PISettings.published(TURBINE), IPCSettings(), DT))
    rows = run(law, steady(0.0, 0.0), weight=weight)
    # d/d pitch of (out of plane) cos(pitch) at the mean pitch; the weight's own derivative is at 2P
    slope = slope_at(MEAN) * cos(MEAN) - mean_moment * sin(MEAN)
    assert rows[-1, 2:] == pytest.approx([0.0, -weight * sin(MEAN) / slope], abs=1e-4)
    assert np.abs(run(custom(), steady(0.0, 0.0), weight=weight)[:, 2:]).max() < 1e-9


def test_the_lead_keeps_tilt_and_yaw_apart():
    def coupling(law):
        rows = run(law, steady(1.5e6, 0.0), seconds=4.0)
        return abs(rows[-1, 1]) / 1.5e6

    assert coupling(custom()) < 0.02
    assert coupling(custom(lead=False)) > 0.1  # 18 deg of lag, whose sine is 0.3


def test_the_second_harmonic_of_the_blades_moves_nothing():
    quiet, rows = run(custom(), steady(0.0, 0.0)), run(custom(), steady(0.0, 0.0, third=1e6))
    assert np.hypot(quiet[:, 2], quiet[:, 3]).max() == pytest.approx(0.0, abs=1e-9)
    late = np.hypot(rows[300:, 2], rows[300:, 3])
    # without the notch an integrator would answer with bandwidth/(3 Omega) of 1e6 N m: 0.0015 rad
    assert late.max() < 1e-4


def test_a_moment_within_the_bound_is_left_alone_and_one_beyond_it_is_brought_to_it():
    bound = 0.1 * root_slope(TURBINE).moment
    within = run(custom(bound=0.1), steady(0.8 * bound, 0.0))
    assert np.abs(within[:, 2:]).max() < 1e-6
    beyond = run(custom(bound=0.1), steady(1.5 * bound, -2.0 * bound))
    assert np.hypot(*beyond[-1, :2]) == pytest.approx(bound, rel=1e-2)
    assert beyond[-1, 0] / beyond[-1, 1] == pytest.approx(-0.75, rel=2e-2)  # shortened, not turned
    assert beyond[-1, 2] == pytest.approx(0.9 * bound / -slope_at(MEAN), rel=2e-2)

    def fades(t):
        return (2.5 * bound if t < 60.0 else 0.5 * bound), 0.0, lambda psi: 0.0 * psi

    rows = run(custom(bound=0.1), fades, seconds=100.0)
    assert rows[590, 2] > 0.02 and abs(rows[-1, 2]) < 1e-4  # the cyclic pitch goes back to none


def test_the_cyclic_pitch_stays_within_its_limits_and_leaves_them_at_once():
    limit = 0.02

    def load(t):
        return (4e6 if t < 60.0 else -4e6), 0.0, lambda psi: 0.0 * psi

    rows = run(custom(amplitude=limit), load, seconds=80.0)
    assert np.hypot(rows[:, 2], rows[:, 3]).max() < 1.001 * limit
    assert rows[590, 2] == pytest.approx(limit * cos(drive_lag(TURBINE, SPEED)), rel=2e-3)  # behind the drive
    # not wound up: half a second later it is on its way, two crossings of the circle take 2 limit/rate
    rate = BANDWIDTH * SPEED * (4e6 - 0.02 * -slope_at(MEAN)) / -slope_at(MEAN)
    assert rows[600 + round(2.5 * limit / rate / DT) + 5, 2] < 0.0


@pytest.mark.parametrize(("mean", "expected"), [(0.0, 0.0), (0.01, 0.01), (0.5, 0.04)])
def test_the_amplitude_grows_with_the_room_that_the_mean_pitch_has(mean, expected):
    law = custom(amplitude=0.04)
    assert greatest_amplitude(mean, SPEED, law.parameters) == pytest.approx(expected)


def test_the_rate_of_the_drive_limits_the_amplitude():
    law = custom(amplitude=0.5, rate_share=0.5)
    assert greatest_amplitude(0.6, SPEED, law.parameters) == pytest.approx(0.5 * np.radians(8.0) / SPEED)


def test_a_notch_stops_its_frequency_alone():
    b = notch_coefficients(0.5, 0.4, DT)

    def gain(w):
        z = np.exp(1j * w * DT)
        return abs((b[0] + b[1] / z + b[2] / z**2) / (1.0 + b[3] / z + b[4] / z**2))

    def exact(w):
        return abs((0.25 - w * w) / (0.25 - w * w + 0.4j * w))

    assert gain(0.5) < 1e-9 and gain(0.0) == pytest.approx(1.0)
    assert [gain(w) for w in (0.1, 0.4, 0.7, 2.0)] == pytest.approx(
        [exact(w) for w in (0.1, 0.4, 0.7, 2.0)], rel=1e-2
    )


def test_what_belongs_to_the_platform_is_left_in_the_moments():
    frequency = 0.2

    def sway(t):
        return 1e6 * sin(frequency * t), 1e6 * cos(frequency * t), lambda psi: 0.0 * psi

    rows = run(custom(tilt_notches=(frequency,), yaw_corner=0.01), sway, seconds=150.0)[1000:]
    assert np.abs(rows[:, 2]).max() < 5e-4  # 0.018 rad would cancel it
    assert np.abs(rows[:, 3]).max() < 0.05 * 0.018
    rows = run(custom(tilt_notches=(0.05, frequency, 0.76)), steady(1.5e6, 0.0), seconds=150.0)
    assert abs(rows[-1, 0]) < 1e4  # the mean moments are still taken away
    rows = run(custom(yaw_corner=0.1), steady(0.0, 1.5e6), seconds=150.0)
    assert abs(rows[-1, 1]) < 1e4


def test_before_prepare_it_cannot_start():
    with pytest.raises(InputError, match=r"'ipc': call prepare\(scene\) before reset"):
        ipc(TURBINE, DT).reset(STILL)


def test_reset_forgets_the_cyclic_pitch():
    law = prepared(ipc_constrained(TURBINE, DT))
    first = run(law, steady(3e6, 1e6), seconds=10.0)
    assert law.memory[CyclicMemory.TILT] > 0.01
    assert np.array_equal(run(prepared(law), steady(3e6, 1e6), seconds=10.0), first)


def test_settings_outside_their_range_are_named():
    for key in ("bandwidth", "amplitude", "rate_share", "notch_damping", "tilt_damping", "yaw_corner"):
        with pytest.raises(InputError, match=key):
            IPCSettings(**{key: 0.0})
    with pytest.raises(InputError, match="at most 3"):
        IPCSettings(tilt_notches=(0.1, 0.2, 0.3, 0.4))


def test_the_lag_is_that_of_the_drive_at_one_turn():
    assert drive_lag(TURBINE, SPEED) == pytest.approx(np.arctan(0.2 * SPEED))
    drive = TURBINE.pitch_drive.model_copy(update={"natural_frequency": 5.0, "damping": 0.7})
    other = TURBINE.model_copy(update={"pitch_drive": drive})
    answer = 25.0 / (25.0 - SPEED**2 + 2j * 0.7 * 5.0 * SPEED)
    assert drive_lag(other, SPEED) == pytest.approx(-np.angle(answer))
    assert lead_time(other, 0.1) == pytest.approx(-np.angle(answer) / SPEED + 0.05)


@pytest.fixture(scope="module")
def library():
    """(law, the rest of a measurement) of rosco_ipc in wind of 18 m/s, where its cyclic pitch is whole."""
    pytest.importorskip("rosco", reason="needs the ROSCO library: pip install --no-deps rosco")
    law = make("rosco_ipc", TURBINE, DT)
    law.prepare(build_scene("oc3_hywind", wind=18.0, fidelity="fast"))
    return law, STILL._replace(wind_speed=18.0)


def run_library(library, load, seconds):
    """As run, from equal pitches."""
    law, start = library
    blades = np.zeros(len(BladeMeasure))
    blades[BladeMeasure.BLADE_PITCH_1 : BladeMeasure.BLADE_PITCH_1 + 3] = MEAN
    law.reset(whole_view([*start, *blades]))
    return run(law, load, seconds=seconds, measured=start)


def test_the_rosco_library_turns_the_blades_the_same_way(library):
    rows = run_library(library, steady(1.5e6, -0.8e6), 100.0)
    assert np.abs(rows[-1, :2]).max() < 0.1 * 0.8e6
    assert rows[-1, 2:] == pytest.approx([1.5e6 / -slope_at(MEAN), -0.8e6 / -slope_at(MEAN)], rel=0.1)


def test_the_offset_of_the_rosco_library_keeps_tilt_and_yaw_apart(library):
    """A moment that turns with the blades, behind a drive and half a control period that lag by 18 deg.

    Measured: 0.066 of the tilt moment, what is left being the library's own; 0.107 without an offset, 0.284
    with one the other way.
    """
    for load, other in ((steady(1.5e6, 0.0), 1), (steady(0.0, 1.5e6), 0)):
        rows = run_library(library, load, 6.0)
        assert np.abs(rows[:, other]).max() < 0.08 * 1.5e6
        assert np.abs(rows[-1, 1 - other]) < 0.1 * 1.5e6
