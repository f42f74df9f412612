"""Trainings side by side: their folders, what a repeated call does, and the table."""

import pandas as pd
import pytest
import yaml

from fowt_env.errors import InputError
from fowt_env.training.rl import side_by_side
from fowt_env.training.rl.side_by_side import members, train_all, train_one

SWEEP = {"algorithm.gamma": [0.98, 0.99], "environment.reward.pitch_travel": [20]}


@pytest.fixture
def calls(monkeypatch):
    """Replace Training by one that writes what a whole run leaves; return what it was called with."""
    found = []

    class Whole:
        def __init__(self, settings, folder, resume=False):
            found.append((settings, folder.name, resume))
            self.settings, self.folder = settings, folder

        def run(self):
            settings = self.settings or yaml.safe_load((self.folder / "settings.yml").read_text())
            self.folder.mkdir(parents=True, exist_ok=True)
            (self.folder / "settings.yml").write_text(yaml.safe_dump(settings))
            score = settings["algorithm"]["gamma"] + settings["seed"]
            rows = [(0, 9.0), (50, score), (settings["steps"], score + 0.1)]
            pd.DataFrame(rows, columns=["decisions", "score"]).to_csv(self.folder / "validation.csv")
            (self.folder / "last.npz").write_bytes(b"")
            return True

    monkeypatch.setattr(side_by_side, "Training", Whole)
    return found


def test_each_seed_and_combination_of_settings_has_a_folder_and_its_own_settings(tmp_path):
    found = members("ppo", "above_rated", [0, 3], 100, {"algorithm.n_epochs": 2}, SWEEP, tmp_path)
    names = [member.folder.rpartition("/")[2] for member in found]
    assert names == [f"gamma={g}_pitch_travel=20_seed_{seed}" for g in (0.98, 0.99) for seed in (0, 3)]
    assert [member.settings["algorithm"]["gamma"] for member in found] == [0.98, 0.98, 0.99, 0.99]
    assert [member.settings["seed"] for member in found] == [0, 3, 0, 3]
    assert all(member.settings["environment"]["reward"]["pitch_travel"] == 20 for member in found)
    assert all(member.settings["algorithm"]["n_epochs"] == 2 for member in found)


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"seeds": []}, "at least one value"),
        ({"seeds": [1, 1]}, "twice"),
        ({"sweep": {"algorithm.gamma": 0.9}}, "must be a list"),
        ({"sweep": {"algorithm.gamma": [0.9, 0.9]}}, "twice"),
        ({"sweep": {"gamma.x": [1]}}, "unknown setting 'gamma.x'"),
        ({"seeds": [-1]}, "seed = -1"),
    ],
)
def test_what_cannot_be_swept_is_named(tmp_path, given, fault):
    arguments = {"seeds": [0], "steps": 10, "folder": tmp_path} | given
    with pytest.raises(InputError, match=fault):
        members("ppo", "above_rated", **arguments)


def test_a_repeated_call_keeps_what_has_ended_continues_the_rest_and_ranks_all(tmp_path, calls):
    chosen = members("ppo", "above_rated", [1, 0], 100, sweep=SWEEP, folder=tmp_path)
    reported = []
    table = train_all(chosen, report=lambda done, total: reported.append((done, total)))
    assert reported == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert table["score"].tolist() == pytest.approx([0.98, 0.99, 1.98, 1.99])
    assert table["seed"].tolist() == [0, 0, 1, 1] and set(table["decisions"]) == {50}
    assert set(table["last"]) == {100}
    assert table["algorithm.gamma"].tolist() == [0.98, 0.99, 0.98, 0.99]
    assert pd.read_csv(tmp_path / side_by_side.TABLE)["folder"].tolist() == table["folder"].tolist()
    assert [resume for *_, resume in calls] == [False] * 4 and calls[0][0] == chosen[0].settings
    (tmp_path / "gamma=0.98_pitch_travel=20_seed_0" / "last.npz").unlink()  # as an interrupt leaves it
    assert train_all(chosen).equals(table)
    assert calls[4:] == [(None, "gamma=0.98_pitch_travel=20_seed_0", True)]


def test_after_one_that_was_stopped_no_other_training_begins(tmp_path, calls, monkeypatch):
    monkeypatch.setattr(side_by_side.Training, "run", lambda self: False)  # with its checkpoint
    with pytest.raises(KeyboardInterrupt):
        train_all(members("ppo", "above_rated", [0, 1], 100, folder=tmp_path))
    assert len(calls) == 1


def test_a_folder_with_a_run_of_other_settings_is_refused(tmp_path, calls):
    (first,) = members("ppo", "above_rated", [0], 100, folder=tmp_path)
    train_one(first)
    with pytest.raises(InputError, match="other settings"):
        train_one(first._replace(settings=first.settings | {"steps": 200}))
    assert len(calls) == 1


def test_trainings_run_in_worker_processes(tmp_path):
    chosen = members("ppo", "above_rated", [0, 1], 100, folder=tmp_path)
    for member in chosen:  # ended runs: no process has to train
        folder = tmp_path / member.folder.rpartition("/")[2]
        folder.mkdir()
        (folder / "settings.yml").write_text(yaml.safe_dump(member.settings))
        (folder / "last.npz").write_bytes(b"")
        rows = pd.DataFrame({"decisions": [100], "score": [float(1 - member.settings["seed"])]})
        rows.to_csv(folder / "validation.csv")
    assert train_all(chosen, jobs=2)["seed"].tolist() == [1, 0]
    with pytest.raises(InputError, match="unknown engine 'slurm'"):
        train_all(chosen, engine="slurm")
