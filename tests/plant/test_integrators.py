"""Each row of INTEGRATORS against what the compiled step does, and that a new one is a row."""

from pathlib import Path

import numpy as np
import pytest
from fresh_python import fresh_python
from plant_helpers import integrate, state

from fowt_env import Force, Load, Motion, build_scene, linearize, load_kernel, simulate
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.adams import bashforth, moulton
from fowt_env.plant.advance import RUNNING, advance, forget, observe
from fowt_env.plant.integrators import INTEGRATORS, START_STEPS, build_integrator
from fowt_env.plant.measurement import N_MEASUREMENTS
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import STATES, State

MASS = 1e6  # kg, of the body under the spring
OSCILLATIONS = [name for name, method in INTEGRATORS.items() if method.oscillation_limit]
NO_OSCILLATIONS = [name for name in INTEGRATORS if name not in OSCILLATIONS]


@load_kernel
def spring(parameters, motion, force):
    """A spring that stiffens and a damper on surge, sway and heave."""
    for i in range(3):
        place = motion[Motion.X + i]
        pull = parameters[0] * place + parameters[1] * place * place * place
        force[Force.FX + i] = -pull - parameters[2] * motion[Motion.VX + i]


def free_body(integrator, stiffness, stiffening=0.0, damping=0.0):
    """A weightless body in empty space on that spring alone."""
    load = Load("Spring", spring, [stiffness, stiffening, damping])
    scene = build_scene(hydrodynamics=False, mooring=False, loads=[load], fidelity="reference")
    return scene.with_model(
        rigid_body=scene.model.rigid_body._replace(gravity=0.0), integrator=build_integrator(integrator)
    )


def mode(integrator, stiffness, damping):
    """A point mass whose surge has this stiffness (1/s2) and damping (1/s) over its mass."""
    scene = free_body(integrator, MASS * stiffness, damping=MASS * damping)
    body = scene.model.rigid_body
    matrix = np.diag([MASS, MASS, MASS, 1e9, 1e9, 1e9])
    return scene.with_model(rigid_body=body._replace(mass_matrix=matrix, mass=MASS, s_x=0.0, s_z=0.0))


def grows(scene, dt, steps):
    """Whether a disturbance in surge is larger than at the beginning at the end of so many steps."""
    x = state(surge=1e-6, vx=1e-6)
    status = advance(scene.handle(), x, np.zeros(2), 0, steps, dt)
    return status != RUNNING or max(abs(x[State.SURGE]), abs(x[State.VX])) > 1e-4


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.nightly) if name in ("heun", "abm4") else name
        for name in INTEGRATORS
    ],
)
def test_it_converges_at_its_order(name):
    scene = free_body(name, 4e6, 1e5, 1e5)
    x0 = state(surge=2.0, sway=-1.0, roll=0.2, yaw=0.4, vx=1.0, wy=0.03, rotor_speed=1.2671)
    duration, u = 8.0, np.zeros(2)
    end = integrate(scene, x0, duration, samples=2)[1][-1]

    def error(dt):
        # a multistep method is given its past: its own first steps are of lower order and would hide it
        _, start = integrate(scene, x0, START_STEPS * dt, samples=START_STEPS + 1)
        data = scene.data()
        handle = scene.handle(data)
        for k in range(START_STEPS):
            forget(handle)
            rates = data.history[START_STEPS - 1 - k]
            observe(handle, start[k], u, k * dt, rates, np.zeros(N_MEASUREMENTS))
        forget(handle)
        data.cache[LoadCache.STEPS] = START_STEPS
        x = start[-1].copy()
        assert advance(handle, x, u, START_STEPS, round(duration / dt) - START_STEPS, dt) == RUNNING
        return np.linalg.norm((x - end)[:13])

    order = np.log2(error(0.05) / error(0.025))
    assert order == pytest.approx(INTEGRATORS[name].order, abs=0.35)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_decay_is_stable_below_its_limit_and_not_above(name):
    scene, limit = mode(name, 0.0, 1.0), INTEGRATORS[name].decay_limit
    assert not grows(scene, 0.98 * limit, 3000)
    assert grows(scene, 1.02 * limit, 3000)


@pytest.mark.parametrize("name", OSCILLATIONS)
def test_an_oscillation_is_stable_below_its_limit_and_not_above(name):
    scene, limit = mode(name, 1.0, 0.0), INTEGRATORS[name].oscillation_limit
    assert not grows(scene, 0.98 * limit, 3000)
    assert not grows(scene, 0.3 * limit, 3000)
    assert grows(scene, 1.02 * limit, 3000)


@pytest.mark.parametrize("name", NO_OSCILLATIONS)
def test_an_oscillation_grows_at_any_step_where_there_is_no_limit(name):
    assert grows(mode(name, 1.0, 0.0), 0.3, 200_000)


@pytest.fixture(scope="module")
def stiffest():
    """Largest rate (1/s) of a mode of the turbine in operation, the blade pitch left out: it is exact."""
    model = linearize(build_scene(wind=18.0, fidelity="standard"))
    kept = [i for i, name in enumerate(STATES) if name != "blade_pitch"]
    return np.abs(np.linalg.eigvals(model.A[np.ix_(kept, kept)])).max()


@pytest.mark.parametrize("name", INTEGRATORS)
def test_its_default_step_is_within_half_its_limit_in_operation(name, stiffest):
    assert 0.3 < stiffest < 2.0
    assert 2.0 * INTEGRATORS[name].dt * stiffest < INTEGRATORS[name].decay_limit


COUNT = """
import numpy as np
from plant_helpers import state
from fowt_env import build_scene
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.plant.advance import RUNNING, advance

for name in INTEGRATORS:
    counted = []
    for steps in (4, 14):
        scene = build_scene(integrator=name, fidelity="reference")
        data = scene.data()
        x = state(heave=-60.0)  # under water, where each evaluation is counted
        assert advance(scene.handle(data), x, np.zeros(2), 0, steps, 0.01) == RUNNING
        counted.append(data.counters.sum())
    assert counted[1] - counted[0] == 10 * INTEGRATORS[name].evaluations, name
"""


def test_loads_are_evaluated_as_often_as_it_says():
    """As plain Python: a scene of each integrator is a kind of its own."""
    fresh_python(COUNT, paths=[Path(__file__).parents[1]], NUMBA_DISABLE_JIT="1")


ROWS = """
import numpy as np
from fowt_env import build_scene
from fowt_env.plant.advance import advance, forget, observe, output
from fowt_env.plant.state import State

for integrator in ("ab4", "rk4"):
    scene, ends = build_scene(integrator=integrator, fidelity="reference", shaft="torsion"), []
    for look, width in ((observe, scene.n_measurements), (output, len(scene.channels))):
        handle, x, u = scene.handle(), np.zeros(scene.n_state), np.array([2e4, 0.1])
        x[[State.ROTOR_SPEED, State.VX]] = 1.0, 0.3
        forget(handle)
        for k in range(8):
            look(handle, x, u, 0.01 * k, np.zeros_like(x), np.zeros(width))
            if k == 4:  # a look at what another command would do
                observe(handle, x, 2.0 * u, 0.04, np.zeros_like(x), np.zeros(scene.n_measurements))
            u[0] += 1e3 * (k == 3)
            x[State.ROTOR_SPEED] += 0.01 * (k == 5)
            advance(handle, x, u, k, 1, 0.01)
        ends.append(x)
    assert np.array_equal(*ends), integrator
    assert ends[0][State.VX] != 0.3

scene, rates = build_scene(sea={"kind": "regular", "H": 4.0, "T": 10.0}, fidelity="reference"), []
for times in ((0.0, 4.0), (4.0,)):
    handle, x, u, dx = scene.handle(), np.zeros(scene.n_state), np.zeros(2), np.zeros(scene.n_state)
    forget(handle)
    for time in times:
        output(handle, x, u, time, dx, np.zeros(len(scene.channels)))
    rates.append(dx)
assert np.allclose(*rates, rtol=1e-9) and rates[0].any()  # the lines start from their last solution
"""


def test_a_step_after_a_row_counts_what_the_row_does_not_know():
    """A step takes over the rates of the row where it begins, not under another command, state or time."""
    fresh_python(ROWS, paths=[Path(__file__).parents[1]], NUMBA_DISABLE_JIT="1")


@pytest.mark.parametrize("name", ["ab4", pytest.param("abm4", marks=pytest.mark.nightly)])
def test_a_blade_pitch_that_jumps_to_its_command_leaves_the_step_its_accuracy(name):
    """Without lag each command is a jump, through which no polynomial over past derivatives goes."""
    turbine = read_turbine("nrel5mw")
    drive = turbine.pitch_drive.model_copy(update={"time_constant": 0.0})
    scene = build_scene(
        wind={"kind": "ntm", "speed": 18.0, "class": "B"}, seed=2, duration=60.0, fidelity="standard",
        turbine=turbine.model_copy(update={"pitch_drive": drive}), integrator=name,
    )  # fmt: skip
    whole, fine = (simulate(scene, "pi", duration=60.0, dt=dt, output_dt=0.5) for dt in (0.1, 0.0125))
    for channel in ("RotSpeed_[rpm]", "PtfmPitch_[deg]", "PtfmSurge_[m]"):
        error = np.sqrt(np.mean((whole[channel] - fine[channel]) ** 2)) / fine[channel].std()
        assert error < 4e-4  # else 2e-3 to 4e-3 under the plain method and 6e-4 to 9e-4 under the corrected


@pytest.mark.parametrize("order", (1, 2, 3, 4))
def test_the_multistep_formulas_are_exact_for_polynomials_of_their_order(order):
    for power in range(5):
        history = np.array([[float((-k) ** power)] for k in range(4)])  # of t^power at t = 0, -1, -2, -3
        exact = 1.0 / (power + 1.0)  # its integral from 0 to 1
        assert (abs(bashforth(order, 0, history) - exact) < 1e-12) == (power < order)
        assert (abs(moulton(order, 1.0, 0, history) - exact) < 1e-12) == (power <= min(order, 3))
