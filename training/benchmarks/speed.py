"""Measures the speed of each kind of scene: end to end, kernel alone, and per load.

Times are CPU times of one thread, medians of several repeats, reported with the time of a fixed calibration
kernel measured in the same minute to compare machines.
"""

import os
import platform
import re
import tempfile
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numba
import numpy as np
import pandas as pd

from fowt_env.control import EXACT
from fowt_env.controllers import make
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import unknown
from fowt_env.files.atomic import replacing
from fowt_env.loop.interface import interface_data
from fowt_env.loop.protection import build_guard
from fowt_env.loop.rollout import Schedule, rollout
from fowt_env.plant.advance import advance, forget, observe, output
from fowt_env.plant.aero.load import rotor_part
from fowt_env.plant.aero.tower_drag import tower_load
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.channels import measure, record
from fowt_env.plant.compile.decorators import entry, kernel
from fowt_env.plant.compile.handle import Handle, data_of, model_of
from fowt_env.plant.dynamics import loads_of, respond
from fowt_env.plant.hydro.hydrostatics import hydrostatic_load
from fowt_env.plant.hydro.load import strip_load
from fowt_env.plant.measurement import N_MEASUREMENTS, Measurement
from fowt_env.plant.model import LoadCache
from fowt_env.plant.mooring import mooring_load
from fowt_env.plant.state import Command, State, pose_of
from fowt_env.run.initial_conditions import initial_state
from fowt_env.run.interface import build_interface
from fowt_env.run.simulation import HeldCommand, simulate
from fowt_env.scene.build import build_scene
from fowt_env.training.benchmarks.compile_time import session
from fowt_env.training.evaluation.provenance import code_commit

PLATFORM = "oc3_hywind"
CALIBRATION_STEPS = 10_000_000
REPEATS = 5
CHUNK = 2000  # steps or calls in one timing of the kernel or of a load
SEA = {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0}  # 315 components
TURBULENCE = {"kind": "ntm", "speed": 18.0, "class": "B"}
LOADS = (
    "pose and loop", "wind now", "rotor", "tower", "strips and waves", "mooring", "hydrostatics",
    "pose and 6x6 solve", "measure", "record",
)  # fmt: skip


@dataclass(frozen=True)
class TimedScene:
    """Defines a kind of scene: arguments of build_scene and fixed bodies."""

    wind: object = field(default_factory=lambda: TURBULENCE)
    sea: object = field(default_factory=lambda: SEA)
    fidelity: str = "standard"
    options: dict = field(default_factory=dict)
    platform_fixed: bool = False
    parked: bool = False  # rotor at rest, blades feathered
    absent: str = ""  # parts that are absent from the compiled code

    @property
    def controlled(self):
        return self.wind is not None and not self.parked

    def scene(self, platform=PLATFORM):
        """Return the scene of this kind, with the platform fixed if platform_fixed."""
        wind = self.wind(platform) if callable(self.wind) else self.wind
        options = {"fidelity": self.fidelity, "seed": 1, "duration": 700.0} | self.options
        scene = build_scene(platform, wind=wind, sea=self.sea, **options)
        return scene.with_model({"rigid_body.platform_fixed": True}) if self.platform_fixed else scene


def _box(platform):
    """Return the wind of a box larger than the rotor: OC3's stored box, else a sum of plane waves."""
    if platform == PLATFORM:
        from fowt_env.training.validation.openfast_cases import box_wind

        return box_wind()
    return made_box(read_turbine(read_platform(platform).turbine).rotor)


def made_box(rotor, speed=18.0, seconds=620.0, dt=0.25, cell=8.0, waves=24, seed=1):
    """Return a wind box for a Rotor, for timing only: a sum of plane waves convected by the wind."""
    draw, reach = np.random.default_rng(seed), 1.15 * rotor.tip_radius
    y = np.arange(-reach, reach + cell, cell)
    z = np.arange(5.0, rotor.hub_height + reach + cell, cell)
    time = np.arange(0.0, seconds, dt)
    parts = np.zeros((3, time.size, z.size, y.size), dtype=np.float32)
    for value, deviation in zip(parts, (2.7, 2.1, 1.4), strict=True):
        for _ in range(waves):
            frequency, phase = 10.0 ** draw.uniform(-2.3, 0.0), draw.uniform(0.0, 2.0 * np.pi)
            across, up = draw.normal(0.0, 2.0 * np.pi * frequency / speed, 2)
            angle = 2.0 * np.pi * frequency * time[:, None, None] + across * y + up * z[:, None] + phase
            value += deviation * np.sqrt(2.0 / waves) * np.cos(angle).astype(np.float32)
    parts[0] += np.float32(speed)
    return {"kind": "box", **dict(zip("uvw", parts, strict=True)), "y": y, "z": z, "dt": dt, "speed": speed}


TIMED_SCENES = {
    "full, reference": TimedScene(fidelity="reference"),
    "full, standard": TimedScene(),
    "full, fast": TimedScene(fidelity="fast"),
    "full-field box, standard": TimedScene(_box),
    "exact waves, look-up rotor": TimedScene(options={"wave_loads": "exact"}),
    "BEM rotor, fast waves": TimedScene(options={"rotor": "bem"}),
    "bending tower": TimedScene(options={"tower": "modes"}),
    "bending tower, second modes": TimedScene(options={"tower": "modes2"}),
    "bending blades, tower and shaft": TimedScene(
        options={"blades": "modes", "tower": "modes", "shaft": "torsion"}
    ),
    "bending blades, tower and shaft, second modes": TimedScene(
        options={"blades": "modes2", "tower": "modes2", "shaft": "torsion"}
    ),
    "a pitch for each blade": TimedScene(options={"pitch": "individual"}),
    "still water, wind": TimedScene(sea=None, absent="waves"),
    "no wind, waves": TimedScene(None, absent="wind, rotor, tower drag"),
    "still water, no wind": TimedScene(None, None, absent="waves, wind, rotor, tower drag"),
    "parked in a storm": TimedScene(40.0, parked=True),
    "planar, fast": TimedScene(
        fidelity="fast", options={"planar": True}, absent="sway, roll, yaw: 3x3 instead of 6x6 solve"
    ),
    "planar": TimedScene(options={"planar": True}, absent="sway, roll, yaw; 3x3 solve"),
    "mooring by table": TimedScene(options={"mooring": "table"}, absent="catenary iterations"),
    "no mooring": TimedScene(options={"mooring": False}, absent="mooring"),
    "platform fixed": TimedScene(platform_fixed=True, absent="6x6 solve (at run time)"),
    "no water": TimedScene(
        sea=None, options={"hydrodynamics": False, "mooring": False}, platform_fixed=True,
        absent="strips, waves, buoyancy, mooring; 6x6 solve (at run time)",
    ),
    "dynamic inflow": TimedScene(options={"dynamic_inflow": True}),
}  # fmt: skip


@kernel
def multiply_adds(n, a, b):
    """Return the result of n dependent multiply-adds, the calibration of a machine."""
    x = 1.0
    for _ in range(n):
        x = x * a + b
    return x


def calibration(repeats=3):
    """Return the CPU time, ms, of CALIBRATION_STEPS dependent multiply-adds."""
    multiply_adds(10, 0.999, 0.1)
    return 1e3 * median_time(lambda: multiply_adds(CALIBRATION_STEPS, 0.999, 0.1), repeats)


def median_time(call, repeats=REPEATS):
    """Return the median CPU time of this thread in a call, s, without the first call."""
    call()
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        call()
        times.append(time.thread_time() - start)
    return float(np.median(times))


def paired_times(calls, rounds):
    """Return CPU times (rounds, n) of this process, s, of n alternating calls, after a first round."""
    times = np.empty((rounds + 1, len(calls)))
    for i in range(rounds + 1):
        for j, call in enumerate(calls):
            began = time.process_time()
            call()
            times[i, j] = time.process_time() - began
    return times[1:]


@entry
def _repeat(handle, part, x, u, dx, m, row, n, dt):
    """Call one of LOADS n times at changing times and positions; return a sum of the results."""
    model, data, total = model_of(handle), data_of(handle), 0.0
    for i in range(n):
        t = i * dt
        x[State.SURGE] += 1e-7  # inputs change: no call can be optimised out
        if part == 7:
            respond(x, u, model, data, dx)
            total += dx[State.VX]
            continue
        if part == 8:
            data.cache[LoadCache.ELEVATED] = 0.0
            measure(model, data, x, dx, u, t, m)
            total += m[0]
            continue
        if part == 9:
            data.cache[LoadCache.ELEVATED] = 0.0
            record(model, data, x, dx, u, t, loads_of(data, dx), row)
            total += row[0]
            continue
        pose = pose_of(x)
        total += pose.r11 + pose.r23
        if part == 5:
            total += mooring_load(pose, model.mooring, data.lines, data.counters).my
        else:
            total += _of_wind(part, t, pose, x, model.aero, model.pitches, data, dx)
            total += _of_water(part, t, pose, model.hydro, data)
    return total


@kernel
def _of_wind(part, t, pose, x, aero, pitches, data, dx):
    """Return a component of an aerodynamic load, if part is one."""
    if aero is None:
        return 0.0
    now = wind_now(t, aero.wind) if part == 1 else wind_now(0.0, aero.wind)
    if part == 2:
        load = rotor_part(t, pose, x, now, aero, aero.rotor, dx, data.counters, pitches, data.blades)
        return load.thrust + load.wrench.mz
    if part == 3:
        return tower_load(t, pose, now, aero.wind, aero.field, aero.tower).my
    return now.u


@kernel
def _of_water(part, t, pose, hydro, data):
    """Return a component of a hydrodynamic load, if part is one."""
    if hydro is None:
        return 0.0
    if part == 4:
        return strip_load(t, pose, hydro, hydro.strips, data).wrench.my
    if part == 6:
        return hydrostatic_load(pose, hydro.hull, data.counters).my
    return 0.0


def load_times(scene, x, u, calls=CHUNK, repeats=REPEATS):
    """Return {load: microseconds of one call} near a state, without the time of loop and pose."""
    scene = scene.with_step(0.1)
    handle, dx, m = scene.handle(), np.zeros_like(x), np.zeros(scene.n_measurements)
    row = np.zeros(len(scene.channels))
    forget(handle)
    output(handle, x, u, 0.0, dx, row)  # fills the cached loads that measure and record read
    micro = {}
    for part, name in enumerate(LOADS):
        call = partial(_repeat, handle, part)
        time = median_time(lambda call=call: call(x.copy(), u, dx, m, row, calls, 0.1), repeats)
        micro[name] = 1e6 * time / calls
    return micro | {name: max(0.0, micro[name] - micro[LOADS[0]]) for name in LOADS[1:7]}


def step_time(scene, x, u, dt, steps=CHUNK, repeats=REPEATS):
    """Return the microseconds of one physics step under a constant command."""
    handle = scene.with_step(dt).handle()

    def go():
        forget(handle)
        advance(handle, x.copy(), u, 0, steps, dt)

    return 1e6 * median_time(go, repeats) / steps


def loop_time(scene, controlled, x, u, dt, seconds, repeats=REPEATS):
    """Return the CPU seconds of the compiled closed loop, controller at 10 Hz, with one row of output."""
    scene = scene.with_step(dt)
    controller = make("pi", scene.turbine, 0.1) if controlled else HeldCommand()
    handle, last = scene.handle(), round(seconds / dt)
    rows = np.zeros((2, len(scene.channels)))  # first and last instant
    schedule = Schedule(float(dt), round(0.1 / dt), last + 1, last)
    interface = build_interface(scene, controller, build_guard(), None, EXACT, 0.1, round(10.0 * seconds))
    link = interface_data(interface, len(x), len(u), scene.n_measurements)
    linked = Handle(interface, link)

    def go():
        y, v = x.copy(), u.copy()
        forget(handle)
        observe(handle, y, v, 0.0, link.dx, link.measurement)
        controller.reset(Measurement(*link.measurement[:N_MEASUREMENTS].tolist()))
        link.command[:] = v
        law = controller.law, controller.parameters, controller.memory
        rollout(handle, y, v, *law, linked, schedule, 0, last, rows)

    return median_time(go, repeats)


def measure_kind(name, seconds, repeats, calls, platform):
    """Return the row (dict) of a kind of scene: times per step, real-time factors, microseconds per load."""
    kind = TIMED_SCENES[name]
    timed = scene = kind.scene(platform)
    if hasattr(scene.wind, "usable"):  # a wind box has a limited duration
        seconds = min(seconds, 10.0 * int(scene.wind.usable // 10.0))
    # without mooring lines there is no floating steady state in wind
    begin, dt = "zero" if kind.options.get("mooring", True) is False else "trim", scene.dt
    x, u = initial_state(scene, begin)
    if kind.parked:
        x[State.ROTOR_SPEED] = u[Command.GENERATOR_TORQUE] = 0.0
        x[State.BLADE_PITCH] = u[Command.BLADE_PITCH] = scene.turbine.pitch_drive.maximum
    if not kind.controlled:
        timed = scene.with_model({"rigid_body.rotor_fixed": True})
    waves = None if scene.model.hydro is None else scene.model.hydro.waves
    row = {
        "kind": name, "integrator": scene.options["integrator"], "dt_s": dt,
        "wave_components": 0 if waves is None else waves.omega.shape[0], "absent": kind.absent,
        "calibration_ms": calibration(), "step_us": step_time(timed, x, u, dt, calls, repeats),
    }  # fmt: skip
    row["step_x"] = 1e6 * dt / row["step_us"]
    row["loop_x"] = seconds / loop_time(timed, kind.controlled, x, u, dt, seconds, repeats)
    row["simulate_x"] = float("nan")
    if not kind.parked:  # simulate starts with the rotor turning
        law = "pi" if kind.controlled else None
        run = partial(simulate, scene, law, duration=seconds, initial=begin)
        row["simulate_x"] = seconds / median_time(run, repeats)
    return row | {f"{load} (us)": value for load, value in load_times(timed, x, u, calls, repeats).items()}


def silent(text, done, total):
    """Ignore progress reports."""


def speed(kinds=None, seconds=600.0, repeats=REPEATS, calls=CHUNK, progress=silent, platform=PLATFORM):
    """Return a DataFrame of speeds with a row per kind of scene (all by default) of a platform.

    seconds: duration of the closed loop and of simulate; progress: called with (text, done, total).
    Raises: InputError for an unknown kind.
    """
    names, rows = list(kinds or TIMED_SCENES), []
    for name in names:
        if name not in TIMED_SCENES:
            raise unknown("kind of scene", name, TIMED_SCENES)
    for done, name in enumerate(names):
        progress(name, done, len(names))
        rows.append(measure_kind(name, seconds, repeats, calls, platform))
    return pd.DataFrame(rows)


START_CODE = """
import fowt_env
report("import")
scene = fowt_env.build_scene(wind=18.0, sea={"kind": "jonswap", "Hs": 7.5, "Tp": 10.0}, fidelity="FIDELITY")
fowt_env.simulate(scene, "pi", duration=10.0)
report("scene and run")
"""


def start_times(fidelity="standard"):
    """Return {name: seconds} of a first run with empty kernel cache and of a later run, in new processes."""
    times = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("first", "later"):
            table = session(START_CODE.replace("FIDELITY", fidelity), folder)
            times[f"{name} start, import (s)"] = table["seconds"][0]
            times[f"{name} start, import, scene and 10 s run (s)"] = table["seconds"].sum()
            times[f"{name} start, processor time of that (s)"] = table["processor_seconds"].sum()
    return times


def header():
    """Return lines (list of str) with machine, versions, commit and date of a measurement."""
    cpus = Path("/proc/cpuinfo")
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    named = re.search(r"^model name\s*: *(.*)", cpus.read_text() if cpus.is_file() else "", re.M)
    processor = named[1] if named else platform.processor() or platform.machine()
    return [
        f"date: {datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        f"machine: {processor}, {os.cpu_count()} cores, {platform.system()}, load {load:.2f}",
        f"versions: Python {platform.python_version()}, numba {numba.__version__}, numpy {np.__version__}",
        f"commit: {code_commit() or 'unknown'}",
        f"calibration: {calibration():.2f} ms for {CALIBRATION_STEPS:g} dependent multiply-adds",
    ]


def write_csv(table, path, remarks=()):
    """Write a table after header and remarks as comment lines; return the path."""
    path = Path(path)
    with replacing(path) as temporary, Path(temporary).open("w", encoding="utf-8", newline="") as file:
        for line in (*header(), *remarks):
            file.write(f"# {line}\n")
        table.to_csv(file, index=False, float_format="%.6g")
    return path
