"""New weather for a scene: of the types that its kernels were compiled for, or refused."""

import numba
import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.analysis import trim_cache
from fowt_env.analysis.trim import OperatingPoint, mean_derivative
from fowt_env.caches import Cache
from fowt_env.errors import InputError
from fowt_env.plant.aero.wind import WindSeries
from fowt_env.plant.hydro.load import BandedStrips, ExactStrips
from fowt_env.plant.hydro.waves import elevation
from fowt_env.plant.state import State
from fowt_env.weather.wind_field import WindBox

JONSWAP = {"kind": "jonswap", "Hs": 5.0, "Tp": 9.0}
LONG_CRESTED = {"kind": "components", "omega": [0.6, 0.9], "amplitude": [1.0, 0.5], "heading": 20.0}
CROSSING = LONG_CRESTED | {"heading": [0.0, 30.0]}
SEAS = [
    None,
    "still",
    JONSWAP,
    JONSWAP | {"Hs": 0.0},
    JONSWAP | {"heading": -90.0, "ramp": 20},
    {"kind": "regular", "H": 2, "T": 7},
    {"kind": "pierson_moskowitz", "Hs": 3.0},
    LONG_CRESTED,
]
Y, Z = np.linspace(-75.0, 75.0, 7), np.linspace(10.0, 170.0, 9)


def frozen(values, dtype=float):
    """An array that must not be written to."""
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def box(**changes):
    return {"kind": "box", "u": np.full((60, 9, 7), 15.0), "y": Y, "z": Z, "dt": 0.5, "speed": 15.0} | changes


ROW = [12.0, 0.0, 0.0, 0.0, 0.0]
WINDS = [
    14,
    0.0,
    {"kind": "steady", "speed": 11.0, "direction": 10.0, "vertical": 1.0},
    {"kind": "series", "time": frozen([0.0, 900.0]), "speed": frozen([9.0, 12.0])},
    {"kind": "series", "time": [0, 1, 900], "speed": [9, 10, 12]},
    {"kind": "steps", "speeds": (8.0, 12.0), "every": 50.0},
    {"kind": "eog", "speed": 14.0},
    {"kind": "ews", "speed": 14.0},
    {"kind": "ewm"},
    {"kind": "ntm", "speed": 18.0, "class": "B"},
    {"kind": "ntm", "speed": 18.0, "class": "B", "average": "point"},
    {"kind": "etm", "speed": 18.0, "class": "A"},
    WindSeries(frozen([0.0, 900.0]), frozen([ROW, ROW]), 0.0, 0, 0, 90, 126, 1),
    WindSeries(np.arange(3), np.asfortranarray([ROW, ROW, ROW]), 1, 0.0, 0.0, 90.0, 126.0, 1.0),
]
BOXES = [
    box(),
    box(u=frozen(np.full((60, 9, 7), 13.0)), v=np.ones((60, 9, 7)), dt=1, speed=15, periodic=True),
    WindBox(frozen(np.ones((60, 9, 7, 3)), np.float32), Y, Z, np.float32(0.5), np.float32(12.0), False, 1),
]


def kind(scene):
    """What decides which kernel a scene runs: the types of its model and of its scratch."""
    return numba.typeof(scene.model), numba.typeof(scene.data())


def leaves(part):
    """All arrays and numbers of a model, in order."""
    if isinstance(part, tuple):
        return [leaf for inner in part for leaf in leaves(inner)]
    return [np.asarray(part)]


def same_model(one, other):
    return all(map(np.array_equal, *(leaves(s.model.hydro) + leaves(s.model.aero) for s in (one, other))))


@pytest.mark.parametrize("options", [{}, {"diffraction": "maccamy_fuchs", "current": 0.5}])
@pytest.mark.parametrize("fidelity", ["standard", "reference"])
def test_every_wind_and_sea_leaves_the_types_of_a_scene(fidelity, options):
    scene = build_scene(wind=14.0, sea=JONSWAP, fidelity=fidelity, **options)
    for sea in SEAS:
        assert kind(scene.with_weather(14.0, sea, 1)) == kind(scene), sea
    for wind in WINDS:
        assert kind(scene.with_weather(wind, None, 1)) == kind(scene), wind
    tabulated = build_scene(wind=14.0, sea=JONSWAP, fidelity=fidelity, rotor="table", **options)
    for wind in (*WINDS, *BOXES):  # the average over the rotor is a series as any other
        assert kind(tabulated.with_weather(wind, JONSWAP, 1)) == kind(tabulated), wind


def test_every_box_of_wind_leaves_the_types_of_a_scene():
    scene = build_scene(wind=BOXES[0], fidelity="standard")
    for wind in BOXES:
        assert kind(scene.with_weather(wind, None, 1)) == kind(scene), wind


def test_a_scene_of_still_water_keeps_kernels_without_waves():
    for fidelity in ("standard", "reference"):
        scene = build_scene(wind=14.0, fidelity=fidelity)
        moved = scene.with_weather(16.0, "still", 1).with_weather(12.0, JONSWAP | {"Hs": 0.0}, 2)
        assert moved.model.hydro.waves is None and kind(moved) == kind(scene)
    with pytest.raises(InputError, match=r"sea = {'kind': 'jonswap'.*cannot gain a sea; build it with one"):
        moved.with_weather(14.0, JONSWAP, 1)


def test_without_water_any_sea_is_none():
    scene = build_scene(wind=14.0, hydrodynamics=False, mooring=False, fidelity="reference")
    assert scene.with_weather(14.0, JONSWAP, 1).model.hydro is None


@pytest.mark.parametrize("fidelity", ["standard", "reference"])
def test_weather_does_not_depend_on_what_a_scene_had_before(fidelity):
    scene = build_scene(wind=14.0, sea=JONSWAP, fidelity=fidelity, diffraction="maccamy_fuchs")
    for sea in (None, JONSWAP | {"Hs": 2.0}):
        straight = scene.with_weather(15.0, sea, 3)
        winding = scene
        for other in (LONG_CRESTED, None, "still", JONSWAP):
            winding = winding.with_weather(9.0, other, 8)
            assert same_model(winding.with_weather(15.0, sea, 3), straight)
    assert same_model(straight, build_scene(
        wind=15.0, sea=sea, seed=3, fidelity=fidelity, diffraction="maccamy_fuchs"
    ))  # fmt: skip


def test_crossing_seas_need_exact_sums_from_the_start():
    scene = build_scene(wind=14.0, sea=JONSWAP, fidelity="standard")
    with pytest.raises(InputError, match="sea: several headings .* wave_loads = 'exact' from the start"):
        scene.with_weather(14.0, CROSSING, 1)
    for exact in (
        build_scene(wind=14.0, sea=CROSSING, fidelity="standard"),
        build_scene(wind=14.0, sea=JONSWAP, fidelity="standard", wave_loads="exact"),
    ):
        for sea in (CROSSING, LONG_CRESTED, None):
            moved = exact.with_weather(14.0, sea, 1)
            assert isinstance(moved.model.hydro.strips, ExactStrips) and kind(moved) == kind(exact)


def test_still_water_in_a_scene_with_a_sea_has_no_elevation_and_numbers_of_its_own():
    scene = build_scene(sea=JONSWAP, fidelity="standard")
    flat = scene.with_weather(None, None, 0)
    assert flat.sea is None and flat.model.hydro.waves.omega.shape == (1,)
    assert elevation(3.0, 10.0, 5.0, flat.model.hydro.waves) == 0.0
    still = build_scene(fidelity="standard").model.hydro.strips
    assert isinstance(still, BandedStrips)
    # drag turns its sign along a hull in still water, and the nodes are those that it takes there
    assert np.array_equal(flat.model.hydro.strips.quadrature.table, still.quadrature.table)
    assert scene.model.hydro.strips.quadrature.table.size < still.quadrature.table.size


@pytest.mark.parametrize("fidelity", ["standard", pytest.param("reference", marks=pytest.mark.nightly)])
def test_still_water_in_a_scene_with_a_sea_loads_as_a_scene_of_still_water(fidelity):
    """Accelerations of random motions, by two kernels that add the same terms, one of them zeros besides.

    Here they have the same bits. A rounding of 1e8 N over 8e6 kg is 2e-15 m/s2: room for some fifty.
    """
    options = dict(fidelity=fidelity, current=0.5, diffraction="maccamy_fuchs")
    scenes = build_scene(**options), build_scene(sea=JONSWAP, **options).with_weather(None, None, 0)
    rng = np.random.default_rng(1)
    for _ in range(5):
        found = []
        x = np.zeros(scenes[0].n_state)
        x[:6] = rng.uniform(-1.0, 1.0, 6) * (5.0, 5.0, 2.0, 0.2, 0.2, 0.1)
        x[State.VX : State.VX + 6] = rng.uniform(-1.0, 1.0, 6) * (1.0, 1.0, 0.5, 0.05, 0.05, 0.02)
        for scene in scenes:
            dx, mean = np.zeros_like(x), np.zeros_like(x)
            mean_derivative(scene.handle(), x.copy(), np.zeros(2), 1, dx, mean)
            found.append(mean)
        assert np.abs(found[0][State.VX :]).max() > 0.01
        assert found[1] == pytest.approx(found[0], rel=0.0, abs=1e-13)


def test_a_trim_is_not_taken_from_strips_with_other_nodes(monkeypatch):
    """In a current their loads differ, and an episode must not depend on which one came first."""
    found = []

    def trim(scene):
        found.append(scene)
        return OperatingPoint({}, np.full(3, len(found)), np.zeros(2), scene.wind_speed, "floating")

    monkeypatch.setattr(trim_cache, "trim", trim)
    monkeypatch.setattr(trim_cache, "_TRIMS", Cache(100))
    options = dict(wind=14.0, fidelity="standard", current=0.5)
    still, scene, exact = (build_scene(sea=sea, **options) for sea in (None, JONSWAP, CROSSING))
    key = trim_cache.plant_key(scene)
    assert key == trim_cache.plant_key(still) == trim_cache.plant_key(exact)
    flat = scene.with_weather(14.0, None, 0)
    states = [trim_cache.cached_trim(each, key, 14.0)[0][0] for each in (still, flat, scene, exact)]
    assert states == [1, 2, 3, 4]
    assert trim_cache.cached_trim(scene.with_weather(14.0, LONG_CRESTED, 2), key, 14.0)[0][0] == 3
