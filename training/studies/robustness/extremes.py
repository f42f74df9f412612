"""Extreme events on the running or parked turbine, and hostile actions on the environment."""

from dataclasses import dataclass, field
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
    """One extreme run. What happens from `at` on: a fault's name in FAULTS, or nothing but the weather."""

    group: str
    wind: object
    sea: object = field(default_factory=lambda: dict(NORMAL_SEA))
    parked: bool = False  # rotor locked, blades feathered
    fault: str = ""
    line: int = 0  # lost line of the fault "line loss"
    duration: float = DURATION


def feather(command, turbine, held):
    """Emergency stop: no torque, blades to feather as fast as the actuator goes."""
    return 0.0, turbine.pitch_drive.maximum


def no_torque(command, turbine, held):
    """Grid loss: no torque, the pitch controller goes on."""
    return 0.0, command[1]


def no_torque_no_pitch(command, turbine, held):
    """Grid loss with the blades left where they are."""
    return 0.0, held


def stuck(command, turbine, held):
    """Stuck blades: torque goes on, the blade pitch stays."""
    return command[0], held


FAULTS = {
    "emergency stop": feather,
    "grid loss": no_torque,
    "grid loss, no pitch action": no_torque_no_pitch,
    "stuck pitch": stuck,
}


def _gusts():
    """Gust runs: every kind at the speeds where it hurts."""
    found = {}
    for speed in (10.0, 11.4, 13.0, 25.0):
        found[f"EOG {speed:g} m/s"] = Extreme("EOG", {"kind": "eog", "speed": speed, "start": EVENT})
    for speed in (6.0, 12.0, 25.0):
        for sign in (1, -1):
            wind = {"kind": "ecd", "speed": speed, "start": EVENT, "sign": sign}
            found[f"ECD {speed:g} m/s, sign {sign:+d}"] = Extreme("ECD", wind)
    for way in ("vertical", "horizontal"):
        for sign in (1, -1):
            for speed in (12.0, 25.0):
                wind = {"kind": "ews", "speed": speed, "start": EVENT, "sign": sign, "orientation": way}
                found[f"EWS {speed:g} m/s, {way} {sign:+d}"] = Extreme("EWS", wind)
    for speed in (12.0, 18.0, 25.0):
        found[f"ETM {speed:g} m/s"] = Extreme("ETM", {"kind": "etm", "speed": speed, "class": "A"})
    return found


def _storms():
    """Parked and idling in the 50-year storm from several sides, and in waves about to break."""
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
    """Faults in mid-run."""
    found = {}
    etm = {"kind": "etm", "speed": 18.0, "class": "A"}
    for line in range(3):
        storm = Extreme("line loss", STORM_WIND, STORM_SEA, parked=True, fault="line loss", line=line)
        found[f"line {line + 1} lost in the 50-year storm, parked"] = storm
        found[f"line {line + 1} lost at 18 m/s ETM, operating"] = Extreme(
            "line loss", etm, fault="line loss", line=line
        )
    for fault in FAULTS:
        group = "grid loss" if fault.startswith("grid") else fault
        for speed in (11.4, 18.0, 25.0):
            wind = {"kind": "etm", "speed": speed, "class": "A"}
            found[f"{fault} at {speed:g} m/s ETM"] = Extreme(group, wind, fault=fault)
    gust = {"kind": "eog", "speed": 13.0, "start": EVENT}
    found["grid loss in EOG 13 m/s"] = Extreme("grid loss", gust, fault="grid loss")
    found["emergency stop in EOG 13 m/s"] = Extreme("emergency stop", gust, fault="emergency stop")
    found["stuck pitch in EOG 13 m/s"] = Extreme("stuck pitch", gust, fault="stuck pitch")
    return found


EXTREMES = {**_gusts(), **_storms(), **_faults()}


def without_line(scene, line):
    """The scene with one mooring line (0, 1, ..) gone, the others solved as catenaries.

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
        elif self.x[State.ROTOR_SPEED] > 0.0:  # beyond cut-out the trim idles feathered without control
            self.controller = make("pi", scene.turbine, CONTROL_DT)
        self.dx, self.measurement = np.zeros_like(self.x), np.zeros(N_MEASUREMENTS)
        self.peak = dict.fromkeys(PEAKS, 0.0)
        self.held = None  # blade pitch at the fault

    def go(self):
        """(status, time reached) of the whole run."""
        dt, data = self.dt, self.scene.data()
        handle = self.scene.handle(data)
        per_control = round(CONTROL_DT / dt)
        fault = FAULTS.get(self.case.fault)
        forget(handle)
        observe(handle, self.x, self.u, 0.0, self.dx, self.measurement)
        if self.controller is not None:
            self.controller.reset(Measurement(*self.measurement.tolist()))
        for period in range(round(self.case.duration / CONTROL_DT)):
            step = period * per_control
            happened = step * dt >= EVENT - 1e-9
            if happened and self.case.fault == "line loss" and self.held is None:
                self.held = 0.0
                self.scene = without_line(self.scene, self.case.line)
                data = self.scene.data()
                handle = self.scene.handle(data)
            observe(handle, self.x, self.u, step * dt, self.dx, self.measurement)
            self.note(data.lines)
            if self.controller is not None:
                self.u[:] = self.controller.act(Measurement(*self.measurement.tolist()))
            if happened and fault is not None:
                if self.held is None:
                    self.held = float(self.x[State.BLADE_PITCH])
                self.u[:] = fault(self.u, self.scene.turbine, self.held)
            status = advance(handle, self.x, self.u, step, per_control, dt)
            if status != RUNNING:
                return status, (step + per_control) * dt
        return RUNNING, self.case.duration

    def note(self, lines):
        """Add the present instant to the peaks."""
        x = self.x
        values = {
            "rotor_rpm": abs(x[State.ROTOR_SPEED]) / RPM,
            "tilt_deg": max(abs(x[State.ROLL]), abs(x[State.PLATFORM_PITCH])) / DEGREE,
            "yaw_deg": abs(x[State.YAW]) / DEGREE,
            "offset_m": float(np.hypot(x[State.SURGE], x[State.SWAY])),
            "heave_m": abs(x[State.HEAVE]),
            "tension_MN": float(lines[:, 2].max()) * 1e-6,
        }
        for name, value in values.items():
            self.peak[name] = max(self.peak[name], value)


PEAKS = ("rotor_rpm", "tilt_deg", "yaw_deg", "offset_m", "heave_m", "tension_MN")


def run_extreme(name, fidelity="standard", seed=1, finer=1, scene=None):
    """Row (dict) of one of EXTREMES: peaks, verdict, and the scene it ran in.

    finer: the physics step is the default's finer-th. The verdict names the reason of a stop, and
    an overspeed beyond the turbine's limit, which an environment would end the episode for.
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
    """DataFrame with a row per extreme; step_change: worst relative change of a peak with half the step.

    compare: whether to run each again with half the step.
    """
    names = list(names or EXTREMES)
    rows, bases = [], {}
    for done, name in enumerate(names):
        if progress is not None:
            progress(f"extremes: {name}", done, len(names))
        case = EXTREMES[name]
        if "scene" not in bases:
            bases["scene"] = build_scene(
                wind=case.wind, sea=case.sea, seed=seed, fidelity=fidelity, duration=DURATION
            )
        scene = bases["scene"].with_weather(case.wind, case.sea, seed)
        row = run_extreme(name, seed=seed, scene=scene)
        row["step_change"] = float("nan")
        if compare and row["verdict"].startswith("finite"):
            half = run_extreme(name, seed=seed, finer=2, scene=scene)
            row["step_change"] = max(abs(half[key] - row[key]) / max(abs(half[key]), 1e-3) for key in PEAKS)
        rows.append(row)
    return pd.DataFrame(rows)


class Hostile:
    """A policy that means harm: its name, and actions (2,) from the step and a generator."""

    def __init__(self, name, act):
        self.name, self.act = name, act


def _bang(first, second):
    """Full swings every control period of the chosen channels, the others at rest."""
    swing = np.array([first, second], dtype=float)
    return lambda step, rng: swing * (1.0 if step % 2 == 0 else -1.0)


def _constant(first, second):
    action = np.array([first, second], dtype=float)
    return lambda step, rng: action


POLICIES = (
    Hostile("bang-bang at Nyquist, both", _bang(1, 1)),
    Hostile("bang-bang at Nyquist, opposed", _bang(1, -1)),
    Hostile("bang-bang at Nyquist, torque", _bang(1, 0)),
    Hostile("bang-bang at Nyquist, pitch", _bang(0, 1)),
    *(Hostile(f"constant ({a:+d}, {b:+d})", _constant(a, b)) for a in (-1, 1) for b in (-1, 1)),
    Hostile("uniform random", lambda step, rng: rng.uniform(-1.0, 1.0, 2)),
    Hostile("random corners", lambda step, rng: rng.choice([-1.0, 1.0], 2)),
    Hostile("platform-pitch resonance", lambda step, rng: np.full(2, np.sign(np.sin(step * 0.1 * 0.21)))),
    Hostile("far beyond the range", lambda step, rng: rng.choice([-1e300, 1e300, 1e9], 2)),
)
REFUSED = ((np.nan, 0.0), (0.0, np.nan), (np.inf, 0.0), (0.0, -np.inf), (np.nan, np.inf))


def attack(env, policy, seed, steps=HOSTILE_STEPS):
    """Row (dict) of a hostile policy on an environment: periods, ends by reason, whether all was finite."""
    rng = np.random.default_rng(seed)
    observation, _ = env.reset(seed=seed)
    finite = bool(np.all(np.isfinite(observation)))
    reasons, resets = {}, 0
    for step in range(steps):
        observation, reward, terminated, truncated, info = env.step(policy.act(step, rng))
        finite = finite and bool(np.all(np.isfinite(observation))) and isfinite(reward)
        if terminated:
            reasons[info["termination"]] = reasons.get(info["termination"], 0) + 1
        elif not np.all(np.isfinite(env.view().state)):
            finite = False
        if terminated or truncated:
            resets += 1
            env.reset(seed=seed + resets)
    return {"policy": policy.name, "steps": steps, "ends": reasons, "finite": finite}


def _alike(a, b):
    """Whether two arrays of snapshots, or None, are equal; NaN, which a baseline is not given, equals NaN."""
    floats = a is not None and a.dtype.kind == "f"
    return np.array_equal(a, b, equal_nan=floats)


def refused_alike(env, seed):
    """Number of unusable actions that were refused with the state left as it was, of len(REFUSED)."""
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
    modes=("direct", "setpoint", "residual"),
    tasks=("above_rated", "full_range"),
    steps=HOSTILE_STEPS,
    policies=POLICIES,
    progress=None,
):
    """DataFrame with a row per task, action mode and policy, and one for actions that are no numbers."""
    rows = []
    total = len(modes) * len(tasks)
    for task in tasks:
        for mode in modes:
            if progress is not None:
                progress(f"hostile actions: {task}, {mode}", len(rows) // (len(policies) + 1), total)
            env = FowtEnv(task=task, action_mode=mode)
            for number, policy in enumerate(policies):
                rows.append({"task": task, "mode": mode} | attack(env, policy, 1000 * number, steps))
            count = refused_alike(env, 7)
            rows.append({
                "task": task, "mode": mode, "policy": "NaN and infinity", "steps": len(REFUSED),
                "ends": {"refused, state untouched": count}, "finite": count == len(REFUSED),
            })  # fmt: skip
    return pd.DataFrame(rows)
