import numpy as np
import pytest
from elastic_cases import ALOFT, CONSTANT, PINS, SPRING, SPRINGS, acting
from naive.flexible_turbine import Beam, Turbine
from plant_helpers import leaning, random_state, rates, state

from fowt_env import Load, build_scene, load_kernel, simulate
from fowt_env.plant.advance import advance, forget, observe, output_row
from fowt_env.plant.channels import Out
from fowt_env.plant.elastic.steps import begin_swing, keep_swing
from fowt_env.plant.elastic.tower import TowerModes, nacelle_pose
from fowt_env.plant.integrators import START_STEPS
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.rotor_substeps import N_SAMPLE, RotorSubsteps, follow_rotor
from fowt_env.plant.state import N_RIGID, State, pose_of
from fowt_env.plant.user_loads import Force, Motion
from fowt_env.scene.beam import BeamNodes, Shapes, integrated
from fowt_env.scene.tower import stiffness_roots


@load_kernel
def dashpot(parameters, motion, force):
    for i in range(3):
        force[Force.FX + i] = -parameters[0] * motion[Motion.VX + i]


def lumps(n, rng, top, base=10.0):
    """A tower of nine uneven lumps, with shapes and matrices of no special form."""
    height, mass = np.linspace(base + 4.0, top, 9), rng.uniform(1e4, 5e4, 9)
    up = (height - base) / (top - base)
    U, slope = np.zeros((2, n, 2, 9))
    for k, power in enumerate((2, 3, 4, 2)[:n]):
        U[k, k % 2] = up**power * (1.0 + 0.3 * k * (1.0 - up))
        slope[k, k % 2, -1] = rng.uniform(0.01, 0.04)
    stiffness, damping, short = (root @ root.T for root in rng.normal(size=(3, n, n)))
    return Beam(height, mass, U, slope, 0.02 * short[..., None] * up, 2e6 * stiffness, 1e5 * damping)


def modes_of(tower):
    """TowerModes of lumps."""
    n, z = len(tower.U), tower.z
    nodes = BeamNodes(z, z, 0.0 * z, tower.mass, Shapes(tower.U, tower.slope, tower.S))
    beam = integrated(nodes, tower.stiffness, tower.damping)
    return TowerModes(
        first=N_RIGID,
        top_height=tower.z[-1],
        slope=tower.slope[:, :, -1].sum(axis=1),
        shortening=np.ascontiguousarray(tower.S[:, :, -1]),
        beam=beam._replace(mass=0.0, first=0.0, second=0.0),
        drag_shape=np.zeros((6, n)),
        **stiffness_roots(tower.stiffness),
    )


class Bending:
    """A leaning turbine in empty space with n modes and two loads of the user's, and its twin."""

    def __init__(self, platform, turbine, n, loads, damped=True, **options):
        platform, turbine = leaning(platform, turbine)
        self.tower, self.n = lumps(n, np.random.default_rng(n), platform.tower.top_height), n
        if not damped:
            self.tower.damping[:] = 0.0
        self.twin = Turbine(platform, turbine, self.tower)
        scene = build_scene(
            platform,
            turbine=turbine,
            tower="modes",
            hydrodynamics=False,
            mooring=False,
            loads=loads,
            **{"fidelity": "reference"} | options,
        )
        self.scene = scene.with_model(tower=modes_of(self.tower))
        self.blocks = {"tower_deflection": N_RIGID, "tower_velocity": N_RIGID + n}

    def random(self, rng):
        """A state in wild motion."""
        x = random_state(rng, self.scene.n_state, tilt=0.3, speed=3.0, turning=0.3)
        x[N_RIGID : N_RIGID + self.n] = 2.0 * rng.normal(size=self.n)
        x[N_RIGID + self.n :] = 3.0 * rng.normal(size=self.n)
        return x

    def accelerations(self, dx):
        rate = slice(N_RIGID + self.n, N_RIGID + 2 * self.n)
        return np.r_[dx[State.VX : State.WZ + 1], dx[State.ROTOR_SPEED], dx[rate]]

    def fall(self, x, torque, forces):
        """(path, its accelerations) of the twin from a state."""
        falling = self.twin.fall(self.twin.path(x, self.blocks), torque, forces)
        return falling, np.concatenate(list(self.twin.accelerations(falling).values()))


@pytest.mark.parametrize("n", [2, pytest.param(4, marks=pytest.mark.nightly)])
def test_accelerations_are_those_of_particles_on_their_paths(platform, turbine, n):
    rng = np.random.default_rng(n)
    case = Bending(platform, turbine, n, CONSTANT)
    for _ in range(60):
        x = case.random(rng)
        found = case.accelerations(rates(case.scene, x, u=(2e4, 0.0)))
        _, expected = case.fall(x, 2e4, acting(case.twin))
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()


def test_outputs_are_those_of_particles_on_their_paths(platform, turbine):
    rng = np.random.default_rng(7)
    case = Bending(platform, turbine, 4, CONSTANT)
    scene, twin = case.scene, case.twin
    top, u = np.array([0.0, 0.0, case.tower.z[-1]]), np.array([2e4, 0.0])
    foot, aloft = np.array([0.0, 0.0, twin.base]), ["straight", "tower", "nacelle", "wheel", "hub"]
    for _ in range(10):
        x = case.random(rng)
        falling, _ = case.fall(x, 2e4, acting(twin))
        row = output_row(scene.handle(), x, u, 0.0, len(scene.channels))
        base = row[Out.TWRBSFXT : Out.TWRBSMZT + 1]
        expected = twin.section_load(falling, twin.on_platform, foot, aloft, acting(twin)[:1])
        assert np.abs(base - expected).max() < 1e-10 * np.abs(expected).max()
        R, _, _ = twin.frame(falling, twin.on_nacelle)
        _, velocity, acceleration = (R.T @ part for part in twin.point(falling, twin.on_nacelle, top))
        assert row[[Out.NCIMUTAXS, Out.NCIMUTAYS]] == pytest.approx(acceleration[:2], rel=1e-9)
        deflection = x[N_RIGID : N_RIGID + 4].reshape(2, 2).sum(axis=0)
        assert row[-4:] == pytest.approx([*deflection, *acceleration[:2]], rel=1e-9)
        _, _, centre = twin.point(falling, twin.on_nacelle, twin.rotor_centre)
        shaft = np.array([np.cos(twin.tilt), 0.0, -np.sin(twin.tilt)])
        push = shaft @ R.T @ (centre + [0.0, 0.0, twin.gravity])
        assert row[Out.ROTTHRUST] == pytest.approx(-turbine.rotor.mass * push, rel=1e-9)
        turning = shaft @ twin.motion(falling, twin.on_nacelle)[3] + falling[6].second
        assert row[Out.ROTTORQ] == pytest.approx(-turbine.rotor.inertia * turning, rel=1e-9)
        measured, dx = np.zeros(N_MEASUREMENTS), np.zeros_like(x)
        observe(scene.handle(), x, u, 0.0, dx, measured)
        assert measured[Measure.NACELLE_VELOCITY] == pytest.approx(velocity[0], rel=1e-9)
        assert measured[Measure.NACELLE_ACCELERATION] == pytest.approx(acceleration[0], rel=1e-9)


def test_the_nacelle_frame_is_where_the_nacelle_is(platform, turbine):
    rng = np.random.default_rng(3)
    case = Bending(platform, turbine, 4, CONSTANT)
    for _ in range(10):
        x = case.random(rng)
        pose, path = nacelle_pose(pose_of(x), x, case.scene.model.tower), case.twin.path(x, case.blocks)
        carry = case.twin.on_nacelle
        origin, velocity, _ = case.twin.point(path, carry, np.zeros(3))
        R, turning = case.twin.frame(path, carry)[0], case.twin.motion(path, carry)[1]
        found, expected = np.array(pose), np.r_[origin, R.ravel(), R.T @ velocity, turning]
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


def swinging(case):
    """A state of a turbine on its springs in lively motion."""
    x = state(
        case.scene.n_state, surge=0.4, sway=-0.2, roll=0.03, platform_pitch=0.05, yaw=0.02, rotor_speed=1.2
    )
    x[State.VX : State.WZ + 1] = [0.5, -0.2, 0.1, 0.01, 0.02, -0.01]
    x[N_RIGID : N_RIGID + case.n] = [0.3, -0.2, 0.02, 0.01][: case.n]
    return x


@pytest.mark.nightly
def test_energy_is_kept_over_a_million_steps(platform, turbine):
    case = Bending(platform, turbine, 2, SPRINGS, damped=False, integrator="rk4")
    x, u, dt, parts = swinging(case), np.zeros(2), 0.001, 20
    handle = case.scene.handle()

    def energy():
        path = case.twin.path(x, case.blocks)
        held = 0.0
        for pin in PINS:
            place, _, _ = case.twin.point(path, case.twin.on_platform, pin)
            held += 0.5 * SPRING * np.sum((place - pin) ** 2)
        return case.twin.kinetic(path), float(np.squeeze(case.twin.potential(path).value)) + held

    kinetic, total, spin = [], [], 0.5 * case.scene.model.rigid_body.rotor_row * x[State.ROTOR_SPEED] ** 2
    forget(handle)
    for part in range(parts + 1):
        T, V = energy()
        kinetic.append(T - spin)
        total.append(T + V)
        if part < parts:
            assert advance(handle, x, u, part * 1_000_000 // parts, 1_000_000 // parts, dt) == 0
    assert np.ptp(total) < 1e-9 * max(kinetic)


@pytest.fixture(scope="module")
def pinned(platform, turbine):
    """{integrator: Bending on springs}."""
    return {name: Bending(platform, turbine, 2, SPRINGS, integrator=name) for name in ("rk4", "ab4")}


def exact(pinned, duration, samples):
    """(samples + 1, n_state) of a swinging turbine, by steps of half a millisecond at most."""
    case, dt = pinned["rk4"], 0.0005
    x, handle, found = swinging(case), case.scene.handle(), []
    forget(handle)
    for k in range(samples):
        found.append(x.copy())
        steps = int(np.ceil(duration / samples / dt))
        assert advance(handle, x, np.zeros(2), k * steps, steps, duration / samples / steps) == 0
    return np.array([*found, x])


def swung(pinned, integrator, dt, steps):
    """State after steps; a multistep method is given its past, which its own first steps are of low order."""
    case, u = pinned[integrator], np.zeros(2)
    data = case.scene.data()
    handle, model = case.scene.handle(data), case.scene.model
    start = exact(pinned, START_STEPS * dt, START_STEPS)
    for k, x in enumerate(start[:-1]):
        forget(handle)
        row = data.history[START_STEPS - 1 - k]
        observe(handle, x, u, k * dt, row, np.zeros(N_MEASUREMENTS))
        begin_swing(k, x, model.rigid_body, model.tower, None, data.matrix, data.rotor, data.stages[2])
        keep_swing(x, model.tower, None, None, data.rotor, row)
    forget(handle)
    data.cache[LoadCache.STEPS] = START_STEPS
    x = start[-1].copy()
    assert advance(handle, x, u, START_STEPS, steps - START_STEPS, dt) == 0
    return x


@pytest.mark.nightly
@pytest.mark.parametrize("integrator", ["rk4", "ab4"])
def test_it_converges_with_order_four(pinned, integrator):
    end = exact(pinned, 4.0, 1)[-1]
    errors = [np.linalg.norm((swung(pinned, integrator, 4.0 / n, n) - end)[N_RIGID:]) for n in (200, 400)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.35)


@pytest.mark.nightly
@pytest.mark.parametrize("second", [pytest.param(False, marks=pytest.mark.nightly), True])
def test_a_clamped_tower_keeps_its_period_at_the_default_step(second):
    """0.1 s is 0.4 of the first mode's period over two pi, and 1.8 of the second's: five and 25 turns."""
    start = [0.0, 0.0, 0.02, 0.01] if second else [0.3, -0.2, 0.0, 0.0]
    found = {}
    for integrator, dt in (("rk4", 0.0125), ("ab4", None)):
        scene = build_scene(
            "oc3_hywind", wind=None, hydrodynamics=False, mooring=False, tower="modes2", integrator=integrator
        )
        held, x = scene.with_model({"rigid_body.platform_fixed": True}), state(scene.n_state, rotor_speed=1.2)
        x[scene.model.tower.first :][:4] = start
        handle, dt = held.handle(), dt or scene.dt
        found[integrator] = []
        for k in range(100):
            assert advance(handle, x, np.zeros(2), k * round(0.1 / dt), round(0.1 / dt), dt) == 0
            found[integrator].append(x[scene.model.tower.first :][:4].copy())
    assert scene.dt == 0.1
    exact, late = np.array(found["rk4"]), np.array(found["ab4"]) - found["rk4"]
    modes = slice(2, 4) if second else slice(0, 2)
    error = np.sqrt(np.mean(late[70:, modes] ** 2) / np.mean(exact[70:, modes] ** 2))
    assert error < (0.12 if second else 1e-4)


def test_an_impulse_of_the_rotor_is_that_of_a_short_push(platform, turbine):
    """What a rotor followed within a step adds to the velocities: M^-1 J^T of its load, and nothing else."""
    case = Bending(platform, turbine, 2, CONSTANT)
    rng, data = np.random.default_rng(4), case.scene.data()._replace(samples=np.zeros((4, N_SAMPLE)))
    x, load, torque, dt = case.random(rng), 1e6 * rng.normal(size=6), 3e5, 0.02
    x[7:14] = x[N_RIGID + 2 :] = 0.0  # at rest the twin knows no other forces of velocity
    data.samples[0] = [*load, torque]
    y = np.zeros_like(x)
    rates(case.scene, x, handle=case.scene.handle(data))
    follow_rotor(dt, x, case.scene.model, RotorSubsteps(1, np.array([1.0, 0.0, 0.0, 0.0])), data, y)
    push = (case.twin.on_nacelle, np.zeros(3), load[:3], load[3:])
    _, none = case.fall(x, 0.0, [])
    _, pushed = case.fall(x, -torque / case.twin.ratio, [push])
    expected = pushed - none
    assert np.abs(case.accelerations(y) / dt - expected).max() < 1e-10 * np.abs(expected).max()


def test_a_load_aloft_moves_with_the_nacelle(platform, turbine):
    rng = np.random.default_rng(5)
    loads = [Load("aloft", dashpot, point=ALOFT, parameters=[1e5]), CONSTANT[1]]
    case = Bending(platform, turbine, 2, loads)
    columns = [i for i, channel in enumerate(case.scene.channels) if channel.name.startswith("aloft")]
    for _ in range(5):
        x = case.random(rng)
        path = case.twin.path(x, case.blocks)
        place, velocity, _ = case.twin.point(path, case.twin.on_nacelle, ALOFT)
        force = -1e5 * velocity
        moment = np.cross(place - x[:3], force)
        row = output_row(case.scene.handle(), x, np.zeros(2), 0.0, len(case.scene.channels))
        assert row[columns] == pytest.approx(np.r_[force, moment], rel=1e-10)


@pytest.mark.nightly
def test_the_default_step_errs_by_less_than_a_hundredth_at_the_tower_base():
    """Of both moments there, whose side-side one rings with a third of a per cent of damping."""
    wind, sea = {"kind": "ntm", "speed": 18.0, "class": "B"}, {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0}
    frames = []
    for integrator, dt in (("rk4", 0.0125), ("ab4", None)):
        options = {"fidelity": "standard", "integrator": integrator, "tower": "modes", "duration": 200.0}
        scene = build_scene(wind=wind, sea=sea, seed=1, **{"fidelity": "reference"} | options)
        frames.append(simulate(scene, "pi", duration=200.0, dt=dt))
    assert scene.dt == 0.1
    for moment in ("TwrBsMxt_[kN-m]", "TwrBsMyt_[kN-m]"):
        exact, found = (frame[moment].to_numpy() for frame in frames)
        assert np.sqrt(np.mean((found - exact) ** 2)) < 0.01 * exact.std()
