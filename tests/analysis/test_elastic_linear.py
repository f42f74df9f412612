"""Linear models of a turbine with bending blades and a twisting shaft."""

import numpy as np
import pytest

import fowt_env
from fowt_env.analysis.campbell import campbell
from fowt_env.analysis.linear_model import linearize, natural_periods
from fowt_env.analysis.multiblade import linearize_blades
from fowt_env.analysis.reduced_model import platform_mode, residualised
from fowt_env.analysis.trim import trim_prescribed
from fowt_env.controllers.gains import platform_frequency
from fowt_env.plant.state import STATES, State

BENDING = ("flap_1", "flap_2", "edge_1")


@pytest.fixture(scope="module")
def model(elastic_scene):
    return linearize(elastic_scene)


@pytest.fixture(scope="module")
def stiff(elastic_scene):
    """The same turbine with a flexible tower alone."""
    sea = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}
    return fowt_env.build_scene("oc3_hywind", 18.0, sea, tower="modes2", duration=60.0, wave_components=20)


def test_states_of_blades_are_mean_tilt_and_yaw_with_units(model):
    names = [
        f"{part}{mode}{end}" for mode in BENDING for part in ("", "tilt_", "yaw_") for end in ("", "_rate")
    ]
    assert set(names) | {"shaft_twist", "shaft_twist_rate"} <= set(model.states)
    assert model.states[:14] == STATES and len(set(model.states)) == len(model.states)
    assert model.units["yaw_flap_1"] == "m" and model.units["edge_1_rate"] == "m/s"
    assert model.units["shaft_twist"] == "rad"
    for mode in BENDING:  # d q_c/dt = v_c - speed q_s: the coordinates do not turn with the blades
        tilt, yaw = (model.A[model.index(f"{part}{mode}")] for part in ("tilt_", "yaw_"))
        speed = model.point.state[State.ROTOR_SPEED]
        assert tilt[model.index(f"tilt_{mode}_rate")] == pytest.approx(1.0)
        assert tilt[model.index(f"yaw_{mode}")] == pytest.approx(-speed)
        assert yaw[model.index(f"tilt_{mode}")] == pytest.approx(speed)


def test_the_operating_point_has_no_rates(model):
    equilibrium = model.equilibrium
    speed = equilibrium["rotor_speed"]
    assert equilibrium["flap_1"] > 1.0 and equilibrium["flap_1_rate"] == pytest.approx(0.0, abs=1e-12)
    assert equilibrium["tilt_edge_1_rate"] == pytest.approx(speed * equilibrium["yaw_edge_1"])


def test_frequencies_without_air_are_those_of_the_campbell_diagram(elastic_scene):
    calm = elastic_scene.with_weather(0.0, None)  # no drag of the tower
    scene = calm.with_model({"aero.rotor.elements.air_density": 0.0})
    for speed, pitch in ((0.0, 0.0), (1.2671, 0.2)):
        modes = linearize(scene, trim_prescribed(scene, speed, pitch, "fixed")).modes()
        alone = campbell(
            scene.platform, scene.turbine, [speed], blades="modes2", tower="modes2", blade_pitch=pitch
        )
        # sorted: names of modes in which torsion and blades take equal parts are a matter of taste
        order = np.argsort([values[0] for values in alone.frequency.values()])
        found = np.array(sorted((mode.frequency / (2.0 * np.pi), mode.damping_ratio) for mode in modes))
        expected = np.array(
            [[table[name][0] for name in table] for table in (alone.frequency, alone.damping)]
        )
        assert found[:, 0] == pytest.approx(expected[0, order], rel=0.01)
        clear = np.diff(found[:, 0], prepend=0.0) > 0.02  # neighbours at rest mix
        assert found[clear, 1] == pytest.approx(expected[1, order][clear], rel=0.05)


def test_modes_have_the_names_of_deflections_each_once(model):
    modes = {mode.name: mode for mode in model.modes()}
    assert len(modes) == len(model.modes())
    waves = {f"{mode}{way}" for mode in BENDING for way in ("", "_regressive", "_progressive")}
    assert waves | {"tower_fore_aft", "tower_side_side", "shaft_twist", "surge", "platform_pitch"} <= set(
        modes
    )
    apart = modes["edge_1_progressive"].frequency - modes["edge_1_regressive"].frequency
    assert apart == pytest.approx(2.0 * model.point.state[State.ROTOR_SPEED], rel=0.02)
    assert modes["flap_1_regressive"].damping_ratio > 0.3 > 0.03 > modes["edge_1_regressive"].damping_ratio


@pytest.mark.nightly
def test_reduced_models_are_those_of_stiff_blades(elastic_scene, model, stiff):
    bent, rigid = residualised(model), residualised(linearize(stiff))
    assert bent.states == rigid.states == STATES
    assert platform_mode(bent).frequency == pytest.approx(platform_mode(rigid).frequency, rel=0.01)
    row, pitch = bent.index("rotor_speed"), bent.index("blade_pitch")
    assert bent.A[row, pitch] == pytest.approx(rigid.A[row, pitch], rel=0.15)  # blades twist no, but bend
    assert bent.B[row, 0] == pytest.approx(rigid.B[row, 0], rel=0.01)
    for motion in (State.PLATFORM_PITCH, State.SURGE):
        assert platform_frequency(elastic_scene, motion) == pytest.approx(
            platform_frequency(stiff, motion), rel=0.02
        )
    periods = natural_periods(elastic_scene)
    assert periods["tower_fore_aft"] == pytest.approx(natural_periods(stiff)["tower_fore_aft"], rel=0.01)


def test_cyclic_pitch_bends_the_blades_in_turn(elastic_scene):
    model = linearize_blades(elastic_scene)
    assert {"tilt_pitch", "tilt_flap_1", "yaw_edge_1_rate"} <= set(model.states)
    command = model.inputs.index("tilt_pitch_command")
    still = -np.linalg.solve(model.A[13:, 13:], model.B[13:, command])  # platform and rotor held
    found = dict(zip(model.states[13:], still, strict=True))
    turned = model.point.state[State.ROTOR_SPEED] * elastic_scene.turbine.pitch_drive.time_constant
    assert found["tilt_pitch"] == pytest.approx(1.0 / (1.0 + turned**2), rel=1e-6)  # lag of a turning blade
    assert found["tilt_flap_1"] < -5.0  # m/rad: blades pitched to feather bend less downwind
    assert abs(found["flap_1"]) < 0.05 * abs(found["tilt_flap_1"])
