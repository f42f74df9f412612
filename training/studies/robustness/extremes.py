"""Extreme events on the running or parked turbine, and hostile actions on the environment."""

from collections import Counter
from dataclasses import dataclass, field
from itertools import product
from math import isfinite, pi

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
from fowt_env.training.evaluation.run_case import CONTROL_DT

EVENT = 60.0  # s at which gusts start and faults happen
DURATION = 180.0  # s of a run: two minutes after the event
STEEPEST = 0.142  # height over length of the steepest regular wave in deep water (Michell)
GRAVITY = 9.80665
NORMAL_SEA = {"kind": "jonswap", "Hs": 6.0, "Tp": 11.0}
STORM_SEA = {"kind": "jonswap", "Hs": 15.6, "Tp": 16.0, "gamma": 3.0}
STORM_WIND = {"kind": "ewm", "turbine_class": "I", "recurrence": 50, "turbulent": True}
HOSTILE_STEPS = 3000  # control periods of each hostile policy: five minutes


@dataclass(frozen=True)
class Extreme:
    """One extreme run: its weather, and the fault (a name of FAULTS or "line loss") that happens at EVENT."""

    group: str
    wind: object
    sea: object = field(default_factory=lambda: dict(NORMAL_SEA))
    parked: bool = False  # rotor locked, blades feathered
    fault: str = ""
    line: int = 0  # lost line of the fault "line loss"
    duration: float = DURATION


FAULTS = {  # name: command (torque, pitch) from the controller's, the drive's maximum and the pitch at EVENT
    "emergency stop": lambda command, feathered, held: (0.0, feathered),  # as fast as the actuator goes
    "grid loss": lambda command, feathered, held: (0.0, command[1]),
    "grid loss, no pitch action": lambda command, feathered, held: (0.0, held),
    "stuck pitch": lambda command, feathered, held: (command[0], held),
}


def _etm(speed):
    return {"kind": "etm", "speed": speed, "class": "A"}


def _gust(kind, speed, **settings):
    return {"kind": kind, "speed": speed, "start": EVENT, **settings}


def _gusts():
    """Return gust runs: every kind at the speeds where it hurts."""
    found = {f"EOG {u:g} m/s": Extreme("EOG", _gust("eog", u)) for u in (10.0, 11.4, 13.0, 25.0)}
    for speed in (6.0, 12.0, 25.0):
        for sign in (1, -1):
            name = f"ECD {speed:g} m/s, sign {sign:+d}"
            found[name] = Extreme("ECD", _gust("ecd", speed, sign=sign))
    for way in ("vertical", "horizontal"):
        for sign in (1, -1):
            for speed in (12.0, 25.0):
                wind = _gust("ews", speed, sign=sign, orientation=way)
                found[f"EWS {speed:g} m/s, {way} {sign:+d}"] = Extreme("EWS", wind)
    return found | {f"ETM {u:g} m/s": Extreme("ETM", _etm(u)) for u in (12.0, 18.0, 25.0)}


def _storms():
    """Return runs parked and idling in the 50-year storm from several sides, and in waves about to break."""
    found = {}
    for direction in (0.0, 45.0, 90.0, 180.0):
        wind = STORM_WIND | {"direction": direction}
        name = f"50-year storm, wind from {direction:g} deg off"
        found[f"{name}, parked"] = Extreme("50-year storm", wind, STORM_SEA, parked=True)
        found[f"{name}, idling"] = Extreme("50-year storm", wind, STORM_SEA)
    for period in (6.0, 8.0, 10.0, 12.0):
        height = STEEPEST * GRAVITY * period**2 / (2.0 * pi)
        sea = {"kind": "regular", "H": height, "T": period, "ramp": 2.0 * period}
        name = f"breaking-steep wave, {height:.1f} m, {period:g} s"
        found[f"{name}, parked"] = Extreme("breaking-steep wave", 40.0, sea, parked=True)
        found[f"{name}, operating"] = Extreme("breaking-steep wave", 18.0, sea)
    return found


def _faults():
    """Return runs with a fault at EVENT."""
    found = {}
    for line in range(3):
        lost = {"fault": "line loss", "line": line}
        storm = Extreme("line loss", STORM_WIND, STORM_SEA, parked=True, **lost)
        found[f"line {line + 1} lost in the 50-year storm, parked"] = storm
        found[f"line {line + 1} lost at 18 m/s ETM, operating"] = Extreme("line loss", _etm(18.0), **lost)
    for fault in FAULTS:
        group = "grid loss" if fault.startswith("grid") else fault
        for speed in (11.4, 18.0, 25.0):
            found[f"{fault} at {speed:g} m/s ETM"] = Extreme(group, _etm(speed), fault=fault)
    for fault in ("grid loss", "emergency stop", "stuck pitch"):
        found[f"{fault} in EOG 13 m/s"] = Extreme(fault, _gust("eog", 13.0), fault=fault)
    return found


EXTREMES = {**_gusts(), **_storms(), **_faults()}
PEAKS = ("rotor_rpm", "tilt_deg", "yaw_deg", "offset_m", "heave_m", "tension_MN")


def without_line(scene, line):
    """Return the scene with one mooring line (0, 1, ..) gone, the others solved as catenaries.

    Raises: InputError if there is no such line.
    """
    check_whole_number("line", line, 0, scene.n_lines - 1)
    # a table is about the rest position of all lines, which is not where the platform goes
    arrays = scene.model.mooring._replace(table=None)[:-1]
    left = [np.ascontiguousarray(np.delete(array, line, axis=0)) for array in arrays]
    return scene.with_model(mooring=Mooring(*left))


class _ExtremeRun:
    """One extreme run, a control period at a time, with the peaks of its course."""

    def __init__(self, case, scene, dt):
        self.case, self.scene, self.dt = case, scene, dt
        self.x, self.u = initial_state(scene)
        self.controller = None
        if case.parked:
            self.x[State.ROTOR_SPEED] = self.u[Command.GENERATOR_TORQUE] = 0.0
            self.x[State.BLADE_PITCH] = self.u[Command.BLADE_PITCH] = scene.turbine.pitch_drive.maximum
            self.scene = scene.with_model({"rigid_body.rotor_fixed": True})
        elif self.x[State.ROTOR_SPEED] > 0.0:  # above cut-out the trim idles feathered without control
            self.controller = make("pi", scene.turbine, CONTROL_DT)
        self.peak = dict.fromkeys(PEAKS, 0.0)

    def go(self):
        """Run to the end or to a stop; return (status, time reached)."""
        x, u, dt, case, controller = self.x, self.u, self.dt, self.case, self.controller
        dx, row = np.zeros_like(x), np.zeros(N_MEASUREMENTS)
        data = self.scene.data()
        handle = self.scene.handle(data)
        per_control, feathered = round(CONTROL_DT / dt), self.scene.turbine.pitch_drive.maximum
        held = None  # blade pitch at the fault
        forget(handle)
        observe(handle, x, u, 0.0, dx, row)
        if controller is not None:
            controller.reset(Measurement(*row.tolist()))
        for period in range(round(case.duration / CONTROL_DT)):
            step = period * per_control
            begins = case.fault and held is None and step * dt >= EVENT - 1e-9
            if begins:
                held = float(x[State.BLADE_PITCH])
                if case.fault == "line loss":
                    self.scene = without_line(self.scene, case.line)
                    data = self.scene.data()
                    handle = self.scene.handle(data)
            observe(handle, x, u, step * dt, dx, row)
            self.note(data.lines)
            if controller is not None:
                u[:] = controller.act(Measurement(*row.tolist()))
            if held is not None and case.fault in FAULTS:
                u[:] = FAULTS[case.fault](u, feathered, held)
            status = advance(handle, x, u, step, per_control, dt)
            if status != RUNNING:
                return status, (step + per_control) * dt
        return RUNNING, case.duration

    def note(self, lines):
        """Add the present instant to the peaks."""
        x = self.x
        values = (
            abs(x[State.ROTOR_SPEED]) / RPM,
            max(abs(x[State.ROLL]), abs(x[State.PLATFORM_PITCH])) / DEGREE,
            abs(x[State.YAW]) / DEGREE,
            float(np.hypot(x[State.SURGE], x[State.SWAY])),
            abs(x[State.HEAVE]),
            float(lines[:, 2].max()) * 1e-6,
        )
        self.peak = {name: max(self.peak[name], value) for name, value in zip(PEAKS, values, strict=True)}


def run_extreme(name, fidelity="standard", seed=1, finer=1, scene=None):
    """Return the row (dict) of one of EXTREMES: its peaks and its verdict.

    finer: the physics step is the default's finer-th. The verdict names the reason of a stop, and
    an overspeed above the turbine's limit, for which an environment would end the episode.
    """
    case = EXTREMES[name]
    if scene is None:
        scene = build_scene(wind=case.wind, sea=case.sea, seed=seed, fidelity=fidelity, duration=DURATION)
    run = _ExtremeRun(case, scene, scene.dt / finer)
    status, time = run.go()
    finite = bool(np.all(np.isfinite(run.x))) and all(isfinite(value) for value in run.peak.values())
    verdict = "finite"
    if status != RUNNING:
        verdict = f"{STOP_REASONS[status]} at {time:.1f} s"
    elif run.peak["rotor_rpm"] > scene.turbine.overspeed / RPM:
        verdict = f"finite, beyond the overspeed limit of {scene.turbine.overspeed / RPM:.2f} rpm"
    return {"group": case.group, "case": name, **run.peak, "finite": finite, "verdict": verdict}


def extremes(names=None, fidelity="standard", seed=1, compare=True, progress=None):
    """Return a DataFrame with a row per extreme.

    step_change: worst relative change of a peak with half the step, with which each runs again if compare.
    """
    names = list(names or EXTREMES)
    rows, base = [], None
    for done, name in enumerate(names):
        if progress is not None:
            progress(f"extremes: {name}", done, len(names))
        case = EXTREMES[name]
        weather = {"wind": case.wind, "sea": case.sea, "seed": seed}
        if base is None:
            base = build_scene(**weather, fidelity=fidelity, duration=DURATION)
        scene = base.with_weather(**weather)
        row = run_extreme(name, seed=seed, scene=scene)
        row["step_change"] = float("nan")
        if compare and row["verdict"].startswith("finite"):
            half = run_extreme(name, seed=seed, finer=2, scene=scene)
            row["step_change"] = max(abs(half[key] - row[key]) / max(abs(half[key]), 1e-3) for key in PEAKS)
        rows.append(row)
    return pd.DataFrame(rows)


def _bang(first, second):
    """Return full swings every control period of the chosen channels, the others at rest."""
    swing = np.array([first, second], dtype=float)
    return lambda step, rng: swing * (1.0 if step % 2 == 0 else -1.0)


def _constant(first, second):
    action = np.array([first, second], dtype=float)
    return lambda step, rng: action


POLICIES = {  # name: action (2,) from the step and a generator
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
    """Return the row (dict) of a policy: periods, ends by reason, whether all was finite."""
    rng = np.random.default_rng(seed)
    observation, _ = env.reset(seed=seed)
    finite = bool(np.all(np.isfinite(observation)))
    reasons, resets = Counter(), 0
    for step in range(steps):
        observation, reward, terminated, truncated, info = env.step(POLICIES[policy](step, rng))
        finite = finite and bool(np.all(np.isfinite(observation))) and isfinite(reward)
        if terminated:
            reasons[info["termination"]] += 1
        elif not np.all(np.isfinite(env.view().state)):
            finite = False
        if terminated or truncated:
            resets += 1
            env.reset(seed=seed + resets)
    return {"policy": policy, "steps": steps, "ends": dict(reasons), "finite": finite}


def _alike(a, b):
    """Return whether two arrays of snapshots, or None, are equal; NaN, as of hidden readings, equals NaN."""
    floats = a is not None and a.dtype.kind == "f"
    return np.array_equal(a, b, equal_nan=floats)


def refused_alike(env, seed):
    """Return how many of the unusable actions REFUSED were refused with the state left as it was."""
    env.reset(seed=seed)
    env.step(np.zeros(2))
    count = 0
    for action in REFUSED:
        before = env.get_state()
        try:
            env.step(np.array(action))
        except InputError:
            after = env.get_state()
            count += all(_alike(a, b) for a, b in zip(before.arrays, after.arrays, strict=True))
    return count


def hostile(
    modes=("direct", "setpoint", "residual"), tasks=("above_rated", "full_range"), steps=HOSTILE_STEPS,
    progress=None,
):  # fmt: skip
    """Return a DataFrame: a row per task, action mode and policy, and one for actions that are no numbers."""
    rows = []
    for done, (task, mode) in enumerate(product(tasks, modes)):
        if progress is not None:
            progress(f"hostile actions: {task}, {mode}", done, len(modes) * len(tasks))
        env = FowtEnv(task=task, action_mode=mode)
        found = [attack(env, policy, 1000 * number, steps) for number, policy in enumerate(POLICIES)]
        count = refused_alike(env, 7)
        ends = {"refused, state untouched": count}
        found.append({"policy": "NaN and infinity", "steps": len(REFUSED), "ends": ends,
                      "finite": count == len(REFUSED)})  # fmt: skip
        rows += [{"task": task, "mode": mode} | row for row in found]
    return pd.DataFrame(rows)
