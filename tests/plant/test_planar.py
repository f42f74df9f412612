"""Planar scenes: surge, heave and platform pitch alone, equal to the full model in its plane."""

import numpy as np
import pytest

from fowt_env import build_scene, simulate
from fowt_env.analysis.linear_model import linearize
from fowt_env.descriptions.platform import read_platform
from fowt_env.errors import InputError
from fowt_env.plant.state import OUT_OF_PLANE
from fowt_env.run.initial_conditions import initial_state

OFFSET = {"PtfmSurge": 8.0, "PtfmHeave": 1.5, "PtfmPitch": 5.0, "PtfmTVxi": 0.3, "PtfmRVyi": 0.2}
IN_PLANE = ["PtfmSurge_[m]", "PtfmHeave_[m]", "PtfmPitch_[deg]", "FAIRTEN1_[kN]", "FAIRTEN2_[kN]"]
ACROSS = ["PtfmSway_[m]", "PtfmRoll_[deg]", "PtfmYaw_[deg]", "PtfmTVyi_[m/s]", "PtfmRVxi_[deg/s]"]
SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}


def both(controller=None, duration=60.0, initial=None, **scene):
    """(planar, full) frames of the same run."""
    return [
        simulate(
            build_scene(planar=planar, **{"fidelity": "reference"} | scene),
            controller,
            duration=duration,
            initial=initial,
        )
        for planar in (True, False)
    ]


def worst(planar, full, columns):
    return max(np.abs(planar[c] - full[c]).max() / np.abs(full[c]).max() for c in columns)


@pytest.mark.nightly
def test_a_decay_in_still_water_is_that_of_the_full_model():
    planar, full = both(initial=OFFSET)
    assert worst(planar, full, IN_PLANE) < 1e-10
    assert np.abs(full[ACROSS]).to_numpy().max() < 1e-9
    assert np.all(planar[ACROSS] == 0.0)


@pytest.mark.nightly
@pytest.mark.parametrize("heading", [0.0, 180.0])
def test_waves_along_the_plane_move_it_as_the_full_model(heading):
    planar, full = both(
        sea=SEA | {"heading": heading}, wave_components=40, initial=OFFSET, fidelity="standard"
    )
    assert worst(planar, full, IN_PLANE) < 1e-9


@pytest.mark.nightly
def test_in_operation_the_torque_of_the_rotor_is_what_differs():
    planar, full = both("pi", 120.0, wind=18.0, sea=SEA, fidelity="fast")
    assert np.all(planar[ACROSS] == 0.0)
    assert np.abs(full["PtfmRoll_[deg]"]).max() > 0.1
    for column in (*IN_PLANE[:3], "RotSpeed_[rpm]"):
        assert np.abs(planar[column] - full[column]).max() < 0.02 * np.abs(full[column]).max(), column


def test_of_turbulence_the_part_in_the_plane_is_kept():
    wind = {"kind": "ntm", "speed": 18.0, "class": "B"}
    planar, full = (build_scene(wind=wind, seed=3, planar=p, fidelity="fast") for p in (True, False))
    values = [scene.model.aero.wind.value[:, [0, 2, 3]] for scene in (planar, full)]
    assert np.array_equal(*values)
    assert np.all(planar.model.aero.wind.value[:, [1, 4]] == 0.0)
    again = planar.with_weather(wind, None, 4)
    assert np.all(again.model.aero.wind.value[:, [1, 4]] == 0.0)
    with pytest.raises(InputError, match="planar"):
        planar.with_weather({"kind": "steady", "speed": 12.0, "direction": 10.0}, None, 4)


@pytest.mark.nightly
def test_trim_and_linear_model_stay_in_the_plane():
    scene = build_scene(wind=12.0, sea=SEA, planar=True, fidelity="fast")
    x, _ = initial_state(scene)
    assert np.all(x[list(OUT_OF_PLANE)] == 0.0) and x[0] > 5.0
    model = linearize(scene)
    assert np.all(np.isfinite(model.A))


@pytest.mark.parametrize(
    "name, value",
    [("PtfmSway", 1.0), ("PtfmRoll", 0.1), ("PtfmYaw", -0.1), ("PtfmTVyi", 0.1), ("PtfmRVzi", 0.1)],
)
def test_offsets_out_of_the_plane_are_refused(name, value):
    scene = build_scene(planar=True, fidelity="reference")
    with pytest.raises(InputError, match=name):
        initial_state(scene, initial={name: value})


def test_lines_without_a_mirror_image_are_refused():
    platform = read_platform("oc3_hywind")
    one_sided = platform.model_copy(update={"lines": platform.lines[:2]})
    with pytest.raises(InputError, match="mirror image"):
        build_scene(one_sided, planar=True, fidelity="reference")
    build_scene(one_sided, planar=True, mooring=False, fidelity="reference")
