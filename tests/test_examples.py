"""Every example runs, says what it claims, and takes less than a minute once compiled."""

import re
import runpy
from math import radians
from pathlib import Path
from time import perf_counter

import pytest

from fowt_env.warmup import compilation_announced

FOLDER = Path(__file__).resolve().parent.parent / "examples"
LIMIT = 60.0  # s
CLAIMS = {  # example: what its output must match, and the files it must write
    "01_simulate": (r"6001 rows", ["run.csv"]),
    "02_plot": (r"pi_land +platform pitch std [3-9]\.", ["run.png", "runs.png", "spectra.png"]),
    "03_own_controller": (r"slow_pi +rotor speed std 0\.", []),
    "04_own_reward": (r"with the tower moment [0-9.]+", []),
    "05_own_sea_state": (r"components +4 x std of elevation  4\.", ["my_sea.toml"]),
    "06_own_load": (r"drag on the nacelle at rest: 8\.5 kN", []),
    "07_linearise": (r"with the PI controller, land gains", ["plant_18mps.mat"]),
    "08_vector_env": (r"[0-9]+ environment steps a second", []),
    "09_evaluate": (r"8 of 8 runs reached their end", []),
}
TRAINED = "10_train_small_agent"  # takes minutes: tests/examples has its test


def test_every_example_is_tested_and_listed():
    names = {path.stem for path in FOLDER.glob("*.py")}
    assert names == {*CLAIMS, TRAINED}
    listed = set(re.findall(r"`(\d\d_\w+)\.py`", (FOLDER / "README.md").read_text()))
    assert listed == names


@pytest.mark.parametrize("name", CLAIMS)
def test_an_example_runs_within_a_minute(name, tmp_path, monkeypatch, capsys):
    if name == "02_plot":
        pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(FOLDER))
    compiled = []
    start = perf_counter()
    with compilation_announced(compiled.append):
        runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
    seconds = perf_counter() - start
    pattern, files = CLAIMS[name]
    output = capsys.readouterr().out
    assert re.search(pattern, output), output
    written = {path.name for path in (tmp_path / "results" / "examples").glob("*")}
    assert written == set(files)
    assert compiled or seconds < LIMIT  # compiling is the first run's alone


def test_the_nacelle_drag_leans_the_platform_by_its_moment_over_the_stiffness(tmp_path, monkeypatch):
    """Arm to the fairleads, some 160 m; weight, buoyancy and moorings restore 1.2 to 1.7 GN m/rad."""
    monkeypatch.chdir(tmp_path)
    found = runpy.run_path(str(FOLDER / "06_own_load.py"))
    moment = found["factor"] * 24.0**2 * (found["HEIGHT"] + 70.0)
    lean = radians(found["after"]["PtfmPitch"] - found["before"]["PtfmPitch"])
    assert moment / 1.7e9 < lean < moment / 1.2e9
