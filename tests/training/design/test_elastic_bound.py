"""The limit on a turbine with bending blades and tower: that of a rigid one if these are stiff."""

from dataclasses import replace

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.reduced_model import residualised, with_reduced_wake
from fowt_env.controllers.lqr.design import SENSORS
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.design.bound_control import Information, Problem, baseline_deviations, front
from fowt_env.training.design.bound_plant import BENDING, PLANAR, BoundPlant

SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}
PARTS = {"blades": "modes2", "tower": "modes2", "shaft": "torsion"}  # as elastic_scene
MEASURED = Information("five", SENSORS)


def limit(scene):
    """(rotor speed, platform pitch) at the limit, and under gspi_oc3, in SI."""
    plant = BoundPlant(scene, 18.0, SEA)
    base = baseline_deviations(plant, plant.true)
    limits = replace(base, torque=0.05, torque_travel=np.inf)
    ((_, best, _),) = front(Problem(plant, MEASURED), limits, (0.6,))
    return np.array([[each.rotor_speed, each.platform_pitch] for each in (best, base)]), plant


def turbine(factor):
    """(platform, turbine) with blades and tower stiffer by a factor."""
    platform, described = read_platform("oc3_hywind"), read_turbine("nrel5mw")
    modes = platform.tower.modes
    tower = modes.model_copy(
        update={
            name: tuple(factor * value for value in getattr(modes, name))
            for name in ("fore_aft_stiffness", "side_side_stiffness")
        }
    )
    blade = described.blade_structure
    blade = blade.model_copy(
        update={
            name: factor * np.array(getattr(blade, name))
            for name in ("flapwise_stiffness", "edgewise_stiffness")
        }
    )
    parts = platform.model_copy(update={"tower": platform.tower.model_copy(update={"modes": tower})})
    return parts, described.model_copy(update={"blade_structure": blade})


def scene(factor):
    platform, described = turbine(factor)
    weather = {"sea": SEA, "duration": 60.0, "wave_components": 20}
    return build_scene(platform, 18.0, turbine=described, **weather, **PARTS)


@pytest.mark.nightly
def test_the_limit_of_stiff_blades_and_tower_is_that_of_the_rigid_turbine():
    """The difference falls with the stiffness, to half a per cent at ten times that of the turbine."""
    rigid = limit(build_scene("oc3_hywind", 18.0, SEA, duration=60.0, wave_components=20))[0]
    bent, plant = limit(scene(1.0))
    assert set(BENDING) <= set(plant.states) and plant.states[:8] == PLANAR
    apart = [np.abs(each / rigid - 1.0).max() for each in (bent, limit(scene(3.0))[0], limit(scene(10.0))[0])]
    assert apart[0] > 0.04
    assert apart[2] < 0.35 * apart[1] < 0.15 * apart[0]
    assert apart[2] < 6e-3


@pytest.mark.nightly
def test_faster_modes_of_the_structure_change_nothing(monkeypatch):
    few, plant = limit(scene(1.0))
    monkeypatch.setattr(
        "fowt_env.training.design.bound_plant.BENDING",
        (*BENDING, "tower_fore_aft_2", "tower_fore_aft_2_rate", "edge_1", "edge_1_rate"),
    )
    many, whole = limit(scene(1.0))
    assert whole.n == plant.n + 4
    np.testing.assert_allclose(few, many, rtol=4e-3)


@pytest.mark.slow
def test_a_reduced_wake_responds_as_the_whole_one():
    scene = build_scene("oc3_hywind", 18.0, dynamic_inflow=True, duration=60.0)
    whole = linearize(scene)
    reduced = with_reduced_wake(whole, 4)
    assert len(reduced.states) == 18
    rows = [whole.output_index(name) for name in ("rotor_speed", "platform_pitch", "nacelle_acceleration")]
    far = 0.0
    settled = residualised(whole)
    for omega in (0.01, 0.1, 0.2, 0.5, 1.0):
        exact, found, still = (m.response(omega)[0, rows] for m in (whole, reduced, settled))
        np.testing.assert_allclose(found, exact, rtol=0.02, atol=0.002 * np.abs(exact).max())
        far = max(far, np.abs(still / exact - 1.0).max())
    assert far > 0.1  # what a wake in equilibrium misses
