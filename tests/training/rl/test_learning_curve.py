"""Learning curves of several runs, and the front of motions against travel, from their tables alone."""

import pandas as pd
import pytest

pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")

from fowt_env.training.rl import learning_curve  # noqa: E402

RATIOS = ("rotor_speed_std_ratio", "platform_pitch_std_ratio", "blade_pitch_travel_ratio")


def folder_of_a_run(path, best):
    """Folder with the table of three validations, the second of them the best."""
    rows = [
        dict.fromkeys(RATIOS, ratio) | {"decisions": 1000 * i, "score": ratio, "reward": -ratio}
        for i, ratio in enumerate((1.2, best, 1.1))
    ]
    path.mkdir()
    pd.DataFrame(rows).to_csv(path / "validation.csv", index=False)
    return path


def test_the_command_draws_both_pictures_of_labelled_runs(tmp_path, capsys):
    runs = [f"{name}={folder_of_a_run(tmp_path / name, best)}" for name, best in (("a", 0.7), ("b", 0.8))]
    learning_curve.main([*runs, "--out", str(tmp_path / "out")])
    written = [tmp_path / "out" / name for name in ("rl_learning_curves.png", "rl_front.png")]
    assert capsys.readouterr().out.split() == [str(path) for path in written]
    assert all(path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 10_000 for path in written)


def test_the_kept_policy_of_each_run_is_a_mark_of_its_front(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(learning_curve, "save_figure", lambda figure, path: drawn.append(figure))
    rows = {"a": pd.read_csv(folder_of_a_run(tmp_path / "a", 0.7) / "validation.csv").to_dict("records")}
    learning_curve.plot_front(rows, tmp_path / "front.png")
    for axis in drawn[0].axes:
        (mark,) = [line for line in axis.lines if line.get_label() == "a"]
        assert list(mark.get_xdata()) == [0.7] and list(mark.get_ydata()) == [0.7]
