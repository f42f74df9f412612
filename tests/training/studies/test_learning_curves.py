"""The study of learning curves: a repeated call trains only what is missing."""

import pandas as pd
import pytest

pytest.importorskip("torch")

from fowt_env.training.studies import learning_curves

EASY, HARD = "fowt_env/OC3HywindEasy-v0", "fowt_env/OC3HywindHard-v0"


def test_a_repeated_call_trains_what_is_missing_and_plots_all(tmp_path, monkeypatch):
    trained, plotted = [], []

    def validated(name, implementation, seed, steps, script):
        trained.append((name, implementation, seed))
        rows = [{"steps": done, "reward": 0.7 + done, "seconds": 1.0} for done in (0, steps)]
        return [{"name": name, "implementation": implementation, "seed": seed} | row for row in rows]

    monkeypatch.setattr(learning_curves, "validated", validated)
    monkeypatch.setattr(learning_curves, "plot", lambda table, path: plotted.append(table))
    learning_curves.main(tmp_path, [EASY], steps=8)
    learning_curves.main(tmp_path, [EASY, HARD], steps=8, seeds=2, script=tmp_path / "ppo.py")
    own = learning_curves.SINGLE_FILE
    assert trained[0] == (EASY, learning_curves.SB3, 0) and len(trained) == len(set(trained)) == 8
    assert trained[1:4] == [(EASY, learning_curves.SB3, 1), (EASY, own, 0), (EASY, own, 1)]
    assert [len(table) for table in plotted] == [2, 16]
    assert pd.read_csv(tmp_path / "validation.csv")["reward"].tolist() == [0.7, 8.7] * 8
