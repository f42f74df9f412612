"""What a LinearModel is handed out as: states from measurements, discrete time, parts by name."""

import numpy as np
import pytest

import fowt_env
from fowt_env.analysis.linear_model import MEASURED_AS, VELOCITIES
from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement
from fowt_env.plant.state import STATE_INDEX

SECOND_ORDER = 1e-5  # m/s: 5 mm/s of surge rate times 1e-3 rad of platform pitch, about what is left out


@pytest.fixture(scope="module")
def model():
    return fowt_env.linearize(fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard"))


def small_motion(model):
    """An environment at the operating point, moved a little, and its state vector."""
    env = FowtEnv(task="steady", wind=18.0, fidelity="standard")
    env.reset(
        seed=1, options={"offsets": {"PtfmPitch": 0.05, "PtfmRoll": 0.02, "PtfmYaw": 0.02, "RotSpeed": 0.02}}
    )
    for _ in range(20):
        env.step_physical(*model.point.command)
    return env, env.view().state[list(STATE_INDEX)] - model.x0


def test_the_state_from_a_measurement_is_that_of_the_plant(model):
    env, expected = small_motion(model)
    found = model.state(env.true_measurement())
    size = np.abs(expected).max()
    assert found.shape == (14,) and size > 1e-3
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=SECOND_ORDER)
    # what the attitude of the operating point makes of the rates is more than that
    rates = [getattr(env.true_measurement(), MEASURED_AS[name]) for name in VELOCITIES]
    assert not np.allclose(rates, expected[6:12], rtol=2e-3, atol=SECOND_ORDER)


def test_the_state_from_rows_of_a_run_is_that_of_the_plant(model):
    env, expected = small_motion(model)
    scene = env.scene
    row = {channel.column: env.channels()[channel.name] for channel in scene.channels}
    np.testing.assert_allclose(model.state(row), expected, rtol=2e-3, atol=SECOND_ORDER)
    run = fowt_env.simulate(model.scene, "constant", duration=2.0)
    rows = model.state(run)
    assert rows.shape == (len(run), 14)
    np.testing.assert_allclose(rows[7], model.state(run.iloc[7]), rtol=1e-12)
    with pytest.raises(InputError, match="no column"):
        model.state({"Time_[s]": 0.0})
    with pytest.raises(InputError, match="must be a Measurement"):
        model.state(3.0)


def test_the_equilibrium_has_names_and_units(model):
    assert model.equilibrium["rotor_speed"] == pytest.approx(1.267, rel=1e-3)
    assert tuple(model.equilibrium.index) == model.states
    assert model.equilibrium_inputs["wind_speed"] == 18.0
    assert model.units["platform_pitch"] == "rad" and model.units["fairlead_tension_1"] == "N"
    assert all(model.units.values())  # this model has neither memory nor wake
    at_rest = Measurement(
        **dict.fromkeys(Measurement._fields, 0.0)
        | {MEASURED_AS[name]: value for name, value in model.equilibrium.items()}
    )
    np.testing.assert_allclose(model.state(at_rest), 0.0, atol=1e-12)


def test_fields_are_what_state_reads(model):
    hidden = {name: np.nan for name in Measurement._fields if name not in model.fields}
    shown = dict.fromkeys(model.fields, 0.1)
    assert np.isfinite(model.state(Measurement(**hidden, **shown))).all()


def test_a_field_of_a_measurement_leads_to_its_state(model):
    with pytest.raises(InputError, match=r"'surge_rate' is a field of Measurement: its state is 'vx'"):
        model.index("surge_rate")
    with pytest.raises(InputError, match="unknown state 'surg'"):
        model.index("surg")


def test_states_that_are_not_measured_are_named():
    model = fowt_env.linearize(fowt_env.build_scene("iea15_volturnus_s", fidelity="standard"))
    with pytest.raises(InputError, match=r"radiation_1.*residualised"):
        model.state(Measurement(*np.zeros(len(Measurement._fields))))


def test_discretize_is_the_hold_of_python_control(model):
    control = pytest.importorskip("control")
    found = model.discretize(0.1)
    expected = control.c2d(model.to_statespace(waves=False), 0.1)
    np.testing.assert_allclose(found.A, expected.A, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.B, expected.B, rtol=1e-9, atol=1e-12)
    system = found.to_statespace()
    assert system.dt == 0.1 and system.state_labels == list(model.states)
    with pytest.raises(InputError, match="dt = 0"):
        model.discretize(0)


def test_waves_come_in_where_there_is_a_sea(model):
    pytest.importorskip("control")
    assert model.to_statespace().nstates == 14 and model.to_statespace().ninputs == 3
    with_waves = model.to_statespace(waves=True)
    assert with_waves.input_labels[-1] == "wave_elevation" and with_waves.nstates > 14
    rough = fowt_env.build_scene(
        "oc3_hywind", wind=18.0, sea={"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}, fidelity="reference"
    )
    assert fowt_env.linearize(rough).to_statespace().ninputs == 4


def test_parts_are_chosen_by_name_and_named_after_it(model):
    control = pytest.importorskip("control")
    whole = model.to_statespace()
    part = model.to_statespace(inputs="blade_pitch_command", outputs=("platform_pitch", "rotor_speed"))
    assert whole.name == "fowt" and part.name == "blade_pitch_command to platform_pitch, rotor_speed"
    assert part.output_labels == ["platform_pitch", "rotor_speed"]
    response = control.frequency_response(part, [0.2]).complex[:, 0, 0]
    every = control.frequency_response(whole, [0.2]).complex[:, 1, 0]
    rows = [model.output_index(name) for name in part.output_labels]
    np.testing.assert_allclose(response, every[rows], rtol=1e-12)
    assert model.to_statespace(inputs="wind_speed", name="gusts").name == "gusts"
    with pytest.raises(InputError, match="unknown output 'speed'"):
        model.to_statespace(outputs="speed")


def test_a_model_shows_its_size_and_operating_point_not_its_matrices(model):
    shown = repr(model)
    assert shown.startswith("LinearModel(14 states, 3 inputs, 15 outputs, at OperatingPoint(RotSpeed 12.1")
    assert "array" not in shown and len(shown) < 250
