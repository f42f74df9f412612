"""Scenes shared by the tests, so that each kind is built and compiled once."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: each worker has one core

import pytest

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.scene.build import build_scene

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # windows of render mode "human" without a display
# what programs print is compared: not that they also had to compile, which only a first run does
os.environ.setdefault("FOWT_QUIET", "1")
# workers of pytest-xdist have the width of its terminal set, which the command's console would keep for good
os.environ.pop("COLUMNS", None)


# Test files that run the same kinds of scene, which one worker then compiles once; longest first.
KINDS = {
    "environment": ["tests/envs/test_env.py", "tests/envs/test_golden.py"],
    "command line": ["tests/training/cli/test_app.py", "tests/training/evaluation/test_evaluate.py"],
    "elastic": [
        "tests/envs/test_elastic_env.py",
        "tests/analysis/test_elastic_trim.py",
        "tests/analysis/test_elastic_linear.py",
    ],
    "openfast": ["tests/training/validation/test_validate.py"],
}
KIND_OF = {file: kind for kind, files in KINDS.items() for file in files}


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """With --dist loadfile: files of one kind go to one worker too, since two would both compile it."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class LoadKindScheduling(LoadFileScheduling):
        def _split_scope(self, nodeid):
            return KIND_OF.get(file_of(nodeid), file_of(nodeid))

    return LoadKindScheduling(config, log)


def pytest_itemcollected(item):
    """Mark nightly tests as slow, too."""
    if item.get_closest_marker("nightly"):
        item.add_marker("slow")


def pytest_collection_modifyitems(items):
    """Longest first, so that no worker is left with it at the end: kinds, files with slow tests, others."""
    slow = {file_of(item.nodeid) for item in items if item.get_closest_marker("slow")}
    order = list(KINDS)

    def rank(item):
        file = file_of(item.nodeid)
        return order.index(KIND_OF[file]) if file in KIND_OF else len(order) + (file not in slow)

    items.sort(key=rank)


def file_of(nodeid):
    """The file that a test is in."""
    return nodeid.partition("::")[0]


def pytest_terminal_summary(terminalreporter):
    """Versions that a test has installed, also where it ran in a worker."""
    for report in terminalreporter.getreports("passed"):
        for name, value in report.user_properties:
            if name == "installed":
                terminalreporter.write_line(f"{report.nodeid} installed {value}")


@pytest.fixture(scope="session", autouse=True)
def _own_configuration(tmp_path_factory):
    """The key of checkpoints in a folder of the tests, not in the home of whoever runs them."""
    os.environ["FOWT_CONFIG_DIR"] = str(tmp_path_factory.mktemp("config"))


@pytest.fixture(scope="session")
def platform():
    return read_platform("oc3_hywind")


@pytest.fixture(scope="session")
def turbine(platform):
    return read_turbine(platform.turbine)


@pytest.fixture(scope="session")
def bare_scene():
    """The turbine in empty space: gravity and its own inertia only."""
    return build_scene("oc3_hywind", hydrodynamics=False, mooring=False, fidelity="reference")


@pytest.fixture(scope="session")
def still_scene():
    """Still water, no aerodynamics."""
    return build_scene("oc3_hywind", fidelity="reference")


@pytest.fixture(scope="session")
def wave_scene():
    """Regular waves H = 3 m, T = 5 s, no aerodynamics."""
    return build_scene("oc3_hywind", sea={"kind": "regular", "H": 3.0, "T": 5.0}, fidelity="reference")


@pytest.fixture(scope="session")
def storm_scene():
    """Steady 18 m/s and a random sea."""
    sea = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}
    return build_scene(
        "oc3_hywind", wind=18.0, sea=sea, seed=3, duration=60.0, wave_components=60, fidelity="reference"
    )


@pytest.fixture(scope="session")
def elastic_scene():
    """The weather of storm_scene with blades, tower and shaft that bend, at the default fidelity."""
    sea = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}
    settings = {"seed": 3, "duration": 60.0, "wave_components": 20}
    return build_scene("oc3_hywind", 18.0, sea, blades="modes2", tower="modes2", shaft="torsion", **settings)
