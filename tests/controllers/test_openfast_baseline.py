"""The OpenFAST-side controller against a line-by-line twin of the published law."""

import numpy as np
import pytest
from naive.discon import Discon

from fowt_env import controllers
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.measurement import Measurement

pytestmark = pytest.mark.installation

TURBINE = read_turbine("nrel5mw_openfast")
RATED = TURBINE.rated_rotor_speed * TURBINE.drivetrain.gear_ratio
POWER = TURBINE.torque_law.rated_torque * RATED


def measured(time, speed, pitch, torque=0.0):
    values = dict.fromkeys(Measurement._fields, 0.0)
    values |= {
        "time": time,
        "generator_speed": speed,
        "rotor_speed": speed / 97.0,
        "blade_pitch": pitch,
        "generator_torque": torque,
    }
    return Measurement(**values)


def make(dt):
    return controllers.make("openfast_oc3", TURBINE, dt)


@pytest.mark.parametrize("mean", [70.0, 95.0, 118.0, RATED, 135.0])
@pytest.mark.parametrize("dt", [0.0125, 0.1])
def test_every_command_is_the_twins_of_one_sample_earlier(mean, dt):
    rng = np.random.default_rng(7)
    speeds = mean * (1.0 + 0.15 * np.sin(0.3 * np.arange(600) * dt) + 0.01 * rng.standard_normal(600))
    pitch = 0.02
    law, twin = make(dt), Discon(RATED, POWER)
    law.reset(measured(0.0, speeds[0], pitch))
    before = None
    for step, speed in enumerate(speeds):
        torque, command = law.act(measured(step * dt, speed, pitch))
        wanted = twin(step * dt, speed, pitch)
        if before is None:
            assert command == pitch
            assert torque == pytest.approx(wanted[0], rel=1e-6)
        else:
            assert command == pytest.approx(before[1], rel=1e-9, abs=1e-12)
            assert torque == pytest.approx(before[0], rel=1e-6, abs=1e-6)
        before = wanted
        pitch = command


def test_pitch_rate_never_exceeds_8_deg_per_s_whatever_the_overspeed():
    law = make(0.05)
    law.reset(measured(0.0, RATED, 0.1))
    pitch, largest = 0.1, 0.0
    for step in range(100):
        _, command = law.act(measured(0.05 * step, 2.0 * RATED, pitch))
        largest = max(largest, abs(command - pitch) / 0.05)
        pitch = command
    assert largest == pytest.approx(np.radians(8.0), rel=1e-9)


def test_integral_is_clipped_so_that_pitch_returns_at_once_after_a_long_lull():
    law = make(0.1)
    law.reset(measured(0.0, 0.8 * RATED, 0.0))
    for step in range(3000):
        _, pitch = law.act(measured(0.1 * step, 0.8 * RATED, 0.0))
        assert pitch == 0.0
    pitch = 0.0
    for step in range(40):
        _, pitch = law.act(measured(300.0 + 0.1 * step, 1.1 * RATED, pitch))
    assert pitch > 0.02


def test_start_holds_the_blade_pitch_at_rated_speed():
    law = make(0.0125)
    law.reset(measured(0.0, RATED, 0.26))
    for step in range(100):
        torque, pitch = law.act(measured(0.0125 * step, RATED, 0.26))
    assert pitch == pytest.approx(0.26, abs=1e-9)
    assert torque == pytest.approx(43093.55, rel=1e-6)
