"""fowt import: what it prints and writes, and its exit codes."""

import pytest
from command_line import fowt
from small_deck import NAMES, write_deck

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine


def test_a_deck_is_imported_and_the_summary_says_what_is_not_as_in_it(tmp_path):
    out = tmp_path / "mine"
    printed, notes = fowt("import", str(write_deck(tmp_path)), "--out", str(out), "--no-check")
    platform = read_platform(out / "platform.toml")
    assert platform.name == "mine"
    assert "60 450.0 kg" in printed  # the rotor
    assert "first blade flap mode" in printed
    assert "peak shaving (PS_Mode)" in printed
    assert "Hs 6 m, Tp 10 s" in printed
    assert f"fowt simulate --platform {out}/platform.toml" in notes


@pytest.mark.slow
def test_an_import_ends_with_what_does_not_fit_in_the_imported_platform(tmp_path):
    strips = ("1    PotMod ", "0    PotMod ")  # the deck's four frequencies are too few to be fitted
    path = str(write_deck(tmp_path, MAP=[("1 chain 450.0", "1 chain 100.0")], HydroDyn=[strips]))
    printed, notes = fowt("import", path, "--out", str(tmp_path / "out"), code=1)
    assert "line" in printed.rsplit("Wind of the deck", 1)[1] and "no contradictions found" not in printed
    assert "the files are kept" in notes
    assert read_platform(tmp_path / "out" / "platform.toml").lines[0].length == 100.0
    # exactly what fowt model check says
    said, _ = fowt("model", "check", str(tmp_path / "out" / "platform.toml"), code=1)
    faults = printed.rsplit("power law", 1)[1].split("\n", 1)[1]
    assert said.endswith(faults)


def test_part_files_and_a_controller_replace_those_of_the_deck(tmp_path):
    path = write_deck(tmp_path, OpenFAST=[("1    CompMooring", "2    CompMooring")])
    faster = tmp_path / "tuned.IN"
    faster.write_text((tmp_path / NAMES["DISCON"]).read_text().replace("130.0", "140.0"))
    out = str(tmp_path / "out")
    parts = ("--mooring", str(tmp_path / NAMES["MoorDyn"]), "--discon", str(faster), "--name", "tuned")
    _, error = fowt("import", str(path), "--out", out, code=2)
    assert "CompMooring = 2" in error
    fowt("import", str(path), "--out", out, "--no-check", *parts)
    turbine = read_turbine(tmp_path / "out" / "turbine" / "turbine.toml")
    assert (turbine.name, turbine.torque_law.rated_speed) == ("tuned", 140.0)
    assert len(read_platform(tmp_path / "out" / "platform.toml").lines) == 3


def test_files_of_other_folders_are_found_by_their_names(tmp_path):
    (tmp_path / "deck").mkdir()
    path = write_deck(tmp_path / "deck")
    (tmp_path / "shared").mkdir()
    (tmp_path / "deck" / NAMES["blade"]).rename(tmp_path / "shared" / NAMES["blade"])
    out = str(tmp_path / "out")
    _, error = fowt("import", str(path), "--out", out, code=2)
    assert "BldFile(1) = 'blade.dat': no such file" in error
    fowt("import", str(path), "--out", out, "--no-check", "--search", str(tmp_path / "shared"))


def test_nothing_to_import_and_a_folder_in_use_are_refused(tmp_path):
    _, error = fowt("import", "--out", str(tmp_path / "out"), code=2)
    assert "needs an .fst file" in error
    path, out = str(write_deck(tmp_path)), str(tmp_path / "out")
    fowt("import", path, "--out", out, "--no-check")
    _, error = fowt("import", path, "--out", out, code=2)
    assert "--overwrite" in error
    fowt("import", path, "--out", out, "--no-check", "--overwrite")
