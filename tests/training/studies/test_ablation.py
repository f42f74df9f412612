"""The ablation: its file names real settings, its runs go on, its report says what there is."""

import pytest
import yaml

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")

from small_run import QUICK_ALGORITHM, SMALL

from fowt_env.errors import InputError
from fowt_env.training.rl.train import Training, environment_settings, make_algorithm
from fowt_env.training.studies import ablation


@pytest.fixture
def table(tmp_path):
    """Two small variants, as read from a file."""
    quick = {f"algorithm.{key}": value for key, value in QUICK_ALGORITHM["ppo"].items()}
    both = {"a": {"label": "first"}, "b": {"label": "second", "set": {"environment.observation": "blade"}}}
    path = tmp_path / "table.yml"
    path.write_text(yaml.safe_dump({"steps": 64, "seeds": [0], "common": SMALL | quick, "variants": both}))
    return ablation.read_table(path)


def test_every_variant_of_the_file_differs_from_the_others_and_can_be_resolved():
    table = ablation.read_table()
    resolved = [ablation.settings_of(table, name, 0) for name in table]
    for settings in resolved:
        assert environment_settings(settings)["observation"] and make_algorithm(settings["algo"])
    assert all(one != other for i, one in enumerate(resolved) for other in resolved[:i])


def test_a_finished_variant_is_left_alone_and_a_longer_one_goes_on(table, tmp_path):
    out = tmp_path / "runs"
    assert ablation.run_variant(table, "a", 0, out)
    folder = ablation.folder_of(out, "a", 0)
    before = (folder / "validation.csv").stat().st_mtime_ns
    assert ablation.decisions_done(folder) == 64
    assert ablation.run_variant(table, "a", 0, out)
    assert (folder / "validation.csv").stat().st_mtime_ns == before
    assert ablation.run_variant(table, "a", 0, out, steps=128)
    assert ablation.decisions_done(folder) == 128


@pytest.mark.nightly
def test_a_run_killed_before_its_first_checkpoint_starts_anew_and_its_folder_keeps_what_is_in_it(
    table, tmp_path
):
    folder = ablation.folder_of(tmp_path, "b", 0)
    Training(ablation.settings_of(table, "b", 0), folder)._write_settings()
    (folder / "notes.txt").write_text("mine")
    assert ablation.run_variant(table, "b", 0, tmp_path)
    assert ablation.decisions_done(folder) == 64 and (folder / "notes.txt").read_text() == "mine"


def test_a_variant_may_have_its_own_seeds_and_the_report_an_interval_over_them(table, tmp_path):
    table["a"]["seeds"] = [0, 1, 2]
    header = "decisions,seconds,failed,score," + ",".join(ablation.COLUMNS)
    for seed, score in enumerate((0.5, 0.7, 0.6)):
        folder = ablation.folder_of(tmp_path, "a", seed)
        folder.mkdir()
        row = f"64,30.0,0.0,{score}" + ",1.0" * len(ablation.COLUMNS)
        (folder / "validation.csv").write_text(f"{header}\n{row}\n")
    line = ablation.markdown(ablation.ablation_rows(table, tmp_path)).splitlines()[2]
    # by hand: standard deviation 0.1, 0.1/sqrt(3) * 4.303 (Student's t, two degrees of freedom)
    assert line == "| first | " + "1.000 | " * 5 + "0.00 | 0.600 ± 0.248 | 3 | 0 k | 30 |"


def test_misspelt_names_are_refused(table, tmp_path):
    with pytest.raises(InputError, match="unknown variant 'c'"):
        ablation.settings_of(table, "c", 0)
    path = tmp_path / "bad.yml"
    path.write_text("steps: 1\nseeds: [0]\ncommon: {}\nvariants: {a: {lable: x}}\n")
    with pytest.raises(InputError, match="lable"):
        ablation.read_table(path)


def test_the_command_trains_what_is_left_and_reports_what_there_is(table, tmp_path, capsys):
    path, out, picture = tmp_path / "table.yml", tmp_path / "runs", tmp_path / "plot.png"
    words = ["--table", str(path), "--out", str(out)]
    with pytest.raises(InputError, match="no variant has been validated"):
        ablation.main([*words, "--report", str(picture)])
    ablation.main([*words, "--only", "a"])
    assert ablation.decisions_done(ablation.folder_of(out, "a", 0)) == 64
    with pytest.raises(InputError, match="unknown variant 'c'"):
        ablation.main([*words, "--only", "c"])
    capsys.readouterr()
    ablation.main([*words, "--report", str(picture)])
    shown = capsys.readouterr().out
    assert str(picture) in shown and "| first | " in shown and "| second | " not in shown
    assert picture.stat().st_size > 5000
