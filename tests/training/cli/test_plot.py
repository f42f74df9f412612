"""fowt plot and the plots of trim: every kind from files, and what cannot be plotted is named."""

import numpy as np
import pandas as pd
import pytest
from command_line import fowt

from fowt_env.files.tables import read_series, write_table
from fowt_env.training.cli.plot import _names

pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")

PNG = b"\x89PNG\r\n\x1a\n"


def run(path, seed=0):
    """A file as `fowt simulate --out` writes, in short."""
    rng = np.random.default_rng(seed)
    time = 0.1 * np.arange(6000)
    wave = sum(
        0.1 * np.cos(2.0 * np.pi * f * time + p)
        for f, p in zip(np.linspace(0.06, 0.16, 40), rng.uniform(0.0, 7.0, 40), strict=True)
    )
    columns = {"Time_[s]": time, "Wave1Elev_[m]": wave, "PtfmPitch_[deg]": 3.0 + 0.4 * wave}
    columns |= {"PtfmSurge_[m]": 20.0 + wave, "RotSpeed_[rpm]": 12.1 + 0.1 * rng.standard_normal(len(time))}
    pd.DataFrame(columns).to_csv(path, index=False)
    return str(path)


@pytest.mark.parametrize("kind", ["series", "spectra", "boxes", "raos"])
def test_every_kind_is_one_call_on_saved_runs(kind, tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    files = [run(tmp_path / "a" / "run.csv"), run(tmp_path / "b" / "run.csv", 1)]
    out = tmp_path / "picture.png"
    _, stderr = fowt("plot", kind, *files, "--skip", "50", "--title", "two runs", "--out", str(out))
    assert out.read_bytes().startswith(PNG) and "wrote" in stderr
    monkeypatch.chdir(tmp_path)
    fowt("plot", kind, files[0])
    assert (tmp_path / f"{kind}.png").read_bytes().startswith(PNG)
    _, stderr = fowt("plot", kind, files[0], "--out", "a")  # the name of a folder, too
    assert "wrote a.png" in stderr and (tmp_path / "a.png").read_bytes().startswith(PNG)


def test_an_outb_is_plotted_as_the_same_run_in_a_csv(tmp_path):
    frame = pd.read_csv(run(tmp_path / "run.csv"))
    write_table(frame, tmp_path / "same.outb")
    pd.testing.assert_frame_equal(read_series(tmp_path / "same.outb"), frame, rtol=1e-9)
    out = tmp_path / "picture.png"
    fowt("plot", "series", str(tmp_path / "same.outb"), str(tmp_path / "run.csv"), "--out", str(out))
    assert out.read_bytes().startswith(PNG)
    _, stderr = fowt("plot", "series", str(tmp_path / "nothing.outb"), code=2)
    assert "nothing.outb" in stderr and "no such file" in stderr


def test_runs_are_named_by_what_tells_them_apart():
    files = ["out/runs/pi/ntm_18_seed1.parquet", "out/runs/lqr/ntm_18_seed1.parquet"]
    assert list(_names(files)) == ["pi", "lqr"]
    assert list(_names(["a/one.csv", "a/two.csv"])) == ["one", "two"]
    assert list(_names(["a/run.csv", "a/run.parquet"])) == ["a/run.csv", "a/run.parquet"]
    assert list(_names(["run.csv", "b/run.csv"])) == ["run", "b/run"] and list(_names(["x/run.csv"])) == [
        "run"
    ]


def test_trim_plots_the_schedule_and_plot_does_so_from_its_table(tmp_path):
    table, picture, again = (tmp_path / name for name in ("steady.csv", "one.png", "two.png"))
    fowt("model", "trim", "--winds", "8,18", "--out", str(table), "--plot", str(picture))
    fowt("plot", "schedule", str(table), "--out", str(again))
    assert picture.read_bytes().startswith(PNG) and again.read_bytes().startswith(PNG)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("pie", "run.csv"), "unknown kind of plot 'pie'"),
        (("series", "nothing.csv"), "nothing.csv"),
        (("series", "run.txt"), "file 'run.txt': must end with .csv, .parquet, .outb or .out"),
        (("series", "run.csv", "run.csv"), "each must be named once"),
        (("schedule", "run.csv"), "needs a column"),
        (("series", "run.csv", "--out", "run.what"), "unknown extension"),
        (("spectra", "run.csv", "--platform", "raft"), "raft"),
        (("series", "run.csv", "--skip", "9999"), "skip = 9999"),
        (("series", "text.csv"), "'text.csv': column 'RotSpeed_[rpm]', row 2: 'x' is not a number"),
        (("series", "run.csv", "rotor.csv"), "'rotor.csv': needs a column 'Time_[s]' and at least two rows;"),
        (("series", "rotor.csv"), "has 2 rows of RotSpeed_[rpm]"),
        (("series", "short.csv"), "'short.csv': needs a column 'Time_[s]' and at least two rows; has 1 rows"),
        (("series", "empty.outb"), "file 'empty.outb': is empty (0 bytes)"),
    ],
)
def test_what_cannot_be_plotted_is_one_clear_line(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(tmp_path / "run.csv")
    (tmp_path / "text.csv").write_text("Time_[s],RotSpeed_[rpm]\n0,12\n1,x\n")
    (tmp_path / "rotor.csv").write_text("RotSpeed_[rpm]\n12\n13\n")
    (tmp_path / "short.csv").write_text("Time_[s],RotSpeed_[rpm]\n0,12\n")
    (tmp_path / "empty.outb").touch()
    _, stderr = fowt("plot", *arguments, code=2)
    assert words in stderr.replace("\n", " ")
