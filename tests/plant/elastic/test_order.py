"""Order of the default step of bending blades and tower, from an exact past; by runs in plain Python."""

import json
from pathlib import Path

import numpy as np
import pytest
from elastic_cases import BLADES, SPRINGS, Case, swinging
from fresh_python import fresh_python
from plant_helpers import rates

from fowt_env.plant.advance import advance, forget
from fowt_env.plant.dynamics import respond
from fowt_env.plant.elastic.in_phase import keep_twist
from fowt_env.plant.elastic.steps import begin_swing, keep_blades, keep_swing, swing_on
from fowt_env.plant.integrators import START_STEPS
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State

DURATION, FINE, STEPS = 1.0, 0.0025, (100, 200)
SOFT = 0.01  # stiffness of a shaft, over that of the turbine


def case_of(integrator, shaft):
    case = Case(
        "iea15_volturnus_s", "modes2", "modes2", shaft, wind=False, loads=SPRINGS, integrator=integrator
    )
    if shaft == "torsion":  # as soft as that of the NREL 5 MW, so that its swing is a part of the errors
        shaft = case.scene.model.shaft
        case.scene = case.scene.with_model(shaft=shaft._replace(stiffness=SOFT * shaft.stiffness))
    return case


def commands(x, case):
    pitches = x[case.blocks["other_blade_pitches"] :][: BLADES - 1]
    return np.array([0.0, x[State.BLADE_PITCH], *pitches])


def exact(case, times):
    """States at multiples of FINE."""
    x, handle, found, done = swinging(case), case.scene.handle(), [], 0
    u = commands(x, case)
    forget(handle)
    for time in times:
        step = round(time / FINE)
        assert advance(handle, x, u, done, step - done, FINE) == 0
        done = step
        found.append(x.copy())
    return found


def swung(case, start, steps):
    """State after steps, of which the first START_STEPS are given: (START_STEPS + 1, n_state)."""
    data, dt, u = case.scene.data(), DURATION / steps, commands(start[0], case)
    handle, model = case.scene.handle(data), case.scene.model
    for k, x in enumerate(start[:-1]):
        dx = rates(case.scene, x, u, k * dt, handle)
        begin_swing(
            k, x, model.rigid_body, model.tower, model.blades, data.matrix, data.rotor, data.stages[2]
        )
        keep_blades(x, model.blades, data.elastic)
        keep_twist(x, model.blades, model.shaft, data.elastic, data.rotor, dx)
        keep_swing(x, model.tower, model.blades, model.shaft, data.rotor, dx)
        data.history[START_STEPS - 1 - k] = dx
    forget(handle)
    data.cache[LoadCache.STEPS] = START_STEPS
    x = start[-1].copy()
    assert advance(handle, x, u, START_STEPS, steps - START_STEPS, dt) == 0
    return x


def errors(integrator, shaft):
    """Of an integrator, of all velocities, blades and twist, with each of STEPS."""
    fine, coarse = case_of("rk4", shaft), case_of(integrator, shaft)
    end, found = exact(fine, [DURATION])[0], []
    for steps in STEPS:
        start = exact(fine, [k * DURATION / steps for k in range(START_STEPS + 1)])
        found.append(float(np.linalg.norm((swung(coarse, start, steps) - end)[State.VX : -2])))
    return found


@pytest.mark.parametrize(
    ("integrator", "shaft"),
    [
        pytest.param("ab4", "rigid", marks=pytest.mark.nightly),
        ("ab4", "torsion"),
        pytest.param("abm4", "torsion", marks=pytest.mark.nightly),
    ],
)
def test_it_converges_with_order_four(integrator, shaft):
    code = f"import json, test_order; print(json.dumps(test_order.errors({integrator!r}, {shaft!r})))"
    here = Path(__file__).parent
    found = json.loads(fresh_python(code, paths=(here, here.parents[1]), NUMBA_DISABLE_JIT="1"))
    assert np.log2(found[0] / found[1]) == pytest.approx(4.0, abs=0.35)


def not_by_the_tower():
    """Share of a step's correction for the tower that no force on the tower alone explains."""
    case, rng = Case("iea15_volturnus_s", "modes", "modes2", wind=False), np.random.default_rng(6)
    model, data, x = case.scene.model, case.scene.data(), case.random(rng)
    still, extra = np.zeros((2, len(x)))
    u, tower, work = commands(x, case), model.tower, data.rotor
    rates(case.scene, x, u, 0.0, case.scene.handle(data))
    n, moving = len(tower.beam.count), slice(State.VX, None)
    answers = np.zeros((1 + n, len(x)))
    for i, answer in enumerate(answers):
        data.cache[LoadCache.MODAL + i - 1] += 1e6 * (i > 0)
        respond(x, u, model, data, answer)
    begin_swing(0, x, model.rigid_body, tower, model.blades, data.matrix, work, still)
    y, history = x.copy(), rng.normal(size=(4, len(x)))
    swing_on(
        0.05, x, 4, history, model.rigid_body, tower, model.blades, model.shaft, data.matrix, work, still,
        extra, y,
    )  # fmt: skip
    places = tower.first + np.arange(n)
    change, pushed = y - x, np.diff(answers, axis=0)
    change[places] = 0.0
    by_tower = np.linalg.lstsq(pushed[:, moving].T, change[moving], rcond=None)[0] @ pushed
    return float(np.linalg.norm((change - by_tower)[moving]) / np.linalg.norm(change[moving]))


def test_a_step_moves_platform_and_blades_as_a_force_on_the_tower_does():
    """The momentum of the whole turbine is then kept, however far the tower is bent."""
    code = "import json, test_order; print(json.dumps(test_order.not_by_the_tower()))"
    here = Path(__file__).parent
    assert json.loads(fresh_python(code, paths=(here, here.parents[1]), NUMBA_DISABLE_JIT="1")) < 1e-9
