"""Each row of LOADS: absent is zero, zero strength is absent, left and right are alike.

A scene without a part is a kind of its own, which takes a minute to compile. So the loads are evaluated
by the same functions as plain Python, in a process with NUMBA_DISABLE_JIT=1.
"""

import json
from functools import cache, reduce
from pathlib import Path

import numba
import numpy as np
import pytest
from fresh_python import fresh_python
from plant_helpers import random_state
from potential_body import made_up_body

import fowt_env
from fowt_env import Force, Load, build_scene, load_kernel
from fowt_env.descriptions.platform import AdditionalLoads, Member, read_platform
from fowt_env.plant.advance import forget, observe
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State
from fowt_env.scene.loads import LOADS
from fowt_env.scene.options import ROTORS
from fowt_env.scene.radiation_fit import build_radiation
from fowt_env.weather.excitation import build_excitation

ROOT = Path(fowt_env.__file__).resolve().parent.parent
FORMS = ("exact", "fast")  # of the wave loads
TIME = 3.0
BLOCKS = ("TOTAL", "ROTOR", "TOWER", "HYDRO", "MOORING")  # of LoadCache, six entries each
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # of a wrench
ADDED_MASS = tuple(map(tuple, np.diag([8e6, 8e6, 9e6, 6e10, 6e10, 9e9]).tolist()))
ADDITIONAL = AdditionalLoads(
    preload=(1e5, 0.0, -2e5, 0.0, 3e6, 0.0),
    stiffness=tuple(map(tuple, np.diag([1e4, 1e4, 3e4, 5e7, 5e7, 2e7]).tolist())),
    linear_damping=tuple(map(tuple, np.diag([2e4, 2e4, 1e4, 4e7, 4e7, 1e7]).tolist())),
    quadratic_damping=(
        (9e5, 0.0, 0.0, 0.0, -8e6, 0.0),
        (0.0, 9e5, 0.0, 8e6, 0.0, 0.0),
        (0.0, 0.0, 2e6, 0.0, 0.0, 0.0),
        (0.0, 8e6, 0.0, 1e10, 0.0, 0.0),
        (-8e6, 0.0, 0.0, 0.0, 1e10, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 4e10),
    ),
)
NOTHING = {
    "hydro.linear_damping": (0.0,) * 6,
    "hydro.yaw_stiffness": 0.0,
    "hydro.added_mass": None,
    "additional": None,
    "members": (),
    "potential_flow": None,
}
MEMBERS = tuple(
    Member(
        start=(4.0, 3.0 * side, -30.0), end=(15.0, 12.0 * side, 8.0), diameter=(5.0, 3.0),
        drag_coefficient=(0.6, 0.7), added_mass_coefficient=(0.9, 0.8), axial_drag_coefficient=(4.8, 1.0),
        axial_added_mass_coefficient=(1.0, 0.5),
    )
    for side in (1.0, -1.0)
)  # fmt: skip
ALL = {
    "wind": 12.0,
    "sea": {"kind": "regular", "H": 4.0, "T": 9.0},
    "current": 0.5,
    "diffraction": "maccamy_fuchs",
}
WITH_SLOT = [name for name, load in LOADS.items() if load.slot]
WITH_STRENGTH = [name for name, load in LOADS.items() if load.strength]
SLOTS = sorted({load.slot for load in LOADS.values() if load.slot and load.strength})


@load_kernel
def push(parameters, motion, force):
    force[Force.FX] = parameters[0]
    force[Force.FY] = parameters[1]


def scene_of(form):
    """Scene with every load."""
    return scene_less(form, "")


@cache
def scene_less(form, name):
    """Scene with every load but this one, which is left out as a user does."""
    arguments = ALL | {"loads": [Load("Push", push, [1e5, 2e5])]}
    hydro = {
        "hydro.added_mass": ADDED_MASS,
        "additional": ADDITIONAL,
        "members": MEMBERS,
        "potential_flow": made_up_body(),
    }
    if name:
        arguments |= LOADS[name].without
        hydro |= {key: NOTHING[key] for key in LOADS[name].keys}
    body = hydro.pop("potential_flow")
    beside = {key: hydro.pop(key) for key in ("additional", "members")}
    given = {key.removeprefix("hydro."): value for key, value in hydro.items()}
    platform = read_platform("oc3_hywind")
    platform = platform.model_copy(update={"hydro": platform.hydro.model_copy(update=given), **beside})
    scene = build_scene(platform, rotor="bem", wave_loads=form, **{"fidelity": "reference"} | arguments)
    if scene.model.hydro is None:
        return scene
    # of a body whose other coefficients are left out, so that no other load depends on it
    options = {"radiation": "state_space", "radiation_error": 0.1, "planar": True} | arguments
    parts = {"hydro.radiation": build_radiation(made_up_body(), options, 0.1, scene.n_state)}
    if scene.model.hydro.waves is not None:
        parts["hydro.excitation"] = build_excitation(
            body, scene.model.hydro.waves, duration=10.0, fast=form == "fast", planar=True,
            second_order="full",
        )  # fmt: skip
    return scene.with_model(parts)


def part_at(model, path):
    """What is at a path of a model; None where it has no such part."""
    return reduce(lambda part, name: getattr(part, name, None), path.split("."), model)


def no_strength(scene, names):
    """The scene with all that scales these loads at zero."""
    paths = [path for name in names for path in LOADS[name].strength]
    found = {path: part_at(scene.model, path) for path in paths}
    return scene.with_model({path: 0.0 * value for path, value in found.items() if value is not None})


def within(slot):
    """Names of the loads whose slot lies inside a slot, that itself included."""
    return [name for name in WITH_SLOT if f"{LOADS[name].slot}.".startswith(f"{slot}.")]


# What runs without the compiler


def wrenches(scene, states):
    """{block: (states, 6)} of the loads, and the added mass of each state as one more."""
    data = scene.data()
    handle, found = scene.handle(data), {block: [] for block in (*BLOCKS, "added mass")}
    for x in states:
        forget(handle)
        x = np.r_[
            x, 1e5 * np.cos(np.arange(scene.n_state - x.size))
        ]  # motions in the plane alone have memory
        observe(handle, x.copy(), np.zeros(2), TIME, np.zeros_like(x), np.zeros(64))
        for block in BLOCKS:
            start = LoadCache[block]
            found[block].append(data.cache[start : start + 6].tolist())
        found["added mass"].append(data.added_mass.tolist())
    return found


def mirrored(x):
    y = x.copy()
    for entry in (State.SWAY, State.ROLL, State.YAW, State.VY, State.WX, State.WZ):
        y[entry] *= -1.0
    return y


def measured(form):
    """{scene: wrenches}: with all loads, without each, with each at no strength, and each slot's at none."""
    rng = np.random.default_rng(3)
    states = [random_state(rng) for _ in range(2)]
    states += [mirrored(x) for x in states]
    whole = scene_of(form)
    found = {"all": wrenches(whole, states)}
    for name in WITH_SLOT:
        found[f"without {name}"] = wrenches(scene_less(form, name), states)
    for name in WITH_STRENGTH:
        found[f"no {name}"] = wrenches(no_strength(whole, [name]), states)
    for slot in SLOTS:
        found[f"nothing in {slot}"] = wrenches(no_strength(whole, within(slot)), states)
    return found


# What is compared


@pytest.fixture(
    scope="module", params=[FORMS[0], *(pytest.param(form, marks=pytest.mark.nightly) for form in FORMS[1:])]
)
def figures(request):
    """(form, {scene: {block: array}})."""
    code = f"import json, test_loads; print(json.dumps(test_loads.measured({request.param!r})))"
    folder = Path(__file__).parent
    found = json.loads(fresh_python(code, paths=(folder, folder.parent), NUMBA_DISABLE_JIT="1"))
    return request.param, {
        scene: {block: np.array(rows) for block, rows in blocks.items()} for scene, blocks in found.items()
    }


def scale_of(figures):
    """Largest entries of the total wrench (6,)."""
    return np.abs(figures["all"]["TOTAL"]).max(axis=0)


@pytest.mark.parametrize("name", WITH_SLOT)
@pytest.mark.parametrize("form", FORMS)
def test_what_leaves_a_load_out_empties_its_slot_and_no_other(name, form):
    slot, whole, scene = LOADS[name].slot, scene_of(form).model, scene_less(form, name).model
    assert part_at(whole, slot) is not None and part_at(scene, slot) is None
    gone = {LOADS[inner].slot for inner in within(slot)}
    if name == "waves":
        gone |= {"hydro.strips.diffraction", "hydro.excitation"}  # of waves
    for other in {LOADS[other].slot for other in WITH_SLOT} - gone:
        assert part_at(scene, other) is not None, other


@pytest.mark.parametrize("name", WITH_SLOT)
def test_without_a_load_it_is_zero_and_the_others_keep_their_bits(name, figures):
    _, found = figures
    load, whole, less = LOADS[name], found["all"], found[f"without {name}"]
    moved = {LOADS[inner].total for inner in within(load.slot)} | {"TOTAL"}
    for block in BLOCKS:
        assert block in moved or np.array_equal(whole[block], less[block]), block
    alone = {other for other in WITH_SLOT if LOADS[other].total == load.total} <= set(within(load.slot))
    assert not (alone and load.total != "TOTAL" and less[load.total].any())
    assert not all(np.array_equal(whole[block], less[block]) for block in (load.total, "added mass"))


@pytest.mark.parametrize("name", WITH_STRENGTH)
def test_its_strength_moves_its_own_block_alone(name, figures):
    _, found = figures
    whole, less = found["all"], found[f"no {name}"]
    assert not np.array_equal(whole["TOTAL"], less["TOTAL"])
    for block in BLOCKS:
        moved = block in ("TOTAL", LOADS[name].total)
        assert moved or np.array_equal(whole[block], less[block]), block


@pytest.mark.parametrize("slot", SLOTS)
def test_no_strength_is_the_slot_left_empty(slot, figures):
    form, found = figures
    if form == "fast" and slot == "hydro.waves":
        pytest.skip("still water has a finer quadrature than waves have")
    name = next(name for name, load in LOADS.items() if load.slot == slot)
    zero, absent = found[f"nothing in {slot}"], found[f"without {name}"]
    assert np.abs(zero["TOTAL"] - absent["TOTAL"]).max(axis=0) == pytest.approx(
        np.zeros(6), abs=1e-12 * scale_of(found).max()
    )
    assert np.allclose(zero["added mass"], absent["added mass"], rtol=1e-12, atol=1e-6)


def test_no_gravity_is_no_weight(figures, platform, turbine):
    _, found = figures
    weight = found["all"]["TOTAL"] - found["no weight"]["TOTAL"]
    mass = build_scene(fidelity="reference").model.rigid_body.mass
    size = mass * platform.environment.gravity
    assert np.linalg.norm(weight[:, :3], axis=1) == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize("name", [name for name, load in LOADS.items() if load.mirrored])
def test_the_mirrored_state_has_the_mirrored_load(name, figures):
    _, found = figures
    less = found[f"without {name}"] if LOADS[name].slot else found[f"no {name}"]
    load = found["all"][LOADS[name].total] - less[LOADS[name].total]
    here, there = load[: len(load) // 2], load[len(load) // 2 :]
    assert np.abs(there - MIRROR * here).max() <= 1e-9 * scale_of(found).max()


@cache
def kind_of(form):
    """Numba type of the scene with every load: what a compiled run is chosen by."""
    return numba.typeof(scene_of(form).handle())


@pytest.mark.parametrize("form", FORMS)
def test_other_numbers_compile_nothing(form):
    other = no_strength(scene_of(form), WITH_STRENGTH)
    assert numba.typeof(other.handle()) == kind_of(form)


@pytest.mark.parametrize("name", WITH_STRENGTH)
def test_each_of_its_strengths_is_in_a_form_of_the_model(name):
    models = [scene_of(form).model for form in FORMS]
    models += [build_scene(wind=8.0, rotor=rotor, fidelity="reference").model for rotor in ROTORS]
    for path in LOADS[name].strength:
        assert any(part_at(model, path) is not None for model in models), path


@pytest.mark.parametrize("name", LOADS)
def test_its_file_and_its_section_exist(name):
    load = LOADS[name]
    theory = (ROOT / "docs" / "explanation" / "theory.md").read_text()
    assert f"### {load.section} " in theory
    for file in load.file.split(", "):
        assert (ROOT / "fowt_env" / "plant" / file).is_file()
