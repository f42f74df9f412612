"""First-order forces of a sea on a potential-flow body: the table's interpolation, its ends, OpenFAST."""

import numpy as np
import pytest
from potential_body import made_up_body, reference, sea_of, volturnus

from fowt_env.errors import InputError, PlantWarning
from fowt_env.plant.hydro.excitation import first_order_force
from fowt_env.training.validation.openfast_cases import wave_components
from fowt_env.weather.excitation import build_excitation, excitation_at, still_excitation

BODY = made_up_body()
RANDOM = {"kind": "jonswap", "Hs": 4.0, "Tp": 8.0}


@pytest.mark.installation
@pytest.mark.parametrize("fast", [False, True])
def test_first_order_forces_are_openfasts_to_2e5_of_their_deviation(fast):
    found = reference()
    part = build_excitation(volturnus(), sea_of(wave_components()), duration=600.0, fast=fast, planar=True)
    there = found[["excitation_Fx_N", "excitation_Fz_N", "excitation_My_Nm"]].to_numpy()
    forces = [first_order_force(t, 0.0, 0.0, part.first, np.zeros((5, 0))) for t in found["time_s"]]
    error = (np.array(forces)[:, [0, 2, 4]] - there).std(axis=0) / there.std(axis=0)
    assert (error < 2e-5).all(), error
    if fast:
        assert part.first.table.periodic and part.first.table.span == pytest.approx(720.0, rel=1e-8)


def test_real_and_imaginary_parts_are_linear_in_frequency_and_heading():
    at = excitation_at(BODY, BODY.excitation_omega[4:6], np.radians([30.0, 30.0]))
    assert np.allclose(at, BODY.excitation[4:6, 7], rtol=1e-12)
    omega = 0.25 * BODY.excitation_omega[4] + 0.75 * BODY.excitation_omega[5]
    corners = BODY.excitation[4:6, 7:9]
    expected = np.tensordot([0.25, 0.75], np.tensordot([0.6, 0.4], corners, (0, 1)), (0, 0))
    assert np.allclose(excitation_at(BODY, [omega], np.radians(42.0))[0], expected, rtol=1e-12)


def test_headings_wrap_at_a_whole_turn():
    whole = made_up_body()
    once = made_up_body(headings=range(0, 360, 30))
    omega = np.linspace(0.15, 3.9, 30)
    for degrees in (-180.0, 180.0, -170.0, 355.0, -5.0, 539.0, 0.0, 360.0 - 1e-7):
        a, b = (excitation_at(body, omega, np.radians(degrees)) for body in (whole, once))
        assert np.allclose(a, b, rtol=1e-6, atol=1e-3), degrees
    near = [excitation_at(once, omega, np.radians(degrees)) for degrees in (359.999, 0.001)]
    assert np.allclose(*near, rtol=1e-3)


def test_a_heading_beyond_the_table_is_refused():
    half = made_up_body(headings=range(0, 181, 30))
    sea = RANDOM | {"heading": -20.0}
    with pytest.raises(InputError, match="heading -20 deg lies outside .* a made-up body, .* 0 to 180 deg"):
        build_excitation(half, sea_of(sea), duration=100.0, fast=True, planar=False)
    excitation_at(half, [1.0], np.radians(180.0 + 1e-6))  # rounding is no reason
    one = made_up_body(headings=(0,))
    assert np.array_equal(excitation_at(one, BODY.excitation_omega, 0.0), one.excitation[:, 0])
    with pytest.raises(InputError, match="0 to 0 deg"):
        excitation_at(one, [1.0], 0.01)


def test_below_the_table_is_the_limit_of_long_waves_and_above_it_nothing():
    low, high = BODY.excitation_omega[[0, -1]]
    limit = np.r_[0.0, 0.0, BODY.stiffness[2:5, 2], 0.0]
    half = excitation_at(BODY, [0.5 * low, 1e-12], np.radians(30.0))
    assert np.allclose(half[0], 0.5 * (limit + BODY.excitation[0, 7]), rtol=1e-12)
    assert np.allclose(half[1], limit, rtol=1e-9, atol=1e-4)
    assert not excitation_at(BODY, [high * 1.0001], 0.0).any()
    assert np.allclose(excitation_at(BODY, [high * (1.0 + 1e-9)], 0.0)[0], BODY.excitation[-1, 6])


def test_energy_beyond_the_table_is_warned_of_and_a_sea_that_mostly_is_refused():
    build = dict(duration=100.0, fast=True, planar=False)
    quiet = {"kind": "components", "omega": [0.05, 1.0], "amplitude": [0.03, 1.0]}
    build_excitation(BODY, sea_of(quiet), **build)
    some = quiet | {"amplitude": [0.3, 1.0]}
    with pytest.warns(PlantWarning, match=r"8\.26 % .* 0\.1 to 4 rad/s"):
        part = build_excitation(BODY, sea_of(some), **build)
    assert part.first.exact.force[0, 2] > 0.0
    with pytest.raises(InputError, match="100 % .* 0.1 to 4 rad/s"):
        build_excitation(BODY, sea_of({"kind": "regular", "H": 1.0, "T": 100.0}), **build)


def test_planar_scenes_have_forces_in_the_plane_alone():
    sea = sea_of(RANDOM)
    space, plane = (
        build_excitation(BODY, sea, duration=100.0, fast=True, planar=planar, second_order="full")
        for planar in (False, True)
    )
    assert not plane.first.table.value[:, [1, 3, 5]].any() and not plane.second.mean[[1, 3, 5]].any()
    assert not plane.second.table.value[:, [1, 3, 5]].any()
    assert space.first.table.value[:, [1, 3, 5]].any() and space.second.table.value[:, [1, 3, 5]].any()
    for one, other in ((space.first.exact, plane.first.exact),):
        assert np.array_equal(one.force[:, [0, 2, 4]], other.force[:, [0, 2, 4]])


@pytest.mark.parametrize("fast", [False, True])
def test_flat_water_has_the_same_types_and_no_force(fast):
    part = build_excitation(
        BODY, sea_of(RANDOM), duration=100.0, fast=fast, planar=False, second_order="full"
    )
    flat = still_excitation(part)
    assert type(flat.first) is type(part.first) and type(flat.second) is type(part.second)
    assert not np.any(
        [first_order_force(t, 0.0, 0.0, flat.first, np.zeros((5, 0))) for t in (0.0, 3.3, 8.0, 1e4)]
    )
    assert not flat.second.table.value.any() and not flat.second.mean.any()
    assert still_excitation(None) is None
    assert build_excitation(BODY, None, duration=100.0, fast=fast, planar=False) is None
    assert build_excitation(None, sea_of(RANDOM), duration=100.0, fast=fast, planar=False) is None
