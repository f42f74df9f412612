"""Torsion of the shaft: two masses on a spring in closed form, conservation laws, rigid limit, outputs."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from plant_helpers import rates, state
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit

from fowt_env import build_scene
from fowt_env.analysis.campbell import campbell
from fowt_env.errors import InputError
from fowt_env.plant.advance import advance, output_row
from fowt_env.plant.drivetrain import build_drivetrain
from fowt_env.plant.elastic.oscillator import swung
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.plant.state import State, pose_of

BARE = {"wind": None, "hydrodynamics": False, "mooring": False, "shaft": "torsion"}
HELD = {"rigid_body.platform_fixed": True}
ELASTIC = Path(__file__).parents[3] / "training/validation/reference/elastic"
NIGHTLY = pytest.mark.nightly
TURBINES = ("oc3_hywind", pytest.param("iea15_volturnus_s", marks=NIGHTLY))


def inertias(turbine):
    """Inertia of rotor and generator about the low-speed shaft, kg m2, and gear ratio."""
    drive = turbine.drivetrain
    return turbine.rotor.inertia, drive.gear_ratio**2 * drive.generator_inertia, drive.gear_ratio


@pytest.mark.parametrize(("square", "decay"), [(40.0, 0.5), (40.0, 6.4), (40.0, np.sqrt(40.0)), (4e4, 13.0)])
def test_an_oscillator_under_a_cubic_load_is_exact(square, decay):
    c = np.array([3.0, -40.0, 200.0, -300.0])

    def rate(t, y):
        return [y[1], c @ t ** np.arange(4) - square * y[0] - 2.0 * decay * y[1]]

    done = solve_ivp(rate, (0.0, 0.4), [0.1, -0.7], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert swung(0.1, -0.7, *c, 0.4, square, decay) == pytest.approx(done, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("platform", TURBINES)
@pytest.mark.parametrize(
    "integrator",
    [pytest.param(name, marks=() if name == "ab4" else NIGHTLY) for name in INTEGRATORS],
)
def test_a_free_shaft_decays_as_two_masses_at_the_default_step(platform, integrator):
    scene = build_scene(platform, integrator=integrator, **BARE)
    twist, handle = scene.model.shaft.first, scene.with_model(HELD).handle()
    rotor, generator, _ = inertias(scene.turbine)
    spring, mobility = scene.turbine.shaft_torsion, 1.0 / rotor + 1.0 / generator
    decay = 0.5 * mobility * spring.damping
    w = np.sqrt(mobility * spring.stiffness - decay**2)
    x = state(scene.n_state, rotor_speed=1.0)
    x[twist] = 1e-3
    dt, steps = scene.dt, 9
    assert dt >= 0.05 and w * dt > 0.6
    advance(handle, x, np.zeros(2), 0, steps, dt)
    t = dt * steps
    expected = 1e-3 * np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t))
    assert x[twist] == pytest.approx(expected, rel=1e-10, abs=1e-20)
    momentum = rotor * x[State.ROTOR_SPEED] + generator * (x[State.ROTOR_SPEED] - x[twist + 1])
    assert momentum == pytest.approx(rotor + generator, rel=1e-13)


@pytest.mark.parametrize("platform", TURBINES)
def test_a_lost_generator_torque_swings_the_shaft_about_its_relief(platform):
    scene = build_scene(platform, **BARE).with_model(HELD)
    rotor, generator, ratio = inertias(scene.turbine)
    spring, mobility = scene.turbine.shaft_torsion, 1.0 / rotor + 1.0 / generator
    torque = scene.turbine.torque_law.rated_torque
    share = rotor / (rotor + generator) * ratio * torque  # of the torque in a rigid shaft without wind
    x, twist = state(scene.n_state, rotor_speed=1.0), scene.model.shaft.first
    x[twist] = share / spring.stiffness
    handle, dt = scene.handle(), scene.dt
    advance(handle, x, np.array([torque, 0.0]), 0, 10, dt)
    assert x[twist] == pytest.approx(share / spring.stiffness, rel=1e-12)
    assert x[twist + 1] == pytest.approx(0.0, abs=1e-14)
    advance(handle, x, np.zeros(2), 10, 1, dt)
    decay = 0.5 * mobility * spring.damping
    w = np.sqrt(mobility * spring.stiffness - decay**2)
    swing = np.exp(-decay * dt) * (np.cos(w * dt) + decay / w * np.sin(w * dt))
    assert x[twist] == pytest.approx(share / spring.stiffness * swing, rel=1e-9)


def laws(scene, x):
    """(7,) energy, J, and momentum about the inertial origin, of a free turbine without gravity."""
    body, shaft, drive = scene.model.rigid_body, scene.model.shaft, build_drivetrain(scene.turbine)
    pose, rotor = pose_of(x), scene.turbine.rotor.inertia
    tilt = scene.turbine.rotor.shaft_tilt
    n, nu = np.array([np.cos(tilt), 0.0, -np.sin(tilt)]), x[State.VX : State.WZ + 1]
    speed = x[State.ROTOR_SPEED] - x[shaft.first + 1]
    spin = rotor * x[State.ROTOR_SPEED] + (drive.coupling - rotor) * speed
    energy = 0.5 * nu @ body.mass_matrix @ nu + spin * n @ nu[3:]
    energy += 0.5 * (rotor * x[State.ROTOR_SPEED] ** 2 + (drive.inertia_row - rotor) * speed**2)
    energy += 0.5 * shaft.stiffness * x[shaft.first] ** 2
    p, k = np.split(body.mass_matrix @ nu, 2)
    R, k = np.array(pose[3:12]).reshape(3, 3), k + spin * n
    return np.array([energy, *(R @ p), *(np.cross(x[:3], R @ p) + R @ k)])


@pytest.mark.parametrize("platform", TURBINES)
def test_energy_and_momentum_change_by_the_damping_of_the_shaft_alone(platform):
    scene = build_scene(platform, **BARE)
    parts = {"rigid_body.gravity": 0.0, "structure.lower.gravity": 0.0}
    scene, rng = scene.with_model(parts), np.random.default_rng(7)
    shaft = scene.model.shaft
    _, generator, ratio = inertias(scene.turbine)
    for _ in range(5):
        x = rng.normal(size=scene.n_state) * 0.2
        x[shaft.first] *= 0.02
        dx = rates(scene, x)
        step = 1e-5
        change = (laws(scene, x + step * dx) - laws(scene, x - step * dx)) / (2.0 * step)
        lost = shaft.damping * x[shaft.first + 1] ** 2
        scale = np.array([lost, *(6 * [abs(laws(scene, x)).max()])])
        assert change / scale == pytest.approx([-1.0, *(6 * [0.0])], abs=5e-6)
        tilt = scene.turbine.rotor.shaft_tilt
        torque = shaft.stiffness * x[shaft.first] + shaft.damping * x[shaft.first + 1]
        turning = np.cos(tilt) * dx[State.WX] - np.sin(tilt) * dx[State.WZ]
        speeding = dx[State.ROTOR_SPEED] - dx[shaft.first + 1]
        assert generator * (speeding + turning / ratio) == pytest.approx(torque, rel=1e-9)


PARTS = [
    {},
    pytest.param({"pitch": "individual"}, marks=NIGHTLY),
    pytest.param({"tower": "modes2"}, marks=NIGHTLY),
    pytest.param({"tower": "modes", "pitch": "individual"}, marks=NIGHTLY),
    pytest.param({"blades": "modes"}, marks=NIGHTLY),
    pytest.param({"blades": "modes", "tower": "modes"}, marks=NIGHTLY),
]


@pytest.mark.parametrize("parts", PARTS)
def test_a_stiff_shaft_is_a_rigid_one(parts):
    """In motion and in all outputs, with whatever else is elastic."""
    kinds = ("torsion", "rigid")
    scene, rigid = (build_scene("oc3_hywind", **BARE | parts | {"shaft": kind}) for kind in kinds)
    shaft, u = scene.model.shaft, np.r_[4e4, np.zeros(rigid.n_commands - 1)]
    scene, q = scene.with_model(shaft=shaft._replace(stiffness=1e15, damping=1e10)), shaft.first
    x = state(rigid.n_state, rotor_speed=1.2, roll=0.05, wx=0.02, wy=0.01, vy=0.3)
    x[State.INTERNAL : q] = 0.01
    y = np.insert(x, q, [0.0, 0.0])
    loose = rates(scene, y, u)[q + 1]
    y[q] = 1e-9
    y[q] *= loose / (loose - rates(scene, y, u)[q + 1])  # no acceleration of the twist
    handle, other = scene.handle(), rigid.handle()
    found = output_row(handle, y, u, 0.0, len(scene.channels))
    names = [channel.name for channel in scene.channels]
    wanted = output_row(other, x, u, 0.0, len(rigid.channels))
    found = np.delete(found, [names.index("Q_DrTr"), names.index("QD_DrTr")])
    assert found == pytest.approx(wanted, rel=1e-6, abs=1e-9 * np.abs(wanted).max())
    finer = 8 if "blades" in parts else 1  # blades in phase are exact on a shaft that twists alone
    advance(other, x, u, 0, 20 * finer, 0.025 / finer)
    advance(handle, y, u, 0, 20, 0.025)
    y = np.delete(y, [q, q + 1])
    if "blades" in parts:  # 4e-4 from a sudden start; 3e-3 if steps of both are the same
        assert np.linalg.norm(y - x) < 1e-3 * np.linalg.norm(x)
    else:
        assert y == pytest.approx(x, rel=1e-5, abs=1e-6)


@NIGHTLY
@pytest.mark.parametrize(("tower", "step"), [("modes", 0.1), ("modes2", 0.05)])
def test_a_tower_with_a_twisting_shaft_swings_no_further_at_the_default_step(tower, step):
    """At 0.1 s, 1.8 over the frequency, the second modes would grow without limit within two seconds."""
    scene = build_scene("oc3_hywind", **BARE, tower=tower)
    x, q, far = state(scene.n_state, rotor_speed=1.2), scene.model.tower.first, []
    x[scene.model.shaft.first] = 5e-3
    held, n = scene.with_model(HELD).handle(), len(scene.model.tower.slope)
    assert scene.dt == step
    for k in range(60):
        assert advance(held, x, np.zeros(2), k * round(0.1 / step), round(0.1 / step), step) == 0
        far.append(np.abs(x[q : q + n]).max())
    assert max(far[30:]) <= max(far[:30]) < 0.05


@pytest.mark.nightly
@pytest.mark.parametrize("turbine", ["nrel5mw", pytest.param("iea15", marks=NIGHTLY)])
def test_blades_on_a_twisting_shaft_swing_no_further_at_the_default_step(turbine):
    """Without air: with an extrapolated torque of the blades the NREL 5 MW would swing ten times as far."""
    scene = build_scene("oc3_hywind", turbine=turbine, **BARE, blades="modes").with_model(HELD)
    blades, x = scene.model.blades, state(scene.n_state, rotor_speed=0.8)
    handle, u, far = scene.handle(), np.zeros(scene.n_commands), []
    steps = round(0.5 / scene.dt)
    assert scene.dt == 0.05
    for k in range(28):
        assert advance(handle, x, u, k * steps, steps, scene.dt) == 0
        far.append(np.abs(x[blades.first : blades.first + 6]).max())
    assert max(far[14:]) < 1.2 * max(far[:14])


def test_a_held_rotor_holds_the_generator():
    """As ElastoDyn without its generator degree of freedom."""
    scene = build_scene("oc3_hywind", **BARE).with_model(HELD | {"rigid_body.rotor_fixed": True})
    shaft, x, u = scene.model.shaft, state(scene.n_state, rotor_speed=1.2), (4e4, 0.0)
    x[shaft.first] = 1e-3
    dx = rates(scene, x, u)
    assert dx[shaft.first + 1] == dx[State.ROTOR_SPEED]
    assert dx[State.ROTOR_SPEED] == pytest.approx(
        -1e-3 * shaft.stiffness / inertias(scene.turbine)[0], rel=1e-12
    )


def test_outputs_are_of_either_side_of_the_shaft():
    scene = build_scene("oc3_hywind", **BARE)
    shaft, (_, _, ratio) = scene.model.shaft, inertias(scene.turbine)
    x = state(scene.n_state, rotor_speed=1.2, roll=0.1, wx=0.02, wz=0.03)
    x[shaft.first], x[shaft.first + 1] = 0.004, -0.01
    row = output_row(scene.handle(), x, np.array([3e4, 0.0]), 0.0, len(scene.channels))
    out = dict(zip((channel.name for channel in scene.channels), row, strict=True))
    assert out["GenSpeed"] == pytest.approx(ratio * 1.21, rel=1e-14)
    assert out["GenPwr"] == pytest.approx(0.944 * ratio * 1.21 * 3e4, rel=1e-14)
    assert (out["Q_DrTr"], out["QD_DrTr"]) == (0.004, -0.01)
    assert out["RotTorq"] == pytest.approx(shaft.stiffness * 0.004 - shaft.damping * 0.01, rel=1e-9)


def test_its_frequency_is_that_of_the_campbell_diagram():
    scene = build_scene("oc3_hywind", **BARE)
    shaft, held = scene.model.shaft, scene.with_model(HELD)
    x, step = np.zeros(scene.n_state), 1e-6
    x[shaft.first] = step
    hertz = np.sqrt(-rates(held, x)[shaft.first + 1] / step) / (2.0 * np.pi)
    diagram = campbell(scene.platform, scene.turbine, [0.0], blades="rigid", tower="rigid")
    assert hertz == pytest.approx(diagram.frequency["drivetrain torsion"][0], rel=1e-9)


def test_refusals_name_key_and_remedy():
    with pytest.raises(InputError, match=r"shaft = 'torsion'.*no \[shaft_torsion\].*allowed: 'rigid'"):
        build_scene("oc3_hywind", turbine="liu_1_50", shaft="torsion")
    with pytest.raises(InputError, match=r"shaft = 'torsion'.*planar = False"):
        build_scene("oc3_hywind", shaft="torsion", planar=True)


@pytest.mark.parametrize(
    ("case", "platform"),
    [("nrel5mw", "oc3_hywind"), pytest.param("iea15", "iea15_volturnus_s", marks=NIGHTLY)],
)
def test_a_lost_torque_rings_as_in_openfast(case, platform):
    """OpenFAST v5.0.0, rigid blades, 12 m/s, tower and platform held, generator torque lost at 20 s.

    The wind damps the rotor, which adds half a per cent to the decay of the NREL 5 MW; the other decay is
    that of OpenFAST's step, 0.4 over the frequency.
    """
    series = pd.read_csv(ELASTIC / f"{case}_torque_loss_rigid_blades.csv.gz", comment="#")
    scene = build_scene(platform, **BARE).with_model(HELD)
    rotor, generator, _ = inertias(scene.turbine)
    spring, first = scene.turbine.shaft_torsion, scene.model.shaft.first
    slow = generator / (rotor + generator) * series["RtFldMxh_[N-m]"] / spring.stiffness
    rows = series["time_s"].between(20.05, 23.0)
    t, twist = series["time_s"][rows] - 20.0, (series["Q_DrTr_[rad]"] - slow)[rows]
    # of the plant, at rest: q'' = -square q - 2 decay q'
    x = state(scene.n_state)
    x[first] = 1e-3
    square = -rates(scene, x)[first + 1] / 1e-3
    x[first], x[first + 1] = 0.0, 1e-3
    decay = -0.5 * rates(scene, x)[first + 1] / 1e-3
    start = series["Q_DrTr_[rad]"][:90].mean() * rotor / (rotor + generator)

    def ringing(t, size, decay, w, phase):
        return size * np.exp(-decay * t) * np.cos(w * t + phase)

    own = (start, decay, np.sqrt(square - decay**2), 0.0)
    (size, damped, w, _), _ = curve_fit(ringing, t, twist, p0=own)
    assert w == pytest.approx(own[2], rel=5e-4)
    assert damped == pytest.approx(decay, rel=0.02)
    assert size == pytest.approx(start * np.sqrt(1.0 + (decay / own[2]) ** 2), rel=0.01)
