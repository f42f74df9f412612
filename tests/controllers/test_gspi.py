"""The published controllers at their own sampling, against the naive PI law called at that sampling."""

import math

import numpy as np
import pytest
from naive.pi import NaivePI
from naive.turbine import turbine

import fowt_env
from fowt_env.controllers.gspi import GSPI, gspi_land, gspi_oc3
from fowt_env.controllers.pi import Memory, PISettings
from fowt_env.plant.measurement import Measurement

TURBINE = turbine()
RATED = 122.9096
STILL = Measurement(*[0.0] * len(Measurement._fields))
BETA_K = 0.1099965
LAWS = {
    "oc3": (gspi_oc3, (0.006275604, 0.0008965149), False),
    "land": (gspi_land, (0.01882681, 0.008068634), True),
}


def measured(speed, pitch, torque=43093.55, time=0.0):
    return STILL._replace(time=time, generator_speed=speed, blade_pitch=pitch, generator_torque=torque)


@pytest.mark.parametrize("mean", [80.0, 118.0, RATED, 132.0])
@pytest.mark.parametrize("law", LAWS)
def test_a_coarse_call_is_eight_fine_calls_on_the_line_between_the_speeds(law, mean):
    make, gains, power_law = LAWS[law]
    coarse, twin = make(TURBINE, 0.1), NaivePI(*gains, BETA_K, 0.0125, power_law=power_law)
    rng = np.random.default_rng(5)
    speeds = mean * (1.0 + 0.1 * np.sin(0.04 * np.arange(400)) + 0.003 * rng.standard_normal(400))
    coarse.reset(measured(speeds[0], 0.05))
    twin.start(speeds[0], 0.05, 43093.55)
    twin.I_e = coarse.memory[Memory.INTEGRAL]
    last = speeds[0]
    for call, speed in enumerate(speeds):
        torque, pitch = coarse.act(measured(speed, 0.0))
        for k in range(8) if call else (7,):  # no time has passed at the first call
            expected = twin.step(last + (speed - last) * (k + 1) / 8, 0.0)
        last = speed
        assert torque == pytest.approx(expected[0], rel=1e-9)
        assert pitch == pytest.approx(expected[1], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("speed", [0.9 * RATED, RATED, 1.08 * RATED])
@pytest.mark.parametrize("control_dt", [0.01, 0.0125, 0.1])
def test_the_first_command_is_the_measured_pitch(speed, control_dt):
    law = gspi_oc3(TURBINE, control_dt)
    law.reset(measured(speed, 0.25))
    assert law.bumpless
    torque, pitch = law.act(measured(speed, 0.25))
    assert pitch == pytest.approx(0.25, abs=1e-12)


@pytest.mark.parametrize("control_dt, periods", [(0.0125, 1), (0.01, 1), (0.02, 2), (0.1, 8), (0.05, 4)])
def test_no_period_is_longer_than_published(control_dt, periods):
    assert GSPI(PISettings.published(TURBINE), control_dt).periods == periods


def test_pitch_rate_stays_at_8_deg_per_s_and_returns_at_once_after_a_lull():
    law = gspi_oc3(TURBINE, 0.1)
    law.reset(measured(0.8 * RATED, 0.0))
    for k in range(3000):
        _, pitch = law.act(measured(0.8 * RATED, 0.0, time=0.1 * k))
        assert pitch == 0.0
    steps = []
    for _ in range(40):
        _, after = law.act(measured(2.0 * RATED, pitch))
        steps.append(after - pitch)
        pitch = after
    assert max(steps) == pytest.approx(0.1 * 0.1396263, rel=1e-9)
    assert pitch > 0.02


def test_above_rated_oc3_holds_torque_and_land_holds_power():
    commands = {}
    for name, (make, *_) in LAWS.items():
        law = make(TURBINE, 0.1)
        law.reset(measured(1.05 * RATED, 0.2))
        for _ in range(100):
            commands[name] = law.act(measured(1.05 * RATED, 0.2))[0]
    assert commands["oc3"] == pytest.approx(43093.55)
    assert commands["land"] == pytest.approx(5296610.0 / (1.05 * RATED), rel=1e-9)


@pytest.mark.nightly
def test_on_the_deck_without_actuator_it_does_what_the_openfast_law_does():
    """Two codings of one published law: they differ by one 0.0125 s sample of delay and by their start."""
    sea = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}
    scene = fowt_env.build_scene(
        "oc3_hywind_openfast", wind={"kind": "ntm", "speed": 18.0, "class": "B"}, sea=sea,
        seed=1001, duration=100.0, fidelity="standard",
    )  # fmt: skip
    frames = {
        name: fowt_env.simulate(scene, name, duration=100.0, dt=0.0125, control_dt=0.0125, output_dt=0.1)
        for name in ("gspi_oc3", "openfast_oc3")
    }
    for channel in ("RotSpeed_[rpm]", "BldPitch1_[deg]", "PtfmPitch_[deg]", "GenPwr_[kW]"):
        ours, theirs = (frame[channel].to_numpy() for frame in frames.values())
        difference = math.sqrt(np.mean((ours - theirs) ** 2)) / theirs.std()
        assert difference < 0.02, channel
