"""Individual pitch control on the plant: the slope that it is designed with, what it does and may read."""

import numpy as np
import pandas as pd
import pytest

from fowt_env import build_scene, simulate
from fowt_env.control import PRIVILEGED_INPUTS, make
from fowt_env.controllers.gains import platform_frequency
from fowt_env.controllers.ipc.design import lead_time, root_slope
from fowt_env.controllers.ipc.law import CyclicParameter, notch_coefficients
from fowt_env.errors import InputError
from fowt_env.plant.measurement import BladeMeasurement, Measurement
from fowt_env.plant.state import State

NAMES = ("ipc", "ipc_constrained", "ipc_floating")


@pytest.fixture(scope="module")
def scene():
    """Sheared steady wind."""
    return build_scene("oc3_hywind", wind=18.0, fidelity="standard", pitch="individual")


class Cyclic:
    """Blades about where they were, with a cyclic pitch (rad) against the lag of the drive."""

    individual = True
    information = ("generator_torque", "blade_pitch", "azimuth", "rotor_speed")

    def __init__(self, tilt, yaw, turbine):
        self.tilt, self.yaw, self.lead = tilt, yaw, lead_time(turbine, 0.1)

    def reset(self, measurement):
        self.torque, self.mean = measurement.generator_torque, measurement.blade_pitch

    def act(self, measurement):
        azimuths = measurement.blades.azimuth + 2.0 * np.pi / 3.0 * np.arange(3)
        psi = azimuths + self.lead * measurement.rotor_speed
        return self.torque, *(self.mean + self.tilt * np.cos(psi) + self.yaw * np.sin(psi))


def moments(frame, name="RootMyc", unit="kN-m"):
    """(n, 2) of tilt and yaw component of a channel of each blade."""
    psi = np.radians(frame["Azimuth_[deg]"].to_numpy())[:, None] + 2.0 * np.pi / 3.0 * np.arange(3)
    values = np.stack([frame[f"{name}{i}_[{unit}]"] for i in (1, 2, 3)], axis=1)
    return 2.0 / 3.0 * np.stack([(values * f(psi)).sum(axis=1) for f in (np.cos, np.sin)], axis=1)


@pytest.mark.nightly
def test_the_rotor_answers_to_cyclic_pitch_with_the_slope_of_the_design(scene):
    fixed = scene.with_model({"rigid_body.platform_fixed": True, "rigid_body.rotor_fixed": True})
    size = np.radians(1.0)
    mean = [
        moments(simulate(fixed, Cyclic(*pitch, fixed.turbine), duration=15.0)[50:]).mean(axis=0)
        for pitch in ((0.0, 0.0), (size, 0.0), (0.0, size))
    ]
    found = root_slope(fixed.turbine)
    pitch = simulate(fixed, None, duration=0.1)["BldPitch1_[deg]"].iloc[0]
    slope = 1e-3 * found.at_zero * size * (1.0 + np.radians(pitch) / found.doubling)  # kN m
    by_tilt, by_yaw = mean[1] - mean[0], mean[2] - mean[0]
    assert [by_tilt[0], by_yaw[1]] == pytest.approx([slope, slope], rel=0.1)
    assert abs(by_tilt[1]) < 0.1 * abs(slope) and abs(by_yaw[0]) < 0.1 * abs(slope)


def test_it_takes_away_what_the_shear_does_at_one_cycle_a_turn(scene):
    without, left = (
        np.hypot(*moments(simulate(scene, name, duration=60.0)[400:]).mean(axis=0)) for name in ("pi", "ipc")
    )
    assert without > 1000.0  # kN m
    assert left < 0.01 * without


def test_the_floating_form_knows_the_frequencies_of_its_platform(scene):
    law = make("ipc_floating", scene.turbine, 0.1)
    law.prepare(scene)
    sway, roll, yaw = (platform_frequency(scene, motion) for motion in (State.SWAY, State.ROLL, State.YAW))
    # OC3-Hywind, NREL/TP-500-47535: 0.121 Hz in yaw, 0.034 Hz in roll
    assert yaw / (2.0 * np.pi) == pytest.approx(0.121, abs=2e-3)
    assert roll / (2.0 * np.pi) == pytest.approx(0.034, abs=1e-3)
    wanted = [notch_coefficients(w, 0.5, 0.1) for w in (sway, roll)] + [(1.0, 0.0, 0.0, 0.0, 0.0)]
    assert law.parameters[CyclicParameter.NOTCHES :] == pytest.approx(np.ravel(wanted))
    assert law.parameters[CyclicParameter.YAW_DECAY] == pytest.approx(np.exp(-0.1 * 0.25 * sway))


@pytest.mark.parametrize("name", NAMES)
def test_each_declares_all_that_it_uses(scene, name):
    honest, told = make(name, scene.turbine, 0.1), make(name, scene.turbine, 0.1)
    privileged = (x for x in honest.information if x in PRIVILEGED_INPUTS)
    given = (*Measurement._fields, *BladeMeasurement._fields, *privileged)
    told.__class__ = type("Told", (type(told),), {"information": given})
    one, other = (simulate(scene, law, duration=20.0) for law in (honest, told))
    pd.testing.assert_frame_equal(one, other, check_exact=True)
    assert np.isfinite(one.to_numpy()).all()


@pytest.mark.parametrize("name", NAMES)
def test_one_pitch_for_all_blades_is_refused(name):
    with pytest.raises(InputError, match=f"{name!r}.*pitch='individual'"):
        simulate(build_scene("oc3_hywind", wind=18.0, fidelity="standard"), name, duration=1.0)
