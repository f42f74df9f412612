"""Energy of an elastic turbine along runs: kept, or changed by the work of air, generator and dampers.

Energy and power are those of particles on their paths, the runs those of the plant as plain Python.
"""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from elastic_cases import BLADES, PINS, SPRING, SPRINGS, Case, put_loads, swinging
from fresh_python import fresh_python

from fowt_env.plant.advance import advance, forget
from fowt_env.plant.state import State

TORQUE = 2e4  # N m
DURATION, STEPS = 1.0, (40, 80)  # s
BENT = ("blades", "tower")


def energy_and_power(case, x, torque, drawn):
    """(total energy, energy of motion, power of generator, dampers and air) of a state."""
    now = case.at(x)
    twin, path, held = now.twin, now.path, 0.0
    for pin in PINS:
        held += 0.5 * SPRING * np.sum((twin.point(path, twin.on_platform, pin)[0] - pin) ** 2)
    kinetic = twin.kinetic(path)
    power = -twin.ratio * torque * path[6].first
    for q, beam in twin.parts_that_bend(path):
        rates = np.array([one.first for one in q])
        power -= rates @ beam.damping @ rates
    if twin.shaft is not None:
        power -= twin.shaft[1] * path[-1].first ** 2
    for b, load in enumerate([] if drawn is None else case.air(now, SimpleNamespace(drawn=drawn))):
        carry = twin.on_blade(b)
        R, velocity = twin.frame(path, carry)[0], twin.point(path, carry, np.zeros(3))[1]
        power += load.force @ R.T @ velocity + load.moment @ twin.motion(path, carry)[1]
        power += load.modal @ now.v[b]
    return float(np.squeeze(twin.potential(path).value) + held + kinetic), kinetic, float(np.squeeze(power))


def drift(case, steps, torque=0.0, drawn=None):
    """(largest change of energy beyond the work done, energy of swinging) of a run."""
    handle, x, dt = case.scene.handle(), swinging(case), DURATION / steps
    u = np.zeros(case.scene.n_commands)
    u[0], u[1:] = torque, [x[State.BLADE_PITCH], *x[case.blocks["other_blade_pitches"] :][:2]]
    found = [energy_and_power(case, x, torque, drawn)]
    forget(handle)
    for k in range(steps):
        assert advance(handle, x, u, k, 1, dt) == 0
        found.append(energy_and_power(case, x, torque, drawn))
    energy, kinetic, power = np.array(found).T
    # to the sixth order over every four steps
    weights = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) * 2.0 / 45.0 * dt
    work = np.cumsum([power[k : k + 5] @ weights for k in range(0, steps, 4)])
    return float(np.abs(energy[4::4] - energy[0] - work).max()), float(np.ptp(kinetic))


def drifts(working, shaft):
    """[drift] of runs with each of STEPS; working: with air, generator and dampers, or with none of them."""
    case = Case("iea15_volturnus_s", "modes2", "modes", shaft, wind=working, loads=SPRINGS, integrator="rk4")
    if not working:
        case.scene = case.scene.with_model(
            {f"{part}.beam.damping": 0.0 * getattr(case.scene.model, part).beam.damping for part in BENT}
        )
        case.beam, case.tower = (one._replace(damping=0.0 * one.damping) for one in (case.beam, case.tower))
        if case.shaft is not None:
            case.scene = case.scene.with_model({"shaft.damping": 0.0})
            case.shaft = case.shaft[0], 0.0
        return [drift(case, steps) for steps in STEPS]
    count = len(case.scene.model.aero.rotor.elements.radius)
    drawn = np.random.default_rng(4).normal(size=(BLADES, count, 3)) * [3e4, 5e3, 2e4]
    put_loads(drawn, np.zeros((BLADES, count, 4)))
    return [drift(case, steps, TORQUE, drawn) for steps in STEPS]


@pytest.mark.parametrize(
    ("working", "shaft", "small"),
    [
        pytest.param(False, "rigid", 1e-8, marks=pytest.mark.nightly),
        pytest.param(True, "rigid", 1e-7, marks=pytest.mark.nightly),
        (False, "torsion", 1e-5),
    ],
)
def test_energy_changes_by_the_work_alone_but_for_the_fourth_order_of_the_step(working, shaft, small):
    """The amplitude of a free oscillation even converges with one order more.

    A shaft swings within a few steps, as its powers do: their work would need finer sums.
    """
    code = f"import json, test_energy; print(json.dumps(test_energy.drifts({working}, {shaft!r})))"
    here = Path(__file__).parent
    found = json.loads(fresh_python(code, paths=(here, here.parents[1]), NUMBA_DISABLE_JIT="1"))
    coarse, fine = (error for error, _ in found)
    assert coarse < small * found[0][1]
    assert 3.9 < np.log2(coarse / fine) < 5.3
