"""The imitation of mpc: fits, files, and what a stopped or changed run does."""

import json

import numpy as np
import pytest

from fowt_env import simulate

pytest.importorskip("torch")
pytest.importorskip("osqp")

from fowt_env.controllers.mpc.clone import HIDDEN, N_INPUTS, SHAPES, read_clone  # noqa: E402
from fowt_env.errors import InputError  # noqa: E402
from fowt_env.training.evaluation.seeds import TRAINING  # noqa: E402
from fowt_env.training.studies import clone_mpc  # noqa: E402


@pytest.fixture
def data():
    """Inputs and rates of a smooth law, of different sizes and scales."""
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=(4000, N_INPUTS)) * np.geomspace(1e-3, 10.0, N_INPUTS) + 2.0
    x = (inputs - 2.0) / np.geomspace(1e-3, 10.0, N_INPUTS)
    return inputs, np.column_stack([0.03 * np.tanh(x[:, 0] - x[:, 3]) + 0.1, 0.4 * np.sin(x[:, 1]) - 0.2])


def test_a_fit_finds_a_smooth_law_and_a_second_one_goes_on_from_it(data, monkeypatch):
    monkeypatch.setattr(clone_mpc, "STEPS", 600)
    monkeypatch.setattr(clone_mpc, "BATCH", 128)
    network, found = clone_mpc.fitted(*data, seed=0)
    assert {name: array.shape for name, array in network.items()} == SHAPES and HIDDEN == 64
    assert min(found) > 0.9
    missed = clone_mpc.outputs(network, data[0]) - data[1]
    assert np.all(missed.std(axis=0) < 0.3 * data[1].std(axis=0)) and np.abs(missed.mean()) < 0.01
    monkeypatch.setattr(clone_mpc, "STEPS", 1)
    again, kept = clone_mpc.fitted(*data, seed=0, start={k: v.astype(float) for k, v in network.items()})
    assert min(kept) > 0.85 and not np.array_equal(again["weight_1"], network["weight_1"])
    assert min(clone_mpc.fitted(*data, seed=0)[1]) < 0.3  # without a start one step finds nothing


def test_a_file_is_read_as_it_was_written(data, monkeypatch, tmp_path):
    monkeypatch.setattr(clone_mpc, "STEPS", 1)
    network, _ = clone_mpc.fitted(*data, seed=1)
    clone_mpc.write_clone(tmp_path / "a.npz", network, clone_mpc.settings_of(), {"rounds": 3})
    settings, arrays = read_clone(tmp_path / "a.npz")
    assert settings.about == {"rounds": 3} and settings.period == 0.5
    assert settings.integral_limit == pytest.approx(7.5 * 1.267109)  # of the present mpc
    assert all(np.array_equal(arrays[name], network[name]) for name in SHAPES)


def test_settings_of_mpc_are_numbers_of_its_own():
    assert clone_mpc.mpc_settings(["shaft=0.4", "travel=1"]).shaft == 0.4
    wrong = (
        ("shaft", "KEY=NUMBER"),
        ("shaft=-1", "shaft = -1"),
        ("shafts=1", "'shafts'"),
        ("torque_low=0.5", "limit"),
    )
    for text, fault in wrong:
        with pytest.raises(InputError, match=fault):
            clone_mpc.mpc_settings([text])


def test_episodes_are_kept_and_those_of_another_mpc_refused(tmp_path, monkeypatch):
    folder = tmp_path / "round_0"
    folder.mkdir()
    (folder / "episode_3.npz").write_bytes(b"kept")
    clone_mpc.record(3, 0, tmp_path, None)
    assert (folder / "episode_3.npz").read_bytes() == b"kept"
    (tmp_path / "teacher.json").write_text(json.dumps({"teacher": {}, "code": "other"}))
    with pytest.raises(InputError, match="episodes are of another mpc"):
        clone_mpc.main(tmp_path)
    with pytest.raises(InputError, match="--ship: needs platform 'oc3_hywind'"):
        clone_mpc.main(tmp_path, ship=True, platform="iea15_volturnus_s")


def test_the_first_round_is_driven_by_mpc_or_by_the_network_given(tmp_path):
    assert clone_mpc.driver_of(0, tmp_path, None) is None
    assert clone_mpc.driver_of(0, tmp_path, tmp_path / "a.npz") == tmp_path / "a.npz"
    assert clone_mpc.driver_of(2, tmp_path, tmp_path / "a.npz") == tmp_path / "network_1.npz"


@pytest.mark.slow
def test_an_episode_records_what_mpc_would_do_in_weather_of_training():
    scene, initial = clone_mpc.episode(3, 12.0, 14.0)
    assert scene.seed in TRAINING and 12.0 <= scene.wind_speed <= 14.0 and len(initial) == 8
    records = clone_mpc.Records()
    teacher = clone_mpc.Teacher(scene.turbine, 0.1, records, read_clone()[1])
    frame = simulate(scene, teacher, 60.0, initial=initial, sensors="standard")
    assert frame.filter(like="PtfmPitch_[").iloc[0, 0] == pytest.approx(initial["PtfmPitch"])
    inputs, rates = (np.array(part) for part in zip(*records, strict=True))
    assert inputs.shape == (120, N_INPUTS)
    assert np.abs(rates).max() <= 1.0 and np.ptp(rates, axis=0).min() > 0.0
    imitated = clone_mpc.outputs(read_clone()[1], inputs)
    assert np.corrcoef(imitated[:, 1], rates[:, 1])[0, 1] > 0.9
