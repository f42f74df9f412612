"""Kernels of the wave force on a potential-flow body: sums, tables, axes."""

import numpy as np
import pytest
from naive import excitation as naive
from potential_body import SIZE, made_up_body, sea_of

from fowt_env.plant.hydro.excitation import (
    N_SCRATCH,
    add_excitation,
    add_second_order,
    build_filtered_position,
    elevation_beside,
    exact_force,
    first_order_force,
    meeting_point,
    position_rates,
)
from fowt_env.plant.hydro.waves import elevation
from fowt_env.plant.state import NO_LOAD, Wrench, pose_of
from fowt_env.weather.excitation import build_excitation

BODY = made_up_body()
SCRATCH = np.zeros((N_SCRATCH, 0))  # of forms that need none
RANDOM = {"kind": "jonswap", "Hs": 4.0, "Tp": 8.0}
REGULAR = {"kind": "regular", "H": 3.0, "T": 7.0, "phase": 0.4, "heading": 50.0}
UNEVEN = {
    "kind": "components",
    "omega": [0.5, 0.61, 0.98, 1.4142],
    "amplitude": [0.5, 1.0, 0.4, 0.2],
    "phase": [0.1, 2.0, 4.0, 1.0],
    "heading": [0.0, 20.0, -75.0, 170.0],
}
HARMONIC = {
    "kind": "components",
    "omega": [0.4, 0.6, 0.9, 1.3],
    "amplitude": [0.5, 1.0, 0.4, 0.2],
    "phase": [0.1, 2.0, 4.0, 1.0],
}
SEAS = {"random": RANDOM, "regular": REGULAR, "uneven": UNEVEN, "harmonic": HARMONIC}


def parts(spec, fast=True, **given):
    waves = sea_of(spec)
    return waves, build_excitation(BODY, waves, duration=100.0, fast=fast, planar=False, **given)


def forces(times, first):
    return np.array([first_order_force(t, 0.0, 0.0, first, SCRATCH) for t in times])


@pytest.mark.parametrize("sea", SEAS)
def test_the_sum_is_that_of_its_twin(sea):
    waves, part = parts(SEAS[sea], fast=False)
    times = [0.0, 3.3, 71.0, 512.0]
    expected = [naive.first_order(t, BODY, waves) for t in times]
    scale = np.abs(expected).max(axis=0)
    assert np.abs(forces(times, part.first) - expected).max() / scale.max() < 1e-12
    assert (np.abs(forces(times, part.first) - expected) < 1e-11 * scale).all()


@pytest.mark.parametrize("sea", SEAS)
def test_a_table_errs_by_less_than_1e5_of_the_deviation(sea):
    waves, part = parts(SEAS[sea])
    times = np.random.default_rng(1).uniform(0.0, 100.0, 400)
    exact = forces(times, part.first.exact)
    error = forces(times, part.first) - exact
    assert (np.sqrt((error**2).mean(axis=0)) < 1e-5 * exact.std(axis=0)).all()
    heights = np.array(
        [[elevation_beside(t, waves, part, SCRATCH), elevation(t, 0.0, 0.0, waves)] for t in times]
    )
    assert np.std(heights[:, 0] - heights[:, 1]) < 1e-5 * heights[:, 1].std()
    assert elevation_beside(3.0, waves, None, SCRATCH) == elevation(3.0, 0.0, 0.0, waves)
    summed = part._replace(first=part.first.exact)
    assert elevation_beside(3.0, waves, summed, SCRATCH) == elevation(3.0, 0.0, 0.0, waves)


@pytest.mark.parametrize("sea", SEAS)
def test_a_table_repeats_or_gives_way_to_the_sum(sea):
    _, part = parts(SEAS[sea])
    table = part.first.table
    assert table.periodic == (sea in ("regular", "harmonic"))
    if table.periodic:
        assert table.span == pytest.approx({"regular": 7.0, "harmonic": 20.0 * np.pi}[sea], rel=1e-9)
    else:
        assert table.span >= 105.0
    for t in (-0.02, table.span + 1e-6, 5.3 * table.span):
        close = forces([t], part.first)[0]
        expected = np.array(exact_force(t, 0.0, 0.0, part.first.exact, SCRATCH))
        if table.periodic:
            assert np.abs(close / expected - 1.0).max() < 1e-3
        else:
            assert np.array_equal(close, expected)


def test_the_ramp_raises_first_order_linearly_and_second_order_with_its_square():
    for fast in (True, False):
        _, plain = parts(HARMONIC, fast=fast, second_order="full")
        _, raised = parts(HARMONIC | {"ramp": 40.0}, fast=fast, second_order="full")
        for t, share in ((10.0, 0.25), (60.0, 1.0)):
            one, other = forces([t], plain.first), forces([t], raised.first)
            assert np.allclose(other, share * one, rtol=1e-12)
            one, other = (np.array(add_second_order(t, NO_LOAD, p.second)) for p in (plain, raised))
            assert np.allclose(other, share**2 * one, rtol=1e-12)
    waves, raised = parts(HARMONIC | {"ramp": 40.0})
    assert elevation_beside(10.0, waves, raised, SCRATCH) == pytest.approx(
        elevation(10.0, 0.0, 0.0, waves), rel=1e-4
    )


def test_forces_are_turned_into_body_axes_at_any_pose():
    _, part = parts(REGULAR, second_order="none")
    x = np.zeros(15)
    x[3:6] = 0.1, -0.2, 0.7
    pose, load = pose_of(x), Wrench(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    rows = np.array([[getattr(pose, f"r{i}{j}") for j in (1, 2, 3)] for i in (1, 2, 3)])
    force = forces([2.0], part.first)[0]
    expected = np.r_[rows.T @ force[:3], rows.T @ force[3:]] + np.array(load)
    assert np.allclose(np.array(add_excitation(2.0, pose, x, load, part, SCRATCH)), expected, rtol=1e-12)


@pytest.mark.parametrize("sea", SEAS)
def test_the_sum_at_a_position_is_that_of_shifted_waves_in_both_forms(sea):
    waves, exact = parts(SEAS[sea], fast=False)
    _, fast = parts(SEAS[sea], position=build_filtered_position(15, 0.01))
    scratch = np.zeros((N_SCRATCH, fast.first.amplitude.size))
    for t, x, y in ((0.0, 0.0, 0.0), (33.0, 12.0, -7.0), (640.0, -25.0, 40.0)):
        phase = waves.phase + waves.wave_number * (x * waves.cos_heading + y * waves.sin_heading)
        expected = naive.first_order(t, BODY, waves._replace(phase=phase))
        assert np.allclose(
            exact_force(t, x, y, exact.first, SCRATCH), expected, rtol=1e-10, atol=1e-10 * SIZE.max()
        )
        ours = first_order_force(t, x, y, fast.first, scratch)
        assert np.abs(ours - expected).max() < 1e-6 * np.abs(expected).max()
    ours = elevation_beside(9.0, waves, fast, scratch)
    assert ours == pytest.approx(elevation(9.0, 0.0, 0.0, waves), abs=1e-6)


def test_the_meeting_point_follows_surge_and_sway_behind_a_low_pass():
    _, part = parts(REGULAR, position=build_filtered_position(15, 0.02))
    x, dx = np.zeros(17), np.zeros(17)
    x[0], x[1], x[15], x[16] = 5.0, -3.0, 2.0, 1.0
    position_rates(x, part, dx)
    assert np.array_equal(dx[:15], np.zeros(15))
    assert np.allclose(dx[15:], 2.0 * np.pi * 0.02 * np.array([3.0, -4.0]), rtol=1e-12)
    assert meeting_point(x, part.position) == (2.0, 1.0) and meeting_point(x, None) == (0.0, 0.0)
    scratch = np.zeros((N_SCRATCH, part.first.amplitude.size))
    moved = add_excitation(4.0, pose_of(x), x, NO_LOAD, part, scratch)
    assert np.allclose(moved, first_order_force(4.0, 2.0, 1.0, part.first, scratch), rtol=1e-12)
