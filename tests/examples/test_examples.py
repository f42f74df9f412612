"""Every example runs, says what it claims, and takes less than a minute once compiled."""

import contextlib
import io
import re
import runpy
from functools import cache
from math import exp, pi
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import pytest

from fowt_env.plant.compile.notice import compilation_reported

FOLDER = Path(__file__).resolve().parents[2] / "examples"
LIMIT = 60.0  # s
CLAIMS = {  # example: what its output must match, and the files it must write
    "01_simulate": (r"6001 rows", ["run.csv"]),
    "02_plot": (r"pi_land +platform pitch std [3-9]\.", ["run.png", "runs.png", "spectra.png"]),
    "03_own_controller": (r"slow_pi +rotor speed std 0\.", []),
    "04_own_reward": (r"with the tower moment [0-9.]+", []),
    "05_own_sea_state": (r"components +4 x std of elevation  4\.", ["my_sea.toml"]),
    "06_own_load": (r"with plate .* in swell std 0\.[0-9]+ m", []),
    "07_linearise": (r"with the PI controller, land gains", ["plant_18mps.mat"]),
    "08_vector_env": (r"[0-9]+ environment steps a second", []),
    "09_evaluate": (r"8 of 8 runs reached their end", []),
    "11_report": (r"pi_land +platform pitch std [1-3]\.(.|\n)*it needs no network", ["report"]),
    "12_ray": (r"the table of Ray is that of this process", []),
    "13_resume": (r"called again: 2 runs made, 4 in the table(.|\n)*resumed: finished", ["resume"]),
    "14_tune": (r"least mean of both deviations: omega 0\.(12|2) rad/s", []),
    "15_record_video": (r"200 pictures of 960 x 640\nwrote ", ["video"]),
    "17_state_feedback": (r"stable: True(.|\n)*state_feedback +rotor speed std 0\.[0-4]", []),
    "19_extended_kalman_filter": (r"deviates by 2\.\d+ m/s, estimated within 0\.[45]", []),
    "20_short_horizon_actor_critic": (r"gspi_oc3: cost 5\.(.|\n)*trained in \d+ periods: cost [34]\.", []),
    "16_what_if": (r"same bits\nreward of an episode", []),
}
NEEDS = {  # example: modules without which its claims are not met
    "02_plot": ("matplotlib",),
    "11_report": ("plotly",),
    "12_ray": ("ray",),
    "13_resume": ("stable_baselines3", "matplotlib"),
    "15_record_video": ("pygame", "moviepy"),
    "17_state_feedback": ("control",),
    "20_short_horizon_actor_critic": ("torch",),
}
# they start Ray, and torch; what the others show has tests of its own
OTHERS = (
    "05_own_sea_state", "06_own_load", "08_vector_env", "11_report", "12_ray", "13_resume", "15_record_video",
    "20_short_horizon_actor_critic",
)  # fmt: skip
NIGHTLY = dict.fromkeys(OTHERS, pytest.mark.nightly)
TRAINED = ("10_train_small_agent", "18_cleanrl_ppo")  # take minutes: tests/examples has a test of each


def test_every_example_is_tested_and_listed():
    names = {path.stem for path in FOLDER.glob("*.py")}
    assert names == {*CLAIMS, *TRAINED}
    listed = set(re.findall(r"`(\d\d_\w+)\.py`", (FOLDER / "README.md").read_text()))
    assert listed == names


@pytest.fixture(scope="module")
def run_of(tmp_path_factory):
    """Function of an example's name: the Run of it, which is made once."""

    @cache
    def run(name):
        compiled, start, printed = [], perf_counter(), io.StringIO()
        with pytest.MonkeyPatch.context() as patch, compilation_reported(compiled.append):
            patch.chdir(tmp_path_factory.mktemp(name))
            patch.syspath_prepend(str(FOLDER))
            with contextlib.redirect_stdout(printed):
                names = runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
            written = {path.name for path in Path("results/examples").glob("*")}
        return Run(names, printed.getvalue(), written, None if compiled else perf_counter() - start)

    return run


class Run(NamedTuple):
    """What an example defined, printed and wrote, and the seconds that it took, None if it had to compile."""

    names: dict
    output: str
    written: set
    seconds: float | None


@pytest.mark.parametrize("name", [pytest.param(name, marks=NIGHTLY.get(name, ())) for name in CLAIMS])
def test_an_example_runs_within_a_minute(name, run_of):
    for module in NEEDS.get(name, ()):
        pytest.importorskip(module, reason=f"{module} is not installed: its extra is missing")
    run = run_of(name)
    pattern, files = CLAIMS[name]
    assert re.search(pattern, run.output), run.output
    assert run.written == set(files)
    assert run.seconds is None or run.seconds < LIMIT  # compiling is the first run's alone


@pytest.mark.nightly
def test_the_plate_brakes_the_heave_as_quadratic_drag_does(run_of):
    """Averaged over a cycle the amplitude follows dA/dt = -s A - c A^2 with c = 4 k w/(3 pi M)."""
    run = run_of("06_own_load")
    mass, frequency = 8066048.0 + 250319.0, 2.0 * pi / 30.8
    slow, start, end = 1.3e5 / (2.0 * mass), 4.0, 3.0 * 30.8
    quick = 4.0 * run.names["plate"].parameters[0] * frequency / (3.0 * pi * mass)
    bare = start * exp(-slow * end)
    braked = slow * bare / (slow + quick * (start - bare))
    left = [float(value) for value in re.findall(r"up to ([0-9.]+) m", run.output)]
    assert left == pytest.approx([bare, braked], rel=0.05)  # the lines couple heave to surge a little
    swell = [float(value) for value in re.findall(r"swell std ([0-9.]+) m", run.output)]
    assert swell[1] < swell[0]


def test_a_look_ahead_pays(run_of):
    found = re.search(r"PI alone (-?[0-9.]+), with a look ahead (-?[0-9.]+)", run_of("16_what_if").output)
    alone, planned = map(float, found.groups())
    assert planned > alone


def test_an_lqr_beats_the_reference_in_rotor_speed_and_platform_pitch(run_of):
    pytest.importorskip("control")
    pattern = r"rotor speed std ([0-9.]+) rpm, platform pitch std ([0-9.]+) deg"
    rows = re.findall(pattern, run_of("17_state_feedback").output)
    (speed, tilt), (own_speed, own_tilt) = [tuple(map(float, row)) for row in rows]
    assert own_speed < 0.6 * speed and own_tilt < 0.8 * tilt


def test_without_its_library_an_example_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    runpy.run_path(str(FOLDER / "12_ray.py"), run_name="__main__")
    assert "fowt-env[ray]" in capsys.readouterr().out
