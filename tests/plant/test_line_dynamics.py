"""Moving mooring lines against a plain twin, MoorDyn, OpenFAST with MoorDyn, and catenaries."""

from pathlib import Path

import naive.lines as naive
import numpy as np
import pandas as pd
import pytest

from fowt_env import build_scene, simulate
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.trim import trim
from fowt_env.descriptions.platform import Line, MovingLine
from fowt_env.envs.env import FowtEnv
from fowt_env.errors import InputError
from fowt_env.plant import line_dynamics as lines
from fowt_env.plant.mooring import build_mooring
from fowt_env.plant.state import N_RIGID, State, pose_of
from fowt_env.training.evaluation.metrics import damage_equivalent_load
from fowt_env.training.validation.openfast_cases import wave_components

REFERENCE = Path(__file__).parents[1] / "reference"
DEPTH, DENSITY, GRAVITY = 200.0, 1025.0, 9.81
MASS = 685.0  # kg/m, of the line of VolturnUS-S
VOLTURNUS = MovingLine(
    segments=20, diameter=0.333, drag_coefficient=2.0, axial_drag_coefficient=0.4,
    added_mass_coefficient=0.82, axial_added_mass_coefficient=0.27,
)  # fmt: skip
FAIRLEAD = np.array([-58.0, 0.0, -14.0])


def volturnus(segments=20, **changed):
    """(Mooring with dynamics) of one line of VolturnUS-S."""
    own = VOLTURNUS.model_copy(update={"segments": segments, **changed})
    weight = (MASS - DENSITY * 0.25 * np.pi * own.diameter**2) * GRAVITY
    line = Line(
        anchor=(-837.6, 0.0, -DEPTH), fairlead=tuple(FAIRLEAD), length=850.0, wet_weight=weight, EA=3.27e9
    )
    dynamics = lines.build_line_dynamics([line], [own], DENSITY, GRAVITY, DEPTH, first=N_RIGID)
    return build_mooring([line])._replace(dynamics=dynamics)


def state_of(mooring):
    """State vector of a platform without other states, whose line is at rest."""
    x = np.zeros(N_RIGID + lines.line_states(mooring))
    lines.fill_catenaries(mooring, pose_of(x), x)
    assert lines._relax_lines(x, None, mooring, mooring.dynamics, lines.line_work(mooring)) <= lines.AT_REST
    return x


def motion(t, rise=20.0):
    """(position, velocity) of the fairlead: surge and heave of different periods, rising from rest (s)."""
    w, fade = 2.0 * np.pi / 10.0, np.exp(-((t / rise) ** 2))
    ramp, rate = 1.0 - fade, 2.0 * t / rise**2 * fade
    x, z = 5.0 * np.sin(w * t), 1.5 * np.sin(1.3 * w * t + 0.4)
    u, v = 5.0 * w * np.cos(w * t), 1.5 * 1.3 * w * np.cos(1.3 * w * t + 0.4)
    return (
        FAIRLEAD + np.array([ramp * x, 0.0, ramp * z]),
        np.array([rate * x + ramp * u, 0.0, rate * z + ramp * v]),
    )


def driven(mooring, times, rise=20.0):
    """(len(times), 3) force on the fairlead of a platform that surges and heaves as `motion`."""
    x, work, forces = state_of(mooring), lines.line_work(mooring), []
    for k, t in enumerate(times):
        if k:
            lines.begin_lines(x, None, mooring, work)
        position, velocity = motion(t, rise)
        x[State.SURGE : State.HEAVE + 1] = position - FAIRLEAD
        x[State.VX : State.VZ + 1] = velocity
        if k:
            lines.end_lines(x, t - times[k - 1], None, mooring, np.zeros((1, 6)), work)
        row = np.zeros((1, 6))
        wrench = lines.lines_load(pose_of(x), x, mooring, row, np.zeros(8))
        forces.append(wrench[:3])
    return np.array(forces)


def test_a_driven_line_moves_as_its_plain_twin():
    """On the bed and off it, heavier across than along; the error falls with the longest substep."""
    mooring, times = volturnus(8, added_mass_coefficient=2.0), np.arange(0.0, 15.01, 0.1)
    length = 850.0 / 8
    twin = {
        "EA": 3.27e9, "BA": length * np.sqrt(3.27e9 * MASS), "l": length, "w": mooring.weight[0],
        "rho": DENSITY, "d": 0.333, "m": MASS, "Cdn": 2.0, "Cdt": 0.4, "Can": 2.0, "Cat": 0.27,
        "bed": -DEPTH, "kbot": 3e6, "cbot": 3e5,
    }  # fmt: skip
    nodes = state_of(mooring)[N_RIGID:].reshape(6, 7).T

    def path(t):
        return motion(t, rise=4.0)

    slow = naive.run(nodes[:, :3], nodes[:, 3:], path, mooring.anchor[0], twin, times, steps=12)
    scale = slow[:, 2].std()
    for parts, limit in ((1, 0.065), (10, 0.03)):
        fast = driven(mooring, np.linspace(0.0, 15.0, 150 * parts + 1), rise=4.0)[::parts]
        error = np.sqrt(((fast - slow) ** 2).mean(axis=0)).max() / scale
        assert error < limit
        assert np.abs(fast[:, 1]).max() < 1e-6 * scale


def test_a_line_at_rest_hangs_as_a_catenary():
    """Within the error of 100 segments: force of the line, tension at the anchor, length on the bed."""
    mooring = volturnus(100)
    x, moving, hanging = state_of(mooring), np.zeros((1, 6)), np.zeros((1, 6))
    force = lines.lines_load(pose_of(x), x, mooring, moving, np.zeros(8))
    resting = mooring._replace(dynamics=mooring.dynamics._replace(resting=True))
    expected = lines.lines_load(pose_of(x), x, resting, hanging, np.zeros(8))
    np.testing.assert_allclose(force[:3], expected[:3], rtol=1e-3, atol=1.0)
    np.testing.assert_allclose(moving[0, :4], hanging[0, :4], rtol=1e-3)
    assert abs(moving[0, 4] - hanging[0, 4]) < 8.5
    assert moving[0, 5] == hanging[0, 5]


def test_the_force_acts_at_the_fairlead():
    """The moment about the body origin is that of the force at the fairlead, in a turned platform too."""
    mooring = volturnus()
    x = state_of(mooring)
    x[State.PLATFORM_PITCH], x[State.YAW] = 0.05, 0.1
    wrench = np.array(lines.lines_load(pose_of(x), x, mooring, np.zeros((1, 6)), np.zeros(8)))
    np.testing.assert_allclose(wrench[3:], np.cross(FAIRLEAD, wrench[:3]), rtol=1e-12)


def test_half_a_node_at_the_fairlead_has_drag_and_damping():
    """A moving fairlead is held back by its segment's damper and by the drag of half a segment."""
    mooring = volturnus()
    x = state_of(mooring)
    still = np.array(lines.lines_load(pose_of(x), x, mooring, np.zeros((1, 6)), np.zeros(8)))
    x[State.VY] = 2.0
    across = np.array(lines.lines_load(pose_of(x), x, mooring, np.zeros((1, 6)), np.zeros(8))) - still
    half = 0.5 * 850.0 / 20
    np.testing.assert_allclose(across[1], -0.5 * DENSITY * 2.0 * 0.333 * half * 2.0**2, rtol=1e-9)
    last = x[N_RIGID : N_RIGID + 57].reshape(3, 19)[:, -1]
    q = (FAIRLEAD - last) / np.linalg.norm(FAIRLEAD - last)
    x[State.VY], x[State.VX], x[State.VZ] = 0.0, 0.1 * q[0], 0.1 * q[2]
    along = np.array(lines.lines_load(pose_of(x), x, mooring, np.zeros((1, 6)), np.zeros(8))) - still
    damping = np.sqrt(3.27e9 * MASS) * 0.1 + 0.5 * DENSITY * 0.4 * np.pi * 0.333 * half * 0.1**2
    np.testing.assert_allclose(along[:3], -damping * q, rtol=1e-6, atol=1e-6 * damping)


def test_lines_without_properties_are_refused():
    with pytest.raises(InputError, match="mooring = 'dynamic'.*no .line_dynamics.*for line 1"):
        build_scene("liu_1_50", mooring="dynamic")


def test_substeps_resolve_the_swing_of_a_line_by_the_tension_of_its_last_segment():
    mooring = volturnus()
    dynamics, x = mooring.dynamics, state_of(mooring)
    last = N_RIGID + np.array([18, 37, 56])
    for swing, count in ((3.9, 2), (7.9, 4), (8.1, 5)):  # rad/s, of a mass between two such segments
        tension = 0.25 * swing**2 * dynamics.mass[0] * dynamics.length[0]
        x[last] = FAIRLEAD - [0.0, 0.0, dynamics.length[0] + tension / dynamics.stiffness[0]]
        assert lines._substeps(0, 0.1, tuple(FAIRLEAD), x, dynamics) == count


def test_stiff_lines_shorten_the_step_of_a_light_platform():
    """The barge's eight lines hold 5450 t: 7.6 rad/s on their last segments."""
    barge = build_scene("nrel5mw_iti_barge", mooring="dynamic")
    assert barge.dt == 0.05
    assert build_scene("nrel5mw_iti_barge", mooring="dynamic", line_segments=8).dt == 0.1
    assert build_scene("nrel5mw_iti_barge").dt == 0.1


def test_a_driven_line_has_the_tensions_of_moordyn():
    """Force on the fairlead in 5 m of surge: MoorDyn's package includes the inertia of half a node."""
    theirs = pd.read_csv(REFERENCE / "moordyn_line.csv", comment="#")
    times = np.arange(0.0, 100.01, 0.1)
    ours = pd.DataFrame(driven(volturnus(), times)[:, [0, 2]] / 1e3, index=times.round(1))
    ours = ours.loc[theirs["time_s"].round(1)].to_numpy()
    theirs = theirs[["force_x_kN", "force_z_kN"]].to_numpy()
    np.testing.assert_allclose(ours.std(axis=0), theirs.std(axis=0), rtol=0.02)
    np.testing.assert_allclose(ours.mean(axis=0), theirs.mean(axis=0), rtol=0.005)
    assert (np.sqrt(((ours - theirs) ** 2).mean(axis=0)) < 0.06 * theirs.std(axis=0)).all()


@pytest.mark.nightly
def test_a_run_starts_in_equilibrium():
    """Still water: nothing moves but by the difference of 20 segments from a catenary, and drag holds it."""
    scene = build_scene("oc3_hywind", mooring="dynamic")
    run = simulate(scene, controller=None, duration=30.0)
    rest = trim(scene)
    assert np.ptp(run["PtfmSurge_[m]"]) < 0.01 and np.ptp(run["PtfmHeave_[m]"]) < 0.01
    for line in (1, 2, 3):
        tension = run[f"FAIRTEN{line}_[kN]"]
        np.testing.assert_allclose(tension, rest[f"FAIRTEN{line}"], rtol=0.01)
        assert np.ptp(tension) < 0.003 * tension.mean()
    moved = simulate(scene, controller=None, duration=1.0, initial={"PtfmSurge": 10.0})
    hanging = build_scene("oc3_hywind")
    expected = simulate(hanging, controller=None, duration=1.0, initial={"PtfmSurge": 10.0})
    names = [f"FAIRTEN{line}_[kN]" for line in (1, 2, 3)]
    np.testing.assert_allclose(moved[names].iloc[0], expected[names].iloc[0], rtol=0.01)


OPENFAST = {  # line: mean, standard deviation, damage-equivalent loads of exponents 3 and 4, kN
    1: (2413.1, 74.7, 95.1, 126.2),
    2: (2433.4, 95.0, 150.2, 203.1),
    3: (2433.4, 95.0, 150.2, 203.1),
}


@pytest.mark.nightly
def test_fairlead_fatigue_of_volturnus_in_waves_is_that_of_openfast_with_moordyn():
    """OpenFAST v5.0.0, MoorDyn file of the deck, Hs 7.5 m, no wind, 100 to 600 s."""
    scene = build_scene("iea15_volturnus_s", sea=wave_components(), mooring="dynamic")
    run = simulate(scene, controller=None, duration=600.0, initial="zero")
    run = run[run["Time_[s]"] > 100.0]
    for line, expected in OPENFAST.items():
        tension = run[f"FAIRTEN{line}_[kN]"].to_numpy()
        ours = tension.mean(), tension.std(), *(damage_equivalent_load(tension, 500.0, m) for m in (3, 4))
        np.testing.assert_allclose(ours, expected, rtol=0.02)


@pytest.mark.nightly
@pytest.mark.parametrize("integrator", ["rk4", "heun", "abm4"])
def test_integrators_advance_lines_alike(integrator):
    """Each step method gives the tensions of the default one in waves."""
    frames = []
    for method in (integrator, None):
        scene = build_scene("oc3_hywind", sea="regular:6:10", mooring="dynamic", integrator=method)
        frames.append(simulate(scene, controller=None, duration=60.0, dt=0.05)["FAIRTEN1_[kN]"].to_numpy())
    error = np.sqrt(np.mean((frames[0] - frames[1]) ** 2)) / frames[1].std()
    assert error < 0.01


@pytest.mark.nightly
def test_a_linear_model_has_the_lines_as_catenaries():
    moving, hanging = (build_scene("oc3_hywind", wind=18.0, mooring=kind) for kind in ("dynamic", True))
    ours, theirs = linearize(moving), linearize(hanging)
    assert ours.states == theirs.states
    np.testing.assert_allclose(ours.A, theirs.A, rtol=1e-6, atol=1e-9 * np.abs(theirs.A).max())


@pytest.mark.nightly
def test_an_environment_with_moving_lines_returns_to_a_snapshot():
    env = FowtEnv("above_rated", mooring="dynamic")
    env.reset(seed=1)
    action = np.zeros(env.action_space.shape, dtype=env.action_space.dtype)
    for _ in range(20):
        env.step(action)
    snapshot = env.get_state()
    first = [env.step(action)[0] for _ in range(20)]
    env.set_state(snapshot)
    again = [env.step(action)[0] for _ in range(20)]
    np.testing.assert_array_equal(first, again)
