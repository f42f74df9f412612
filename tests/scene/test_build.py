"""Building scenes: what is refused, what a level of fidelity means, and what it costs in accuracy."""

import inspect

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.errors import InputError
from fowt_env.loop.rollout import rollout
from fowt_env.plant.aero.section_inflow import DynamicSections
from fowt_env.plant.hydro.load import ExactStrips
from fowt_env.scene.options import ARGUMENTS

NTM = {"kind": "ntm", "speed": 18.0, "class": "B"}
SEA = {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0, "gamma": 3.3}
SPREAD = {"kind": "components", "omega": [0.6, 0.9], "amplitude": [1.0, 0.5], "phase": [0.0, 1.0]}
MOTIONS = ["PtfmSurge", "PtfmSway", "PtfmHeave", "PtfmRoll", "PtfmPitch", "PtfmYaw"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"sea": {"kind": "regular", "H": 400.0, "T": 12.0}}, ["400", "water depth", "320"]),
        ({"sea": {"kind": "jonswap", "Hs": 330.0, "Tp": 20.0}}, ["330", "water depth"]),
        ({"platform": "oc3_hywnd"}, ["oc3_hywnd", "Did you mean 'oc3_hywind'"]),
        ({"rotor": "ben"}, ["ben", "Did you mean 'bem'"]),
        ({"fidelity": "standart"}, ["standart", "Did you mean 'standard'"]),
        ({"surfaces": "swl"}, ["surfaces", "Did you mean 'surface'"]),
        ({"fidelty": "standard"}, ["fidelty", "Did you mean 'fidelity'", "Nearest of"]),
        ({"winds": 18.0}, ["winds", "Did you mean 'wind'"]),
        ({"surface": "sea"}, ["surface = 'sea'", "instantaneous", "swl"]),
        ({"seed": -1}, ["seed = -1", ">= 0"]),
        ({"seed": 1.5}, ["seed = 1.5"]),
        ({"duration": 0.0}, ["duration = 0.0"]),
        ({"duration": float("nan")}, ["duration = nan"]),
        ({"shear_exponent": 2.0}, ["shear_exponent = 2.0", "[0, 1]"]),
        ({"wave_components": 0}, ["wave_components = 0", "1 to 10000"]),
        ({"current": {"sped": 1.0}}, ["sped", "Did you mean 'speed'"]),
        ({"current": -1.0}, ["current.speed = -1.0"]),
        ({"wind": 8.0, "rotor": "table", "skewed_wake": True}, ["table", "skewed_wake", "lookup", "bem"]),
        ({"wind": 8.0, "rotor": "table", "dynamic_inflow": True}, ["table", "dynamic_inflow", "bem"]),
        ({"sea": SPREAD | {"heading": [0.0, 30.0]}, "wave_loads": "fast"}, ["wave_loads", "one heading"]),
        ({"sea": SEA, "wave_loads": "fast", "stretching": "none"}, ["wave_loads", "exact"]),
        ({"planar": 1.5}, ["planar = 1.5", "False", "True"]),
        ({"planar": True, "sea": SPREAD | {"heading": [30.0, 30.0]}}, ["heading", "0 or 180", "planar"]),
        ({"planar": True, "current": {"speed": 1.0, "heading": 90.0}}, ["current.heading", "planar"]),
        ({"planar": True, "wind": {"kind": "steady", "speed": 9.0, "direction": 5.0}}, ["0.78", "planar"]),
        ({"planar": True, "wind": NTM | {"direction": 5.0}}, ["cross wind", "planar"]),
        ({"planar": True, "wind": {"kind": "ecd", "speed": 12.0}}, ["cross wind", "planar"]),
    ],
)
def test_what_cannot_be_built_is_refused_by_name_value_and_range(arguments, words):
    with pytest.raises(InputError) as error:
        build_scene(**{"fidelity": "reference"} | arguments)
    for word in words:
        assert word in str(error.value)


def test_every_argument_of_build_scene_is_among_those_that_a_refusal_names():
    kinds = inspect.signature(build_scene).parameters.values()
    assert {kind.name for kind in kinds if kind.kind != kind.VAR_KEYWORD} == set(ARGUMENTS)


def test_a_level_falls_back_to_what_the_scene_needs():
    spread = build_scene(sea=SPREAD | {"heading": [0.0, 30.0]}, fidelity="standard")
    assert isinstance(spread.model.hydro.strips, ExactStrips)
    skewed = build_scene(wind=8.0, fidelity="fast", skewed_wake=True)
    assert skewed.rotor == "lookup" and isinstance(skewed.model.aero.rotor, DynamicSections)


def test_new_weather_cannot_add_or_remove_aerodynamics():
    scene = build_scene(wind=8.0, fidelity="reference")
    with pytest.raises(InputError, match="aerodynamics"):
        scene.with_weather(None, None, 1)


def test_weather_that_is_not_named_stays():
    scene = build_scene(wind=NTM, sea=SEA, seed=3, fidelity="reference")
    for same in (scene.with_weather(), scene.with_weather(NTM), scene.with_weather(sea=SEA, seed=3)):
        assert (same.wind, same.sea, same.seed) == (scene.wind, scene.sea, 3)
        assert np.array_equal(same.model.aero.wind.value, scene.model.aero.wind.value)
        assert np.array_equal(same.model.hydro.waves.phase, scene.model.hydro.waves.phase)
    assert scene.with_weather(sea=None).sea is None


def test_new_weather_is_that_of_a_scene_built_with_it():
    moved = build_scene(wind=NTM, sea=SEA, seed=1, fidelity="reference").with_weather(
        NTM | {"speed": 14.0}, SEA, 5
    )
    built = build_scene(wind=NTM | {"speed": 14.0}, sea=SEA, seed=5, fidelity="reference")
    assert np.array_equal(moved.model.aero.wind.value, built.model.aero.wind.value)
    assert np.array_equal(moved.model.hydro.waves.phase, built.model.hydro.waves.phase)
    assert moved.wind_speed == built.wind_speed == 14.0


@pytest.mark.parametrize(
    "levels, options, duration, most",
    [
        # 60 components keep the exact run short
        (("reference", "standard"), {"wave_components": 60}, 200.0, 1e-3),
        pytest.param(("standard", "fast"), {}, 600.0, 2e-2, marks=pytest.mark.nightly),
    ],
)
def test_a_level_stays_near_the_one_before(levels, options, duration, most):
    """Root-mean-square difference over the standard deviation."""
    scenes = (build_scene(wind=NTM, sea=SEA, seed=2, fidelity=level, **options) for level in levels)
    exact, quick = (simulate(scene, "pi", duration=duration) for scene in scenes)
    for name in (*MOTIONS, "RotSpeed", "FAIRTEN1"):
        column = next(c for c in exact.columns if c.startswith(f"{name}_["))
        error = np.sqrt(np.mean((quick[column] - exact[column]) ** 2)) / exact[column].std()
        assert error < most, (name, error)


def test_scenes_of_one_kind_share_one_compiled_run():
    kinds = len(rollout.signatures)
    for seed, components in ((1, 30), (2, 40)):
        scene = build_scene(wind=NTM, sea=SEA, seed=seed, wave_components=components, fidelity="standard")
        simulate(scene, "pi", duration=1.0)
        simulate(scene, "pi_land", duration=1.0)
    assert len(rollout.signatures) <= kinds + 1


@pytest.mark.parametrize("count", [2, 1000, 5.0, True])
def test_a_number_of_stations_that_the_blade_lacks_is_refused(count):
    with pytest.raises(InputError, match="blade_stations = .*: must be a whole number from 3 to"):
        build_scene(wind=18.0, blade_stations=count, fidelity="reference")


def test_stations_are_left_out_between_root_and_tip():
    every = build_scene(wind=18.0, fidelity="reference").model.aero.rotor.elements.radius
    some = build_scene(wind=18.0, blade_stations=5, fidelity="reference").model.aero.rotor.elements.radius
    assert some.size == 5 and some[0] == every[0] and some[-1] == every[-1]
    assert set(some) <= set(every)


def test_strips_are_no_longer_than_asked_for():
    fine, coarse = (
        build_scene(strip_length=length, fidelity="reference").model.hydro.strips.shape
        for length in (3.0, 12.0)
    )
    assert fine.nodes > coarse.nodes
    with pytest.raises(InputError, match="strip_length = 0.0: must be a number in"):
        build_scene(strip_length=0.0, fidelity="reference")
