from math import pi

import numpy as np
import pytest
from naive import joined_bodies, rigid_body
from plant_helpers import integrate, leaning, make_pose, random_state, rates, state
from scipy.integrate import solve_ivp

from fowt_env import build_scene
from fowt_env.errors import InputError
from fowt_env.plant.accelerations import accelerate, factor_spd, substitute_spd
from fowt_env.plant.advance import forget, observe
from fowt_env.plant.drivetrain import build_drivetrain, shaft_torque
from fowt_env.plant.hydro.hydrostatics import submerged
from fowt_env.plant.model import N_CACHE
from fowt_env.plant.mooring import mooring_load
from fowt_env.plant.rigid_body import gravity_load, momentum_rate
from fowt_env.plant.state import N_RIGID, State, Wrench, add, pose_of
from fowt_env.scene.mass import build_rigid_body

DRY = np.zeros((6, 6))  # added mass
SPEEDS = [*range(State.VX, State.WZ + 1), State.ROTOR_SPEED]
TUMBLING = dict(
    surge=1.0, sway=-2.0, heave=3.0, roll=0.2, platform_pitch=-0.15, yaw=0.4,
    vx=1.5, vy=0.4, vz=-0.3, wx=0.05, wy=0.03, wz=-0.04, rotor_speed=1.2671,
)  # fmt: skip


def random_states(count):
    """Attitudes, speeds and loads on the rotor, beyond what the plant meets; SI units, platform axes."""
    rng, rows = np.random.default_rng(20260726), []
    for _ in range(count):
        angles = rng.uniform(-1.0, 1.0, 3) * [0.6, 0.6, 3.0]
        row = dict(zip(("roll", "platform_pitch", "yaw"), angles, strict=True))
        for names, size in (("v", 3.0), ("w", 0.2), ("hub_f", 5e5), ("hub_m", 3e6)):
            row |= {names + axis: size * rng.normal() for axis in "xyz"}
        row["rotor_speed"], row["generator_torque"] = rng.uniform(-0.3, 1.5), rng.uniform(0.0, 4.7e4)
        rows.append(row)
    return rows


def columns(row, *names):
    return np.array([row[name] for name in names])


def motion(row):
    return (
        columns(row, "vx", "vy", "vz"),
        columns(row, "wx", "wy", "wz"),
        columns(row, "hub_fx", "hub_fy", "hub_fz"),
        columns(row, "hub_mx", "hub_my", "hub_mz"),
    )


def project_accelerations(row, turbine, body):
    """(7,) of the package for one of the random states."""
    v, w, force, moment = motion(row)
    names = ("roll", "platform_pitch", "yaw", "rotor_speed")
    x = state(**{name: row[name] for name in names})
    x[State.VX : State.VX + 3], x[State.WX : State.WX + 3] = v, w
    pose = pose_of(x)
    about_origin = moment + np.cross(rigid_body.hub(turbine), force)
    load = add(gravity_load(pose, body), Wrench(*force, *about_origin))
    drivetrain = build_drivetrain(turbine)
    along = moment @ rigid_body.rotation(0.0, turbine.rotor.shaft_tilt, 0.0)[:, 0]
    torque = shaft_torque(along, row["generator_torque"], row["rotor_speed"], drivetrain)
    dx = np.zeros(15)
    accelerate(pose, x, load, torque, DRY, body, np.zeros((6, 6)), np.zeros(N_CACHE), dx)
    return dx[SPEEDS]


def naive_accelerations(row, platform, turbine, **options):
    v, w, force, moment = motion(row)
    R = rigid_body.rotation(row["roll"], row["platform_pitch"], row["yaw"])
    torque = row["generator_torque"]
    gravity = platform.environment.gravity
    return rigid_body.accelerations(
        platform, turbine, R, v, w, row["rotor_speed"], force, moment, torque, gravity, **options
    )


@pytest.mark.installation
def test_accelerations_are_those_of_free_bodies_held_together_by_joints_and_a_gearbox(platform, turbine):
    body = build_rigid_body(platform, turbine)
    for row in random_states(200):
        _, _, force, moment = motion(row)
        expected = joined_bodies.accelerations(platform, turbine, row, force, moment)
        assert np.abs(project_accelerations(row, turbine, body) - expected).max() < 1e-11


@pytest.mark.installation
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("leans", [False, True])
def test_accelerations_are_those_of_newton_and_euler_body_by_body(platform, turbine, leans, held):
    """leans: with a tilted rotor and a heavy side; held: with a rotor of prescribed speed."""
    if leans:
        platform, turbine = leaning(platform, turbine)
    body = build_rigid_body(platform, turbine, rotor_fixed=held)
    for row in random_states(60):
        expected = naive_accelerations(row, platform, turbine, held=held)
        assert np.abs(project_accelerations(row, turbine, body) - expected).max() < 1e-11


def test_a_planar_scene_refuses_a_heavy_side(platform, turbine):
    with pytest.raises(InputError, match="cm_left"):
        build_rigid_body(*leaning(platform, turbine), plane=True)


def test_fixed_platform_leaves_the_rotor_alone(platform, turbine):
    body = build_rigid_body(platform, turbine, platform_fixed=True)
    drivetrain = build_drivetrain(turbine)
    row = random_states(1)[0]
    accelerations = project_accelerations(row, turbine, body)
    torque = row["hub_mx"] - drivetrain.gear_ratio * row["generator_torque"]
    assert np.all(accelerations[:6] == 0.0)
    assert accelerations[6] == pytest.approx(torque / drivetrain.inertia_row, rel=1e-14)
    both = build_rigid_body(platform, turbine, platform_fixed=True, rotor_fixed=True)
    assert np.all(project_accelerations(row, turbine, both) == 0.0)


@pytest.mark.installation
def test_mass_matrix_has_the_published_entries(platform, turbine):
    m = build_rigid_body(platform, turbine).mass_matrix
    assert np.array_equal(m, m.T)
    assert m[0, 0] == 8066048.0
    assert m[1, 5] == pytest.approx(-9.6101e4, rel=1e-5)
    # the hub stands at 90 m here and at 89.56256 m in the published list
    shift = turbine.rotor.mass * (90.0 - 89.56256)
    assert m[0, 4] - shift == pytest.approx(-6.29205e8, rel=1e-5)
    steiner = turbine.rotor.mass * (90.0**2 - 89.56256**2)
    assert m[3, 3] - steiner == pytest.approx(6.8022e10, rel=2e-5)
    assert m[4, 4] - steiner == pytest.approx(6.8007e10, rel=2e-5)
    assert m[5, 5] == pytest.approx(1.9079e8, rel=2e-5)


@pytest.mark.installation
def test_the_solver_agrees_with_numpy_on_badly_scaled_systems():
    rng = np.random.default_rng(5)
    for _ in range(50):
        root = rng.normal(size=(6, 6))
        scale = np.array([1e4, 1e4, 1e4, 1e6, 1e6, 1e5])
        a = (root @ root.T + 0.1 * np.eye(6)) * np.outer(scale, scale)
        right = rng.normal(size=6) * scale
        b = right.copy()
        factors = a.copy()
        factor_spd(factors)
        substitute_spd(factors, b)
        np.testing.assert_allclose(b * scale, np.linalg.solve(a, right) * scale, rtol=1e-10)


def test_downwind_pitching_turns_the_nacelle_left(platform, turbine):
    body = build_rigid_body(platform, turbine)
    x = state(wy=0.01, rotor_speed=1.2671)
    c = momentum_rate(pose_of(x), 1.2671, body.mass_matrix, body.coupling, None)
    assert -c.mz == pytest.approx(body.coupling * 1.2671 * 0.01, rel=1e-12)


# Conservation laws of theory.md, section 10


def invariants(scene, platform, turbine, states, gravity):
    """(kinetic + potential energy, linear momentum, angular momentum) along a path, body by body."""
    parts = rigid_body.bodies(platform, turbine)
    energy, linear, angular = [], [], []
    for x in states:
        r, R = x[:3], rigid_body.rotation(*x[3:6])
        v, w, speed = x[7:10], x[10:13], x[State.ROTOR_SPEED]
        kinetic = rigid_body.kinetic_energy(parts, v, w, speed)
        energy.append([kinetic, rigid_body.potential_energy(parts, r, R, gravity)])
        p, h = rigid_body.momenta(parts, r, R, v, w, speed)
        linear.append(p)
        angular.append(h)
    return np.array(energy), np.array(linear), np.array(angular)


def drift(history):
    """Largest change of a vector over its first length."""
    return np.abs(history - history[0]).max() / np.linalg.norm(history[0])


def weightless(scene):
    return scene.with_model(rigid_body=scene.model.rigid_body._replace(gravity=0.0))


def test_free_fall_with_a_spinning_rotor_keeps_its_energy(bare_scene, platform, turbine):
    times, states = integrate(bare_scene, state(**TUMBLING), 100.0)
    gravity = platform.environment.gravity
    energy, linear, _ = invariants(bare_scene, platform, turbine, states, gravity)
    total = energy.sum(axis=1)
    assert np.abs(total - total[0]).max() < 1e-9 * energy[0, 0]
    weight = bare_scene.model.rigid_body.mass * gravity
    assert np.abs(linear[:, 2] - linear[0, 2] + weight * times).max() < 1e-12 * weight * 100.0


@pytest.mark.parametrize("torque", [0.0, 2e4])
def test_momenta_are_kept_without_gravity_whatever_the_generator_does(bare_scene, platform, turbine, torque):
    # the generator's torque, the gearbox's and the friction act inside the turbine
    times, states = integrate(weightless(bare_scene), state(**TUMBLING), 100.0, u=(torque, 0.0))
    energy, linear, angular = invariants(bare_scene, platform, turbine, states, 0.0)
    assert drift(linear) < 1e-11
    assert drift(angular) < 1e-11
    if torque == 0.0:
        assert drift(energy[:, :1]) < 1e-11
    else:
        assert np.ptp(states[:, State.ROTOR_SPEED]) > 1.0


def test_euler_angles_and_a_quaternion_lead_to_the_same_place(bare_scene):
    x0 = state(**TUMBLING)
    times, states = integrate(bare_scene, x0, 100.0)
    body = bare_scene.model.rigid_body

    def rate(t, y):
        R = rigid_body.quaternion_rotation(y[3:7])
        pose = make_pose(y[:3], R, y[7:10], y[10:13])
        x, dx = np.zeros(15), np.zeros(N_RIGID)
        x[State.VX : State.WZ + 1], x[State.ROTOR_SPEED] = y[7:13], y[13]
        cache = np.zeros(N_CACHE)
        accelerate(pose, x, gravity_load(pose, body), 0.0, DRY, body, np.zeros((6, 6)), cache, dx)
        return np.r_[R @ y[7:10], rigid_body.quaternion_rate(y[3:7], y[10:13]), dx[SPEEDS]]

    y0 = np.r_[x0[:3], rigid_body.quaternion(*x0[3:6]), x0[SPEEDS]]
    scale = np.r_[np.full(3, 100.0), np.ones(4), np.full(3, 10.0), np.ones(4)]
    solution = solve_ivp(
        rate, (0.0, 100.0), y0, method="DOP853", rtol=1e-13, atol=1e-14 * scale, t_eval=times, max_step=0.5
    )
    fallen = np.abs(states[-1, State.HEAVE])
    assert fallen > 4e4
    assert np.abs(solution.y[:3].T - states[:, :3]).max() < 1e-8  # m, over 49 km
    for x, q in zip(states, solution.y[3:7].T, strict=True):
        assert np.abs(rigid_body.rotation(*x[3:6]) - rigid_body.quaternion_rotation(q)).max() < 1e-9


def line_energy(H, V, length, weight, EA):
    """Elastic and gravity energy of one frictionless line on the seabed or clear of it, by quadrature."""
    lying = max(0.0, length - V / weight)
    x, w = np.polynomial.legendre.leggauss(60)
    s = lying + (length - lying) * (x + 1.0) / 2.0
    vertical = V - weight * (length - s)
    start = V - weight * (length - lying)
    tension = np.hypot(H, vertical)
    height = (tension - np.hypot(H, start)) / weight + (vertical**2 - start**2) / (2.0 * EA * weight)
    hanging = np.sum(w * (length - lying) / 2.0 * (tension**2 / (2.0 * EA) + weight * height))
    return hanging + lying * H * H / (2.0 * EA)


def test_floating_body_on_its_lines_keeps_its_energy_without_fluid_inertia(still_scene, platform, turbine):
    model = still_scene.model
    strips = model.hydro.strips.shape._replace(
        added_mass_coefficient=0.0, drag_coefficient=0.0, heave_added_mass=0.0,
    )  # fmt: skip
    damping = type(model.hydro.damping)(*(0.0,) * 7)
    scene = still_scene.with_model({"hydro.strips.shape": strips, "hydro.damping": damping})
    x0 = state(
        surge=5.0, sway=2.0, heave=0.5, roll=0.02, platform_pitch=0.06, yaw=0.03,
        vx=0.3, vy=-0.1, vz=0.05, wx=0.002, wy=0.004, wz=-0.001, rotor_speed=1.2671,
    )  # fmt: skip
    times, states = integrate(scene, x0, 100.0, samples=26, rtol=1e-12, atol=1e-13)
    gravity = platform.environment.gravity
    energy, _, _ = invariants(scene, platform, turbine, states, gravity)
    data = scene.data()
    outside = []
    for x in states:
        pose = pose_of(x)
        mooring_load(pose, model.mooring, data.lines, data.counters)
        lines = zip(data.lines, model.mooring.length, model.mooring.weight, model.mooring.EA, strict=True)
        total = sum(line_energy(row[0], row[1], *line) for row, *line in lines)
        volume, qx, qy, qz = submerged(pose, model.hydro.hull, data.counters)
        height = volume * pose.z + qx * pose.r31 + qy * pose.r32 + qz * pose.r33
        outside.append(total - model.hydro.hull.specific_weight * height)
    total = energy.sum(axis=1) + outside
    spin = 0.5 * model.rigid_body.rotor_row * x0[State.ROTOR_SPEED] ** 2
    moving = np.abs(energy[:, 0] - spin).max()
    assert np.abs(states[:, State.SURGE]).max() > 4.0
    assert np.abs(total - total[0]).max() < 1e-8 * moving


# Symmetries

MIRROR = np.ones(15)
MIRROR[[State.SWAY, State.ROLL, State.YAW, State.VY, State.WX, State.WZ, State.ROTOR_SPEED]] = -1.0


def test_left_and_right_are_mirror_images(wave_scene):
    rng = np.random.default_rng(8)
    for _ in range(30):
        x, t = random_state(rng), rng.uniform(0.0, 20.0)
        here = rates(wave_scene, x, t=t)
        there = rates(wave_scene, MIRROR * x, t=t)
        assert np.abs(there - MIRROR * here)[SPEEDS].max() < 1e-12


def turned_scene(scene, angle):
    """The scene with anchors, waves and wind turned about the vertical; the yaw spring is left out."""
    model = scene.model
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    parts = {
        "hydro.damping": model.hydro.damping._replace(yaw_stiffness=0.0),
        "mooring": model.mooring._replace(anchor=np.ascontiguousarray(model.mooring.anchor @ turn.T)),
    }
    waves, aero = model.hydro.waves, model.aero
    if waves is not None:
        cosine, sine = waves.cos_heading, waves.sin_heading
        headings = {"cos_heading": c * cosine - s * sine, "sin_heading": s * cosine + c * sine}
        parts["hydro.waves"] = waves._replace(**headings)
    if aero is not None:
        value = aero.wind.value.copy()
        value[:, :2] = aero.wind.value[:, :2] @ turn[:2, :2].T
        parts["aero.wind"] = aero.wind._replace(value=value)
    return scene.with_model(parts), turn


@pytest.mark.parametrize("name", ["wave_scene", "storm_scene"])
def test_nothing_depends_on_the_compass(name, request):
    scene = request.getfixturevalue(name)
    rng = np.random.default_rng(9)
    plain, _ = turned_scene(scene, 0.0)
    for _ in range(20):
        x, t, angle = random_state(rng, scene.n_state), rng.uniform(0.0, 20.0), rng.uniform(-pi, pi)
        other, turn = turned_scene(scene, angle)
        turned = x.copy()
        turned[:3] = turn @ x[:3]
        turned[State.YAW] += angle
        command = (4e4, 0.1)
        difference = rates(other, turned, command, t) - rates(plain, x, command, t)
        assert np.abs(difference[SPEEDS]).max() < 1e-10


def test_still_water_has_no_preferred_time(still_scene):
    x = random_state(np.random.default_rng(4))
    assert np.array_equal(rates(still_scene, x, t=0.0), rates(still_scene, x, t=123.4))


@pytest.mark.parametrize("tower", ("rigid", "modes"))
def test_rates_are_those_of_the_state_whatever_was_evaluated_before(tower):
    """The factors of the mass matrix stay in the data arrays for the same state alone."""
    scene = build_scene("oc3_hywind", tower=tower, mooring=False)  # whose solution keeps a warm start
    rng, used, found = np.random.default_rng(6), scene.handle(), []
    for _ in range(3):
        x, u = 0.05 * rng.normal(size=scene.n_state), np.zeros(scene.n_commands)
        x[State.HEAVE] = rng.normal()
        for handle in (used, scene.handle()):
            dx, measurement = np.zeros_like(x), np.zeros(scene.n_measurements)
            forget(handle)
            observe(handle, x, u, 0.0, dx, measurement)
            found.append(dx)
        assert np.array_equal(*found[-2:])
    assert not np.array_equal(found[0], found[2])
