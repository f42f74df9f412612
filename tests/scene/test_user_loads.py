"""Loads of one's own: statics, springs, dampers against formulas, and their part in every use of a scene."""

import os
import pickle
import subprocess
import sys
from math import exp, isfinite, nan, pi, radians, sin, sqrt
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest
from plant_helpers import rates

import fowt_env
from fowt_env import Force, Load, Motion, build_scene, linearize, load_kernel, natural_periods, simulate, trim
from fowt_env.descriptions.platform import read_platform
from fowt_env.envs import FowtEnv, FowtVectorEnv
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.plant.advance import output_row
from fowt_env.plant.hydro.morison import current_at
from fowt_env.plant.hydro.waves import wave_kinematics
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State, pose_of

ROOT = Path(fowt_env.__file__).resolve().parent.parent
WEATHER = {
    "wind": 18.0,
    "sea": {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3},
    "rotor": "table",
    "fidelity": "standard",
    "wave_components": 20,
}
QUICK = {"rotor": "table", "wave_components": 20}


class Push(NamedTuple):
    """Parameters of push."""

    fx: float = 0.0
    fy: float = 0.0
    fz: float = 0.0
    mx: float = 0.0
    my: float = 0.0
    mz: float = 0.0


@load_kernel
def push(parameters, motion, force):
    """A constant force and moment."""
    for i in range(6):
        force[i] = parameters[i]


@load_kernel
def yaw_spring(parameters, motion, force):
    force[5] = -parameters[0] * motion[Motion.YAW]


@load_kernel
def heave_damper(parameters, motion, force):
    force[2] = -parameters[0] * motion[Motion.VZ]


@load_kernel
def probe(parameters, motion, force):
    """Shows three entries of motion as a force."""
    for i in range(3):
        force[i] = motion[int(parameters[0]) + i]


@load_kernel
def failing_later(parameters, motion, force):
    force[0] = sqrt(parameters[0] - motion[Motion.TIME])


@load_kernel
def failing_in_wind(parameters, motion, force):
    force[0] = sqrt(5.0 - motion[Motion.WIND_X])


@load_kernel
def lagged_push(parameters, motion, force):
    """A force that follows mean + amplitude sin(omega t) with a lag: tau, mean, amplitude, omega."""
    tau, mean, amplitude, omega = parameters
    force[Force.FX] = motion[Motion.STATE]
    force[Force.RATE] = (mean + amplitude * sin(omega * motion[Motion.TIME]) - motion[Motion.STATE]) / tau


def still(*loads, platform="oc3_hywind", **options):
    return build_scene(platform, fidelity="standard", loads=loads, **options)


def stormy(*loads, **options):
    return build_scene("oc3_hywind", loads=loads, **(WEATHER | options))


def with_hydro(**changes):
    platform = read_platform("oc3_hywind")
    return platform.model_copy(update={"hydro": platform.hydro.model_copy(update=changes)})


def test_without_loads_there_is_no_part_and_no_channel():
    scene = still()
    assert scene.model.user is None and scene.loads == ()
    assert len(scene.channels) == len(build_scene("oc3_hywind", fidelity="reference").channels)
    assert scene.data().user.size == 0


@pytest.mark.nightly
def test_a_force_at_the_fairleads_is_held_by_the_lines_alone():
    """theory.md 5.5: the lines pull 380.67 kN back at 10 m of surge; weight and buoyancy feel no lean."""
    point = trim(still(Load("Tug", push, Push(fx=380.67e3), point=(0.0, 0.0, -70.0))))
    at_fairlead = point["PtfmSurge"] - 70.0 * np.sin(radians(point["PtfmPitch"]))
    assert at_fairlead == pytest.approx(10.0, rel=2e-3)  # the lines' moment leans the spar a little
    assert abs(point["PtfmPitch"] - trim(still())["PtfmPitch"]) < 0.05
    assert point["TugFxi"] == pytest.approx(380.67e3, rel=1e-12)
    moment = 380.67e3 * (-70.0 * np.cos(radians(point["PtfmPitch"])))
    assert point["TugMyi"] == pytest.approx(moment, rel=1e-12)


def test_a_moment_leans_the_spar_by_the_metacentric_formula():
    """M = (rho g I + B z_B - W z_G + preload 70 m) theta; the lines' own turning stiffness adds 0.4 %."""
    moment = 2e7
    platform = read_platform("oc3_hywind")
    points = [trim(still(Load("Couple", push, Push(my=m)))) for m in (moment, -moment)]
    lean = radians(points[0]["PtfmPitch"] - points[1]["PtfmPitch"]) / 2.0  # the nacelle leans it by itself
    body = still().model.rigid_body
    buoyancy, preload, diameter = 80708144.0, 1607182.0, 6.5
    z = np.linspace(-120.0, 0.0, 120001)
    area = 0.25 * pi * np.interp(z, platform.hull.z, platform.hull.diameter) ** 2
    centre = np.trapezoid(area * z, z) / np.trapezoid(area, z)
    stiffness = 1025.0 * 9.80665 * pi * diameter**4 / 64.0 + buoyancy * centre
    stiffness += -body.s_z * 9.80665 + preload * 70.0
    assert lean == pytest.approx(moment / stiffness, rel=8e-3)


def test_at_a_loaded_trim_the_rest_of_the_plant_balances_the_load_exactly():
    load = Load("Push", push, Push(2e5, 3e4, -1e5, 1e6, 2e6, 3e6), point=(2.0, -1.0, -50.0))
    point, scene = trim(still(load)), still()
    data = scene.data()
    rates(scene, point.state, handle=scene.handle(data))
    pose = pose_of(point.state)
    turn = np.array([getattr(pose, f"r{i}{j}") for i in (1, 2, 3) for j in (1, 2, 3)]).reshape(3, 3)
    force, moment = turn.T @ load.parameters[:3], turn.T @ load.parameters[3:]
    expected = np.r_[force, moment + np.cross(load.point, force)]
    left = data.cache[LoadCache.TOTAL : LoadCache.TOTAL + 6]
    assert np.abs(left + expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.nightly
def test_a_yaw_spring_is_the_same_stiffness_of_the_platform_file():
    own = still(Load("Delta", yaw_spring, [5e7], axes="body"))
    same = still(platform=with_hydro(yaw_stiffness=98.34e6 + 5e7))
    assert natural_periods(own)["yaw"] == pytest.approx(natural_periods(same)["yaw"], rel=1e-9)
    assert natural_periods(own)["yaw"] < 0.9 * natural_periods(still())["yaw"]
    runs = [simulate(s, None, 60.0, initial={"PtfmYaw": 5.0}) for s in (own, same)]
    difference = np.abs(runs[0]["PtfmYaw_[deg]"] - runs[1]["PtfmYaw_[deg]"]).max()
    assert difference < 1e-9
    shown = runs[0]["DeltaMzi_[N-m]"] + 5e7 * np.radians(runs[0]["PtfmYaw_[deg]"])
    assert (
        np.abs(shown).max() < 1e-3 * np.abs(runs[0]["DeltaMzi_[N-m]"]).max()
    )  # roll and pitch are not quite zero


def test_a_linear_damper_takes_the_decay_down_as_the_formula_says():
    """Heave is linear but for its coupling through the lines: the envelope falls with exp(-b t / 2 M)."""
    b = 2e5
    own, bare = still(Load("Damper", heave_damper, [b], axes="body")), still()
    same = still(platform=with_hydro(linear_damping=[1e5, 1e5, 1.3e5 + b, 0.0, 0.0, 1.3e7]))
    mass = 8066048.0 + 250319.0
    sigma = {}
    for name, scene in (("own", own), ("same", same), ("bare", bare)):
        modes = {mode.name: mode for mode in linearize(scene).modes()}
        sigma[name] = modes["heave"].damping_ratio * modes["heave"].frequency
    assert sigma["own"] == pytest.approx(sigma["same"], rel=1e-9)
    assert sigma["own"] - sigma["bare"] == pytest.approx(b / (2.0 * mass), rel=2e-3)
    rest = trim(bare)["PtfmHeave"]
    peaks = []
    for scene in (own, bare):
        heave = simulate(scene, None, 180.0, initial={"PtfmHeave": rest + 1.0})["PtfmHeave_[m]"] - rest
        inner = heave.to_numpy()
        top = np.flatnonzero((inner[1:-1] > inner[:-2]) & (inner[1:-1] >= inner[2:])) + 1
        peaks.append((0.1 * top[4], inner[top[4]]))
    ratio = peaks[0][1] / peaks[1][1]
    assert ratio == pytest.approx(exp(-b / (2.0 * mass) * peaks[0][0]), rel=1e-2)


@pytest.mark.nightly
def test_a_load_of_no_strength_is_the_plant_without_it():
    loaded = simulate(stormy(Load("Nothing", push, Push())), "pi", 30.0)
    bare = simulate(stormy(), "pi", 30.0)
    scale = bare.std() + 1e-9
    assert ((loaded[bare.columns] - bare).abs().max() / scale).max() < 1e-7
    assert (loaded[[c for c in loaded if c.startswith("Nothing")]] == 0.0).all(axis=None)


def test_motion_holds_what_its_names_say():
    """Probes at a point, with wind, waves and current, against kinematics written out here."""
    point, names = (3.0, -2.0, -20.0), ("X", "VX", "WX", "SURGE", "ROLL", "R11", "R31", "WATER_X")
    loads = [Load(f"P{name}", probe, [Motion[name]], point, water=name == "WATER_X") for name in names]
    scene = stormy(*loads, current={"speed": 0.8, "heading": 20.0, "exponent": 0.5})
    x = trim(scene).state
    x[: State.YAW + 1] += [1.0, 2.0, -0.5, 0.03, 0.05, -0.04]
    x[State.VX : State.WZ + 1] = [0.5, -0.3, 0.2, 0.01, -0.02, 0.005]
    t = 7.3
    row = output_row(scene.handle(), x, np.array([4e4, 0.2]), t, len(scene.channels))
    values = dict(zip((channel.name for channel in scene.channels), row, strict=True))
    shown = {name: np.array([values[f"P{name}F{axis}i"] for axis in "xyz"]) for name in names}
    pose = pose_of(x)
    turn = np.array([getattr(pose, f"r{i}{j}") for i in (1, 2, 3) for j in (1, 2, 3)]).reshape(3, 3)
    place = x[:3] + turn @ point
    spin = turn @ x[State.WX : State.WZ + 1]
    velocity = turn @ x[State.VX : State.VZ + 1] + np.cross(spin, turn @ point)
    water = wave_kinematics(t, *place, scene.model.hydro.waves)
    u, v = current_at(place[2], 320.0, scene.model.hydro.current)
    expected = {
        "X": place,
        "VX": velocity,
        "WX": spin,
        "SURGE": x[:3],
        "ROLL": x[State.ROLL : State.YAW + 1],
        "R11": turn[0],
        "R31": turn[2],
        "WATER_X": np.array([water.u + u, water.v + v, water.w]),
    }
    for name in names:
        assert np.allclose(shown[name], expected[name], rtol=1e-12, atol=1e-14), name


@pytest.mark.nightly
def test_wind_surface_rotor_and_body_axes_are_those_of_the_channels():
    hub = (-5.0191, 0.0, 89.563)
    names = ("WIND_X", "ELEVATION", "TIME", "ROTOR_SPEED", "WATER_AX")
    loads = [Load(f"P{name}", probe, [Motion[name]], hub) for name in names]
    loads += [Load("PBody", probe, [Motion.VX], hub, axes="body")]
    run = simulate(stormy(*loads), "pi", 20.0).iloc[100]
    assert run["Time_[s]"] == 10.0
    assert run["PTIMEFxi_[N]"] == pytest.approx(10.0, rel=1e-12)  # turned to body axes and back
    assert run["PELEVATIONFxi_[N]"] == pytest.approx(run["Wave1Elev_[m]"], rel=1e-12)
    assert run["PROTOR_SPEEDFxi_[N]"] == pytest.approx(run["RotSpeed_[rpm]"] * pi / 30.0, rel=1e-12)
    assert run["PWIND_XFxi_[N]"] == pytest.approx(18.0, rel=2e-3)  # of the hub on its way, not at rest
    assert run["PWATER_AXFxi_[N]"] == 0.0  # not asked for
    platform_speed = run["PtfmTVxi_[m/s]"] + radians(run["PtfmRVyi_[deg/s]"]) * 89.5
    assert run["PBodyFxi_[N]"] == pytest.approx(platform_speed, rel=0.02)  # turned to and fro again


def test_a_load_on_the_nacelle_is_carried_by_the_tower_base_and_one_on_the_hull_is_not():
    force = Push(fx=1e5, fy=2e4)
    changes = []
    for z in (90.0, -20.0):
        rows = []
        for strength in (force, Push()):
            scene = stormy(Load("Push", push, strength, point=(0.0, 0.0, z)))
            held = scene.with_model({"rigid_body.platform_fixed": True})
            row = output_row(held.handle(), np.zeros(held.n_state), np.zeros(2), 0.0, len(held.channels))
            rows.append(dict(zip((c.name for c in held.channels), row, strict=True)))
        changes.append({name: rows[0][name] - rows[1][name] for name in rows[0]})
    upper, lower = changes
    assert upper["TwrBsFxt"] == pytest.approx(1e5) and upper["TwrBsMyt"] == pytest.approx(1e5 * 80.0)
    assert upper["TwrBsMxt"] == pytest.approx(-2e4 * 80.0)
    assert {lower[f"TwrBs{kind}t"] for kind in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")} == {0.0}


def test_weather_drawn_anew_keeps_the_loads():
    scene = stormy(Load("Push", push, Push(fx=1e5))).with_weather(16.0, WEATHER["sea"], 5)
    assert scene.model.user is not None
    assert simulate(scene, "pi", 5.0)["PushFxi_[N]"].to_numpy() == pytest.approx(1e5)


def test_a_planar_scene_takes_loads_in_its_plane_alone():
    sideways, along = Load("Side", push, Push(fy=1e4)), Load("Along", push, Push(fx=2e5))
    with pytest.raises(InputError, match="load 'Side': acts out of the plane"):
        still(sideways, planar=True)
    planar, full = trim(still(along, planar=True)), trim(still(along))
    assert planar["PtfmSurge"] == pytest.approx(full["PtfmSurge"], abs=1e-6)
    assert planar["PtfmPitch"] == pytest.approx(full["PtfmPitch"], abs=1e-6)


LOADS = (
    Load("Damper", heave_damper, [2e6], point=(0.0, 0.0, -110.0)),
    Load("Wind", probe, [Motion.WIND_X], point=(0.0, 0.0, 90.0)),
    Load("Winch", lagged_push, (4.0, 2e4, 1e4, 0.5), states=1),
)


def test_environments_run_with_loads_and_the_vector_form_gives_their_bits():
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (12, 2, 2))
    envs = [FowtEnv(loads=LOADS, **QUICK) for _ in range(2)]
    together = FowtVectorEnv(2, threads=2, loads=LOADS, **QUICK)
    observations, _ = together.reset(seed=4)
    single = [env.reset(seed=4 + i)[0] for i, env in enumerate(envs)]
    assert np.array_equal(observations, single)
    for action in actions:
        observations, rewards, *_ = together.step(action)
        for i, env in enumerate(envs):
            observation, reward, *_ = env.step(action[i])
            assert np.array_equal(observation, observations[i]) and reward == rewards[i]
    assert envs[0].channels()["WindFxi"] > 5.0
    weak = FowtEnv(loads=(Load("Damper", heave_damper, [0.0], point=LOADS[0].point), *LOADS[1:]), **QUICK)
    weak.reset(seed=4)
    for action in actions:
        last = weak.step(action[0])[0]
    assert not np.array_equal(last, observations[0])


def test_an_episode_begins_at_the_steady_state_of_its_own_loads():
    """Steady states are remembered over environments: each plant has its own."""
    begun = []
    for fx in (0.0, 3e5, -3e5):
        env = FowtEnv(task="above_rated", loads=[Load("Push", push, Push(fx=fx))], **QUICK)
        env.reset(seed=1, options={"wind": 16.0, "offsets": {}})
        begun.append(env.channels()["PtfmSurge"])
        assert begun[-1] == pytest.approx(trim(env.scene)["PtfmSurge"], abs=1e-6)
    assert begun[1] > begun[0] + 1.0 > begun[2] + 2.0


def test_a_pickled_snapshot_of_a_loaded_environment_goes_on_bit_for_bit():
    env = FowtEnv(loads=LOADS, **QUICK)
    env.reset(seed=1)
    env.step([0.1, -0.1])
    saved = pickle.loads(pickle.dumps(env.get_state()))
    expected = [env.step([0.2, 0.3])[0] for _ in range(5)][-1]
    env.set_state(saved)
    assert np.array_equal([env.step([0.2, 0.3])[0] for _ in range(5)][-1], expected)
    with pytest.raises(InputError, match="another plant"):
        FowtEnv(loads=LOADS[:1], **QUICK).set_state(saved)


PROCESS = """
import sys
from fowt_env import Force, Load, Motion, build_scene, load_kernel, simulate
from fowt_env.plant.compile.notice import compilation_reported
@load_kernel
def one(parameters, motion, force):
    force[0] = -parameters[0] * motion[Motion.VX]
@load_kernel
def other(parameters, motion, force):
    force[4] = -parameters[0] * motion[Motion.WY] * abs(motion[Motion.WY])
said = []
kernel, strength = ((one, 1e5), (other, 1e10))[int(sys.argv[1])]
with compilation_reported(said.append):
    for loads in ((), (Load("Own", kernel, [strength]),)):
        frame = simulate(build_scene(fidelity="standard", loads=loads), None, duration=float(sys.argv[2]),
                         initial={"start": "zero", "PtfmPitch": 5.0})
        print(repr(float(frame["PtfmPitch_[deg]"].iloc[-1])))
print(int(bool(said)))
"""


def process(*arguments, **environment):
    """Lines that PROCESS prints in a fresh Python."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROCESS, *arguments],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment, capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_another_load_in_another_process_compiles_no_kernel_of_the_package():
    first, again, other = (process(which, "10") for which in "001")
    assert again == [*first[:2], "0"]  # nothing was compiled, and the bits are the same
    assert other[0] == first[0] and other[2] == "0"
    assert len({first[0], first[1], other[1]}) == 3


@pytest.mark.nightly
def test_without_the_jit_a_load_gives_the_same_figures():
    compiled, plain = process("1", "0.5"), process("1", "0.5", NUMBA_DISABLE_JIT="1")
    assert float(plain[1]) == pytest.approx(float(compiled[1]), rel=1e-9)
    assert plain[1] != plain[0]


@load_kernel
def beyond_its_parameters(parameters, motion, force):
    force[0] = parameters[3]


@load_kernel
def beyond_the_force(parameters, motion, force):
    force[6] = 1.0


@load_kernel
def not_a_number(parameters, motion, force):
    force[1] = nan


@load_kernel
def writing_to_motion(parameters, motion, force):
    motion[0] = 1.0


def plain(parameters, motion, force):
    """Not compiled."""


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Load("Mine", plain), "load 'Mine': kernel = .*decorated with @fowt_env.load_kernel"),
        (lambda: Load("my load", push), "name = 'my load'"),
        (lambda: Load("Mine", push, ["a"]), r"load 'Mine': parameters = \['a'\]"),
        (lambda: Load("Mine", push, [nan]), "load 'Mine': parameters = .nan.: must be a list of finite"),
        (lambda: Load("Mine", push, 3.0), "load 'Mine': parameters = 3.0"),
        (lambda: Load("Mine", push, [], (1.0, 2.0)), "load 'Mine': point = .*three numbers"),
        (lambda: Load("Mine", push, axes="world"), "load 'Mine': axes = 'world'"),
        (lambda: Load("Mine", push, water=1), "load 'Mine': water = 1"),
        (lambda: still(push), "loads: .*must be a fowt_env.Load"),
        (lambda: still(Load("Mine", push)), "load 'Mine': its kernel failed: IndexError"),
        (
            lambda: still(Load("Mine", beyond_its_parameters, [1.0])),
            "load 'Mine': its kernel failed: IndexError",
        ),
        (lambda: still(Load("Mine", beyond_the_force)), "load 'Mine': its kernel failed: IndexError"),
        (lambda: still(Load("Mine", not_a_number)), "load 'Mine': its kernel gave force = .*nan"),
        (lambda: still(Load("Mine", writing_to_motion)), "load 'Mine': its kernel failed: ValueError"),
        (lambda: still(*[Load("Mine", push, Push())] * 2), "load 'Mine': its channel MineFxi exists"),
        (lambda: still(Load("Hydro", push, Push())), "load 'Hydro': its channel HydroFxi exists"),
        (lambda: still(*[Load(f"L{i}", push, Push()) for i in range(9)]), "9 of them: at most 8"),
        (lambda: load_kernel(lambda a, b: None), "must take three arguments"),
        (lambda: load_kernel(3), "must be a plain Python function"),
    ],
)
def test_what_cannot_be_a_load_is_refused_by_name(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_kernels_that_differ_in_an_outer_number_alone_are_told_apart():
    """Trims are remembered by what a load does, not by its name."""

    def spring(stiffness, table):
        def kernel(parameters, motion, force):
            force[0] = -stiffness * motion[Motion.X] + table[0]

        return Load("Spring", load_kernel(kernel)).key()

    same, zeros = spring(1.0, np.zeros(1)), np.zeros(1)
    assert spring(1.0, zeros) == same
    assert spring(2.0, zeros) != same and spring(1.0, np.ones(1)) != same


def test_so_are_those_that_differ_in_a_number_of_a_module_they_name():
    constants = ModuleType("constants")
    constants.GAIN, constants.UNUSED, constants.itself = 1.0, 5.0, constants

    def key():
        def kernel(parameters, motion, force):
            force[0] = -constants.GAIN * motion[Motion.X]

        return Load("Spring", load_kernel(kernel)).key()

    before = key()
    constants.UNUSED = 6.0
    assert key() == before
    constants.GAIN = 2.0
    assert key() != before


def test_a_kernel_that_numba_cannot_compile_is_refused_by_name():
    with pytest.raises(InputError, match="load kernel 'wordy': numba cannot compile it"):

        @load_kernel
        def wordy(parameters, motion, force):
            force[0] = motion["speed"]


def test_a_load_that_fails_during_a_run_is_named():
    scene = still(Load("Fine", push, Push()), Load("Late", failing_later, [3.0]))
    with pytest.raises(SimulationStopped, match="non-finite state: load 'Late' gave") as caught:
        simulate(scene, None, 10.0)
    assert 2.9 < caught.value.time < 3.3 and isfinite(caught.value.frame["PtfmPitch_[deg]"].iloc[-2])
    with pytest.raises(InputError, match="no steady state found .* load 'Windy' gave"):
        trim(stormy(Load("Windy", failing_in_wind)))


def test_an_episode_that_a_load_spoils_says_so():
    loads = [Load("Late", failing_later, [1.0])]
    env, together = FowtEnv(loads=loads, **QUICK), FowtVectorEnv(1, loads=loads, **QUICK)
    env.reset(seed=0)
    together.reset(seed=0)
    for _ in range(20):
        *_, terminated, _, info = env.step([0.0, 0.0])
        *_, infos = together.step([[0.0, 0.0]])
        if terminated:
            break
    assert (
        info["termination"]
        == infos["termination"][0]
        == ("non-finite state: load 'Late' gave a force that is not finite")
    )


# ------------------------------------------------------------------ states of a load's own


def lagged(time, tau, mean, amplitude, omega):
    """What lagged_push does from its steady value at time 0 on."""
    swing = np.sin(omega * time) - omega * tau * (np.cos(omega * time) - np.exp(-time / tau))
    return mean + amplitude * swing / (1.0 + (omega * tau) ** 2)


@load_kernel
def integral(parameters, motion, force):
    force[Force.RATE] = parameters[0]


@pytest.mark.parametrize("fidelity", ["standard", pytest.param("reference", marks=pytest.mark.nightly)])
def test_loads_with_states_follow_the_solution_of_their_equations(fidelity):
    cases = {"Winch": (4.0, 2e5, 1e5, 0.4), "Jet": (1.0, -1e5, 5e4, 0.9)}
    loads = [Load(name, lagged_push, values, states=1) for name, values in cases.items()]
    scene = build_scene(fidelity=fidelity, loads=[loads[0], Load("Still", push, Push(fy=1e3)), loads[1]])
    assert [block[:3] for block in scene.blocks[-2:]] == [("load Winch", 15, 1), ("load Jet", 16, 1)]
    frame = simulate(scene, duration=20.0)
    for name, values in cases.items():
        expected = lagged(frame["Time_[s]"].to_numpy(), *values)
        assert np.abs(frame[f"{name}Fxi_[N]"] - expected).max() < 2e-4 * values[2]
    assert frame["StillFyi_[N]"].to_numpy() == pytest.approx(1e3)


def test_a_trim_settles_the_states_and_refuses_what_never_settles():
    lagged = trim(still(Load("Winch", lagged_push, (4.0, 2e5, 0.0, 1.0), states=1)))
    assert lagged.state[State.INTERNAL] == pytest.approx(2e5, rel=1e-9)
    steady = trim(still(Load("Winch", push, Push(fx=2e5))))
    assert lagged.state[: State.INTERNAL] == pytest.approx(steady.state, rel=1e-7, abs=1e-9)
    with pytest.raises(InputError, match="load Sum: its states have no steady value"):
        trim(still(Load("Sum", integral, (1.0,), states=1)))


@pytest.mark.parametrize("states", [-1, 1.5, True, 101])
def test_a_number_of_states_that_cannot_be_is_named(states):
    with pytest.raises(InputError, match="states = .*: must be a whole number from 0 to 100"):
        Load("Winch", lagged_push, (4.0, 2e5, 0.0, 1.0), states=states)
