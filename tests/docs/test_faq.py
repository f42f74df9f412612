"""docs/guides/faq.md quotes each error as it is met: here each is provoked, and compared."""

import os
import re
import subprocess
import sys
from importlib.util import find_spec

import gymnasium
import numba
import numpy as np
import pytest
from doc_pages import DOCS, blocks
from gymnasium.envs.registration import registry
from typer.testing import CliRunner

import fowt_env
from fowt_env import errors
from fowt_env.controllers import make
from fowt_env.descriptions.platform import DATA, read_platform
from fowt_env.envs import FowtEnv
from fowt_env.plant.compile import decorators, notice
from fowt_env.plant.compile.versions import check_numba
from fowt_env.training.cli import app as cli
from fowt_env.training.cli import health

NAME = "fowt_env/OC3Hywind-v1"
MESSAGES = [block for block in blocks("guides/faq.md") if block.language == "text"]
PROVOKED = {}  # heading of the page: functions of (folder, monkeypatch) that return what is printed there


def under(heading, *marks):
    """Register a provocation of a message that the page quotes under this heading."""

    def add(function):
        PROVOKED.setdefault(heading, []).append(pytest.param(heading, function, marks=marks))
        return function

    return add


def message(kind, function, *arguments, **options):
    """Text of the error of that kind that a call raises."""
    with pytest.raises(kind) as caught:
        function(*arguments, **options)
    return str(caught.value)


def refused(function, *arguments, **options):
    """Text of the InputError that a call raises."""
    return message(fowt_env.InputError, function, *arguments, **options)


def said(*arguments):
    """What the command prints on stderr when it refuses its arguments."""
    result = CliRunner().invoke(cli.app, list(arguments), env={"COLUMNS": "200", "NO_COLOR": "1"})
    assert result.exit_code == 2, f"{result.stdout}\n{result.exception!r}"
    return result.stderr.strip().removeprefix("Error: ")


def python(code, folder):
    """stderr of a fresh Python on a machine without a display."""
    display = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER", "XDG_RUNTIME_DIR")
    variables = {key: value for key, value in os.environ.items() if key not in display}
    variables["PYTHONPATH"] = str(DOCS.parent)
    (folder / "program.py").write_text(code)
    done = subprocess.run(
        [sys.executable, "program.py"], cwd=folder, env=variables, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip
    return done.stderr


def missing(name, monkeypatch):
    """Let imports of a library or package fail as where it is not installed."""

    def of_it(module):
        return module == name or module.startswith(f"{name}.")

    class Missing:
        def find_spec(self, wanted, path=None, target=None):
            if of_it(wanted):
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    for loaded in [key for key in sys.modules if of_it(key)]:
        monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setattr(sys, "meta_path", [Missing(), *sys.meta_path])


def episode(**settings):
    """An environment at the start of an episode."""
    env = FowtEnv("steady", **settings)
    env.reset(seed=1)
    return env


@under("The first run takes a minute")
def _(folder, monkeypatch):
    return notice.COMPILING_MESSAGE


@under("Every run takes a minute")
def _(folder, monkeypatch):
    monkeypatch.setattr(health, "CACHE_FOLDER", None)
    return health.cache_state().advice


@under("Every run takes a minute")
def _(folder, monkeypatch):
    monkeypatch.setenv("FOWT_CACHE_DIR", str(folder))
    (folder / "kernels").mkdir()
    (folder / "kernels").chmod(0o777)
    with pytest.warns(RuntimeWarning) as caught:
        assert decorators._cache_folder([]) is None
    return str(caught[0].message)


@under("Numba is too old or too new")
def _(folder, monkeypatch):
    return message(ImportError, check_numba, "0.61.0")


@under("Numba refuses NumPy")
def _(folder, monkeypatch):
    monkeypatch.setattr(np, "__version__", "2.99.0")
    return message(ImportError, numba._ensure_critical_deps)


@under("A part is not installed")
def _(folder, monkeypatch):
    from fowt_env.training.rl.train import make_algorithm

    missing("stable_baselines3", monkeypatch)
    return refused(make_algorithm, "ppo")


@under("A part is not installed")
def _(folder, monkeypatch):
    from fowt_env.visual.style import new_figure

    missing("matplotlib", monkeypatch)
    return refused(new_figure, 1.0, 1.0)


@under("A part is not installed")
def _(folder, monkeypatch):
    from fowt_env.visual.rendering import load_pygame

    missing("pygame", monkeypatch)
    return refused(load_pygame)


@under("A study is not installed")
def _(folder, monkeypatch):
    missing("fowt_env.training.studies", monkeypatch)
    return said("paper", "LC5")


@under("ROSCO's library is not there")
def _(folder, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "rosco" else find_spec(name))
    scene = fowt_env.build_scene(wind=18.0, fidelity="standard")
    return refused(fowt_env.simulate, scene, "rosco", duration=10.0)


@under("Gymnasium does not know the environment")
def _(folder, monkeypatch):
    for name in [name for name in registry if name.startswith("fowt_env/")]:
        monkeypatch.delitem(registry, name)
    return message(gymnasium.error.NamespaceNotFound, gymnasium.make, NAME)


@under("A name is not known")
def _(folder, monkeypatch):
    return said("simulate", "--controller", "gspi_oc4")


@under("A name is not known")
def _(folder, monkeypatch):
    return said("simulate", "--controller", "mymodule:Mine")


@under("A name is not known")
def _(folder, monkeypatch):
    return refused(fowt_env.build_scene, fidelty="standard")


@under("The step does not divide the period")
def _(folder, monkeypatch):
    return refused(FowtEnv, "steady", control_dt=0.1, dt=0.03)


@under("A controller needs wind")
def _(folder, monkeypatch):
    return refused(fowt_env.simulate, fowt_env.build_scene(fidelity="standard"), "lqr", duration=10.0)


@under("Random weather is too short")
def _(folder, monkeypatch):
    sea = {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}
    scene = fowt_env.build_scene(sea=sea, fidelity="standard")
    return refused(fowt_env.simulate, scene, None, duration=900.0, initial="zero")


@under("A value of a platform file is refused")
def _(folder, monkeypatch):
    text = (DATA / "platforms" / "oc3_hywind.toml").read_text()
    text = text.replace("mass = 7466330.0", "mass = -7466330.0")
    (folder / "mine.toml").write_text(text.replace("drag_coefficient = 0.6", "drag = 0.6"))
    monkeypatch.chdir(folder)
    return refused(read_platform, "mine.toml")


@under("A platform finds no place to rest")
def _(folder, monkeypatch):
    text = (DATA / "platforms" / "oc3_hywind.toml").read_text()
    (folder / "mine.toml").write_text(text.replace("mass = 7466330.0", "mass = 8.47e6"))
    monkeypatch.chdir(folder)
    return refused(fowt_env.trim, fowt_env.build_scene("mine.toml", fidelity="standard"))


@under("A place in a platform file is doubted")
def _(folder, monkeypatch):
    text = (DATA / "platforms" / "oc3_hywind.toml").read_text()
    (folder / "mine.toml").write_text(text.replace("fairlead_radius = 5.2", "fairlead_radius = 52.0"))
    monkeypatch.chdir(folder)
    monkeypatch.setattr(errors, "_said", set())  # another test of this process may have met the same
    with pytest.warns(fowt_env.PlantWarning) as caught:
        fowt_env.build_scene("mine.toml", fidelity="reference")
    return str(caught[0].message)


@under("A controller's answer stops the run")
def _(folder, monkeypatch):
    class Mine:
        name = "Mine"

        def reset(self, measurement):
            pass

        def act(self, measurement):
            return measurement.generator_torque, float("nan")

    scene = fowt_env.build_scene(wind=18.0, fidelity="standard")
    return message(fowt_env.ControllerError, fowt_env.simulate, scene, Mine(), duration=10.0)


@under("The run stops before its end")
def _(folder, monkeypatch):
    scene = fowt_env.build_scene(fidelity="standard")
    start = {"start": "zero", "PtfmRVyi": 90.0}
    return message(
        fowt_env.SimulationStopped, fowt_env.simulate, scene, None, duration=60.0, initial=start
    )


@under("An episode has ended")
def _(folder, monkeypatch):
    env = FowtEnv("steady")
    return message(gymnasium.error.ResetNeeded, env.step, [0.0, 0.0])


@under("An action is refused")
def _(folder, monkeypatch):
    return refused(episode().step, [0.0, float("nan")])


@under("A saved state does not fit")
def _(folder, monkeypatch):
    return refused(FowtEnv("steady").set_state, episode(action_mode="residual").get_state())


@under("The results folder is of another version")
def _(folder, monkeypatch):
    from fowt_env.training.evaluation import provenance
    from fowt_env.training.evaluation.evaluate import evaluate

    asked = {"cases": "steady_16", "duration": 5.0, "skip": 1.0, "folder": "results/mine"}
    monkeypatch.chdir(folder)
    evaluate("pi", **asked)
    monkeypatch.setattr(provenance, "plant_code", lambda: "edited")
    return refused(evaluate, "pi", **asked)


@under("The results folder is of another version")
def _(folder, monkeypatch):
    from fowt_env.training.evaluation.evaluate import evaluate

    asked = {"cases": "steady_16", "duration": 5.0, "skip": 1.0, "folder": "results/mine"}
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(str(folder))
    source = (
        "class Mine:\n    def reset(self, m):\n        pass\n"
        "    def act(self, m):\n        return 43093.55, 0.2{}\n"
    )
    (folder / "mine.py").write_text(source.format(""))
    evaluate("mine:Mine", **asked)
    del sys.modules["mine"]
    (folder / "mine.py").write_text(source.format("1"))
    try:
        return refused(evaluate, "mine:Mine", **asked)
    finally:
        del sys.modules["mine"]


@under("Worker processes die")
def _(folder, monkeypatch):
    errors = python(
        "from fowt_env.training.evaluation import engines\n"
        "engines.kernels_compiled = lambda: True\n"  # else the first run is done without a worker
        "list(engines.outcomes(abs, [1, 2], jobs=2))\n",
        folder,
    )
    said = [line for line in errors.splitlines() if "WorkersLost: worker processes" in line]
    return said[-1].partition("WorkersLost: ")[2]  # a dying worker may have the last word


@under("A process that forks ends at once", pytest.mark.slow)
def _(folder, monkeypatch):
    return python(
        "import multiprocessing\nimport numpy as np\nfrom fowt_env.envs import FowtVectorEnv\n"
        "def use():\n"
        "    envs = FowtVectorEnv(2, task='steady', threads=2)\n"
        "    envs.reset(seed=1)\n"
        "    envs.step(np.zeros((2, 2)))\n"
        "use()\n"
        "process = multiprocessing.get_context('fork').Process(target=use)\n"
        "process.start()\nprocess.join()\n",
        folder,
    )  # fmt: skip


@under("Rendering without a display")
def _(folder, monkeypatch):
    pytest.importorskip("pygame", reason="pygame is not installed: the extra `render` is missing")
    code = "from fowt_env.visual.rendering import load_pygame\nload_pygame().display.init()\n"
    return python(code, folder)


@under("An agent is a zip")
def _(folder, monkeypatch):
    return refused(make, "policy:best.zip", None, 0.1)


@under("A scene cannot gain wind")
def _(folder, monkeypatch):
    return refused(fowt_env.build_scene(fidelity="reference").with_weather, 18.0, None, 0)


@under("A scene cannot gain a sea")
def _(folder, monkeypatch):
    sea = {"kind": "regular", "H": 3.0, "T": 9.0}
    return refused(fowt_env.build_scene(fidelity="reference").with_weather, None, sea, 0)


def plain(text):
    """The text with its white space made single."""
    return " ".join(text.split())


def quoted(heading):
    """Messages that the page quotes under a heading."""
    return [plain(block.text) for block in MESSAGES if block.heading == heading]


def fits(quote, text):
    """Whether a quote, in which ... leaves something out, is what the text says."""
    return re.fullmatch(".*".join(map(re.escape, quote.split("..."))), plain(text)) is not None


@pytest.mark.parametrize(("heading", "provoke"), [case for found in PROVOKED.values() for case in found])
def test_the_page_quotes_a_message_as_it_is_met(heading, provoke, tmp_path, monkeypatch):
    text = provoke(tmp_path, monkeypatch)
    assert [quote for quote in quoted(heading) if fits(quote, text)], f"{heading}: {text}"


def test_every_quoted_message_is_provoked():
    assert {block.heading for block in MESSAGES} == set(PROVOKED)
    for heading, provocations in PROVOKED.items():
        assert len(quoted(heading)) == len(provocations), heading


def test_a_quote_must_be_the_whole_message():
    assert fits("unknown name 'x'. Known: ...", "unknown name 'x'.\n Known: a, b")
    assert not fits("unknown name", "unknown name 'x'")
