"""The state-space model against the nonlinear plant: steps in each input and small regular waves."""

import numpy as np
import pytest

import fowt_env
from fowt_env.analysis.linear_model import linearize

PERIODS = (6.0, 9.0, 14.0)  # s


@pytest.fixture(scope="module")
def model():
    return linearize(fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard"))


class Step:
    """Holds the trim's commands plus a change from the start on."""

    def __init__(self, point, torque=0.0, blade_pitch=0.0):
        self.command = point.command + [torque, blade_pitch]

    def reset(self, measurement):
        pass

    def act(self, measurement):
        return tuple(self.command)


@pytest.mark.parametrize(
    ("number", "change", "channel", "output", "scale"),
    [
        (0, 50.0, "RotSpeed_[rpm]", "rotor_speed", 30.0 / np.pi),
        (1, 1e-4, "RotSpeed_[rpm]", "rotor_speed", 30.0 / np.pi),
        (1, 1e-4, "PtfmPitch_[deg]", "platform_pitch", 180.0 / np.pi),
        (2, 0.02, "RotSpeed_[rpm]", "rotor_speed", 30.0 / np.pi),
        (2, 0.02, "PtfmSurge_[m]", "surge", 1.0),
    ],
)
def test_small_steps_move_the_nonlinear_plant_as_predicted(model, number, change, channel, output, scale):
    control = pytest.importorskip("control")
    torque, pitch = (change if number == i else 0.0 for i in range(2))
    scene = model.scene
    motions = ("PtfmSurge", "PtfmSway", "PtfmHeave", "PtfmRoll", "PtfmPitch", "PtfmYaw")
    start = {name: model.point[name] for name in (*motions, "RotSpeed", "BldPitch1")}
    if number == 2:
        scene = scene.with_weather(18.0 + change, None, 0)
    frame = fowt_env.simulate(scene, Step(model.point, torque, pitch), duration=30.0, initial=start)
    # the blades' passing through the shear rides on both runs, the linear model is its average
    still = fowt_env.simulate(model.scene, Step(model.point), duration=30.0, initial=start)
    found = (frame[channel] - still[channel]).to_numpy() / scale
    time = frame["Time_[s]"].to_numpy()
    inputs = np.zeros((4, time.size))
    inputs[number] = change
    row = model.output_index(output)
    predicted = control.forced_response(model.to_statespace(waves=True), time, inputs).outputs[row]
    miss, size = np.abs(found - np.asarray(predicted)), np.abs(np.asarray(predicted))
    assert miss.max() < 0.03 * size.max()


@pytest.mark.parametrize("period", PERIODS)
def test_the_wave_filter_gives_the_exact_response_within_its_stated_error(model, period):
    control = pytest.importorskip("control")
    omega = 2.0 * np.pi / period
    exact = model.response([omega], ("wave_elevation",))[0, :, 0]
    fitted = control.frequency_response(model.to_statespace(waves=True), [omega]).complex[:, 3, 0]
    fitted = fitted * np.exp(1j * omega * model.wave_filter.lead)
    for name in ("surge", "platform_pitch"):
        i = model.output_index(name)
        assert abs(fitted[i] - exact[i]) < 0.06 * abs(exact[i])


@pytest.mark.parametrize("period", PERIODS)
def test_small_regular_waves_move_the_nonlinear_plant_as_predicted(model, period):
    height, omega = 0.1, 2.0 * np.pi / period
    sea = {"kind": "regular", "H": height, "T": period}
    scene = fowt_env.build_scene("oc3_hywind", wind=18.0, sea=sea, fidelity="standard")
    frame = fowt_env.simulate(scene, Step(model.point), duration=600.0)
    late = frame["Time_[s]"].to_numpy() >= 600.0 - 20.0 * period
    time, response = frame["Time_[s]"][late], model.response([omega], ("wave_elevation",))[0, :, 0]
    basis = np.c_[np.cos(omega * time), np.sin(omega * time), np.ones(time.size), time, time**2, time**3]
    for channel, output, scale in (
        ("PtfmSurge_[m]", "surge", 1.0),
        ("PtfmPitch_[deg]", "platform_pitch", 180.0 / np.pi),
    ):
        fit = np.linalg.lstsq(basis, frame[channel][late].to_numpy() / scale, rcond=None)[0]
        expected = 0.5 * height * abs(response[model.output_index(output)])
        assert np.hypot(fit[0], fit[1]) == pytest.approx(expected, rel=0.05)
