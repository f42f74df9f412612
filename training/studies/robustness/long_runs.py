"""Long runs: invariants and memory over millions of steps, order of the integrators, quaternion attitude."""

import resource
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fowt_env.envs import FowtEnv
from fowt_env.plant.advance import RUNNING, advance, forget, observe
from fowt_env.plant.integrators import INTEGRATORS, START_STEPS, Adams
from fowt_env.plant.measurement import N_MEASUREMENTS
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import N_COMMANDS, N_RIGID, State
from fowt_env.run.initial_conditions import initial_state
from fowt_env.scene.build import build_scene
from fowt_env.training.studies.robustness.random_cases import (
    Runner,
    platform_energy,
    potential_energy,
    with_integrator,
)

CHUNK = 100_000  # steps between looks at the invariants
WEATHER_SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}


def free_scene():
    """Return the turbine in empty space without weight and without losses in the shaft."""
    scene = build_scene(hydrodynamics=False, mooring=False, fidelity="reference")
    model = scene.model
    shaft = model.drivetrain._replace(bearing_loss_coefficient=0.0, mesh_loss=0.0)
    return scene.with_model(rigid_body=model.rigid_body._replace(gravity=0.0), drivetrain=shaft)


def floating_scene():
    """Return the turbine afloat on its lines in still water without drag, damping and fluid inertia."""
    scene = build_scene(fidelity="reference")
    model = scene.model
    shape = model.hydro.strips.shape._replace(
        added_mass_coefficient=0.0, drag_coefficient=0.0, heave_added_mass=0.0
    )
    damping = type(model.hydro.damping)(*(0.0,) * len(model.hydro.damping))
    shaft = model.drivetrain._replace(bearing_loss_coefficient=0.0, mesh_loss=0.0)
    return scene.with_model({"hydro.strips.shape": shape, "hydro.damping": damping, "drivetrain": shaft})


def free_start():
    """Return the state (N_RIGID,) of a body that drifts and nutates, its pitch off the singular 90 deg."""
    x = np.zeros(N_RIGID)
    x[3:6] = 0.2, -0.15, 0.4
    x[7:10] = 0.1, 0.05, -0.08
    x[10:13] = 0.01, 0.004, 0.006
    x[State.ROTOR_SPEED] = 1.2671
    return x


def kinetic_energy(scene, x):
    """Return the kinetic energy of platform and rotor, J."""
    body, speed = scene.model.rigid_body, x[State.ROTOR_SPEED]
    spin = 0.5 * body.rotor_row * speed**2 + body.coupling * speed * x[State.WX]
    return platform_energy(x, body.mass_matrix) + spin


def rotation(x):
    """Return the rotation of the platform, body to inertial axes."""
    return Rotation.from_euler("ZYX", [x[State.YAW], x[State.PLATFORM_PITCH], x[State.ROLL]])


def momenta(scene, x):
    """Return (linear, angular about the origin) momentum of the turbine, inertial axes, (3,) each."""
    body, turn = scene.model.rigid_body, rotation(x)
    body_momentum = body.mass_matrix @ x[7:13]
    body_momentum[3] += body.coupling * x[State.ROTOR_SPEED]
    linear = turn.apply(body_momentum[:3])
    return linear, np.cross(x[:3], linear) + turn.apply(body_momentum[3:])


def own_momenta(scene, x):
    """Return (linear, angular about the centre of mass) momentum, inertial axes: constant in free flight."""
    linear, angular = momenta(scene, x)
    body = scene.model.rigid_body
    centre = x[:3] + rotation(x).apply([body.s_x / body.mass, 0.0, body.s_z / body.mass])
    return linear, angular - np.cross(centre, linear)


def free_drift(integrator, steps, dt=None, progress=None):
    """Return {energy, linear, angular: largest relative change; status, steps} of the free body."""
    scene, x = free_scene(), free_start()
    energy0, momenta0 = kinetic_energy(scene, x), own_momenta(scene, x)

    def changes(handle, x):
        found = [abs(kinetic_energy(scene, x) / energy0 - 1.0)]
        for vector, first in zip(own_momenta(scene, x), momenta0, strict=True):
            found.append(float(np.linalg.norm(vector - first) / np.linalg.norm(first)))
        return dict(zip(("energy", "linear", "angular"), found, strict=True))

    handle = with_integrator(scene, integrator).handle()
    return _drift(changes, handle, x, integrator, steps, dt, "free body", progress)


def floating_drift(integrator, steps, dt=None, progress=None):
    """Return {energy: largest change over that of the motion; status, steps} of the undamped floating body.

    The energy of the motion is kinetic (without the rotor's spin) and potential energy above rest.
    """
    scene, x = floating_scene(), np.zeros(N_RIGID)
    x[:6], x[State.ROTOR_SPEED] = (5.0, 2.0, 0.5, 0.02, 0.06, 0.03), 1.2671  # set free at an offset
    handle = with_integrator(scene, integrator).handle()
    start = kinetic_energy(scene, x) + potential_energy(handle, x)
    moving = potential_energy(handle, x) - potential_energy(handle, np.zeros(N_RIGID))

    def changes(handle, x):
        now = kinetic_energy(scene, x) + potential_energy(handle, x)
        return {"energy": abs(now - start) / moving}

    return _drift(changes, handle, x, integrator, steps, dt, "floating body", progress)


def _drift(changes, handle, x, integrator, steps, dt, words, progress):
    """Advance a body by so many steps; return {name: largest of changes(handle, x); status, steps}."""
    dt = INTEGRATORS[integrator].dt if dt is None else dt
    u, largest, status, done = np.zeros(N_COMMANDS), {}, RUNNING, 0
    forget(handle)
    while done < steps and status == RUNNING:
        n = min(CHUNK, steps - done)
        status = advance(handle, x, u, done, n, dt)
        done += n
        for name, change in changes(handle, x).items():
            largest[name] = max(largest.get(name, 0.0), change)
        if progress is not None:
            progress(f"{words}, {integrator}", done, steps)
    return largest | {"status": int(status), "steps": done}


def resident():
    """Return the resident memory of this process, MB, or its largest so far where that is all there is."""
    statm = Path("/proc/self/statm")
    if statm.is_file():
        return int(statm.read_text().split()[1]) * resource.getpagesize() / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)


def plant_memory(steps, progress=None):
    """Return {growth_MB, status, steps}: memory of the full plant after all steps less after a tenth."""
    scene = build_scene(
        wind={"kind": "ntm", "speed": 18.0, "class": "B"}, sea=WEATHER_SEA, fidelity="standard", seed=1
    )
    runner = Runner(scene, scene.dt)
    x = np.zeros(scene.n_state)
    x[State.ROTOR_SPEED], x[State.BLADE_PITCH] = 1.2671, 0.26
    chunk = min(6000, max(1, steps // 10))  # a run of ten minutes under the PI, again and again
    done, first, status = 0, None, RUNNING
    while done < steps and status == RUNNING:
        status = runner.run(x, [], chunk * scene.dt).status
        done += chunk
        if first is None and done >= steps // 10:
            first = resident()
        if progress is not None:
            progress("memory of the plant", done, steps)
    return {"growth_MB": resident() - first, "status": int(status), "steps": done}


def environment_memory(steps, progress=None):
    """Return {growth_MB, steps, resets} of an environment with episodes of 20 s, likewise."""
    env = FowtEnv(duration=20.0)
    env.reset(seed=0)
    first, resets = None, 0
    for step in range(steps):
        _, _, terminated, truncated, _ = env.step(np.zeros(N_COMMANDS))
        if terminated or truncated:
            env.reset()
            resets += 1
        if step == steps // 10:
            first = resident()
        if progress is not None and step % 1000 == 0:
            progress("memory of the environment", step, steps)
    return {"growth_MB": resident() - first, "steps": steps, "resets": resets}


def measured_orders(duration=20.0, steps=(0.1, 0.05, 0.025), finest=0.003125):
    """Return {integrator: order of convergence} in a regular wave, from the error at the two smallest steps.

    Without drag, whose |u| u is not smooth where the flow turns. The Adams methods get the derivatives of
    their first three steps from the fine run: their own starting steps are of lower order, which leaves
    an error of third order that would hide the method's.
    """
    base = build_scene(sea={"kind": "regular", "H": 6.0, "T": 8.0}, fidelity="reference")
    base = base.with_model({"hydro.strips.shape.drag_coefficient": 0.0})
    x0, u = initial_state(base)
    rows = np.r_[0:6, 7:13]
    exact_scene = with_integrator(base, "rk4")

    def advanced(scene, steps, dt):
        x, handle = x0.copy(), scene.handle()
        forget(handle)
        advance(handle, x, u, 0, steps, dt)
        return x

    def exact(time):
        return advanced(exact_scene, round(time / finest), finest)

    def end(name, dt):
        scene = with_integrator(base, name)
        if not isinstance(scene.model.integrator, Adams):
            return advanced(scene, round(duration / dt), dt)[rows]
        data = scene.data()
        handle, unread = scene.handle(data), np.zeros(N_MEASUREMENTS)
        for k in range(START_STEPS):
            forget(handle)
            observe(handle, exact(k * dt), u, k * dt, data.history[START_STEPS - 1 - k], unread)
        forget(handle)
        data.cache[LoadCache.STEPS] = START_STEPS
        x = exact(START_STEPS * dt)
        advance(handle, x, u, START_STEPS, round(duration / dt) - START_STEPS, dt)
        return x[rows]

    last = exact(duration)[rows]
    found = {}
    for name in INTEGRATORS:
        errors = np.array([np.linalg.norm(end(name, dt) - last) for dt in steps])
        found[name] = float(np.log2(errors[-2] / errors[-1]))
    return found


def quaternion_difference(duration=60.0, integrator="rk4", dt=None):
    """Return (largest difference of rotation matrices, rad turned): Euler angles against a quaternion.

    A body tumbling in free space by the plant's own step, and its twin whose attitude is a quaternion
    integrated by an eighth-order method; body rates come from the plant's equation of motion in both.
    """
    scene = with_integrator(free_scene(), integrator)
    dt = INTEGRATORS[integrator].dt if dt is None else dt
    x = np.zeros(N_RIGID)
    x[3:6], x[10:13] = (0.5, 0.3, -1.0), (0.6, 0.02, 0.25)
    x[State.ROTOR_SPEED] = 1.2671
    handle, u = scene.handle(), np.zeros(N_COMMANDS)
    dx, measurement = np.zeros(N_RIGID), np.zeros(N_MEASUREMENTS)

    def rate(t, y):
        state = np.zeros(N_RIGID)
        turn = Rotation.from_quat(y[:4])
        state[5], state[4], state[3] = turn.as_euler("ZYX")
        state[7:13], state[State.ROTOR_SPEED] = y[4:10], y[10]
        forget(handle)
        observe(handle, state, u, 0.0, dx, measurement)
        a, w = y[:4], y[7:10]
        spin = np.r_[a[3] * w + np.cross(a[:3], w), -a[:3] @ w]  # q (0, w), scalar last
        return np.r_[0.5 * spin, dx[7:13], dx[State.ROTOR_SPEED]]

    times = np.linspace(0.0, duration, 61)
    y0 = np.r_[rotation(x).as_quat(), x[7:13], x[State.ROTOR_SPEED]]
    twin = solve_ivp(rate, (0.0, duration), y0, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times)
    own = scene.handle()
    forget(own)
    worst, turned, step = 0.0, 0.0, 0
    for i, time in enumerate(times):
        n = round(time / dt) - step
        if advance(own, x, u, step, n, dt) != RUNNING:
            return float("inf"), turned
        step += n
        difference = rotation(x).as_matrix() - Rotation.from_quat(twin.y[:4, i]).as_matrix()
        worst = max(worst, float(np.abs(difference).max()))
        turned = max(turned, float(np.abs(x[3:6]).max()))
    return worst, turned
