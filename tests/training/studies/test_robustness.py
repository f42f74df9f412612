"""The stability study on small counts: what must not break whatever is asked of the plant, and what would."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from naive import rigid_body
from plant_helpers import rates
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from fowt_env.descriptions.units import RPM
from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError
from fowt_env.plant.advance import RUNNING, advance
from fowt_env.plant.hydro.linear_damping import LinearDamping
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.plant.state import N_RIGID, STATES, State
from fowt_env.scene.build import build_scene
from fowt_env.training.cli.app import app
from fowt_env.training.studies.robustness import (
    extremes,
    long_runs,
    random_cases,
    step_limits,
    study,
    without_compiler,
)

FOUND = Path(__file__).parents[2] / "reference" / "stability"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "integrator"),
    [
        (name, integrator)
        for name in ("full, look-up rotor", "idling feathered, 70 m/s, Hs 15 m", "platform fixed")
        for integrator in INTEGRATORS
    ]
    + [("full, rotor sampled thrice a step", "ab4")],
)
def test_default_step_keeps_a_factor_of_two_from_blow_up(name, integrator):
    kind = step_limits.LIMIT_SCENES[name]
    base = kind.scene()
    point = kind.point(base)
    fine, _ = step_limits.excursions(base, point, 0.025, 100.0)
    scene = random_cases.with_integrator(base, integrator, kind.rotor_samples)
    step = step_limits.MARGIN * INTEGRATORS[integrator].dt
    assert step_limits.stays(scene, point, fine, step, 100.0)


@pytest.mark.nightly
@pytest.mark.parametrize(
    "name",
    step_limits.LIMIT_SCENES,  # half a minute each
)
def test_default_step_keeps_a_factor_of_two_on_the_whole_map(name):
    table = step_limits.stability_map([name], duration=150.0)
    assert (table["margin"] >= step_limits.MARGIN).all()
    both = table[np.isfinite(table["measured_s"]) & np.isfinite(table["theory_s"])]
    assert (both["measured_s"] > 0.8 * both["theory_s"]).all()


NIGHTLY = pytest.mark.nightly  # `fowt dev benchmark stability --cases N` runs more
ALL = ("standard", "fast", "standard", "standard", "reference")


@pytest.mark.parametrize(
    ("count", "seed", "per_weather", "plants"),
    [
        (100, 11, 10, ("standard",)),
        pytest.param(200, 13, 10, (f"standard{random_cases.BENDS}",), marks=NIGHTLY),
        pytest.param(500, 12, random_cases.PER_WEATHER, ALL, marks=NIGHTLY),
    ],
    ids=["standard", "bending tower", "every fidelity"],
)
def test_random_scenes_and_states_stay_finite_and_bounded(count, seed, per_weather, plants):
    tally = random_cases.random_cases(count, seed, per_weather, plants=plants)
    assert tally.failures == [] and tally.unconverged == 0


@pytest.mark.parametrize("case", sorted(FOUND.glob("*.json")), ids=lambda path: path.stem)
def test_cases_that_once_broke_the_bounds_keep_them(case):
    assert random_cases.replay(case).failure == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if number % 4 == 0 or "lost" in name else NIGHTLY)
        for number, name in enumerate(extremes.EXTREMES)
    ],
)
def test_extremes_stay_finite(name):
    assert extremes.run_extreme(name)["finite"]


def test_idling_in_the_50_year_storm_does_not_depend_on_the_step():
    # the feathered blades damp the rotor so much that Adams-Bashforth alone blows up at its default step
    name = "50-year storm, wind from 0 deg off, idling"
    default, half = (extremes.run_extreme(name, finer=finer) for finer in (1, 2))
    for key in extremes.PEAKS:
        assert default[key] == pytest.approx(half[key], rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    "mode", ["residual", *(pytest.param(mode, marks=pytest.mark.nightly) for mode in ("direct", "setpoint"))]
)
def test_hostile_actions_leave_everything_finite_or_end_with_the_reason(mode):
    table = extremes.hostile(modes=(mode,), tasks=("above_rated",), steps=600)
    assert table["finite"].all()


@pytest.mark.parametrize("steps", [10_000, pytest.param(10_000_000, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_free_body_keeps_energy_and_momenta_at_the_default_step(integrator, steps):
    drift = long_runs.free_drift(integrator, steps)
    assert drift["status"] == RUNNING
    for key, most in study.DRIFT[integrator].items():
        assert drift[key] <= most


@pytest.mark.nightly
@pytest.mark.parametrize("integrator, most", study.FLOATING_DRIFT.items())
def test_undamped_floating_body_keeps_its_energy(integrator, most):
    # a tenth of the documented steps and of the change allowed over them
    drift = long_runs.floating_drift(integrator, 1_000_000)
    assert drift["status"] == RUNNING and drift["energy"] <= 0.1 * most


@pytest.mark.nightly
def test_memory_does_not_grow():
    assert long_runs.plant_memory(1_000_000)["growth_MB"] <= study.MEMORY_MB
    assert long_runs.environment_memory(50_000)["growth_MB"] <= study.MEMORY_MB


@pytest.mark.nightly
def test_every_integrator_converges_at_its_order():
    for integrator, order in long_runs.measured_orders().items():
        assert order >= INTEGRATORS[integrator].order - study.ORDER_SLACK


@pytest.mark.nightly
def test_euler_angles_of_a_tumbling_body_follow_a_quaternion_and_bodies_one_by_one(platform, turbine):
    scene = long_runs.free_scene()
    x = np.zeros(N_RIGID)
    x[3:6], x[10:13] = (0.5, 0.3, -1.0), (0.6, 0.02, 0.25)
    x[State.ROTOR_SPEED] = 1.2671
    zero = np.zeros(3)

    def rate(t, y):
        R = rigid_body.quaternion_rotation(y[:4])
        dv = rigid_body.accelerations(platform, turbine, R, y[4:7], y[7:10], y[10], zero, zero, 0.0, 0.0)
        return np.r_[rigid_body.quaternion_rate(y[:4], y[7:10]), dv]

    duration, dt = 20.0, INTEGRATORS["rk4"].dt
    y0 = np.r_[rigid_body.quaternion(*x[3:6]), x[7:14]]
    twin = solve_ivp(rate, (0.0, duration), y0, method="DOP853", rtol=1e-9, atol=1e-10)
    assert advance(scene.handle(), x, np.zeros(2), 0, round(duration / dt), dt) == RUNNING
    assert np.abs(x[3:6]).max() > 2.0 * np.pi
    R = rigid_body.quaternion_rotation(twin.y[:4, -1])
    assert np.abs(rigid_body.rotation(*x[3:6]) - R).max() < 1e-6


@pytest.mark.nightly
def test_without_the_compiler_a_scene_gives_the_same_numbers():
    jobs = without_compiler.jobs(
        {"still water": {}, "empty space": without_compiler.SCENES["empty space"]}, False
    )
    assert max(without_compiler.differences(jobs).values()) <= study.PLAIN


@pytest.mark.nightly
def test_without_the_compiler_every_scene_and_environment_gives_the_same_numbers():
    assert max(without_compiler.differences().values()) <= study.PLAIN


CALM = {"kind": "jonswap", "Hs": 3.0, "Tp": 9.0}


@pytest.fixture(scope="module")
def scene():
    return build_scene(wind=18.0, sea=CALM, fidelity="standard", duration=random_cases.WEATHER)


@pytest.fixture(scope="module")
def runner(scene):
    return random_cases.Runner(scene, scene.dt)


def system(decay=0.0, speeds=0.0, frequency=0.0):
    """Matrix of a linear model: all decay, the speeds drive nothing, or six oscillate; a slow blade pitch."""
    a = -decay * np.eye(len(STATES))
    a[6:13, 6:13] -= speeds * np.eye(7)  # the positions' Adams-Moulton step has no part in it
    if frequency:
        a[:6, 6:12], a[6:12, :6] = np.eye(6), -(frequency**2) * np.eye(6)
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
    options = {"per_weather": 6, "duration": 5.0, "plants": ("standard",)}
    first, second, other = (random_cases.random_cases(12, seed=seed, **options) for seed in (3, 3, 4))
    assert first.cases == 12 and first.weathers == 2
    assert np.array_equal(first.peak, second.peak) and not np.array_equal(first.peak, other.peak)


def test_drawn_weather_reaches_the_ends_of_the_range(turbine):
    rng = np.random.default_rng(1)
    winds = [random_cases.draw_wind(rng) for _ in range(400)]
    seas = [random_cases.draw_sea(rng) for _ in range(400)]
    states = np.array([random_cases.draw_state(rng, turbine) for _ in range(400)])
    assert {wind["kind"] for wind in winds} >= {"steady", "ntm", "etm", "ewm", "eog", "ecd", "edc", "ews"}
    assert max(wind.get("speed", 0.0) for wind in winds) > 65.0
    assert max(sea.get("Hs", 0.0) for sea in seas) > 16.0
    assert np.hypot(states[:, 0], states[:, 1]).max() > 28.0
    assert 28.0 < np.degrees(np.hypot(states[:, 3], states[:, 4])).max() <= 30.0
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
    handle, shape = still_scene.handle(), still_scene.model.hydro.strips.shape
    none = dict.fromkeys(("added_mass_coefficient", "drag_coefficient", "heave_added_mass"), 0.0)
    damping = still_scene.model.hydro.damping._replace(yaw_stiffness=0.0)
    plant = still_scene.with_model({"hydro.strips.shape": shape._replace(**none), "hydro.damping": damping})
    x, step, slope = np.zeros(N_RIGID), 1e-3, []
    x[:3] = 4.0, -2.0, 0.7
    for way in step * np.eye(N_RIGID)[:3]:
        high, low = (random_cases.potential_energy(handle, x + side * way) for side in (1, -1))
        slope.append((high - low) / (2.0 * step))
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
    *_, peaks, x = extremes.course(case, scene, scene.dt)
    assert x[State.BLADE_PITCH] == pytest.approx(scene.turbine.pitch_drive.maximum, abs=1e-6)
    assert x[State.ROTOR_SPEED] / RPM < 0.3 * peaks["rotor_rpm"]


def test_a_rotor_without_torque_and_pitch_runs_away_and_the_verdict_says_so(scene, monkeypatch):
    case = extremes.Extreme("grid loss", 18.0, CALM, fault="grid loss, no pitch action", duration=100.0)
    monkeypatch.setitem(extremes.EXTREMES, "runaway", case)
    row = extremes.run_extreme("runaway", scene=scene)
    assert row["finite"] and "overspeed" in row["verdict"]


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
    assert "`fowt dev benchmark stability --parts plain --seed 3`" in text
    assert "(report/plain_2.csv)" in text and "y39" not in text
    many = pd.read_csv(tmp_path / "report" / "plain_2.csv")
    assert list(many["a"]) == [f"y{n}" for n in range(40)] and (many["b"] == 2).all()
    with pytest.raises(InputError, match="unknown part"):
        study.study(tmp_path, ["maps"])


def test_replay_from_the_command_line_tells_the_outcome(scene, tmp_path):
    case = random_cases._case(scene, 18.0, CALM, 0, np.zeros(N_RIGID), [[0.0, 1.5]], 2.0)
    path = tmp_path / "case.json"
    path.write_text(json.dumps(case))
    done = CliRunner().invoke(app, ["dev", "benchmark", "stability", "--replay", str(path)])
    assert done.exit_code == 0 and "ran to its end" in done.output
    case["state"][State.VX] = float("nan")
    path.write_text(json.dumps(case))
    done = CliRunner().invoke(app, ["dev", "benchmark", "stability", "--replay", str(path)])
    assert done.exit_code == 1 and "non-finite" in done.output


def test_momenta_and_energy_are_those_of_the_bodies_one_by_one(platform, turbine):
    scene, x = long_runs.free_scene(), long_runs.free_start()
    parts, R, speed = rigid_body.bodies(platform, turbine), rigid_body.rotation(*x[3:6]), x[State.ROTOR_SPEED]
    expected = rigid_body.momenta(parts, x[:3], R, x[7:10], x[10:13], speed)
    for found, wanted in zip(long_runs.momenta(scene, x), expected, strict=True):
        assert np.allclose(found, wanted, rtol=1e-9)
    energy = rigid_body.kinetic_energy(parts, x[7:10], x[10:13], speed)
    assert long_runs.kinetic_energy(scene, x) == pytest.approx(energy, rel=1e-9)
