"""Raw readings of a lidar: channels beside the spectra of whole lidars, shots, travel, boxes and gusts."""

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.descriptions.iec import ntm_sigma
from fowt_env.descriptions.lidar import Lidar, read_lidar
from fowt_env.errors import InputError
from fowt_env.weather import lidar as lidar_module
from fowt_env.weather import lidar_gates as gates_module
from fowt_env.weather.lidar import blocked_share, points, shares
from fowt_env.weather.lidar_gates import (
    FREQUENCIES,
    MOST_POINTS,
    channel_shares,
    channel_weights,
    lidar_gates,
    mean_age,
    represented,
    travel_distances,
)
from fowt_env.weather.preview import rotor_wind_series

SPEED, HUB, RADIUS = 18.0, 90.0, 63.0
SIGMA = ntm_sigma(SPEED, "B")
TWO_GATES = {"distances": (80.0, 200.0)}


def remade(preset, **changes):
    return Lidar(**read_lidar(preset).model_dump() | changes)


def scene_in(wind, seed=1001, duration=600.0):
    return build_scene("oc3_hywind", wind=wind, seed=seed, duration=duration, fidelity="fast")


def turbulent(seed=1001, **options):
    return scene_in({"kind": "ntm", "speed": SPEED, "class": "B"} | options, seed)


def blocked_in(scene, lidar):
    return blocked_share(lidar, scene.turbine.rotor, scene.turbine.blade)


@pytest.mark.parametrize("lidar", [remade("four_beam_pulsed", **TWO_GATES), read_lidar("circular_cw")])
def test_the_mean_of_all_channels_has_the_spectra_of_the_whole_lidar(lidar):
    """Those of lidar.shares, which sum over pairs of points in another way; to 0.2 % of the strength."""
    found, whole = (
        channel_shares(lidar, SPEED, SIGMA, HUB, RADIUS),
        shares(lidar, 0, SPEED, SIGMA, HUB, RADIUS),
    )
    point = lidar_module.kaimal_spectrum
    scale = [(1.0, 8.1), (0.8, 2.7), (0.5, 0.66)]
    u, v, w = (point(FREQUENCIES, SPEED, ratio, length * 42.0) for ratio, length in scale)
    own = lidar_module.at_frequencies(whole.own, FREQUENCIES)
    np.testing.assert_allclose(
        found.own.mean(axis=(1, 2)).real, own[0] + (own[1] * v + own[2] * w) / u, atol=0.002, rtol=0.0
    )
    cross = lidar_module.at_frequencies(whole.cross, FREQUENCIES)
    np.testing.assert_allclose(found.cross.mean(axis=1), cross, atol=0.002, rtol=0.0)
    hermitian = found.own - np.conj(found.own.swapaxes(1, 2))
    assert np.abs(hermitian).max() < 1e-12


def test_readings_hold_their_value_between_shots_and_count_those_that_succeed():
    """One beam: a reading per scan, kept where a blade is in the way, at the moment that the count says."""
    lidar = remade("four_beam_pulsed", azimuth=(10.0,), elevation=(5.0,), distances=(150.0,), scan_period=2.0)
    scene = turbulent()
    blocked = blocked_in(scene, lidar)
    made = lidar_gates(scene, lidar)
    assert made.lidar is lidar
    time, (speed, fresh) = made.series.time, made.series.values
    changes = np.diff(speed) != 0.0
    assert 0.3 < blocked < 0.5 and set(fresh) == {0.0, 1.0}
    assert fresh.mean() == pytest.approx(1.0 - blocked, abs=4.0 * np.sqrt(0.25 / 300.0))
    at_shots = np.isclose(time[1:] % 2.0, 0.0) | np.isclose(time[1:] % 2.0, 2.0)
    assert not changes[~at_shots].any() and np.array_equal(changes[at_shots], fresh[1:][at_shots] > 0.0)
    free = lidar_gates(scene, remade("four_beam_pulsed", behind_rotor=None)).series.values
    assert np.all(free[10:] == 1.0)


def test_the_share_of_fresh_shots_is_that_of_the_beams():
    scene, lidar = turbulent(), read_lidar("four_beam_pulsed")
    fresh = lidar_gates(scene).series.values[10:]
    assert set(np.round(np.unique(fresh), 9)) == {0.0, 0.25, 0.5, 0.75, 1.0}
    assert np.array_equal(fresh, np.tile(fresh[0], (10, 1)))
    assert fresh.mean() == pytest.approx(1.0 - blocked_in(scene, lidar), abs=0.04)  # of 2400 shots: 0.01


def test_a_gust_that_fills_the_disc_is_seen_at_each_gate_before_it_arrives():
    """Without lost shots, by the travel time less the mean age of a value."""
    time = np.arange(0.0, 121.0)
    wind = {"kind": "series", "time": time.tolist(), "speed": (16.0 + np.sin(0.2 * time)).tolist()}
    scene = scene_in(wind, duration=120.0)
    lidar = remade("four_beam_pulsed", **TWO_GATES, behind_rotor=None, above_shaft=0.0)
    series = lidar_gates(scene, lidar).series
    start, speed, _ = rotor_wind_series(scene)
    inner = (series.time > 5.0) & (series.time < 90.0)
    for row, distance in zip(series.values, (80.0, 200.0), strict=False):
        arrives = series.time + distance / scene.wind_speed - mean_age(lidar, 0.0)
        wanted = np.interp(arrives, start, speed)[inner]
        offset = row[inner] - wanted  # the beams see more of the power law than the disc
        assert np.ptp(offset) < 0.1 and abs(offset.mean()) < 0.2  # beams are up to 0.4 s older or younger


def test_a_lasting_wind_is_read_with_the_power_law_at_the_beams():
    scene = scene_in(SPEED, duration=20.0)
    lidar = remade("four_beam_pulsed", **TWO_GATES)
    values = lidar_gates(scene, lidar).series.values
    p, series = points(lidar), scene.model.aero.wind
    height = ((HUB + p.z) / HUB) ** series.shear_exponent
    of_gate = np.array([2.0 * p.weight[p.gate == gate] @ height[p.gate == gate] for gate in (0, 1)])
    wanted = SPEED * (1.0 + of_gate - series.rotor_factor)
    np.testing.assert_allclose(values[:2], np.tile(wanted[:, None], values.shape[1]), rtol=1e-9)


@pytest.mark.parametrize("periodic", [True, False])
def test_of_a_box_that_does_not_evolve_each_gate_sees_what_will_arrive(periodic, monkeypatch):
    monkeypatch.setattr(gates_module, "evolution", lambda *args: (0.0, 0.0))
    grid = np.linspace(-70.0, 70.0, 15)
    time = np.arange(240) * 0.5
    u = SPEED + np.sin(2.0 * np.pi * time / 30.0)[:, None, None] + np.zeros((240, 15, 15))
    box = {"kind": "box", "u": u, "y": grid, "z": HUB + grid, "dt": 0.5, "speed": SPEED, "periodic": periodic}
    scene = build_scene("oc3_hywind", wind=box, duration=60.0, fidelity="standard")
    lidar = remade("four_beam_pulsed", **TWO_GATES, behind_rotor=None, pulse_length=None)
    values = lidar_gates(scene, lidar).series
    start, speed, period = rotor_wind_series(scene)
    inner = (values.time > 5.0) & (values.time < 45.0)
    for row, distance in zip(values.values, (80.0, 200.0), strict=False):
        arrives = values.time + distance / SPEED - mean_age(lidar, 0.0)
        assert np.abs(row - np.interp(arrives, start, speed, period=period))[inner].max() < 0.2
    with pytest.raises(InputError, match="points of every distance of lidar"):
        lidar_gates(scene, remade("circular_cw", half_angle=40.0))


def test_far_gates_err_more_and_neighbours_err_alike():
    """What gates do not share with the rotor, by the drawn winds of ten seeds."""
    lidar = remade("four_beam_pulsed", distances=(80.0, 190.0, 200.0), scan_period=0.0, behind_rotor=None)
    errors = []
    for seed in range(1001, 1011):
        scene = turbulent(seed)
        series = lidar_gates(scene, lidar).series
        start, speed, period = rotor_wind_series(scene)
        lead = travel_distances(lidar) / SPEED
        rows = zip(series.values, lead, strict=False)
        errors.append([row - np.interp(series.time + t, start, speed, period=period) for row, t in rows])
    errors = np.array(errors)[:, :, :5000]
    near, far, beside = np.concatenate(errors, axis=1)
    assert near.std() < 0.95 * far.std()
    # at the same wind: the neighbour saw it 10 m earlier
    late = round(10.0 / SPEED / 0.1)
    assert np.corrcoef(far[late:], beside[:-late])[0, 1] > 0.7
    assert np.corrcoef(near, far)[0, 1] < 0.6


def test_a_seed_draws_the_readings_and_another_one_others():
    scene = turbulent()
    first, again, other = (
        lidar_gates(scene, "circular_cw", seed=seed).series.values for seed in (None, 1001, 7)
    )
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_of_many_beams_as_many_are_simulated_as_few_points_permit():
    many = remade("circular_cw", beams=720, distances=(100.0, 200.0), half_angle=20.0)
    few = represented(many)
    assert represented(read_lidar("four_beam_pulsed")) is read_lidar("four_beam_pulsed")
    assert points(few).y.size <= MOST_POINTS < points(many).y.size
    slope = np.hypot(*lidar_module.directions(few))
    np.testing.assert_allclose(slope, np.tan(np.radians(20.0)), rtol=1e-9)
    assert np.abs(np.mean(lidar_module.directions(few), axis=1)).max() < 0.01
    weights = channel_weights(few)
    assert weights.shape[0] == 16 and weights.sum(axis=1) == pytest.approx(np.ones(16))
