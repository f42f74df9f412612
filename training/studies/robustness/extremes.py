"""Runs extreme events on the operating or parked turbine, and hostile actions on the environment."""

from collections import Counter
from dataclasses import dataclass, field
from itertools import product
from math import pi

import numpy as np
import pandas as pd

from fowt_env.controllers import make
from fowt_env.descriptions.checks import check_whole_number
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError
from fowt_env.plant.advance import RUNNING, STOP_REASONS, advance, forget, observe
from fowt_env.plant.measurement import N_MEASUREMENTS, Measurement
from fowt_env.plant.mooring import Mooring
from fowt_env.plant.state import Command, State
from fowt_env.run.initial_conditions import initial_state
from fowt_env.scene.build import build_scene
from fowt_env.training.benchmarks.speed import silent
from fowt_env.training.evaluation.run_case import CONTROL_DT
from fowt_env.training.studies.robustness.random_cases import STEEPEST

EVENT = 60.0  # s, start of gusts and faults
DURATION = 180.0  # s of a run: two minutes after the event
GRAVITY = 9.80665
NORMAL_SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 11.0}
STORM_SEA = {"kind": "jonswap", "Hs": 15.6, "Tp": 16.0, "gamma": 3.0}
STORM_WIND = {"kind": "ewm", "turbine_class": "I", "recurrence": 50, "turbulent": True}
HOSTILE_STEPS = 3000  # control periods of each hostile policy: five minutes


@dataclass(frozen=True)
class Extreme:
    """Describes an extreme run: weather, and the fault (a name of FAULTS or "line loss") at EVENT."""

    group: str
    wind: object
    sea: object = field(default_factory=lambda: dict(NORMAL_SEA))
    parked: bool = False  # rotor locked, blades feathered
    fault: str = ""
    line: int = 0  # index of the lost line
    duration: float = DURATION


FAULTS = {  # name: command (torque, pitch) from controller command, maximum pitch and pitch at EVENT
    "emergency stop": lambda command, feathered, stuck: (0.0, feathered),  # at the rate limit of the actuator
    "grid loss": lambda command, feathered, stuck: (0.0, command[1]),
    "grid loss, no pitch action": lambda command, feathered, stuck: (0.0, stuck),
    "stuck pitch": lambda command, feathered, stuck: (command[0], stuck),
}


def _etm(speed):
    return {"kind": "etm", "speed": speed, "class": "A"}


def _gust(kind, speed, **settings):
    return {"kind": kind, "speed": speed, "start": EVENT, **settings}


def _steep(period):
    height = STEEPEST * GRAVITY * period**2 / (2.0 * pi)
    return {"kind": "regular", "H": height, "T": period, "ramp": 2.0 * period}


SIGNS = (1, -1)
EXTREMES = {
    # gusts of every kind at critical wind speeds
    **{f"EOG {u:g} m/s": Extreme("EOG", _gust("eog", u)) for u in (10.0, 11.4, 13.0, 25.0)},
    **{
        f"ECD {u:g} m/s, sign {sign:+d}": Extreme("ECD", _gust("ecd", u, sign=sign))
        for u, sign in product((6.0, 12.0, 25.0), SIGNS)
    },
    **{
        f"EWS {u:g} m/s, {way} {sign:+d}": Extreme("EWS", _gust("ews", u, sign=sign, orientation=way))
        for way, sign, u in product(("vertical", "horizontal"), SIGNS, (12.0, 25.0))
    },
    **{f"ETM {u:g} m/s": Extreme("ETM", _etm(u)) for u in (12.0, 18.0, 25.0)},
    # parked and idling in the storm from several directions, and in waves at breaking steepness
    **{
        f"50-year storm, wind from {side:g} deg off, {rotor}": Extreme(
            "50-year storm", STORM_WIND | {"direction": side}, STORM_SEA, parked=rotor == "parked"
        )
        for side, rotor in product((0.0, 45.0, 90.0, 180.0), ("parked", "idling"))
    },
    **{
        f"breaking-steep wave, {_steep(period)['H']:.1f} m, {period:g} s, {rotor}": Extreme(
            "breaking-steep wave", wind, _steep(period), parked=rotor == "parked"
        )
        for period, (rotor, wind) in product((6.0, 8.0, 10.0, 12.0), (("parked", 40.0), ("operating", 18.0)))
    },
    **{
        f"line {line + 1} lost {words}": Extreme("line loss", *weather, fault="line loss", line=line)
        for line in range(3)
        for words, weather in (
            ("in the 50-year storm, parked", (STORM_WIND, STORM_SEA, True)),
            ("at 18 m/s ETM, operating", (_etm(18.0),)),
        )
    },
    **{
        f"{fault} at {u:g} m/s ETM": Extreme(fault.removesuffix(", no pitch action"), _etm(u), fault=fault)
        for fault, u in product(FAULTS, (11.4, 18.0, 25.0))
    },
    **{
        f"{fault} in EOG 13 m/s": Extreme(fault, _gust("eog", 13.0), fault=fault)
        for fault in ("grid loss", "emergency stop", "stuck pitch")
    },
}
PEAKS = ("rotor_rpm", "tilt_deg", "yaw_deg", "offset_m", "heave_m", "tension_MN")


def without_line(scene, line):
    """Return the scene without one mooring line (0, 1, ..), the others solved as catenaries.

    Raises: InputError if there is no such line.
    """
    check_whole_number("line", line, 0, scene.n_lines - 1)
    # mooring tables are only valid near the rest position of all lines
    arrays = scene.model.mooring._replace(table=None, dynamics=None)._asdict()
    kept = {
        name: np.ascontiguousarray(np.delete(array, line, axis=0))
        for name, array in arrays.items()
        if array is not None
    }
    return scene.with_model(mooring=Mooring(**kept))


def course(case, scene, dt):
    """Run an Extreme with steps of dt (s); return (status, time reached, {PEAKS: largest}, final state)."""
    (x, u), controller, stuck = initial_state(scene), None, None  # stuck: blade pitch at EVENT
    feathered = scene.turbine.pitch_drive.maximum
    if case.parked:
        x[State.ROTOR_SPEED] = u[Command.GENERATOR_TORQUE] = 0.0
        x[State.BLADE_PITCH] = u[Command.BLADE_PITCH] = feathered
        scene = scene.with_model({"rigid_body.rotor_fixed": True})
    elif x[State.ROTOR_SPEED] > 0.0:  # above cut-out the trim is feathered and idling, without control
        controller = make("pi", scene.turbine, CONTROL_DT)
    dx, row, peaks = np.zeros_like(x), np.zeros(N_MEASUREMENTS), np.zeros(len(PEAKS))
    data, per_control = scene.data(), round(CONTROL_DT / dt)
    handle = scene.handle(data)
    forget(handle)
    observe(handle, x, u, 0.0, dx, row)
    if controller is not None:
        controller.reset(Measurement(*row.tolist()))
    status, time = RUNNING, case.duration
    for step in range(0, round(case.duration / CONTROL_DT) * per_control, per_control):
        if case.fault and stuck is None and step * dt >= EVENT - 1e-9:
            stuck = float(x[State.BLADE_PITCH])
            if case.fault == "line loss":
                scene = without_line(scene, case.line)
                data = scene.data()
                handle = scene.handle(data)
        observe(handle, x, u, step * dt, dx, row)
        now = (
            abs(x[State.ROTOR_SPEED]) / RPM, np.abs(x[[State.ROLL, State.PLATFORM_PITCH]]).max() / DEGREE,
            abs(x[State.YAW]) / DEGREE, np.hypot(x[State.SURGE], x[State.SWAY]), abs(x[State.HEAVE]),
            data.lines[:, 2].max() * 1e-6,
        )  # fmt: skip
        np.fmax(peaks, now, out=peaks)
        if controller is not None:
            u[:] = controller.act(Measurement(*row.tolist()))
        if stuck is not None and case.fault in FAULTS:
            u[:] = FAULTS[case.fault](u, feathered, stuck)
        status = advance(handle, x, u, step, per_control, dt)
        if status != RUNNING:
            time = (step + per_control) * dt
            break
    return status, time, dict(zip(PEAKS, peaks.tolist(), strict=True)), x


def run_extreme(name, seed=1, finer=1, scene=None):
    """Run one of EXTREMES with its step divided by finer; return the row (dict) of peaks and verdict.

    The verdict states the reason of a stop, or an overspeed that would terminate an episode.
    """
    case = EXTREMES[name]
    if scene is None:
        scene = build_scene(wind=case.wind, sea=case.sea, seed=seed, fidelity="standard", duration=DURATION)
    status, time, peaks, x = course(case, scene, scene.dt / finer)
    verdict, limit = "finite", scene.turbine.overspeed / RPM
    if status != RUNNING:
        verdict = f"{STOP_REASONS[status]} at {time:.1f} s"
    elif peaks["rotor_rpm"] > limit:
        verdict = f"finite, beyond the overspeed limit of {limit:.2f} rpm"
    finite = bool(np.isfinite([*x, *peaks.values()]).all())
    return {"group": case.group, "case": name, **peaks, "finite": finite, "verdict": verdict}


def extremes(seed, progress):
    """Run all EXTREMES and return a DataFrame; step_change: largest change of a peak with half the step."""
    rows, base = [], None
    for done, (name, case) in enumerate(EXTREMES.items()):
        progress(f"extremes: {name}", done, len(EXTREMES))
        weather = {"wind": case.wind, "sea": case.sea, "seed": seed}
        base = base or build_scene(**weather, fidelity="standard", duration=DURATION)
        scene = base.with_weather(**weather)
        row = run_extreme(name, scene=scene) | {"step_change": float("nan")}
        if row["verdict"].startswith("finite"):
            half = run_extreme(name, finer=2, scene=scene)
            row["step_change"] = max(abs(half[key] - row[key]) / max(abs(half[key]), 1e-3) for key in PEAKS)
        rows.append(row)
    return pd.DataFrame(rows)


def _bang(first, second):  # full swing of the selected channels every control period, zero in others
    swing = np.array([first, second], dtype=float)
    return lambda step, rng: swing * (1.0 if step % 2 == 0 else -1.0)


def _constant(first, second):
    action = np.array([first, second], dtype=float)
    return lambda step, rng: action


POLICIES = {  # name: function of (step, random generator) -> action (2,)
    "bang-bang at Nyquist, both": _bang(1, 1),
    "bang-bang at Nyquist, opposed": _bang(1, -1),
    "bang-bang at Nyquist, torque": _bang(1, 0),
    "bang-bang at Nyquist, pitch": _bang(0, 1),
    **{f"constant ({a:+d}, {b:+d})": _constant(a, b) for a in (-1, 1) for b in (-1, 1)},
    "uniform random": lambda step, rng: rng.uniform(-1.0, 1.0, 2),
    "random corners": lambda step, rng: rng.choice([-1.0, 1.0], 2),
    "platform-pitch resonance": lambda step, rng: np.full(2, np.sign(np.sin(step * 0.1 * 0.21))),
    "far beyond the range": lambda step, rng: rng.choice([-1e300, 1e300, 1e9], 2),
}
REFUSED = ((np.nan, 0.0), (0.0, np.nan), (np.inf, 0.0), (0.0, -np.inf), (np.nan, np.inf))


def attack(env, policy, seed, steps=HOSTILE_STEPS):
    """Run a policy and return its row (dict): periods, terminations by reason, whether all was finite."""
    rng, reasons, resets = np.random.default_rng(seed), Counter(), 0
    finite = np.isfinite(env.reset(seed=seed)[0]).all()
    for step in range(steps):
        observation, reward, terminated, truncated, info = env.step(POLICIES[policy](step, rng))
        finite &= np.isfinite([*observation, reward]).all()
        if terminated:
            reasons[info["termination"]] += 1
        else:
            finite &= np.isfinite(env.view().state).all()
        if terminated or truncated:
            resets += 1
            env.reset(seed=seed + resets)
    return {"policy": policy, "steps": steps, "ends": dict(reasons), "finite": bool(finite)}


def refused_alike(env, seed):
    """Return how many of the invalid actions REFUSED raise InputError and leave the state unchanged."""
    env.reset(seed=seed)
    env.step(np.zeros(2))
    count = 0
    for action in REFUSED:
        before = env.get_state()
        try:
            env.step(np.array(action))
        except InputError:
            pairs = zip(before.arrays, env.get_state().arrays, strict=True)  # of arrays, or of None
            count += all(np.array_equal(a, b, a is not None and a.dtype.kind == "f") for a, b in pairs)
    return count


def hostile(
    modes=("direct", "setpoint", "residual"), tasks=("above_rated", "full_range"), steps=HOSTILE_STEPS,
    progress=silent,
):  # fmt: skip
    """Return a DataFrame with a row per task, action mode and policy, and one for NaN and infinity."""
    rows = []
    for done, (task, mode) in enumerate(product(tasks, modes)):
        progress(f"hostile actions: {task}, {mode}", done, len(modes) * len(tasks))
        env = FowtEnv(task=task, action_mode=mode)
        results = [attack(env, policy, 1000 * number, steps) for number, policy in enumerate(POLICIES)]
        count, of = refused_alike(env, 7), len(REFUSED)
        ends = {"refused, state untouched": count}
        results.append({"policy": "NaN and infinity", "steps": of, "ends": ends, "finite": count == of})
        rows += [{"task": task, "mode": mode} | row for row in results]
    return pd.DataFrame(rows)
