"""MacCamy-Fuchs coefficient against the scattered wave itself, and both strip loads with it against twins."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from naive import diffraction as naive
from naive import morison
from naive.rigid_body import rotation
from plant_helpers import make_pose
from spar_in_waves import SEAS, STILL, motion, nodes_of, strips_of, waves_of

from fowt_env import build_scene, simulate
from fowt_env.errors import InputError
from fowt_env.plant.hydro.banded_strips import banded_strip_load
from fowt_env.plant.hydro.diffraction import (
    TERMS,
    build_strip_diffraction,
    coefficient_series,
    factor_at,
    inertia_coefficient,
)
from fowt_env.plant.hydro.load import BandedStrips, ExactStrips
from fowt_env.plant.hydro.morison import morison_load
from fowt_env.plant.hydro.strip_quadrature import BLOCK, build_quadrature
from fowt_env.plant.hydro.strips import axis_surface
from fowt_env.plant.hydro.wave_bands import band_scratch, build_band_diffraction, build_wave_bands
from fowt_env.weather.waves import wave_number

pytestmark = pytest.mark.installation

MODEL_CHOICES = Path(__file__).resolve().parents[3] / "docs" / "results" / "model-choices.md"
SWITCHES = [("instantaneous", "instantaneous", "wheeler"), ("fixed", "swl", "none")]
# omega, amplitude, phase, heading; the longest is felt at the seabed, the shortest has ka = 2.3 on the spar
SEA = [
    (0.09, 0.8, 0.3, 0.0),
    (0.35, 1.0, 1.0, 0.7),
    (0.8, 1.2, -2.0, -2.5),
    (1.4, 0.4, 0.5, 3.0),
    (2.2, 0.1, 0.0, 1.0),
]
ONE_WAY = [(omega, amplitude, phase, 0.6) for omega, amplitude, phase, _ in SEA]


@pytest.fixture(scope="module")
def site(platform):
    return platform.environment


def slow_motion(rng, tilt=0.08):
    """A motion whose drag does not hide the inertia of the waves."""
    r, R, v, w = motion(rng, tilt)
    return r, R, 0.1 * v, 0.02 * w


def exact(t, moving, strips, waves, diffraction=None):
    kin = np.zeros((7, strips.nodes))
    return morison_load(t, make_pose(*moving), strips, waves, None, kin, diffraction)


def fast(t, moving, platform, strips, waves, diffracted=True):
    quadrature, sea = build_quadrature(platform.hull, strips), build_wave_bands(waves, strips)
    part = build_band_diffraction(sea, quadrature) if diffracted else None
    scratch = band_scratch(sea, quadrature)
    return banded_strip_load(t, make_pose(*moving), quadrature, sea, None, scratch, part)


# The coefficient


@pytest.mark.parametrize("ka", [0.05, 0.523, 0.757, 2.1, 6.0])
def test_coefficient_is_the_pressure_integral_of_a_wave_that_does_not_enter_the_cylinder(ka):
    k, a, step = 0.3, ka / 0.3, 1e-4
    angle = np.arange(400) * 2.0 * pi / 400
    outside, inside = (naive.total_wave(k, a, a + side, angle) for side in (step, -step))
    assert np.abs(outside - inside).max() / (2.0 * step) < 1e-6 * k
    force = -np.mean(naive.total_wave(k, a, a, angle) * np.cos(angle)) * 2.0 * pi * a  # of unit pressure
    undisturbed = -1j * k * pi * a**2  # area times the pressure's gradient on the axis, reversed
    assert inertia_coefficient(ka) == pytest.approx(force / undisturbed, rel=1e-10)


def test_long_waves_give_two_without_lag_and_short_ones_the_limit_of_geometric_optics():
    ka = np.array([1e-6, 1e-3, 0.02])
    assert np.allclose(np.abs(inertia_coefficient(ka)), 2.0, rtol=5e-3)
    assert abs(inertia_coefficient(1e-6) - 2.0) < 1e-10
    assert np.allclose(np.angle(inertia_coefficient(ka)), 0.25 * pi * ka**2, rtol=5e-3)
    short = np.array([200.0, 1000.0])
    assert np.allclose(np.abs(inertia_coefficient(short)), np.sqrt(8.0 / pi) * short**-1.5, rtol=1e-4)
    lead = short + 7.0 / (8.0 * short) - 0.75 * pi  # the crest meets the front of the cylinder first
    turn = inertia_coefficient(short) / np.abs(inertia_coefficient(short)) * np.exp(1j * lead)
    assert np.allclose(turn, 1.0, rtol=0.0, atol=1e-6)


def test_series_of_a_taper_is_the_coefficient_at_its_local_diameter(site):
    k = wave_number(2.0 * pi / np.array([4.0, 6.0, 12.0]), site.water_depth, site.gravity)
    series = coefficient_series(k, -12.0, -4.0, 9.4, 6.5)
    for z in np.linspace(-12.0, -4.0, 17):
        d = 9.4 + (6.5 - 9.4) * (z + 12.0) / 8.0
        expected = inertia_coefficient(0.5 * k * d)
        got = [complex(*factor_at(np.r_[row.real, row.imag], z + 8.0)) for row in series]
        error = np.abs(np.array(got) - expected) / np.abs(expected)
        assert np.all(error < [3e-6, 1e-7, 1e-9])
    straight = coefficient_series(k, -120.0, -12.0, 9.4, 9.4)
    assert np.array_equal(straight[:, 0], inertia_coefficient(4.7 * k)) and not straight[:, 1:].any()


# The strip loads


@pytest.mark.parametrize("switches", SWITCHES, ids="-".join)
def test_exact_load_is_the_complex_sum_over_components(switches, platform, site):
    strips, waves = strips_of(platform, *switches), waves_of(SEA, site)
    spar = morison.spar_of(platform, *switches)
    part = build_strip_diffraction(waves, strips)
    rng = np.random.default_rng(2)
    for _ in range(3):
        t, moving = rng.uniform(0.0, 100.0), slow_motion(rng)
        got, plain = exact(t, moving, strips, waves, part), exact(t, moving, strips, waves)
        assert got[1:] == plain[1:]  # the added mass of the hull's own motion is left alone
        top, eta = morison.surface_on_axis(t, moving[0], moving[1], SEA, spar)
        place = t, moving[0], moving[1], eta, SEA, spar, nodes_of(strips, top)
        expected = np.r_[naive.excitation(*place, inertia_coefficient)]
        expected -= np.r_[naive.excitation(*place, lambda ka: 1.0 + spar.added_mass)]
        change = np.subtract(got.wrench, plain.wrench)
        for block in (slice(0, 3), slice(3, 6)):
            size = np.abs(np.array(plain.wrench)[block]).max()
            assert np.abs(change - expected.ravel())[block].max() < 1e-6 * size
            assert np.abs(change[block]).max() > 5e-3 * size


def test_cut_taper_follows_the_surface(platform, site):
    # a hull lifted by 7 m: the surface meets the taper, whose nodes move and change their diameter
    strips, waves, spar = strips_of(platform), waves_of(ONE_WAY, site), morison.spar_of(platform)
    part = build_strip_diffraction(waves, strips)
    rng = np.random.default_rng(3)
    expected, full, quick = [], [], []
    for t in (1.0, 2.5, 4.0):
        moving = slow_motion(rng, tilt=0.02)
        moving[0][2] = 7.0
        top, eta = morison.surface_on_axis(t, moving[0], moving[1], ONE_WAY, spar)
        assert -12.0 < top < -4.0
        place = t, moving[0], moving[1], eta, ONE_WAY, spar, nodes_of(strips, top)
        diffracted = np.r_[naive.excitation(*place, inertia_coefficient)]
        expected.append(diffracted - np.r_[naive.excitation(*place, lambda ka: 1.0 + spar.added_mass)])
        both = (exact(t, moving, strips, waves, given).wrench for given in (part, None))
        full.append(np.subtract(*both).reshape(2, 3))
        both = (fast(t, moving, platform, strips, waves, given).wrench for given in (True, False))
        quick.append(np.subtract(*both).reshape(2, 3))
    expected = np.array(expected).reshape(-1, 2, 3)
    size = np.abs(expected).max(axis=(0, 2))[:, None]
    assert np.all(np.abs(full - expected) < 1e-5 * size)
    assert np.all(np.abs(quick - expected) < 1e-2 * size)


@pytest.mark.parametrize("sea", SEAS)
def test_fast_load_is_close_to_the_exact_one(sea, platform, site):
    strips, waves = strips_of(platform), waves_of(SEAS[sea], site)
    part = build_strip_diffraction(waves, strips)
    quadrature, fields = build_quadrature(platform.hull, strips), build_wave_bands(waves, strips)
    lane_part, scratch = build_band_diffraction(fields, quadrature), band_scratch(fields, quadrature)
    rng = np.random.default_rng(4)
    quick, full, plain = [], [], []
    while len(full) < 60:
        t, moving = rng.uniform(0.0, 600.0), slow_motion(rng)
        pose = make_pose(*moving)
        if axis_surface(t, pose, strips, waves)[0] < strips.section_bottom[0] + 0.1:
            continue  # the exact path's first section may not run dry without a small step
        quick.append(banded_strip_load(t, pose, quadrature, fields, None, scratch, lane_part).wrench)
        full.append(exact(t, moving, strips, waves, part).wrench)
        plain.append(exact(t, moving, strips, waves).wrench)
    quick, full, plain = np.array(quick), np.array(full), np.array(plain)
    # without diffraction: 1e-4 of the force, 5e-4 of the moment
    for block, bound in (([0, 1], 4e-4), ([3, 4], 7e-4)):
        size = np.sqrt(np.mean(full[:, block] ** 2))
        assert np.sqrt(np.mean((quick - full)[:, block] ** 2)) < bound * size
        assert np.sqrt(np.mean((plain - full)[:, block] ** 2)) > 1e-2 * size
    assert np.array_equal(full[:, [2, 5]], plain[:, [2, 5]])


def test_seabed_reflection_is_turned_with_its_wave(platform, site):
    # both paths in a wave of 70 s, whose reflection at 320 m depth is a fourteenth of it at the keel
    strips = strips_of(platform, "fixed", "swl", "none")
    waves = waves_of([(2.0 * pi / 70.0, 2.0, 0.4, 0.3)], site)
    part = build_strip_diffraction(waves, strips)
    # an exaggerated coefficient, so that a lag of the wrong sign would show
    series = part.series.copy()
    series[..., 0], series[..., TERMS] = 0.3, 0.8
    part = part._replace(series=series)
    quadrature, sea = build_quadrature(platform.hull, strips), build_wave_bands(waves, strips)
    lane_part = build_band_diffraction(sea, quadrature)
    lane_series = lane_part.series.copy()
    lane_series[:] = 0.0
    lane_series[..., :BLOCK] = 0.3
    lane_series[..., TERMS * BLOCK : (TERMS + 1) * BLOCK] = 0.8
    lane_part = lane_part._replace(series=lane_series)
    scratch = band_scratch(sea, quadrature)
    tilted = (np.zeros(3), rotation(0.05, -0.08, 0.0), np.zeros(3), np.zeros(3))
    for t in (0.0, 9.0, 31.0):
        quick = banded_strip_load(t, make_pose(*tilted), quadrature, sea, None, scratch, lane_part).wrench
        full = exact(t, tilted, strips, waves, part).wrench
        assert np.allclose(quick[:2], full[:2], rtol=0.0, atol=2e-4 * np.abs(full[:2]).max())
        assert np.allclose(quick[3:5], full[3:5], rtol=0.0, atol=2e-4 * np.abs(full[3:5]).max())


def published_rows():
    """[(period, force ratio, force lag, moment ratio, moment lag)] of the table in model-choices.md."""
    rows = []
    for line in MODEL_CHOICES.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 10 and cells[0].isdigit():
            pairs = [cell.removesuffix(" deg").split(", ") for cell in cells[-2:]]
            rows.append((float(cells[0]), *(value for pair in pairs for value in pair)))
    return rows


def test_integrated_force_and_moment_are_the_columns_of_the_published_table(platform, site):
    strips = strips_of(platform, "fixed", "swl", "none")._replace(drag_coefficient=0.0)
    rows = published_rows()
    assert [row[0] for row in rows] == [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]
    for period, *columns in rows:
        waves = waves_of({"kind": "regular", "H": 3.0, "T": period}, site)
        part = build_strip_diffraction(waves, strips)
        times = np.arange(8) * period / 8
        turn = np.exp(2j * pi * times / period)
        with_it = turn @ [exact(t, STILL, strips, waves, part).wrench for t in times]
        plain = turn @ [exact(t, STILL, strips, waves).wrench for t in times]
        ratio = (with_it / np.where(plain == 0.0, 1.0, plain))[[0, 4]]
        got = [f(value) for value in ratio for f in (np.abs, lambda c: np.degrees(np.angle(c)))]
        for value, printed in zip(got, columns, strict=True):
            last_digit = 10.0 ** -len(printed.partition(".")[2])
            assert abs(value - float(printed)) < 0.6 * last_digit, (period, value, printed)


# Scenes


def test_absent_option_adds_no_part():
    sea = {"kind": "regular", "H": 3.0, "T": 5.0}
    for options in (
        {"sea": sea}, {"sea": sea, "diffraction": None}, {"sea": sea, "diffraction": "none"},
        {"diffraction": "maccamy_fuchs"},
    ):  # fmt: skip
        assert build_scene(fidelity="reference", **options).model.hydro.strips.diffraction is None
    with pytest.raises(InputError, match="diffraction = 'mcf': allowed None, 'none', 'maccamy_fuchs'"):
        build_scene(sea=sea, diffraction="mcf", fidelity="reference")


@pytest.mark.parametrize("fidelity", ["reference", "standard"])
def test_new_weather_has_the_diffraction_of_a_scene_built_with_it(fidelity):
    seas = [{"kind": "jonswap", "Hs": height, "Tp": period} for height, period in ((3.0, 6.0), (5.0, 9.0))]
    options = {"fidelity": fidelity, "diffraction": "maccamy_fuchs", "wave_components": 30}
    moved = build_scene(sea=seas[0], **options).with_weather(None, seas[1], 3).model.hydro.strips
    built = build_scene(sea=seas[1], seed=3, **options).model.hydro.strips
    assert np.array_equal(moved.diffraction.series, built.diffraction.series)
    assert isinstance(moved, ExactStrips if fidelity == "reference" else BandedStrips)


def test_crossing_seas_fall_back_to_the_exact_path_with_diffraction():
    sea = {"kind": "components", "omega": [0.6, 0.9], "amplitude": [1.0, 0.5], "heading": [0.0, 30.0]}
    scene = build_scene(sea=sea, fidelity="standard", diffraction="maccamy_fuchs")
    strips = scene.model.hydro.strips
    assert isinstance(strips, ExactStrips) and strips.diffraction.series.shape[0] == 2


def first_harmonic(frame, column, period):
    """Complex amplitude of A cos(2 pi t / period + phase) over the last forty periods."""
    rows = frame[frame["Time_[s]"] >= frame["Time_[s]"].iloc[-1] - 40.0 * period + 1e-6]
    turn = np.exp(-2j * pi * rows["Time_[s]"].to_numpy() / period)
    return 2.0 * np.mean(rows[column].to_numpy() * turn)


@pytest.mark.nightly
def test_regular_wave_of_five_seconds_lags_more_than_the_panel_model():
    """OpenFAST's panels have both 9.1 deg behind its strips, 0.3 and 0.8 % longer (model-choices.md)."""
    harmonics = []
    for diffraction in (None, "maccamy_fuchs"):
        scene = build_scene(
            "oc3_hywind_openfast", sea=SEAS["regular"], diffraction=diffraction, fidelity="reference"
        )
        frame = simulate(scene, None, duration=600.0, dt=0.05, initial="zero")
        harmonics.append([first_harmonic(frame, name, 5.0) for name in ("PtfmSurge_[m]", "PtfmPitch_[deg]")])
    strip, diffracted = np.array(harmonics)
    assert np.abs(strip) == pytest.approx([0.1755, 0.1034], rel=5e-3)
    # the lag is the excitation's; the panels' radiation damping turns the motion back by 3 deg
    assert np.degrees(np.angle(strip / diffracted)) == pytest.approx([13.8, 13.6], abs=0.2)
    assert np.abs(diffracted / strip) == pytest.approx([0.962, 0.963], abs=2e-3)
