"""Wave forces of a potential-flow body in a scene: its options, its weather, its linear force."""

from dataclasses import replace

import numba
import numpy as np
import pytest
from potential_body import made_up_body

from fowt_env import build_scene
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.trim import trim, without_fluctuations
from fowt_env.analysis.wave_excitation import fit_wave_filter, wave_force
from fowt_env.descriptions.platform import read_platform
from fowt_env.errors import InputError
from fowt_env.plant.hydro.excitation import ExactExcitation, ExcitationSeries, FastExcitation, add_excitation
from fowt_env.plant.hydro.load import hydro_load, surface_at_origin
from fowt_env.plant.state import NO_LOAD, pose_of

JONSWAP = {"kind": "jonswap", "Hs": 4.0, "Tp": 8.0}
SEAS = [
    None,
    JONSWAP | {"heading": 60.0, "ramp": 30},
    {"kind": "regular", "H": 2, "T": 7},
    {"kind": "components", "omega": [0.6, 0.9412], "amplitude": [1.0, 0.5], "heading": [0.0, 60.0]},
]
FORMS = {"exact": ExactExcitation, "fast": ExcitationSeries}
BODY = made_up_body()


def platform_of(body=BODY):
    platform = read_platform("oc3_hywind")
    return platform.model_copy(
        update={"hull": None, "hydro": None, "potential_flow": body, "draft": 120.0, "options": {}}
    )


def scene_of(sea=JONSWAP, form="fast", body=BODY, **given):
    return build_scene(
        platform_of(body), sea=sea, wave_loads=form, mooring=False, duration=100.0, fidelity="reference",
        **{"radiation": "none"} | given,
    )  # fmt: skip


def water(scene, t, x):
    """(7,) wrench of the strips' slot, and the elevation."""
    hydro, data = scene.model.hydro, scene.data()
    load = hydro_load(t, pose_of(x), x, hydro, data).strips
    return np.array([*load, surface_at_origin(t, hydro, data)])


@pytest.mark.parametrize("form", FORMS)
def test_the_load_of_the_water_has_the_excitation_of_the_sea_and_still_water_none(form):
    scene = scene_of(form=form, second_order="full")
    assert type(scene.model.hydro.excitation.first) is FORMS[form]
    x = np.zeros(scene.n_state)
    x[:6] = 3.0, -2.0, 0.5, 0.05, -0.04, 0.3
    part = scene.model.hydro.excitation
    expected = np.array(add_excitation(7.7, pose_of(x), x, NO_LOAD, part, np.zeros((5, 0))))
    for quiet in (without_fluctuations(scene), scene.with_weather(None, None, 0)):
        still = water(quiet, 7.7, x)
        assert np.allclose(water(scene, 7.7, x)[:6] - still[:6], expected, rtol=1e-9, atol=1.0)
        assert still[6] == 0.0 and water(scene, 7.7, x)[6] != 0.0
        assert numba.typeof(tuple(quiet.model)) == numba.typeof(tuple(scene.model))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("sea", SEAS)
def test_other_weather_has_the_same_types_and_the_forces_of_a_scene_built_in_it(form, sea):
    scene = scene_of(form=form, second_order="full")
    moved = scene.with_weather(None, sea, 3)
    assert numba.typeof(tuple(moved.model)) == numba.typeof(tuple(scene.model))
    if sea is not None:
        built = scene_of(sea, form, second_order="full", seed=3)
        x = np.zeros(scene.n_state)
        assert np.array_equal(water(moved, 20.0, x), water(built, 20.0, x))


@pytest.mark.parametrize("form", FORMS)
def test_a_filtered_position_has_two_states_and_keeps_its_types(form):
    memory = {"exact": "none", "fast": "state_space"}[form]
    scene = scene_of(form=form, excitation_position="filtered", excitation_cutoff=0.02, radiation=memory)
    blocks = {block.name: block for block in scene.blocks}
    part = scene.model.hydro.excitation
    assert (blocks["filtered position"].offset, blocks["filtered position"].size) == (part.position.first, 2)
    assert part.position.rate == pytest.approx(2.0 * np.pi * 0.02)
    if form == "fast":
        assert type(part.first) is FastExcitation
        assert blocks["radiation"].offset == scene.model.hydro.radiation.first == part.position.first + 2
    x = np.zeros(scene.n_state)
    x[part.position.first] = 30.0
    for sea in (None, JONSWAP | {"heading": 60.0}, {"kind": "regular", "H": 2, "T": 7}):
        moved = scene.with_weather(None, sea, 1)
        assert numba.typeof(tuple(moved.model)) == numba.typeof(tuple(scene.model))
        assert moved.n_state == scene.n_state
    at_rest, displaced = water(moved, 5.0, np.zeros(scene.n_state)), water(moved, 5.0, x)
    shift = moved.model.hydro.waves.wave_number[0] * 30.0 / moved.model.hydro.waves.omega[0]
    assert np.allclose(displaced[:6], water(moved, 5.0 - shift, 0.0 * x)[:6], rtol=1e-5, atol=1e-3)
    assert not np.allclose(displaced[:6], at_rest[:6], rtol=1e-3) and displaced[6] == at_rest[6]
    with pytest.raises(InputError, match="excitation_cutoff = 10: must be a number in"):
        scene_of(excitation_position="filtered", excitation_cutoff=10)


def test_second_order_needs_a_qtf():
    with pytest.raises(InputError, match="second_order = 'full': .* has no difference-frequency QTF"):
        build_scene(sea=JONSWAP, second_order="full", fidelity="reference")
    with pytest.raises(InputError, match="second_order = 'newman': .* has no difference-frequency QTF"):
        scene_of(body=replace(BODY, difference_qtf=None), second_order="newman")
    with pytest.raises(InputError, match="'full_sum': the platform .* has no sum-frequency QTF"):
        scene_of(body=replace(BODY, sum_qtf=None), second_order="full_sum")
    with pytest.raises(InputError, match="second_order = 'sum': allowed None, 'none', 'mean_drift'"):
        scene_of(second_order="sum")
    with pytest.raises(InputError, match="second_order_cutoff = -1"):
        scene_of(second_order="full", second_order_cutoff=-1)
    assert scene_of().model.hydro.excitation.second is None
    cut = scene_of(second_order="full", second_order_cutoff=1e-3).model.hydro.excitation.second
    steady = scene_of(second_order="mean_drift").model.hydro.excitation.second
    assert np.allclose(cut.table.value[:, :6], steady.mean, rtol=1e-9)


def test_scenes_without_sea_or_potential_flow_have_none():
    assert scene_of(sea=None).model.hydro.excitation is None
    assert build_scene(sea=JONSWAP, fidelity="reference").model.hydro.excitation is None


def test_the_linear_wave_force_is_the_excitation_turned_into_body_axes():
    scene = scene_of()
    x = np.zeros(scene.n_state)
    x[:6] = 3.0, -2.0, 0.5, 0.05, -0.04, 0.3
    omega = 0.83
    force = wave_force(scene, x, [omega])[0]
    regular = scene.with_weather(None, {"kind": "regular", "H": 2.0, "T": 2.0 * np.pi / omega}, 0)
    part = regular.model.hydro.excitation.first.exact
    for t in (0.0, 1.3):
        exact = regular.model.hydro.excitation._replace(first=part)
        expected = add_excitation(t, pose_of(x), x, NO_LOAD, exact, np.zeros((5, 0)))
        assert np.allclose((force * np.exp(1j * omega * t)).real, np.array(expected), rtol=1e-9)
    assert not wave_force(build_scene(hydrodynamics=False, fidelity="reference"), x, [omega]).any()
    planar = wave_force(
        build_scene(platform_of(), planar=True, mooring=False, fidelity="reference"), np.zeros(15), [omega]
    )
    assert not planar[:, [1, 3, 5]].any() and planar[:, [0, 2, 4]].all()


def test_the_wave_filter_fits_the_force_within_its_stated_error():
    scene = scene_of()
    x = np.zeros(scene.n_state)
    model = fit_wave_filter(scene, x)
    omega = np.linspace(0.15, 2.0, 150)
    force, fitted = wave_force(scene, x, omega), model.response(omega)
    scale = np.abs(force).max(axis=0)
    error = np.linalg.norm((fitted - force) / scale, axis=1) / np.linalg.norm(force / scale, axis=1)
    for (low, high), stated in model.errors.items():
        assert error[(omega >= low) & (omega <= high)].max() == pytest.approx(stated, rel=1e-6)
    assert model.errors[0.4, 0.8] < 0.02
    assert np.linalg.eigvals(model.A).real.max() < 0.0


@pytest.mark.nightly
def test_a_filtered_position_follows_a_trim_and_leaves_linear_models_as_they_are():
    sea = {"kind": "regular", "H": 2.0, "T": 9.0}
    undisplaced, filtered = (
        build_scene("iea15_volturnus_s", sea=sea, fidelity="standard", excitation_position=name)
        for name in ("undisplaced", "filtered")
    )
    one, other = linearize(undisplaced), linearize(filtered)
    assert one.states == other.states
    assert np.allclose(one.A, other.A, rtol=1e-6, atol=1e-8)
    waves = ["wave_elevation"]
    assert np.allclose(one.response([0.7], waves), other.response([0.7], waves), rtol=1e-6)
    x, first = trim(filtered).state, filtered.model.hydro.excitation.position.first
    assert x[first : first + 2] == pytest.approx(x[:2], abs=1e-9) and abs(x[0]) > 0.1
