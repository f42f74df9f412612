"""Mooring lines that break and compartments that are flooded, against platforms built so."""

import numpy as np
import pandas as pd
import pytest
from naive.mooring import catenary

import fowt_env
from fowt_env.descriptions.platform import read_platform
from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.loop.protection import Flood, fill_compartments
from fowt_env.plant.hydro.flooding import add_point_mass, with_floods
from fowt_env.plant.hydro.load import NO_HYDRO_LOAD
from fowt_env.plant.mooring import LOST, mooring_load
from fowt_env.plant.state import pose_of
from fowt_env.run.simulation import build_run

MOTIONS = [
    f"Ptfm{name}" for name in ("Surge_[m]", "Sway_[m]", "Heave_[m]", "Roll_[deg]", "Pitch_[deg]", "Yaw_[deg]")
]
SEA = {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}
OC3 = read_platform("oc3_hywind")


def scene_of(platform="oc3_hywind", **options):
    return fowt_env.build_scene(platform, wind=12.0, sea=SEA, seed=5, **{"fidelity": "standard"} | options)


@pytest.fixture(scope="module")
def scene():
    return scene_of()


def run(scene, *faults, duration=40.0, **options):
    return fowt_env.simulate(scene, "pi", duration=duration, faults=list(faults), **options)


def without(line):
    return OC3.model_copy(update={"lines": tuple(x for i, x in enumerate(OC3.lines, 1) if i != line)})


@pytest.mark.parametrize(
    ("line", "options"),
    [
        pytest.param(2, {}, id="catenaries"),
        pytest.param(1, {"fidelity": "fast"}, id="tables", marks=pytest.mark.nightly),
        pytest.param(3, {"mooring": "dynamic"}, id="moving", marks=pytest.mark.nightly),
    ],
)
def test_a_platform_that_loses_a_line_at_once_is_one_without_it(line, options):
    start = {"initial": "zero", "duration": 20.0}
    broken = run(scene_of(**options), {"kind": "line_loss", "time": 0.0, "line": line}, **start)
    fewer = run(scene_of(without(line), **options), **start)
    np.testing.assert_allclose(broken[MOTIONS], fewer[MOTIONS], rtol=0.0, atol=1e-9)
    tensions = broken.filter(like="TEN")
    lost = [name for name in tensions if f"TEN{line}_" in name]
    assert len(lost) == 2 and not tensions[lost].to_numpy().any()
    np.testing.assert_allclose(tensions.drop(columns=lost), fewer.filter(like="TEN"), rtol=1e-9)


def test_the_load_of_lines_without_a_broken_one_is_that_of_the_twin(scene):
    x = np.zeros(scene.n_state)
    x[:6] = 9.0, -4.0, -1.0, 0.02, 0.05, -0.03
    lines, pose, mooring = np.zeros((3, 6)), pose_of(x), scene.model.mooring
    lines[1, 5] = LOST
    load = np.array(mooring_load(pose, mooring, lines, np.zeros(8)))
    rotation = np.array([[getattr(pose, f"r{i}{j}") for j in (1, 2, 3)] for i in (1, 2, 3)])
    expected = np.zeros(6)
    for i in (0, 2):
        way = mooring.anchor[i] - (x[:3] + rotation @ mooring.fairlead[i])
        across = np.hypot(*way[:2])
        H, V = catenary(
            across, -way[2], mooring.length[i], mooring.weight[i], mooring.EA[i], mooring.friction[i]
        )
        force = rotation.T @ [*(H * way[:2] / across), -V]
        expected += [*force, *np.cross(mooring.fairlead[i], force)]
    np.testing.assert_allclose(load, expected, rtol=1e-9, atol=1e-3)
    assert lines[1].tolist() == [0.0] * 5 + [LOST]


def test_until_its_time_a_line_holds_and_then_the_platform_goes_where_the_others_pull(scene):
    free, broken = run(scene), run(scene, {"kind": "line_loss", "time": 5.0, "line": 2})
    before = free["Time_[s]"] < 5.0 - 1e-9
    pd.testing.assert_frame_equal(broken[before], free[before], check_exact=True)
    assert free["FAIRTEN2_[kN]"].min() > 500.0 and not broken.loc[~before, "FAIRTEN2_[kN]"].any()
    anchor = scene.model.mooring.anchor[1, :2]
    moved = (broken - free)[["PtfmSurge_[m]", "PtfmSway_[m]"]].iloc[-1].to_numpy()
    assert moved @ anchor / np.hypot(*anchor) < -5.0


def test_a_line_that_breaks_is_a_jump_and_no_error_of_the_steps(scene):
    """A polynomial through derivatives before and after it would have first-order errors."""
    fault = {"kind": "line_loss", "time": 5.0, "line": 2}
    coarse, fine = (
        run(scene, fault, duration=6.0, dt=dt)["PtfmSurge_[m]"].to_numpy()
        - run(scene, duration=6.0, dt=dt)["PtfmSurge_[m]"].to_numpy()
        for dt in (0.1, 0.0125)
    )
    assert np.abs(fine).max() > 0.01
    np.testing.assert_allclose(coarse, fine, atol=2e-5)


def point_mass(mass, point):
    """The mass matrix (6, 6) of a point mass by cross products."""
    cross = np.array([np.cross(axis, point) for axis in np.eye(3)])  # rows: e_i x r
    lever = cross.T  # w -> w x r
    return mass * np.block([[np.eye(3), lever], [lever.T, lever.T @ lever]])


def test_the_mass_matrix_and_the_load_of_flooded_compartments_are_those_of_points():
    rng = np.random.default_rng(2)
    x = np.zeros(15)
    x[:6], x[7:13] = 0.3 * rng.normal(size=6), rng.normal(size=6)
    pose, gravity = pose_of(x), 9.81
    flood, expected, force = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6)
    rotation = np.array([[getattr(pose, f"r{i}{j}") for j in (1, 2, 3)] for i in (1, 2, 3)])
    velocity, turning = x[7:10], x[10:13]
    for mass, point in ((2e5, [3.0, -2.0, -40.0]), (1e5, [-5.0, 6.0, -10.0])):
        add_point_mass(mass, *point, flood)
        expected += point_mass(mass, np.array(point))
        # in an inertial frame: without accelerations of the body, w x v + w x (w x r) remains
        moving = np.cross(turning, velocity) + np.cross(turning, np.cross(turning, point))
        pull = mass * (rotation.T @ [0.0, 0.0, -gravity] - moving)
        force += [*pull, *np.cross(point, pull)]
    np.testing.assert_allclose(flood, expected, rtol=1e-14)
    added = np.eye(6)
    load = with_floods(pose, NO_HYDRO_LOAD, gravity, flood, added)
    np.testing.assert_allclose(np.array(load.buoyancy), force, rtol=1e-12, atol=1e-3)
    np.testing.assert_allclose(added, np.eye(6) + expected, rtol=1e-14)


def ballasted(scene, mass, point):
    """The scene whose rigid body has a point mass, with y = 0, more."""
    body, (x, _, z) = scene.model.rigid_body, point
    heavier = body._replace(
        mass_matrix=body.mass_matrix + point_mass(mass, np.array(point)), mass=body.mass + mass,
        s_x=body.s_x + mass * x, s_z=body.s_z + mass * z,
    )  # fmt: skip
    return scene.with_model(rigid_body=heavier)


FLOODED = {"kind": "flooded_compartment", "time": 0.0, "mass": 8e4, "point": [3.0, 0.0, -60.0]}


def test_a_flooded_platform_moves_as_one_with_this_ballast_and_comes_to_rest_at_its_trim(scene):
    start = {"initial": "zero", "duration": 30.0}
    heavy = ballasted(scene, FLOODED["mass"], FLOODED["point"])
    flooded = run(scene, FLOODED, **start)
    np.testing.assert_allclose(flooded[MOTIONS], run(heavy, **start)[MOTIONS], rtol=0.0, atol=1e-9)
    still = fowt_env.build_scene("oc3_hywind", wind=12.0, fidelity="standard")
    rest = fowt_env.trim(ballasted(still, FLOODED["mass"], FLOODED["point"]))
    assert rest["PtfmHeave"] < fowt_env.trim(still)["PtfmHeave"] - 2.0
    initial = {name.split("_")[0]: rest[name.split("_")[0]] for name in MOTIONS}
    frame = run(
        still, FLOODED, initial=initial | {"RotSpeed": rest["RotSpeed"], "BldPitch1": rest["BldPitch1"]}
    )
    assert np.abs(frame["PtfmHeave_[m]"] - rest["PtfmHeave"]).max() < 1e-3


def test_a_platform_that_sinks_ends_the_run_where_its_tower_meets_the_water(scene):
    flood = {"kind": "flooded_compartment", "time": 5.0, "mass": 4e6, "point": [0.0, 0.0, -100.0]}
    with pytest.raises(SimulationStopped, match="sunk") as caught:
        run(scene, flood)
    foot = 10.0 + caught.value.frame["PtfmHeave_[m]"].to_numpy()
    assert caught.value.time == caught.value.frame["Time_[s]"].iloc[-1] < 20.0
    assert foot[-1] < 0.0 < foot[:-1].min()


def test_a_compartment_fills_at_a_constant_rate(scene):
    filling = FLOODED | {"time": 1.0, "duration": 4.0}
    runs = [build_run(scene, "pi", duration, faults=[filling]) for duration in (0.9, 3.0, 6.0)]
    for each, share in zip(runs, (0.0, 0.475, 1.0), strict=True):  # of the last control period, at 2.9 s
        each.advance(lambda fraction: None)
        expected = share * point_mass(FLOODED["mass"], np.array(FLOODED["point"]))
        np.testing.assert_allclose(each.data.flood, expected, rtol=1e-9)


def test_a_sudden_flood_restarts_the_steps_and_a_full_compartment_changes_nothing(scene):
    data, floods = scene.data(), np.zeros((1, len(Flood)))
    floods[0] = 2.0, 0.0, 1e5, 0.0, 0.0, -50.0
    for t, valid, steps in ((1.9, 1.0, 7.0), (2.0, 0.0, 0.0), (2.1, 1.0, 7.0)):
        data.cache[:2] = 1.0, 7.0
        fill_compartments(t, 0.1, floods, data)
        assert data.cache[:2].tolist() == [valid, steps]


BAD = [
    ({"kind": "line_loss", "time": 1.0}, "line is missing"),
    ({"kind": "line_loss", "time": 1.0, "line": 4}, "line = 4: the scene has 3 mooring lines"),
    ({"kind": "line_loss", "time": 1.0, "line": 0}, "line"),
    (FLOODED | {"mass": -1.0}, "mass"),
    (FLOODED | {"mass": 1e9}, "mass = 1e\\+09 kg: must be at most 8.066e\\+06 kg"),
    (FLOODED | {"point": [0.0, 0.0, 40.0]}, "z must be in \\[-320, 10\\] m"),
    (FLOODED | {"line": 1}, "line: is not a key of flooded_compartment"),
    ({"kind": "flooded_compartment", "time": 1.0, "mass": 1e4}, "point is missing"),
]


@pytest.mark.parametrize(("fault", "message"), BAD)
def test_a_platform_fault_that_cannot_be_is_refused_before_anything_runs(scene, fault, message):
    with pytest.raises(InputError, match=message):
        run(scene, fault)


def test_an_environment_has_the_same_faults_and_its_snapshots_keep_them():
    faults = [{"kind": "line_loss", "time": 2.0, "line": 2}, FLOODED | {"time": (2.0, 2.5)}]
    env = FowtEnv(action_mode="residual", faults=faults, record=True)
    env.reset(seed=4)
    zero = np.zeros(env.action_space.shape)
    for _ in range(30):
        env.step(zero)
    kept, rows = env.get_state(), []
    for _ in range(2):
        env.set_state(kept)
        for _ in range(20):
            env.step(zero)
        rows.append(env.frame())
    pd.testing.assert_frame_equal(*rows, check_exact=True)
    assert not rows[0]["FAIRTEN2_[kN]"].iloc[20:].any() and rows[0]["FAIRTEN2_[kN]"].iloc[19] > 100.0
    env.reset(seed=4, options={"faults": [faults[0] | {"time": 1e4}, FLOODED | {"time": 1e4}]})
    assert env.channels()["FAIRTEN2"] > 100.0
    for _ in range(5):
        env.step(zero)
    assert env.frame()["FAIRTEN2_[kN]"].min() > 100.0
