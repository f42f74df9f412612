"""Steady states of a turbine with bending blades and a twisting shaft, and runs that begin at them."""

import numpy as np
import pytest

import fowt_env
from fowt_env.analysis.blade_coordinates import bending_states, coordinates, placed, turned_to
from fowt_env.analysis.equilibrium import causes_of, evaluated
from fowt_env.analysis.statics import Evaluation
from fowt_env.analysis.trim import AZIMUTHS, trim, trim_prescribed, without_fluctuations
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.errors import InputError
from fowt_env.plant.advance import output, output_row
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State
from fowt_env.run.initial_conditions import initial_state
from fowt_env.training.validation.openfast_cases import table

TURN = 2.0 * np.pi * np.arange(3 * AZIMUTHS) / (3 * AZIMUTHS)


@pytest.fixture(scope="module")
def point(elastic_scene):
    return trim(elastic_scene)


def around(scene, point):
    """Return (n, n_state) states of a periodic state over a turn, and their rates."""
    states = turned_to_all(scene, point.state)
    data, rates, row = scene.data(), np.zeros_like(states), np.zeros(len(scene.channels))
    handle = without_fluctuations(scene).handle(data)
    for x, dx in zip(states, rates, strict=True):
        data.cache[LoadCache.VALID] = 0.0
        output(handle, x, point.command, 0.0, dx, row)
    return states, rates


def turned_to_all(scene, state):
    return np.array([turned_to(state, azimuth, bending_states(scene)) for azimuth in TURN])


def harmonics(values):
    """Return mean, cosine and sine part of values (n, ...) over TURN."""
    waves = np.array([np.ones_like(TURN), 2.0 * np.cos(TURN), 2.0 * np.sin(TURN)]) / len(TURN)
    return np.tensordot(waves, values, 1)


def test_accelerations_of_platform_tower_rotor_and_shaft_are_zero_on_average(elastic_scene, point):
    _, rates = around(elastic_scene, point)
    moving = np.ones(elastic_scene.n_state, dtype=bool)
    moving[[State.AZIMUTH, *bending_states(elastic_scene).ravel()]] = False
    assert np.abs(rates.mean(axis=0)[moving]).max() < 1e-8
    assert point.state[elastic_scene.model.shaft.first] == pytest.approx(
        point["RotTorq"] * 1e3 / elastic_scene.turbine.shaft_torsion.stiffness, rel=1e-6
    )


def test_mean_and_first_harmonic_of_each_blade_are_periodic(elastic_scene, point):
    states, rates = around(elastic_scene, point)
    speed, modes = point.state[State.ROTOR_SPEED], len(bending_states(elastic_scene)) // 2
    for blade in bending_states(elastic_scene).T:
        q, v = states[:, blade[:modes]], states[:, blade[modes:]]
        mean, c, s = harmonics(q)
        assert np.abs(c).max() > 0.01 and mean[0] > 1.0
        assert harmonics(v) == pytest.approx(np.array([0.0 * c, speed * s, -speed * c]), abs=1e-12)
        # the plant's own accelerations are those of this motion
        assert harmonics(rates[:, blade[modes:]]) == pytest.approx(
            np.array([0.0 * c, -(speed**2) * c, -(speed**2) * s]), abs=1e-8
        )


def test_multiblade_coordinates_are_inverse_to_blades_at_an_azimuth(elastic_scene, point):
    states = bending_states(elastic_scene)
    mean, cyclic = coordinates(point.state, states)
    assert placed(mean, 0.0, states, cyclic) == pytest.approx(point.state, abs=1e-15)
    there = turned_to(point.state, 0.7, states)
    again = coordinates(there, states)
    assert again[1] == pytest.approx(cyclic, abs=1e-14) and again[0][states] == pytest.approx(mean[states])
    # after a third of a turn the second blade is where the third was
    third = turned_to(point.state, 2.0 * np.pi / 3.0, states)
    assert third[states[:, [0, 1, 2]]] == pytest.approx(point.state[states[:, [1, 2, 0]]], abs=1e-14)


def test_a_bent_rotor_needs_more_pitch_and_holds_rated_power(elastic_scene, point):
    assert point["RotSpeed"] == pytest.approx(12.1, rel=1e-12)
    assert point["GenPwr"] == pytest.approx(5000.0, rel=1e-4)
    assert 14.0 < point["BldPitch1"] < 16.0
    for number in (1, 2, 3):  # means over a turn are equal
        assert point[f"OoPDefl{number}"] == pytest.approx(point["OoPDefl1"], rel=1e-9)
    assert point["OoPDefl1"] == pytest.approx(1.37, abs=0.05)  # OpenFAST 1.31, on a fixed platform


@pytest.mark.nightly
def test_a_run_in_steady_wind_stays_at_the_periodic_state(elastic_scene):
    calm = elastic_scene.with_weather(sea=None)
    frame = fowt_env.simulate(calm, "gspi_oc3", duration=30.0)
    assert np.ptp(frame["RotSpeed_[rpm]"]) < 0.01
    assert np.ptp(frame["GenPwr_[kW]"]) < 10.0
    states = turned_to_all(calm, trim(calm).state)
    rows = np.array([output_row(calm.handle(), x, np.zeros(4), 0.0, len(calm.channels)) for x in states])
    names = [channel.name for channel in calm.channels]
    azimuth = frame["Azimuth_[deg]"].to_numpy() * DEGREE
    waves = [np.ones_like(azimuth), *(wave(k * azimuth) for k in (1, 2, 3) for wave in (np.cos, np.sin))]
    for name in (
        "OoPDefl1",
        "OoPDefl3",
        "IPDefl2",
    ):  # of a whole run, with the harmonics that the start omits
        run = np.linalg.lstsq(np.array(waves).T, frame[f"{name}_[m]"].to_numpy(), rcond=None)[0]
        mean, *first = harmonics(rows[:, names.index(name)])
        assert run[0] == pytest.approx(mean, rel=2e-3)
        assert run[1:3] == pytest.approx(first, abs=0.01 * np.hypot(*first))


@pytest.mark.installation
@pytest.mark.parametrize("case", ["steady_12mps"])
def test_tips_and_roots_in_steady_wind_are_openfasts(elastic_scene, case):
    known = table("elastic/steady.csv.gz").set_index(["case", "channel"]).loc[f"nrel5mw/{case}"]
    scene = elastic_scene.with_weather(12.0, None).with_model({"aero.wind.shear_exponent": 0.0})
    speed, pitch = known["mean"]["RotSpeed_[rpm]"] * RPM, known["mean"]["BldPitch1_[deg]"] * DEGREE
    point = trim_prescribed(scene, speed, pitch, "fixed")
    assert point["OoPDefl1"] == pytest.approx(known["mean"]["OoPDefl1_[m]"], rel=0.01)
    assert point["IPDefl1"] == pytest.approx(known["mean"]["IPDefl1_[m]"], rel=0.01)
    assert point["TipDxb1"] == pytest.approx(known["mean"]["TipDxb1_[m]"], rel=0.01)
    assert point["TipDyb1"] == pytest.approx(known["mean"]["TipDyb1_[m]"], rel=0.01)
    assert point["RootMzc1"] == pytest.approx(known["mean"]["RootMzc1_[kN-m]"], rel=0.01)
    assert point["RootMyc1"] == pytest.approx(known["mean"]["RootMyc1_[kN-m]"], rel=0.01)
    assert point["RootMxc1"] == pytest.approx(known["mean"]["RootMxc1_[kN-m]"], rel=0.01)
    names = [channel.name for channel in scene.channels]
    handle = scene.handle()
    rows = np.array(
        [output_row(handle, x, point.command, 0.0, len(names)) for x in turned_to_all(scene, point.state)]
    )
    _, c, s = harmonics(rows[:, names.index("IPDefl1")])
    reference = np.hypot(known["cos1"]["IPDefl1_[m]"], known["sin1"]["IPDefl1_[m]"])
    assert np.hypot(c, s) == pytest.approx(reference, rel=0.03)


def test_a_parked_rotor_hangs_in_static_equilibrium(elastic_scene):
    for wind in (30.0, 0.0):
        scene = elastic_scene.with_weather(wind, None)
        point = trim(scene)
        assert point["RotSpeed"] == 0.0
        x, dx = point.state, np.zeros(scene.n_state)
        data = scene.data()
        output(scene.handle(data), x.copy(), point.command, 0.0, dx, np.zeros(len(scene.channels)))
        blades = bending_states(scene)
        modes = len(blades) // 2
        assert np.all(x[blades[modes:]] == 0.0)
        assert np.abs(dx[blades[modes:]]).max() < 1e-8


def test_weight_and_buoyancy_balance_with_the_weight_of_nacelle_and_rotor(elastic_scene):
    evaluation = Evaluation(elastic_scene.with_weather(0.0, None))
    rest = np.zeros(elastic_scene.n_state)
    evaluation.at(rest, LoadCache.TOTAL)
    assert causes_of(elastic_scene, evaluated(rest, evaluation.data)) == {}


def test_initial_tip_displacements_are_those_asked_for(elastic_scene):
    def tips(initial):
        x, u = initial_state(elastic_scene, initial)
        row = output_row(elastic_scene.handle(), x, u, 0.0, len(elastic_scene.channels))
        names = [channel.name for channel in elastic_scene.channels]
        found = {name: row[names.index(name)] for name in names if name.startswith(("OoPDefl", "IPDefl"))}
        return found, x

    found, x = tips({"OoPDefl": 2.0, "IPDefl2": -0.5, "BldPitch3": 30.0})
    assert [found[f"OoPDefl{i}"] for i in (1, 2, 3)] == pytest.approx([2.0, 2.0, 2.0])
    assert [found[f"IPDefl{i}"] for i in (1, 2, 3)] == pytest.approx([0.0, -0.5, 0.0], abs=1e-12)
    states = bending_states(elastic_scene)  # first and second flap, edge, and their rates
    assert np.all(x[states[[0, 2]]] != 0.0) and np.all(x[states[[1, 3, 4, 5]]] == 0.0)
    straight, _ = tips("zero")
    assert set(straight.values()) == {0.0}
    bent, x = tips({"Azimuth": 90.0})
    there = turned_to(trim(elastic_scene).state, 0.5 * np.pi, bending_states(elastic_scene))
    assert x == pytest.approx(there, abs=1e-14) and bent["OoPDefl1"] > 1.0
    with pytest.raises(InputError, match="unknown channel of initial 'OoPDefl4'. Did you mean"):
        initial_state(elastic_scene, {"OoPDefl4": 1.0})
