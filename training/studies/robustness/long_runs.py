"""Measures invariants and memory over millions of steps, orders of integrators, and attitude errors."""

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
from fowt_env.training.benchmarks.speed import silent
from fowt_env.training.studies.robustness.random_cases import (
    Runner,
    platform_energy,
    potential_energy,
    with_integrator,
)

CHUNK = 100_000  # steps between evaluations of the invariants
WEATHER_SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}


def _lossless(scene, **changes):
    shaft = scene.model.drivetrain._replace(bearing_loss_coefficient=0.0, mesh_loss=0.0)
    return scene.with_model({"drivetrain": shaft} | changes)


def free_scene():
    """Return the scene of the turbine in empty space, without gravity and shaft losses."""
    scene = build_scene(hydrodynamics=False, mooring=False, fidelity="reference")
    return _lossless(scene, **{"rigid_body.gravity": 0.0})


def floating_scene():
    """Return the scene of the moored turbine in still water, without drag, damping and added mass."""
    scene = build_scene(fidelity="reference")
    hydro, inert = scene.model.hydro, ("added_mass_coefficient", "drag_coefficient", "heave_added_mass")
    damping = type(hydro.damping)(*(0.0,) * len(hydro.damping))
    shape = hydro.strips.shape._replace(**dict.fromkeys(inert, 0.0))
    return _lossless(scene, **{"hydro.strips.shape": shape, "hydro.damping": damping})


def kinetic_energy(scene, x):
    """Return the kinetic energy (J) of platform and rotor."""
    body, speed = scene.model.rigid_body, x[State.ROTOR_SPEED]
    spin = 0.5 * body.rotor_row * speed**2 + body.coupling * speed * x[State.WX]
    return platform_energy(x, body.mass_matrix) + spin


def rotation(x):
    """Return the Rotation of the platform from body to inertial axes."""
    return Rotation.from_euler("ZYX", [x[State.YAW], x[State.PLATFORM_PITCH], x[State.ROLL]])


def momenta(scene, x, own=False):
    """Return (linear, angular) momentum of the turbine, inertial axes, (3,) each, angular about the origin.

    own: angular momentum about the centre of mass, which is conserved in free flight.
    """
    body, turn = scene.model.rigid_body, rotation(x)
    body_momentum = body.mass_matrix @ x[7:13]
    body_momentum[3] += body.coupling * x[State.ROTOR_SPEED]
    linear = turn.apply(body_momentum[:3])
    angular = np.cross(x[:3], linear) + turn.apply(body_momentum[3:])
    if own:
        centre = x[:3] + turn.apply([body.s_x / body.mass, 0.0, body.s_z / body.mass])
        angular -= np.cross(centre, linear)
    return linear, angular


def free_start():
    """Return the state (N_RIGID,) of a drifting, nutating body away from the singular pitch of 90 deg."""
    x = np.zeros(N_RIGID)
    x[3:6], x[7:10], x[10:13] = (0.2, -0.15, 0.4), (0.1, 0.05, -0.08), (0.01, 0.004, 0.006)
    x[State.ROTOR_SPEED] = 1.2671
    return x


def free_drift(integrator, steps, progress=silent):
    """Return {energy, linear, angular: largest relative change; status, steps} of the free body."""
    scene, x = free_scene(), free_start()
    energy0, momenta0 = kinetic_energy(scene, x), momenta(scene, x, own=True)

    def changes(handle, x):
        pairs = zip(momenta(scene, x, own=True), momenta0, strict=True)
        linear, angular = (float(np.linalg.norm(now - was) / np.linalg.norm(was)) for now, was in pairs)
        energy = abs(kinetic_energy(scene, x) / energy0 - 1.0)
        return {"energy": energy, "linear": linear, "angular": angular}

    handle = with_integrator(scene, integrator).handle()
    return _drift(changes, handle, x, integrator, steps, "free body", progress)


def floating_drift(integrator, steps, progress=silent):
    """Return {energy: largest change over the energy of motion; status, steps} of the floating body."""
    scene, x = floating_scene(), np.zeros(N_RIGID)
    x[:6], x[State.ROTOR_SPEED] = (5.0, 2.0, 0.5, 0.02, 0.06, 0.03), 1.2671  # released at an offset
    handle = with_integrator(scene, integrator).handle()
    start = kinetic_energy(scene, x) + potential_energy(handle, x)
    moving = potential_energy(handle, x) - potential_energy(handle, np.zeros(N_RIGID))

    def changes(handle, x):
        return {"energy": abs(kinetic_energy(scene, x) + potential_energy(handle, x) - start) / moving}

    return _drift(changes, handle, x, integrator, steps, "floating body", progress)


def _drift(changes, handle, x, integrator, steps, words, progress):
    """Advance a body by steps; return {name: largest of changes(handle, x); status, steps}."""
    u, largest, status, done = np.zeros(N_COMMANDS), {}, RUNNING, 0
    forget(handle)
    while done < steps and status == RUNNING:
        n = min(CHUNK, steps - done)
        status = advance(handle, x, u, done, n, INTEGRATORS[integrator].dt)
        done += n
        largest = {name: max(largest.get(name, 0.0), now) for name, now in changes(handle, x).items()}
        progress(f"{words}, {integrator}", done, steps)
    return largest | {"status": int(status), "steps": done}


def resident():
    """Return the resident memory of this process, MB; without /proc its peak so far."""
    statm = Path("/proc/self/statm")
    if statm.is_file():
        return int(statm.read_text().split()[1]) * resource.getpagesize() / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)


def plant_memory(steps, progress=silent):
    """Return {growth_MB, status, steps}: memory growth of the plant after the first tenth of the steps."""
    wind = {"kind": "ntm", "speed": 18.0, "class": "B"}
    scene = build_scene(wind=wind, sea=WEATHER_SEA, fidelity="standard", seed=1)
    runner, x = Runner(scene, scene.dt), np.zeros(scene.n_state)
    x[State.ROTOR_SPEED], x[State.BLADE_PITCH] = 1.2671, 0.26
    chunk = min(6000, max(1, steps // 10))  # repeated runs of ten minutes under PI control
    done, first, status = 0, None, RUNNING
    while done < steps and status == RUNNING:
        status = runner.run(x, [], chunk * scene.dt).status
        done += chunk
        if first is None and done >= steps // 10:
            first = resident()
        progress("memory of the plant", done, steps)
    return {"growth_MB": resident() - first, "status": int(status), "steps": done}


def environment_memory(steps, progress=silent):
    """Return {growth_MB, steps, resets}: the same for an environment with episodes of 20 s."""
    env, first, resets = FowtEnv(duration=20.0), None, 0
    env.reset(seed=0)
    for step in range(steps):
        _, _, terminated, truncated, _ = env.step(np.zeros(N_COMMANDS))
        if terminated or truncated:
            env.reset()
            resets += 1
        if step == steps // 10:
            first = resident()
        if step % 1000 == 0:
            progress("memory of the environment", step, steps)
    return {"growth_MB": resident() - first, "steps": steps, "resets": resets}


def measured_orders(duration=20.0, steps=(0.05, 0.025), finest=0.003125):
    """Return {integrator: order of convergence} in a regular wave, from the errors at two steps.

    Drag is omitted: |u| u is not smooth at flow reversal. The Adams methods take the derivatives of their
    first three steps from the fine run, as their starting steps are of lower order.
    """
    base = build_scene(sea={"kind": "regular", "H": 6.0, "T": 8.0}, fidelity="reference")
    base = base.with_model({"hydro.strips.shape.drag_coefficient": 0.0})
    x0, u = initial_state(base)
    rows = np.r_[0:6, 7:13]

    def advanced(name, duration, dt):
        x, handle = x0.copy(), with_integrator(base, name).handle()
        forget(handle)
        advance(handle, x, u, 0, round(duration / dt), dt)
        return x

    def end(name, dt):
        scene = with_integrator(base, name)
        if not isinstance(scene.model.integrator, Adams):
            return advanced(name, duration, dt)[rows]
        data = scene.data()
        handle, unread = scene.handle(data), np.zeros(N_MEASUREMENTS)
        for k in range(START_STEPS):
            forget(handle)
            x = advanced("rk4", k * dt, finest)
            observe(handle, x, u, k * dt, data.history[START_STEPS - 1 - k], unread)
        forget(handle)
        data.cache[LoadCache.STEPS] = START_STEPS
        x = advanced("rk4", START_STEPS * dt, finest)
        advance(handle, x, u, START_STEPS, round(duration / dt) - START_STEPS, dt)
        return x[rows]

    exact = advanced("rk4", duration, finest)[rows]
    errors = {name: [np.linalg.norm(end(name, dt) - exact) for dt in steps] for name in INTEGRATORS}
    return {name: float(np.log2(coarse / fine)) for name, (coarse, fine) in errors.items()}


def quaternion_difference(duration=60.0):
    """Return (largest difference of rotation matrices, largest angle in rad): Euler angles and quaternion.

    A body tumbling in free space is integrated by Runge-Kutta 4, and with a quaternion attitude by an
    eighth-order method; body rates are those of the equation of motion in both.
    """
    scene, dt = with_integrator(free_scene(), "rk4"), INTEGRATORS["rk4"].dt
    x, dx = np.zeros(N_RIGID), np.zeros(N_RIGID)
    x[3:6], x[10:13] = (0.5, 0.3, -1.0), (0.6, 0.02, 0.25)
    x[State.ROTOR_SPEED] = 1.2671
    handle, u, measurement = scene.handle(), np.zeros(N_COMMANDS), np.zeros(N_MEASUREMENTS)

    def rate(t, y):
        state = np.zeros(N_RIGID)
        state[5], state[4], state[3] = Rotation.from_quat(y[:4]).as_euler("ZYX")
        state[7:13], state[State.ROTOR_SPEED] = y[4:10], y[10]
        forget(handle)
        observe(handle, state, u, 0.0, dx, measurement)
        a, w = y[:4], y[7:10]
        spin = np.r_[a[3] * w + np.cross(a[:3], w), -a[:3] @ w]  # q (0, w), scalar last
        return np.r_[0.5 * spin, dx[7:13], dx[State.ROTOR_SPEED]]

    times = np.linspace(0.0, duration, 61)
    y0 = np.r_[rotation(x).as_quat(), x[7:13], x[State.ROTOR_SPEED]]
    twin = solve_ivp(rate, (0.0, duration), y0, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times)
    euler = scene.handle()
    forget(euler)
    worst, turned, step = 0.0, 0.0, 0
    for time, attitude in zip(times, twin.y[:4].T, strict=True):
        n = round(time / dt) - step
        if advance(euler, x, u, step, n, dt) != RUNNING:
            return float("inf"), turned
        step += n
        difference = rotation(x).as_matrix() - Rotation.from_quat(attitude).as_matrix()
        worst, turned = max(worst, float(np.abs(difference).max())), max(turned, float(np.abs(x[3:6]).max()))
    return worst, turned
