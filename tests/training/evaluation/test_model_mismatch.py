"""Shifted plants: the run is on them, the controller knows the nominal one, noise is on readings alone."""

import json

import numpy as np
import pandas as pd
import pytest

import fowt_env
from fowt_env.analysis.linear_model import linearize
from fowt_env.controllers import make
from fowt_env.envs.sensors import reading_scales
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measurement
from fowt_env.training.evaluation.cases import Case, described, read_suite
from fowt_env.training.evaluation.evaluate import evaluate, planned
from fowt_env.training.evaluation.plant_perturbation import (
    PLANT,
    PlantPerturbation,
    perturbed_parts,
    perturbed_sensors,
)
from fowt_env.training.evaluation.run_case import scored
from fowt_env.training.rl.randomisation import SENSORS

WIND = {"kind": "ntm", "speed": 18.0, "class": "B"}


def windy(shift=None, **more):
    return Case("windy", WIND, {"kind": "jonswap", "Hs": 4.0, "Tp": 10.0}, shift=shift, **more)


def short(controllers, *cases, **options):
    return evaluate(controllers, list(cases), duration=40.0, skip=10.0, seeds=[1], **options)


class Recorder:
    """A constant command that keeps what it was given, and what was true then."""

    information = Measurement._fields

    def reset(self, measurement):
        self.seen = [np.array(measurement)]

    def act(self, measurement):
        self.seen.append(np.array(measurement))
        return 43093.55, 0.26


def readings(shift, seed=1, duration=20.0):
    """(calls, fields) that a controller reads in a run of the shifted case, the reset's first."""
    recorder = Recorder()
    scene = fowt_env.build_scene(wind=WIND, seed=seed, fidelity="standard", duration=700.0)
    sensors = perturbed_sensors(shift, scene.turbine, 0.1)
    fowt_env.simulate(scene, recorder, duration=duration, sensors=sensors)
    return np.array(recorder.seen)


def test_a_shift_has_every_quantity_that_training_randomises():
    assert set(PlantPerturbation.model_fields) == {*PLANT, *SENSORS}
    assert PlantPerturbation(mooring_stiffness=1.2, noise=0.1).factors == {"mooring_stiffness": 1.2}


def periods(shift):
    """{mode: period} of the plant at rest in still water."""
    scene = fowt_env.build_scene(fidelity="standard", **perturbed_parts(shift))
    return {mode.name: mode.period for mode in linearize(scene).modes()}


def test_a_stiffer_mooring_shortens_the_surge_period_by_its_root():
    nominal, stiff, soft = (periods(PlantPerturbation(mooring_stiffness=k)) for k in (1.0, 1.2, 0.8))
    assert stiff["surge"] / nominal["surge"] == pytest.approx(1.2**-0.5, rel=0.01)
    assert soft["surge"] / nominal["surge"] == pytest.approx(0.8**-0.5, rel=0.01)
    # the water plane and the ballast hold the platform's pitch, not the lines
    assert stiff["platform_pitch"] / nominal["platform_pitch"] == pytest.approx(1.0, abs=0.02)


def test_more_added_mass_lengthens_the_surge_period_as_its_share_of_the_mass_says():
    nominal, heavy = periods(PlantPerturbation()), periods(PlantPerturbation(added_mass=1.2))
    # the spar's added mass is about that of its displaced water, half of all that surges
    assert 1.03 < heavy["surge"] / nominal["surge"] < 1.07


def test_the_run_is_on_the_shifted_plant_and_the_controller_knows_the_nominal_one():
    shift = PlantPerturbation(mooring_stiffness=1.2, actuator_lag=2.0)
    run = planned(["lqr"], [windy(shift)], seeds=[1])[0]
    frame = scored(run)[1]
    weather = {"wind": WIND, "sea": run.case.sea, "seed": 1, "fidelity": "standard", "duration": 700.0}
    known = fowt_env.build_scene(**weather)
    true = fowt_env.build_scene(**weather, **perturbed_parts(shift))
    assert true.turbine.pitch_drive.time_constant == 2.0 * known.turbine.pitch_drive.time_constant
    options = {"duration": run.duration, "protection": "end_at_overspeed"}
    unaware = make("lqr", known.turbine, 0.1)
    same = fowt_env.simulate(true, unaware, nominal=known, **options)
    pd.testing.assert_frame_equal(frame, same, check_exact=True)
    told = make("lqr", true.turbine, 0.1)
    assert not frame.equals(fowt_env.simulate(true, told, **options))
    assert not np.array_equal(unaware.parameters, told.parameters)


def test_a_shifted_mooring_changes_the_motions_and_an_empty_shift_no_bit():
    plain, same, soft = (
        short(["gspi_oc3"], windy(shift)).iloc[0]
        for shift in (None, PlantPerturbation(), PlantPerturbation(mooring_stiffness=0.8))
    )
    assert plain.equals(same)
    assert plain["PtfmSurge_mean_[m]"] < soft["PtfmSurge_mean_[m]"]  # it drifts farther on softer lines
    assert plain["Wind1VelX_std_[m/s]"] == soft["Wind1VelX_std_[m/s]"]


def test_noise_reaches_the_controller_with_its_size_and_no_delay(turbine):
    seen, true = (
        readings(shift, duration=400.0) for shift in (PlantPerturbation(noise=0.02), PlantPerturbation())
    )
    scales = reading_scales(turbine)
    assert np.array_equal(seen[:, 0], true[:, 0])  # the clock is exact
    noise = (seen - true)[1:, 1:] / (0.02 * scales[1:])
    np.testing.assert_allclose(noise.std(axis=0), 1.0, rtol=0.06)
    assert np.abs(noise.mean(axis=0)).max() < 0.06
    correlation = np.corrcoef(noise.T) - np.eye(noise.shape[1])
    assert np.abs(correlation).max() < 0.08
    assert np.array_equal(seen[0], seen[1])  # one reading per instant, also that of the start


def test_a_delay_shows_what_was_measured_as_many_periods_ago():
    late, true = readings(PlantPerturbation(delay=2)), readings(PlantPerturbation())
    assert np.array_equal(late[3:, 1:], true[1:-2, 1:])
    assert np.array_equal(late[:3, 1:], true[[0, 0, 0], 1:])
    assert np.array_equal(late[:, 0], true[:, 0])


def test_a_suite_may_carry_shifts_and_names_wrong_ones(tmp_path):
    suite = read_suite("shifted")
    shifts = {case.name.rpartition("_")[0]: case.shift for case in suite.cases}
    assert shifts["nominal"] is None and shifts["mooring_soft"] == PlantPerturbation(mooring_stiffness=0.8)
    assert {tuple(shift.factors.values()) for shift in shifts.values() if shift} >= {(0.8,), (1.2,), (2.0,)}
    assert shifts["noise"].noise > 0.0 and max(suite.seeds) < 1000
    assert described(suite.cases[-1])["shift"] == {"noise": 0.02}
    json.dumps([described(case) for case in suite.cases], allow_nan=False)
    text = (
        'version = 1\ndescription = "d"\nsource = "s"\nwind = "rotor-averaged"\nduration = 100.0\n'
        '[[case]]\nname = "x"\nwind = 18.0\n'
    )
    for more, message in (
        ("shift = {mooring = 1.2}", "mooring"),
        ("shift = {added_mass = 0.0}", "added_mass"),
        ('shift = {drag = 2.0}\noptions = {turbine = "nrel5mw"}', "needs the turbine of the platform"),
    ):
        path = tmp_path / "mine.toml"
        path.write_text(text + more + "\n")
        with pytest.raises(InputError, match=message):
            read_suite(path)
