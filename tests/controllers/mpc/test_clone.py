"""The clone of mpc: its law against mpc's own code around the same network, and what it refuses."""

import json

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.controllers import make
from fowt_env.controllers.mpc.clone import FILE, SHAPES, MPCClone, read_clone
from fowt_env.controllers.mpc.law import Entry
from fowt_env.envs import FowtVectorEnv
from fowt_env.errors import InputError
from fowt_env.training.evaluation.cases import named_cases
from fowt_env.training.evaluation.metrics import metrics


def turbulent(wind, seed, duration):
    """The case of a suite in normal turbulence."""
    (case,) = named_cases(f"ntm_{wind}")
    return build_scene(
        case.platform, wind=case.wind, sea=case.sea, seed=seed, duration=duration, fidelity="standard"
    )


@pytest.mark.parametrize("wind", [12, 18])  # the curve acts in lulls of the first
def test_its_law_is_that_of_mpc_around_the_same_network(wind):
    pytest.importorskip("osqp")
    pytest.importorskip("torch")
    from fowt_env.training.studies.clone_mpc import Records, Teacher

    scene = turbulent(wind, 1004, 60.0)
    made, network = read_clone()
    teacher = Teacher(scene.turbine, 0.1, Records(), network)
    teacher.parameters[Entry.INTEGRAL_LIMIT] = made.integral_limit  # of the training
    ours, theirs = (simulate(scene, law, duration=60.0) for law in ("mpc_clone", teacher))
    assert len(teacher.records) == 120
    for channel, rated in (("GenTq_[kN-m]", 43.1), ("BldPitch1_[deg]", 10.0), ("RotSpeed_[rpm]", 12.1)):
        assert np.ptp(theirs[channel]) > 0.01 * rated
        np.testing.assert_allclose(ours[channel], theirs[channel], rtol=0.0, atol=1e-6 * rated)


def test_it_betters_the_baseline_at_no_more_pitch_travel_on_a_validation_seed():
    scene = turbulent(14, 1003, 660.0)
    ours, theirs = (
        metrics(simulate(scene, name, duration=660.0), 60.0) for name in ("mpc_clone", "gspi_oc3")
    )
    for name in ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]"):
        assert ours[name] < 0.85 * theirs[name]
    assert ours["blade_pitch_travel_[deg/s]"] <= 1.02 * theirs["blade_pitch_travel_[deg/s]"]


@pytest.mark.parametrize("wind", [8.0, 14.0, 20.0])
def test_it_comes_to_rest_in_steady_wind(wind):
    frame = simulate(build_scene("oc3_hywind", wind=wind, fidelity="standard"), "mpc_clone", duration=500.0)
    late = frame[frame["Time_[s]"] >= 400.0]
    assert np.ptp(late["RotSpeed_[rpm]"]) < 0.1 and np.ptp(late["BldPitch1_[deg]"]) < 0.1
    if wind > 11.4:
        assert late["RotSpeed_[rpm]"].mean() == pytest.approx(12.1, rel=5e-3)


def test_it_is_a_baseline_of_a_batch_of_environments():
    settings = {"action_mode": "residual", "baseline": "mpc_clone", "reward": "score", "wind": 18.0}
    env = FowtVectorEnv(2, threads=1, **settings)
    env.reset(seed=1)
    rewards = [env.step(np.zeros((2, 2)))[1] for _ in range(100)]
    assert 0.5 < np.mean(rewards) < 1.0


@pytest.mark.nightly
def test_another_platform_is_refused_and_so_is_a_reset_without_one():
    scene = build_scene("iea15_volturnus_s", wind=14.0)
    law = make("mpc_clone", scene.turbine, 0.1)
    with pytest.raises(InputError, match="call prepare"):
        law.reset(None)
    with pytest.raises(InputError, match="platform .* must be .* on which its network was trained"):
        law.prepare(scene)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"weight_1": np.zeros((64, 63))}, r"weight_1: must be finite numbers of shape \(64, 64\)"),
        ({"bias_2": np.array([0.0, np.nan])}, "bias_2: must be finite"),
        ({"scale": np.zeros(SHAPES["scale"])}, "scale: must be positive"),
        ({"mean": None}, "mean: must be finite"),
        ({"settings": np.array("{")}, "cannot be read"),
        ({"settings": np.array(json.dumps({"format": 2}))}, "format"),
        ({"mean": np.array([object()])}, "cannot be read"),
    ],
)
def test_a_broken_file_is_refused(change, fault, tmp_path):
    with np.load(FILE) as shipped:
        arrays = dict(shipped) | change
    path = tmp_path / "clone.npz"
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(InputError, match=fault):
        read_clone(path)
    with pytest.raises(InputError, match=fault):
        MPCClone(None, 0.1, path)
