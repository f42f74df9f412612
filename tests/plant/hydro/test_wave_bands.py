"""Fast strip loads against the plain sum over components, nodes and (uncut sections) morison_load."""

from pathlib import Path

import numpy as np
import pytest
from fresh_python import fresh_python
from naive.strips import strip_load
from spar_in_waves import SEAS, strips_of
from spar_in_waves import waves_of as sea_of

from fowt_env.descriptions.platform import read_platform
from fowt_env.plant.hydro import strip_quadrature, wave_bands
from fowt_env.plant.hydro.banded_strips import banded_strip_load
from fowt_env.plant.hydro.morison import Current, current_at, morison_load
from fowt_env.plant.hydro.strip_quadrature import build_quadrature
from fowt_env.plant.hydro.strips import axis_surface
from fowt_env.plant.hydro.wave_bands import band_scratch, build_wave_bands, can_use_bands, phasors
from fowt_env.plant.state import N_RIGID, State, pose_of

pytestmark = pytest.mark.installation

PLATFORM = read_platform("oc3_hywind")
SITE = PLATFORM.environment


def strips_for(*switches, **named):
    return strips_of(PLATFORM, *switches, **named)


def waves_of(sea, seed=0, **changes):
    return sea_of({**SEAS[sea], **changes} if isinstance(sea, str) else sea, SITE, seed)


def random_states(count, tilt, seed, drift=10.0):
    """States of a platform adrift and moving, tilted by tilt degrees in a random direction."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        x = np.zeros(N_RIGID)
        direction = rng.uniform(0.0, 2.0 * np.pi)
        x[: State.ROLL] = rng.normal(size=3) * [drift, drift, 0.5]
        x[State.ROLL] = np.radians(tilt) * np.cos(direction)
        x[State.PLATFORM_PITCH] = np.radians(tilt) * np.sin(direction)
        x[State.YAW] = 0.05 * rng.normal()
        x[State.VX : State.WX] = rng.normal(size=3) * [1.0, 0.5, 0.5]
        x[State.WX : State.ROTOR_SPEED] = rng.normal(size=3) * [0.01, 0.01, 0.005]
        yield rng.uniform(0.0, 600.0), x


def naive_load(t, x, strips, waves, current=None):
    pose = pose_of(x)
    rotation = np.array([pose[3:6], pose[6:9], pose[9:12]])
    profile = None if current is None else lambda z: current_at(z, SITE.water_depth, current)
    velocity, rate = x[State.VX : State.WX], x[State.WX : State.ROTOR_SPEED]
    wrench, mass = strip_load(t, x[:3], rotation, velocity, rate, PLATFORM.hull, strips, waves, profile)
    return np.concatenate([wrench[:5], mass])


def as_array(load):
    return np.array([*load.wrench[:5], load.s0, load.s1, load.s2])


def compare(waves, strips, cases, current=None):
    """(fast, naive) arrays (n, 8) over the cases."""
    quadrature = build_quadrature(PLATFORM.hull, strips)
    sea = None if waves is None else build_wave_bands(waves, strips)
    scratch = band_scratch(sea, quadrature)
    fast = [as_array(banded_strip_load(t, pose_of(x), quadrature, sea, current, scratch)) for t, x in cases]
    return np.array(fast), np.array([naive_load(t, x, strips, waves, current) for t, x in cases])


def spread_error(fast, naive):
    """rms error of force and moment, over the rms of the force, and of the moment, of the whole set."""
    error = np.sqrt(np.mean((fast - naive) ** 2, axis=0))
    size = np.sqrt(np.mean(naive**2, axis=0))
    force, moment = size[:2].max(), size[3:5].max()
    return max(error[:2].max() / force, error[2] / size[2], error[3:5].max() / moment)


BOUNDS = {"mild": (3e-4, 3e-4, 4e-4), "rough": (2e-4, 2e-4, 3e-4), "storm": (2e-4, 3e-4, 3e-4)}
UNIFORM, SHEARED = Current(1.2, -0.7, 0.0), Current(1.2, -0.7, 1.0 / 7.0)
CASES = [  # sea, switches of the strips, states, current, largest error
    *((sea, (), (60, 5.0 * i, 1), None, bound) for sea, row in BOUNDS.items() for i, bound in enumerate(row)),
    ("regular", (), (60, 5.0, 1), None, 3e-4),
    ("swell", (), (60, 5.0, 1), None, 5e-4),
    ("storm", (), (60, 30.0, 2), None, 1e-2),
    ("rough", (), (40, 4.0, 4, 0.0), None, 2e-4),
    ("rough", (), (40, 4.0, 4, 100.0), None, 2e-4),
    *(
        ("rough", (position, *rest), (40, 4.0, 5), None, 3e-4)
        for position in ("instantaneous", "fixed")
        for rest in (("instantaneous", "wheeler"), ("swl", "none"))
    ),
    *((sea, (), (30, 4.0, 8), stream, bound)
      for stream in (UNIFORM, SHEARED) for sea, bound in (("rough", 1e-3), (None, 2e-3))),
]  # fmt: skip


@pytest.mark.parametrize("sea, switches, states, current, bound", CASES)
def test_load_is_close_to_the_plain_sum(sea, switches, states, current, bound):
    """Also long after the start: the states of seed 4 are taken 10,000 s later."""
    later = 1e4 if states[2] == 4 else 0.0
    strips, cases = strips_for(*switches), [(t + later, x) for t, x in random_states(*states)]
    waves = None if sea is None else waves_of(sea)
    assert waves is None or can_use_bands(waves, strips)
    assert spread_error(*compare(waves, strips, cases, current)) < bound


def test_ramp_raises_the_waves_from_rest():
    states = (x for _, x in random_states(5, 4.0, seed=11))
    cases = list(zip((0.0, 10.0, 25.0, 49.0, 51.0), states, strict=True))
    assert spread_error(*compare(waves_of("rough", ramp=50.0), strips_for(), cases)) < 3e-4


def test_load_stays_finite_in_any_attitude():
    strips, waves = strips_for(), waves_of("storm")
    quadrature, sea = build_quadrature(PLATFORM.hull, strips), build_wave_bands(waves, strips)
    scratch = band_scratch(sea, quadrature)
    rng = np.random.default_rng(3)
    for t, x in random_states(200, 0.0, seed=3, drift=300.0):
        x[State.HEAVE : State.VX] = rng.uniform(-1.0, 1.0, 5) * [200.0, np.pi, np.pi, np.pi, 0.0]
        load = as_array(banded_strip_load(t, pose_of(x), quadrature, sea, None, scratch))
        assert np.all(np.isfinite(load))
        assert np.abs(load[:2]).max() < 1e9


@pytest.mark.parametrize("sea", [None, "rough"])
def test_axial_drag_on_the_keel_is_that_of_the_plain_sum_and_of_morison_load(sea):
    plain = strips_for()  # no built-in platform has any
    strips, waves = plain._replace(axial_drag_coefficient=9.0), None if sea is None else waves_of(sea)
    cases = list(random_states(40, 4.0, seed=15))
    fast, naive = compare(waves, strips, cases)
    without, naive_without = compare(waves, plain, cases)
    drag, wanted = fast[:, 2] - without[:, 2], naive[:, 2] - naive_without[:, 2]
    assert np.abs(wanted).max() > 0.1 * np.abs(naive[:, 2]).max() and wanted.min() < 0.0 < wanted.max()
    np.testing.assert_allclose(drag, wanted, rtol=2e-3, atol=2e-3 * np.abs(wanted).max())
    nodes = np.zeros((7, strips.nodes))
    exact = [
        np.subtract(*(as_array(morison_load(t, pose_of(x), s, waves, None, nodes)) for s in (strips, plain)))
        for t, x in cases
    ]
    np.testing.assert_allclose(drag, np.array(exact)[:, 2], rtol=2e-3, atol=2e-3 * np.abs(wanted).max())
    assert np.array_equal(np.delete(fast, 2, axis=1), np.delete(without, 2, axis=1))


def test_phasors_hold_over_a_hundred_thousand_steps():
    waves = waves_of("rough")
    sea = build_wave_bands(waves, strips_for())
    cosine, sine = np.zeros((2, sea.component.shape[1]))
    n = waves.omega.size
    for step in (0, 1, 99_999, 100_000):
        t, distance = 0.1 * step, 37.0 * np.sin(step)
        phasors(t, distance, sea.component, cosine, sine)
        phase = waves.wave_number * distance - waves.omega * t + waves.phase
        assert np.abs(cosine[:n] - np.cos(phase)).max() < 1e-8
        assert np.abs(sine[:n] - np.sin(phase)).max() < 1e-8


@pytest.mark.parametrize(
    "sea, axis", [("rough", "displaced"), ("rough", "undisplaced"), (None, "undisplaced")]
)
def test_load_agrees_with_morison_load_while_the_surface_stays_on_its_section(sea, axis):
    strips = strips_for(axis=axis)._replace(axial_drag_coefficient=1.5)
    waves = None if sea is None else waves_of(sea)
    current = SHEARED if sea is None else None
    quadrature = build_quadrature(PLATFORM.hull, strips)
    sea = None if waves is None else build_wave_bands(waves, strips)
    scratch, nodes = band_scratch(sea, quadrature), np.zeros((7, strips.nodes))
    fast, exact = [], []
    for t, x in random_states(100, 4.0, seed=6):
        pose = pose_of(x)
        if axis_surface(t, pose, strips, waves)[0] > strips.section_bottom[0] + 0.1:
            fast.append(as_array(banded_strip_load(t, pose, quadrature, sea, current, scratch)))
            exact.append(as_array(morison_load(t, pose, strips, waves, current, nodes)))
    assert len(fast) > 80
    assert spread_error(np.array(fast), np.array(exact)) < (2e-4 if current is None else 2e-3)
    assert np.allclose(np.array(fast)[:, 5:], np.array(exact)[:, 5:], rtol=1e-5)


def test_surface_below_the_top_section_leaves_the_taper_dry():
    strips, waves = strips_for(), waves_of("storm")
    cases = []
    for t, x in random_states(300, 2.0, seed=7):
        if axis_surface(t, pose_of(x), strips, waves)[0] <= strips.section_bottom[0]:
            cases.append((t, x))
    assert len(cases) > 20
    fast, naive = compare(waves, strips, cases)
    assert spread_error(fast, naive) < 3e-4
    assert np.allclose(fast[:, 5:], naive[:, 5:], rtol=2e-5)


def test_still_water_leaves_drag_and_spin_terms_alone():
    fast, naive = compare(None, strips_for(), list(random_states(30, 4.0, seed=9)))
    assert spread_error(fast, naive) < 1e-3
    assert np.allclose(fast[:, 5:], naive[:, 5:], rtol=1e-5)
    at_rest = compare(None, strips_for(), [(0.0, np.zeros(N_RIGID))])[0]
    assert np.all(at_rest[:, :5] == 0.0)


def test_same_call_gives_the_same_bits_whatever_came_before():
    strips, waves = strips_for(), waves_of("rough")
    quadrature, sea = build_quadrature(PLATFORM.hull, strips), build_wave_bands(waves, strips)
    used, fresh = band_scratch(sea, quadrature), band_scratch(sea, quadrature)
    used.phasor[:], used.field[:], used.nodes[:] = np.nan, np.nan, np.nan
    for t, x in random_states(20, 4.0, seed=12):
        one = banded_strip_load(t, pose_of(x), quadrature, sea, None, used)
        assert one == banded_strip_load(t, pose_of(x), quadrature, sea, None, fresh)


def test_spread_seas_and_nodes_above_the_water_are_left_to_the_exact_path():
    crossed = {"kind": "components", "omega": [0.5, 0.7], "amplitude": [1.0, 1.0], "phase": [0.0, 1.0]}
    assert not can_use_bands(waves_of({**crossed, "heading": [0.0, 30.0]}), strips_for())
    assert can_use_bands(waves_of({**crossed, "heading": [30.0, 30.0]}), strips_for())
    assert not can_use_bands(waves_of("rough"), strips_for(stretching="none"))
    assert not can_use_bands(waves_of("rough"), strips_for(surface="swl"))


def test_wider_bands_are_more_accurate(monkeypatch):
    cases = list(random_states(40, 4.0, seed=13))
    monkeypatch.setattr(strip_quadrature, "SURFACE_NODES", 8)
    monkeypatch.setattr(strip_quadrature, "NODES_AT_LEAST", 6)
    errors = []
    for band in (4, 6, 8):
        monkeypatch.setattr(wave_bands, "BAND", band)
        errors.append(spread_error(*compare(waves_of("rough"), strips_for(), cases)))
    assert errors[0] > 3.0 * errors[1] > 6.0 * errors[2]


def test_plain_python_gives_the_same_load():
    folder = Path(__file__).parent
    code = (
        "from test_wave_bands import *\n"
        "fast, _ = compare(waves_of('rough'), strips_for(), list(random_states(2, 4.0, seed=14)))\n"
        "print(*fast.ravel().tolist())"
    )
    printed = fresh_python(code, paths=(folder, folder.parents[1]), NUMBA_DISABLE_JIT="1")
    plain = np.array(printed.split(), dtype=float).reshape(2, 8)
    fast, _ = compare(waves_of("rough"), strips_for(), list(random_states(2, 4.0, seed=14)))
    assert np.allclose(plain, fast, rtol=1e-9, atol=1e-3)
