"""The stability study on small counts: that it measures what it says, and that it would notice a failure."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError
from fowt_env.plant.hydro.linear_damping import LinearDamping
from fowt_env.plant.state import N_RIGID, STATES, State
from fowt_env.scene.build import build_scene
from fowt_env.training.cli.app import app
from fowt_env.training.studies.robustness import extremes, long_runs, random_cases, step_limits, study

CALM = {"kind": "jonswap", "Hs": 3.0, "Tp": 9.0}


@pytest.fixture(scope="module")
def scene():
    return build_scene(wind=18.0, sea=CALM, fidelity="standard", duration=random_cases.WEATHER)


@pytest.fixture(scope="module")
def runner(scene):
    return random_cases.Runner(scene, scene.dt)


def system(**blocks):
    """Matrix of a linear model that is zero but for {name: value}, with a slow blade pitch."""
    a = np.zeros((len(STATES), len(STATES)))
    if "decay" in blocks:
        a -= blocks["decay"] * np.eye(len(STATES))
    if "speeds" in blocks:  # they drive nothing: the positions' Adams-Moulton step has no part in it
        a[6:13, 6:13] = -blocks["speeds"] * np.eye(7)
    if "frequency" in blocks:  # six undamped oscillators
        a[:6, 6:12], a[6:12, :6] = np.eye(6), -(blocks["frequency"] ** 2) * np.eye(6)
    a[step_limits.PITCH, step_limits.PITCH] = -1e-3
    return a


@pytest.mark.parametrize(
    "a, integrator, limit",
    [
        (system(decay=1.0), "rk4", 2.7853),
        (system(frequency=1.0), "rk4", 2.8284),
        (system(decay=1.0), "heun", 2.0),
        (system(speeds=1.0), "ab4", 0.3),  # Adams-Bashforth alone
    ],
)
def test_theory_has_the_limits_of_the_textbook(a, integrator, limit):
    found = step_limits.first_unstable(lambda h: step_limits.stable(a, h, integrator, duration=3000.0), 0.05)
    assert found == pytest.approx(limit, rel=2.0 * step_limits.RESOLUTION)


def test_search_stops_at_the_first_step_that_fails_even_if_larger_ones_hold():
    found = step_limits.first_unstable(lambda h: not 0.3 < h < 0.5, 0.1)
    assert found == pytest.approx(0.3, rel=step_limits.RESOLUTION)
    assert step_limits.first_unstable(lambda h: False, 0.1) == 0.0
    assert step_limits.first_unstable(lambda h: True, 0.1) == float("inf")


def test_a_step_beyond_the_limit_of_theory_blows_the_plant_up_and_one_below_does_not():
    kind = step_limits.LIMIT_SCENES["full, look-up rotor"]
    base = kind.scene("ab4")
    point = kind.point(base)
    fine, _ = step_limits.excursions(base, point, 0.025, 100.0)
    model = step_limits.linearize(base, point)
    limit = step_limits.first_unstable(lambda h: step_limits.stable(model.A, h, "ab4", 100.0), 0.1)
    for factor, expected in ((0.8, True), (1.3, False)):
        assert step_limits.stays(base, point, fine, factor * limit, 100.0) == expected


def test_same_seed_same_cases():
    first, second = (
        random_cases.random_cases(12, seed=3, per_weather=6, duration=5.0, plants=("standard",))
        for _ in range(2)
    )
    assert first.cases == 12 and first.weathers == 2
    assert np.array_equal(first.peak, second.peak)
    other = random_cases.random_cases(12, seed=4, per_weather=6, duration=5.0, plants=("standard",))
    assert not np.array_equal(first.peak, other.peak)


def test_drawn_weather_reaches_the_ends_of_the_range_and_is_never_refused(turbine):
    rng = np.random.default_rng(1)
    winds = [random_cases.draw_wind(rng) for _ in range(400)]
    seas = [random_cases.draw_sea(rng) for _ in range(400)]
    states = np.array([random_cases.draw_state(rng, turbine) for _ in range(400)])
    assert {wind["kind"] for wind in winds} >= {"steady", "ntm", "etm", "ewm", "eog", "ecd", "edc", "ews"}
    assert max(wind.get("speed", 0.0) for wind in winds) > 65.0
    assert max(sea.get("Hs", 0.0) for sea in seas) > 16.0
    assert np.hypot(states[:, 0], states[:, 1]).max() > 28.0
    tilt = np.degrees(np.hypot(states[:, 3], states[:, 4]))
    assert 28.0 < tilt.max() <= 30.0
    speed = states[:, State.ROTOR_SPEED] / turbine.rated_rotor_speed
    assert speed.min() == 0.0 and 1.45 < speed.max() <= 1.5


def test_a_case_runs_alike_alone_and_among_others(scene, runner, tmp_path):
    rng = np.random.default_rng(5)
    for commands in (np.zeros((0, 2)), np.array([[4e4, 0.2]])):
        state = random_cases.draw_state(rng, scene.turbine)
        runner.run(random_cases.draw_state(rng, scene.turbine), [], 5.0)
        outcome = runner.run(state, commands, 5.0)
        case = random_cases._case(scene, 18.0, CALM, 0, state, commands, 5.0)
        path = random_cases.store_case([(case, "made up")], tmp_path)[0]
        again = random_cases.replay(path)
        assert again.status == outcome.status
        assert np.array_equal(again.peak, outcome.peak)


def test_a_plant_that_gains_energy_is_a_failure(scene):
    driven = LinearDamping(-2e7, -2e7, -2e7, -1e10, -1e10, -1e9, 0.0)
    outcome = random_cases.Runner(scene.with_model({"hydro.damping": driven}), 0.1).run(
        np.r_[5.0, np.zeros(6), 0.5, np.zeros(5), 1.2, 0.2], [[4e4, 0.2]], 30.0
    )
    assert outcome.failure


def test_a_state_that_is_no_number_is_a_failure(scene, runner):
    state = np.zeros(N_RIGID)
    state[State.VX] = np.nan
    assert "non-finite" in runner.run(state, [[0.0, 0.0]], 1.0).failure


def test_an_exception_is_a_failure_with_its_weather(monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("made up")

    monkeypatch.setattr(random_cases, "Runner", broken)
    tally = random_cases.random_cases(5, per_weather=5, plants=("standard",))
    ((case, reason),) = tally.failures
    assert "ZeroDivisionError" in reason and {"wind", "sea", "seed"} <= set(case)


@pytest.mark.parametrize(
    "text, message", [("nonsense", "is not JSON"), ("[1]", "must hold one case"), ("{}", "missing")]
)
def test_a_file_that_is_no_case_is_refused(text, message, tmp_path):
    path = tmp_path / "case.json"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        random_cases.replay(path)


def test_potential_energy_is_the_work_against_the_plants_own_loads(still_scene):
    scene = still_scene
    handle = scene.handle()
    quiet = scene.model.hydro.strips.shape._replace(
        added_mass_coefficient=0.0, drag_coefficient=0.0, heave_added_mass=0.0
    )
    damping = scene.model.hydro.damping._replace(yaw_stiffness=0.0)
    plant = scene.with_model({"hydro.strips.shape": quiet, "hydro.damping": damping})
    x = np.zeros(N_RIGID)
    x[:3] = 4.0, -2.0, 0.7
    step, slope = 1e-3, []
    for i in range(3):
        high, low = (
            random_cases.potential_energy(handle, x + side * step * np.eye(N_RIGID)[i]) for side in (1, -1)
        )
        slope.append((high - low) / (2.0 * step))
    from plant_helpers import rates  # in tests/

    force = plant.model.rigid_body.mass_matrix @ rates(plant, x)[7:13]
    assert np.allclose(-np.array(slope), force[:3], rtol=1e-5, atol=20.0)


def test_a_lost_line_leaves_the_others_as_they_are(still_scene):
    left = extremes.without_line(still_scene, 1)
    assert left.n_lines == 2
    assert np.array_equal(left.model.mooring.anchor, still_scene.model.mooring.anchor[[0, 2]])
    with pytest.raises(InputError, match="from 0 to 2"):
        extremes.without_line(still_scene, 3)


def test_losing_a_line_sets_the_platform_adrift(scene, monkeypatch):
    monkeypatch.setattr(extremes, "EVENT", 5.0)
    rows = []
    for fault in ({"fault": "line loss", "line": 1}, {}):
        case = extremes.Extreme("line loss", 18.0, CALM, duration=50.0, **fault)
        monkeypatch.setitem(extremes.EXTREMES, "mine", case)
        rows.append(extremes.run_extreme("mine", scene=scene))
    lost, kept = rows
    assert lost["finite"] and kept["finite"]
    assert lost["offset_m"] > kept["offset_m"] + 5.0


def test_an_emergency_stop_feathers_at_the_actuators_rate_and_stops_the_rotor(scene, monkeypatch):
    monkeypatch.setattr(extremes, "EVENT", 2.0)
    case = extremes.Extreme("emergency stop", 18.0, CALM, fault="emergency stop", duration=60.0)
    run = extremes._ExtremeRun(case, scene, scene.dt)
    before = run.x[State.ROTOR_SPEED]
    run.go()
    assert run.x[State.BLADE_PITCH] == pytest.approx(scene.turbine.pitch_drive.maximum, abs=1e-6)
    assert run.x[State.ROTOR_SPEED] < 0.3 * before


def test_a_rotor_without_torque_and_pitch_runs_away_and_the_verdict_says_so(scene, monkeypatch):
    case = extremes.Extreme("grid loss", 18.0, CALM, fault="grid loss, no pitch action", duration=100.0)
    monkeypatch.setitem(extremes.EXTREMES, "runaway", case)
    row = extremes.run_extreme("runaway", scene=scene)
    assert row["finite"] and "overspeed" in row["verdict"]


def test_every_extreme_has_the_wind_and_the_fault_of_its_name():
    scene = build_scene(wind=18.0, sea=CALM, fidelity="standard", duration=extremes.DURATION)
    for name, case in extremes.EXTREMES.items():
        built = scene.with_weather(case.wind, case.sea, 1)
        u, v = built.model.aero.wind.value[:, :2].T
        said = {unit: float(number) for number, unit in re.findall(r"([\d.]+) (m/s|deg off)", name)}
        if "m/s" in said:
            assert built.wind_speed == said["m/s"], name
        if "deg off" in said:
            off = np.degrees(np.arctan2(v.mean(), u.mean())) - said["deg off"]
            assert abs((off + 180.0) % 360.0 - 180.0) < 2.0, name
        assert case.parked == name.endswith("parked"), name
        assert f"line {case.line + 1} lost" in name if case.fault == "line loss" else case.fault in name, name


def test_hostile_actions_are_counted_and_refused_and_ends_have_their_reason():
    env = FowtEnv(wind=18.0)
    row = extremes.attack(env, "bang-bang at Nyquist, both", 1, steps=40)
    assert row["finite"] and row["steps"] == 40
    row = extremes.attack(env, "constant (-1, -1)", 1, steps=300)
    assert any("overspeed" in reason for reason in row["ends"])
    assert extremes.refused_alike(env, 2) == len(extremes.REFUSED)


def test_the_report_counts_what_was_missed(tmp_path, monkeypatch):
    def part(sizes, folder, progress):
        found = study.Found()
        found.claim("good", 3, "1", "1", True)
        found.claim("bad", 4, "2", "1", False)
        found.tables.append(["Values", ["a", "b"], [["x", "1"]]])
        found.tables.append(["Many", ["a", "b"], [[f"y{n}", "2"] for n in range(40)]])
        return found

    monkeypatch.setitem(study.PARTS, "plain", replace(study.PARTS["plain"], run=part))
    study.study(tmp_path, ["plain"], study.Sizes(seed=3))
    text = study.write_robustness_report(tmp_path, tmp_path / "report.md").read_text()
    assert "2 checks, 1 of them missed" in text
    assert (
        "| bad | 4 | **MISSED**: 2 | 1 |" in text and "| good | 3 | 1 | 1 |" in text and "| x | 1 |" in text
    )
    assert "`fowt benchmark stability --parts plain --seed 3`" in text
    assert "(report/plain_2.csv)" in text and "y39" not in text
    many = pd.read_csv(tmp_path / "report" / "plain_2.csv")
    assert list(many["a"]) == [f"y{n}" for n in range(40)] and (many["b"] == 2).all()
    with pytest.raises(InputError, match="unknown part"):
        study.study(tmp_path, ["maps"])


def test_replay_from_the_command_line_tells_the_outcome(scene, tmp_path):
    case = random_cases._case(scene, 18.0, CALM, 0, np.zeros(N_RIGID), [[0.0, 1.5]], 2.0)
    path = tmp_path / "case.json"
    path.write_text(json.dumps(case))
    done = CliRunner().invoke(app, ["benchmark", "stability", "--replay", str(path)])
    assert done.exit_code == 0 and "ran to its end" in done.output
    case["state"][State.VX] = float("nan")
    path.write_text(json.dumps(case))
    done = CliRunner().invoke(app, ["benchmark", "stability", "--replay", str(path)])
    assert done.exit_code == 1 and "non-finite" in done.output


def test_momenta_and_energy_are_those_of_the_bodies_one_by_one(platform, turbine):
    from naive import rigid_body

    scene, x = long_runs.free_scene(), long_runs.free_start()
    parts = rigid_body.bodies(platform, turbine)
    R = rigid_body.rotation(*x[3:6])
    speed = x[State.ROTOR_SPEED]
    linear, angular = rigid_body.momenta(parts, x[:3], R, x[7:10], x[10:13], speed)
    found = long_runs.momenta(scene, x)
    assert np.allclose(found[0], linear, rtol=1e-9) and np.allclose(found[1], angular, rtol=1e-9)
    expected = rigid_body.kinetic_energy(parts, x[7:10], x[10:13], speed)
    assert long_runs.kinetic_energy(scene, x) == pytest.approx(expected, rel=1e-9)
