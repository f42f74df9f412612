"""Libraries that the compiled loop calls: the same bits as calls from Python, failures, standard output."""

import os
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from bladed_library import built, needs_gcc

from fowt_env import build_scene, simulate
from fowt_env.controllers import make
from fowt_env.controllers.rosco import Rosco
from fowt_env.errors import ControllerError

pytestmark = needs_gcc
needs_rosco = pytest.mark.skipif(find_spec("rosco") is None, reason="needs pip install --no-deps rosco")


@pytest.fixture(scope="module")
def scene():
    return build_scene("oc3_hywind", wind=18.0, duration=100.0, fidelity="standard")


@pytest.fixture
def in_place_of_rosco(tmp_path, monkeypatch):
    """Function that puts the C library in a mode in the place of ROSCO's."""
    library, module = built(tmp_path), sys.modules[Rosco.__module__]
    monkeypatch.setattr(module, "find_library", lambda: (library, []))

    def put(mode):
        monkeypatch.setattr(module, "deck_text", lambda values: mode)

    return put


class FromPython:
    """Calls a controller from Python in every control period."""

    def __init__(self, name, turbine):
        self.inner = make(name, turbine, 0.1).controller
        self.information = self.inner.information

    def __getattr__(self, name):
        if name in ("prepare", "reset", "act", "order_start_up"):
            return getattr(self.inner, name)
        raise AttributeError(name)


@needs_rosco
@pytest.mark.parametrize("name", ["rosco", "rosco_float"])
@pytest.mark.parametrize(
    "faults", [None, {"kind": "normal_stop", "time": 20.0}, {"kind": "start_up", "time": 1.0}]
)
def test_a_run_has_the_bits_of_calls_from_python(scene, name, faults):
    initial = {"start": "parked" if faults and faults["kind"] == "start_up" else "trim", "PtfmPitch": 5.0}
    settings = {"duration": 40.0, "faults": faults, "sensors": "standard", "initial": initial}
    inside = simulate(scene, name, **settings)
    outside = simulate(scene, lambda turbine, control_dt: FromPython(name, turbine), **settings)
    assert np.array_equal(inside.to_numpy(), outside.to_numpy())
    assert np.ptp(inside["BldPitch1_[deg]"]) > 1.0


def test_a_failure_ends_the_run_with_the_librarys_message_and_time(scene, in_place_of_rosco):
    in_place_of_rosco("fail")
    with pytest.raises(ControllerError, match="'rosco' failed at t = 1.000 s: ROSCO reports 'no wind vane'"):
        simulate(scene, "rosco", duration=3.0)


def test_a_demand_that_is_no_number_ends_the_run(scene, in_place_of_rosco):
    in_place_of_rosco("nan")
    with pytest.raises(ControllerError, match=r"'rosco' returned \(43093.5\d+, nan\) at t = 1.000 s"):
        simulate(scene, "rosco", duration=3.0)


def test_what_it_prints_in_the_loop_stays_out_of_sight_and_what_others_print_does_not(
    scene, in_place_of_rosco, capfd
):
    in_place_of_rosco("talk")
    os.write(1, b"before\n")
    simulate(scene, "rosco", duration=3.0)
    os.write(1, b"after\n")
    assert capfd.readouterr().out == "before\nafter\n"
