"""Scenes shared by the tests, so that each kind is built and compiled once."""

import os

import pytest

from fowt_env.description import read_platform, read_turbine
from fowt_env.scene import build_scene

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # windows of render mode "human" without a display
# workers of pytest-xdist have the width of its terminal set, which the command's console would keep for good
os.environ.pop("COLUMNS", None)


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
    return build_scene("oc3_hywind", hydrodynamics=False, mooring=False)


@pytest.fixture(scope="session")
def still_scene():
    """Still water, no aerodynamics."""
    return build_scene("oc3_hywind")


@pytest.fixture(scope="session")
def wave_scene():
    """Regular waves H = 3 m, T = 5 s, no aerodynamics."""
    return build_scene("oc3_hywind", sea={"kind": "regular", "H": 3.0, "T": 5.0})


@pytest.fixture(scope="session")
def storm_scene():
    """Steady 18 m/s and a random sea."""
    sea = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}
    return build_scene("oc3_hywind", wind=18.0, sea=sea, seed=3, duration=60.0, wave_components=60)
