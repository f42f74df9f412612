"""What must not break whatever is asked of the plant; `fowt benchmark stability` has the full counts."""

from pathlib import Path

import numpy as np
import pytest
from naive import rigid_body
from scipy.integrate import solve_ivp

from fowt_env.plant.advance import RUNNING, advance
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.plant.state import N_RIGID, State
from fowt_env.training.studies.robustness import (
    extremes,
    long_runs,
    random_cases,
    step_limits,
    study,
    without_compiler,
)

FOUND = Path(__file__).parents[2] / "reference" / "stability"


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


EACH_PUSH = ("full, look-up rotor",)  # of the map's scenes, which take half a minute each


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        name if name in EACH_PUSH else pytest.param(name, marks=pytest.mark.nightly)
        for name in step_limits.LIMIT_SCENES
    ],
)
def test_default_step_keeps_a_factor_of_two_on_the_whole_map(name):
    table = step_limits.stability_map([name], duration=150.0)
    assert (table["margin"] >= step_limits.MARGIN).all()
    both = table[np.isfinite(table["measured_s"]) & np.isfinite(table["theory_s"])]
    assert (both["measured_s"] > 0.8 * both["theory_s"]).all()


NIGHTLY = [pytest.mark.slow, pytest.mark.nightly]


@pytest.mark.parametrize(
    ("count", "settings"),
    [
        (100, {"seed": 11, "per_weather": 10, "plants": ("standard",)}),
        pytest.param(
            200, {"seed": 13, "per_weather": 10, "plants": (f"standard{random_cases.BENDS}",)}, marks=NIGHTLY
        ),
        # `fowt benchmark stability --cases N` runs more
        pytest.param(
            500,
            {"seed": 12, "plants": ("standard", "fast", "standard", "standard", "reference")},
            marks=NIGHTLY,
        ),
    ],
    ids=["standard", "bending tower", "every fidelity"],
)
def test_random_scenes_and_states_stay_finite_and_bounded(count, settings):
    tally = random_cases.random_cases(count, **settings)
    assert tally.failures == [] and tally.unconverged == 0


@pytest.mark.parametrize("case", sorted(FOUND.glob("*.json")), ids=lambda path: path.stem)
def test_cases_that_once_broke_the_bounds_keep_them(case):
    assert random_cases.replay(case).failure == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", extremes.EXTREMES)
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


@pytest.mark.parametrize(
    "steps", [10_000, pytest.param(10_000_000, marks=(pytest.mark.slow, pytest.mark.nightly))]
)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_free_body_keeps_energy_and_momenta_at_the_default_step(integrator, steps):
    drift = long_runs.free_drift(integrator, steps)
    assert drift["status"] == RUNNING
    for key, most in study.DRIFT[integrator].items():
        assert drift[key] <= most


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("integrator, most", study.FLOATING_DRIFT.items())
def test_undamped_floating_body_keeps_its_energy(integrator, most):
    # a tenth of the documented steps and of the change allowed over them
    drift = long_runs.floating_drift(integrator, 1_000_000)
    assert drift["status"] == RUNNING and drift["energy"] <= 0.1 * most


@pytest.mark.slow
@pytest.mark.nightly
def test_memory_does_not_grow():
    assert long_runs.plant_memory(1_000_000)["growth_MB"] <= study.MEMORY_MB
    assert long_runs.environment_memory(50_000)["growth_MB"] <= study.MEMORY_MB


@pytest.mark.slow
@pytest.mark.nightly
def test_every_integrator_converges_at_its_order():
    for integrator, order in long_runs.measured_orders().items():
        assert order >= INTEGRATORS[integrator].order - study.ORDER_SLACK


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


def test_without_the_compiler_a_scene_gives_the_same_numbers():
    jobs = without_compiler.jobs(
        {"still water": {}, "empty space": without_compiler.SCENES["empty space"]}, False
    )
    assert max(without_compiler.differences(jobs).values()) <= study.PLAIN


@pytest.mark.slow
@pytest.mark.nightly
def test_without_the_compiler_every_scene_and_environment_gives_the_same_numbers():
    assert max(without_compiler.differences().values()) <= study.PLAIN
