"""Simulates one run of a scene with a controller and returns a table of OpenFAST channels."""

import inspect
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from math import inf, pi
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from fowt_env.control import (
    EXACT,
    CheckedController,
    CommandUnits,
    CompiledController,
    check_pitches,
    known_scene,
    make,
    view_of,
)
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.faults import Fault, read_faults
from fowt_env.descriptions.protection import Protection, read_protection
from fowt_env.descriptions.sensors import SensorChain, sensors_of
from fowt_env.descriptions.units import RPM
from fowt_env.errors import (
    ControllerInputError,
    InputError,
    PlantWarning,
    SimulationStopped,
    level_outside,
    unknown_keyword,
)
from fowt_env.loop.interface import interface_data
from fowt_env.loop.protection import LOADING, PRODUCTION, READY, START
from fowt_env.loop.rollout import Schedule, begin_command, rollout
from fowt_env.plant.advance import BAD_COMMAND, RUNNING, STOP_REASONS, SUNK, TRIPPED
from fowt_env.plant.channels import Out
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.compile.handle import Handle
from fowt_env.plant.events import harm
from fowt_env.plant.measurement import Measurement
from fowt_env.plant.state import N_COMMANDS, N_INDIVIDUAL_COMMANDS, Command, State
from fowt_env.run.initial_conditions import initial_state
from fowt_env.run.interface import build_interface, guard_of, starts_parked
from fowt_env.run.outcome import run_frame, trip_name
from fowt_env.scene.scene import Scene, check_scene
from fowt_env.weather.preview import Preview
from fowt_env.weather.wind_field import WindBox

# Between compiled calls progress is shown and Ctrl-C ends the run. The overhead of a call is 1e-4 s, so calls
# are lengthened until they last about CHUNK_TIME.
FIRST_CHUNK = 20.0  # simulated seconds
CHUNK_TIME = 0.05  # s of wall-clock time
GIB = 2.0**30
MOST_MEMORY = 0.8  # fraction of the machine's memory that a table may take
LIMITED = 0.5  # fraction of a run with limited generator torque that causes a warning
REPLACED = {  # former keywords of simulate
    "stop_overspeed": "protection='end_at_overspeed'",
    "trip": "protection={'overspeed': RATIO}, of rated rotor speed",
    "grid_loss": "faults={'kind': 'grid_loss', 'time': SECONDS}",
    "start": "initial='zero', or initial={'start': 'zero', ...}",
}


@control_kernel
def hold(parameters, memory, measurement, command):
    """Leave the command in force unchanged."""


class HeldCommand(CompiledController):
    """Keeps the command unchanged: the control law of controller=None."""

    kernel = staticmethod(hold)
    information: tuple[str, ...] = ("generator_torque", "blade_pitch")

    def __init__(self, individual: bool = False) -> None:
        self.individual = individual
        super().__init__("none", np.zeros(1), 1)
        if individual:
            self.information += ("blade_pitch_1", "blade_pitch_2", "blade_pitch_3")

    def reset(self, measurement: Measurement) -> None:
        """Do nothing: the control law has no memory."""


def check_period(name: str, value: float) -> None:
    """Raise InputError unless a time (s) called name is positive and finite."""
    check_number(name, value, 0.0, low_open=True, allowed="a positive number of seconds")


def steps_in(name: str, period: float, dt: float, step: str = "dt") -> int:
    """Return the number of steps of dt in a period, s; step and name: their names in messages.

    Raises: InputError if dt does not divide the period.
    """
    check_period(name, period)
    check_period(step, dt)
    count = round(period / dt)
    if count < 1 or abs(count * dt - period) > 1e-9 * period:
        raise InputError(f"{step} = {dt:g} s does not divide {name} = {period:g} s (ratio {period / dt:.6g})")
    return count


def check_duration(scene: Scene, duration: float) -> None:
    """Raise InputError for a run longer than the scene's random or recorded weather."""
    limit = scene.options["duration"]
    aero, hydro = scene.model.aero, scene.model.hydro
    waves: Any = None if hydro is None else hydro.waves
    random_sea = waves is not None and waves.omega.shape[0] > 1
    wind: Any = None if aero is None else aero.wind
    if isinstance(scene.wind, WindBox) and duration > scene.wind.usable:
        raise InputError(
            f"duration = {duration:g} s: the box of wind covers {scene.wind.usable:.1f} s and does not repeat"
            " (periodic = True makes it repeat)"
        )
    if wind is not None and wind.period > 0.0 and duration > wind.period + 1e-9:
        raise InputError(
            f"duration = {duration:g} s: this scene's random wind was drawn for {wind.period:g} s and would"
            f" repeat; build_scene(..., duration={duration:g})"
        )
    if random_sea and waves.random and duration > limit + 1e-9:
        raise InputError(
            f"duration = {duration:g} s: this scene's random sea was drawn for {limit:g} s and would repeat;"
            f" build_scene(..., duration={duration:g})"
        )
    if isinstance(scene.wind, dict) and scene.wind.get("kind") == "series":
        end = float(wind.time[-1])
        if wind.time.shape[0] > 1 and duration > end + 1e-9:
            raise InputError(f"duration = {duration:g} s: the wind series ends at {end:g} s")


def check_memory(scene: Scene, duration: float, output_dt: float) -> None:
    """Raise InputError for a run whose table does not fit into the memory of this machine."""
    rows, columns = round(duration / output_dt) + 1, len(scene.channels)
    needed, most = 8.0 * rows * columns, MOST_MEMORY * physical_memory()
    if needed > most:
        raise InputError(
            f"duration = {duration:g} s: a table of {rows} rows of {columns} channels takes"
            f" {needed / GIB:.3g} GiB, and {most / GIB:.3g} GiB are allowed here: use a longer output_dt"
            f" (now {output_dt:g} s) or several runs"
        )


def physical_memory() -> float:
    """Return the physical memory of this machine in bytes; inf if unknown."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return inf


def build_run(
    scene: Scene,
    controller: Any,
    duration: float,
    dt: float | None = None,
    control_dt: float = 0.1,
    output_dt: float = 0.1,
    initial: str | Mapping[str, Any] | None = None,
    protection: str | Mapping[str, Any] | Protection | None = None,
    faults: Fault | Mapping[str, Any] | Sequence[Any] | None = None,
    sensors: str | SensorChain | None = None,
    preview: str | Preview | Callable[[Scene, tuple[float, ...]], Preview] = EXACT,
    nominal: Scene | None = None,
) -> "Run":
    """Build the Run of a scene, checked and at its initial conditions. Arguments and errors as simulate."""
    check_scene(scene)
    step = "dt"
    if dt is None:  # errors name the period that the step follows from
        given = {"control_dt": control_dt, "output_dt": output_dt}
        for name, period in given.items():
            check_period(name, period)
        steps = [(scene.dt, "dt"), *((period, name) for name, period in given.items())]
        dt, step = min(steps, key=lambda pair: pair[0])
    per_control = steps_in("control_dt", control_dt, dt, step)
    per_output = steps_in("output_dt", output_dt, dt, step)
    last = steps_in("duration", duration, dt, step)
    steps_in("duration", duration, output_dt, "output_dt")
    check_duration(scene, duration)
    check_memory(scene, duration, output_dt)
    scene = scene.with_step(dt)
    turbine = scene.turbine
    limits = read_protection(protection, turbine.protection, turbine.overspeed / turbine.rated_rotor_speed)
    chain = sensors_of(sensors, scene.turbine)
    without_controller = controller is None
    listed = read_faults(faults)
    if without_controller and listed:
        raise InputError(
            f"faults: {listed[0].kind}: faults need a controller; with controller=None rotor speed and blade"
            " pitch are constant"
        )
    if without_controller:
        per_control = last  # no controller reads a measurement
    else:
        controller = make(controller, scene.turbine, control_dt)
        check_pitches(controller, scene.model.pitches is not None)
    period = per_control * dt
    guard = guard_of(scene, limits, listed, period, controller)
    if not without_controller:
        with _controller_errors():
            controller.prepare(known_scene(scene if nominal is None else nominal, controller, preview))
    x, u = initial_state(scene, "parked" if initial is None and starts_parked(listed) else initial)
    if without_controller:
        scene = scene.with_model({"rigid_body.rotor_fixed": True})
        controller = HeldCommand(scene.model.pitches is not None)
        chain = None
    external = not isinstance(controller, CompiledController) and controller.in_loop is None
    schedule = Schedule(float(dt), per_control, per_output, last, bool(controller.individual), external)
    periods = -(-last // per_control)
    interface = build_interface(scene, controller, guard, chain, preview, period, periods)
    return Run(scene, controller, x, u, schedule, interface)


def simulate(
    scene: Scene,
    controller: Any = "pi",
    duration: float = 600.0,
    dt: float | None = None,
    control_dt: float = 0.1,
    output_dt: float = 0.1,
    initial: str | Mapping[str, Any] | None = None,
    progress: bool | Callable[[float], object] = False,
    protection: str | Mapping[str, Any] | Protection | None = None,
    faults: Fault | Mapping[str, Any] | Sequence[Any] | None = None,
    sensors: str | SensorChain | None = None,
    preview: str | Preview | Callable[[Scene, tuple[float, ...]], Preview] = EXACT,
    nominal: Scene | None = None,
    **replaced: Any,
) -> pd.DataFrame:
    """Simulate one run and return its DataFrame, with columns named as in OpenFAST (`PtfmPitch_[deg]`).

    scene       result of build_scene: a platform in its wind and sea
    controller  None: rotor speed and blade pitch are kept at the trim (at rest without wind); the
                name of a built-in controller or "module:Class"; an object with reset(measurement) and
                act(measurement) -> (generator torque N m, blade pitch rad), and optionally
                prepare(scene) for more than measurements; or a function of the measurement alone that
                returns this pair. A controller that commands each blade (control/protocol.py) needs a
                scene with pitch="individual"
    duration    s; rows run from 0 to duration inclusive, every output_dt
    dt          physics step, s; must divide control_dt and output_dt, and output_dt the duration.
                None: scene.dt (0.0125 s at fidelity "reference", 0.1 s at the others)
    initial     "trim" (None): the steady state in the mean wind; "zero": platform and tower at zero;
                "parked": the steady state with the rotor at rest and feathered blades (None with a start_up
                among the faults); or a mapping of absolute values of channels, {"PtfmPitch": 5.0}, at the
                trim, or at another of these with {"start": "zero", ...}
    progress    True shows a bar; a callable is called with the fraction done
    protection  trips by overspeed, overpower, tower-top acceleration and pitch deviation: "turbine" for those
                of the turbine file, a mapping of its [protection] keys that override individual entries
                (False: no such trip), a Protection (fowt_env.descriptions.protection), or "end_at_overspeed",
                which ends the run at a rotor speed above the overspeed of the turbine file. From a trip on
                controller commands are ignored and the blades feather to the drive's maximum: in an emergency
                stop without torque, in a normal one with a torque that falls with the rotor speed. The run
                continues to its end, except where the trip's stop is "end". None: no trips
    faults      a Fault (fowt_env.descriptions.faults), a mapping of its keys, or a list of these: loss of the
                grid, ordered stops and start-up, faults of pitch drives and of sensors, mooring lines that
                break, compartments that are flooded. None: no faults
    sensors     sensors that the controller reads: None or "exact" for exact measurements, the name of a
                built-in chain ("standard") or a SensorChain (fowt_env.descriptions.sensors). Rows
                are true motions; the noise follows from the scene's seed and is the same for every controller
    preview     wind ahead that a controller with preview_times reads: "exact", a lidar
                ("four_beam_pulsed"), a Preview (fowt_env.weather.preview), or a function of (scene,
                preview_times) that returns one
    nominal     scene whose plant the controller is designed on, where it differs from the simulated plant

    A controller reads what its `information` declares and nothing else (fowt_env.control).

    The generator torque is limited to [0, max_torque] of the turbine file and its rate to max_torque_rate:
    GenTq is the torque in force, and GenTqLim is 1 while GenTq differs from the command.

    Columns have their unit in the name, as in OpenFAST's files: frame["RotSpeed_[rpm]"];
    frame.filter(like="RotSpeed") selects a column without the unit. attrs["events"] of the DataFrame:
    {name: count} of events outside the usual range of the plant's models (fowt_env.plant.events), without
    zeros. attrs["doubtful_commands"]: the warning about commands implausible in N m and rad, "" for none.
    attrs["controller_output"]: messages and printed text of a library with the Bladed interface, if any.
    attrs["torque_limited"]: time (s) for which the generator torque differed from the command.
    attrs["tripped"]: time (s) at which the protection stopped the turbine, or None; attrs["trip"]: name of
    that trip, such as "overspeed"; attrs["stop"]: "normal" or "emergency" if a trip or a fault was stopping
    the turbine at the end, else None; attrs["connected"]: time (s) at which a start-up connected the
    generator, if it did; attrs["ratings"]: rated rotor speed, overspeed, rated power and rated
    wind speed of the turbine (descriptions.ratings), marked in plots.

    Warns (PlantWarning) once of commands implausible in N m and rad; and at the end of a run with events that
    made loads less accurate and, if no fault or protection stops the turbine, with a rotor above overspeed or
    a generator torque limited for half of the time.

    Raises: InputError before anything runs (ControllerInputError at any time if the controller raised it);
    SimulationStopped (with the rows so far) on capsize, a numerical blow-up, a non-finite state or command
    or a trip whose stop is "end"; ControllerError if a controller returns anything but finite numbers or
    reads undeclared information.
    """
    for name in replaced:
        if name in REPLACED:
            raise InputError(f"simulate({name}=...) was replaced: use {REPLACED[name]}")
        raise unknown_keyword("simulate", name, KEYWORDS)
    run = build_run(
        scene, controller, duration, dt, control_dt, output_dt, initial, protection, faults, sensors, preview,
        nominal,
    )  # fmt: skip
    with _bar(progress) as report, _controller_errors():
        try:
            run.advance(report)
        finally:
            if isinstance(run.controller, CheckedController):
                run.controller.finish()
    frame = run.frame()
    sentences = [harm(frame.attrs["events"])]
    if not (controller is None or read_faults(faults)):
        sentences += run.out_of_bounds(frame.attrs)
    if message := ". ".join(f"{text[0].upper()}{text[1:]}" for text in sentences if text):
        warnings.warn(f"{scene.label}: {message}", PlantWarning, stacklevel=level_outside())
    return frame


KEYWORDS = tuple(name for name in inspect.signature(simulate).parameters if name != "replaced")


@contextmanager
def _controller_errors():
    """Return a context that turns an InputError into a ControllerInputError with the same message."""
    try:
        yield
    except InputError as error:
        raise ControllerInputError(str(error)) from error


class Run:
    """Runs a scene in chunks, with the control law inside the compiled loop if it is compiled."""

    def __init__(self, scene, controller, x, u, schedule, interface):
        self.scene = scene
        self.controller = controller
        self.interface = interface
        self.data = scene.data()
        self.handle = scene.handle(self.data)
        self.x, self.u, self.schedule = x, u, schedule
        self.link = interface_data(interface, len(x), len(u), scene.n_measurements)
        self.link.command[:] = u
        self.linked = Handle(interface, self.link)
        self.view = view_of(controller, interface.ahead.values.shape[0])
        self.rows = np.empty((schedule.last // schedule.per_output + 1, len(scene.channels)))
        self.filled = 0
        period = schedule.per_control * schedule.dt
        self.units = CommandUnits(f"controller {controller.name!r}", scene.turbine, period)
        self.checked = isinstance(controller, CheckedController) and not schedule.external
        if schedule.external:
            self.law = hold.compiled, np.zeros(1), np.zeros(1)
        elif self.checked:
            law, *arrays = controller.in_loop
            self.law = law.compiled, *arrays
        else:
            self.law = controller.law, controller.parameters, controller.memory

    def advance(self, report):
        """Advance to the end of the run.

        Raises: SimulationStopped; KeyboardInterrupt with the frame so far.
        """
        self.begin(0)
        self.controller.reset(self._reading())
        schedule, last = self.schedule, self.schedule.last
        size = schedule.per_control if schedule.external else max(1, round(FIRST_CHUNK / schedule.dt))
        step = 0
        try:
            while step < last:
                began = perf_counter()
                starting = self.is_starting
                if schedule.external:
                    self._command(step)
                elif starting:
                    self.begin(step)
                end = step + (schedule.per_control if starting else size)
                step = self.roll(step, min(end, last), starting)
                if not (schedule.external or starting) and perf_counter() - began < 0.25 * CHUNK_TIME:
                    size *= 4
                report(step / last)
        except KeyboardInterrupt as interrupt:
            interrupt.frame = self.frame()  # the caller may keep the rows so far
            raise

    @property
    def is_starting(self):
        """Return whether a start-up has not yet handed over to the controller."""
        return PRODUCTION < self.link.watch[START] < LOADING

    def begin(self, step):
        """Begin the control period of a step; return whether the turbine is being stopped or started.

        A start-up that has reached the speed of connection ends here: the controller is reset and takes over.
        """
        supervised = begin_command(self.handle, self.x, self.u, self.linked, self.schedule, step)
        if self.link.watch[START] != READY:
            return supervised
        self.link.watch[START] = LOADING
        self.controller.reset(self._reading())
        return False

    def _reading(self):
        """Return the readings at the current control instant as the controller's view."""
        return self.view(self.link.law_reading.tolist())

    def _command(self, step):
        """Store the command of a Python controller at a step, unless the turbine is being stopped."""
        if not self.begin(step):
            self.take(self.controller.act(self._reading()))

    def take(self, command):
        """Store the command (N m, rad) of the control period that has begun."""
        self.link.command[: len(command)] = command
        self.units.see(command[0], command[1], self.x[State.ROTOR_SPEED])

    def roll(self, first, end, begun=False):
        """Advance from step first to end; return the step reached. Raises: SimulationStopped.

        begun: whether the control period of first has begun.
        """
        schedule = self.schedule._replace(begun=True) if begun else self.schedule
        status, step, count = rollout(
            self.handle, self.x, self.u, *self.law, self.linked, schedule, first, end,
            self.rows[self.filled :],
        )  # fmt: skip
        self.filled += count
        self._check_afloat(count)
        if not self.schedule.external and abs(pitch := self.u[Command.BLADE_PITCH]) > pi:
            self.units.warn(0.0, float(pitch))
        if status != RUNNING:
            self._stop(status, step * self.schedule.dt)
        return step

    def _check_afloat(self, count):
        """End a run with flooded compartments at the first new row whose tower foot is below still water.

        Raises: SimulationStopped.
        """
        if not len(self.interface.guard.floods):
            return
        rows = self.rows[self.filled - count : self.filled]
        foot = self.scene.model.layout.base_height + rows[:, Out.PTFMHEAVE]
        if count and foot.min() < 0.0:
            self.filled += int(np.argmax(foot < 0.0)) + 1 - count
            self._stop(SUNK, float(self.rows[self.filled - 1, Out.TIME]))

    def _stop(self, status, time):
        """Raise SimulationStopped with the reason of a status at a time in s."""
        reason = STOP_REASONS[status]
        if status == BAD_COMMAND and self.checked:
            size = N_INDIVIDUAL_COMMANDS if self.schedule.individual else N_COMMANDS
            raise self.controller.failure(time, self.link.command[:size])
        if status == TRIPPED:
            reason = f"{trip_name(self.link.watch)} ({reason})"
        if fault := self.scene.first_nonfinite_load(self.data):
            reason = f"{reason}: {fault}"
        raise SimulationStopped(f"stopped at t = {time:.3f} s: {reason}", reason, time, self.frame())

    def frame(self):
        """Return the DataFrame of the rows so far; the rows are overwritten by channel units."""
        period = self.schedule.per_output * self.schedule.dt
        frame = run_frame(self.scene, self.rows[: self.filled], self.data.counters, self.link.watch, period)
        if not self.schedule.external and self.units.is_little(self.u[Command.GENERATOR_TORQUE]):
            torque, speed = (frame.iloc[:, out].to_numpy() for out in (Out.GENTQ, Out.ROTSPEED))
            self.units.see_run(torque * 1e3, speed * RPM, period)
        frame.attrs["doubtful_commands"] = self.units.said
        if output := getattr(self.controller, "console_output", ""):
            frame.attrs["controller_output"] = output
        return frame

    def out_of_bounds(self, attrs):
        """Return warnings about overspeed or torque saturation at the end of an unprotected run."""
        if attrs["stop"] is not None:
            return []
        texts, turbine = [], self.scene.turbine
        speed, duration = float(self.x[State.ROTOR_SPEED]), self.schedule.last * self.schedule.dt
        if speed > turbine.overspeed:
            texts.append(
                f"the rotor turns at {speed / RPM:.4g} rpm at the end, above the overspeed of"
                f" {turbine.overspeed / RPM:.4g} rpm in the turbine file (protection='end_at_overspeed' ends"
                " the run there, protection='turbine' stops the turbine)"
            )
        limited = attrs["torque_limited"]
        if limited >= max(1.0, LIMITED * duration) and not self.units.said:
            law = turbine.torque_law
            texts.append(
                f"the generator torque was limited for {limited:.4g} of {duration:.4g} s: controller"
                f" {self.controller.name!r} commanded less than 0 or more than"
                f" {law.max_torque * 1e-3:.4g} kN m, or changes faster than"
                f" {law.max_torque_rate * 1e-3:.4g} kN m/s (GenTqLim)"
            )
        return texts


class _bar:
    """Provides a context with a callable of the fraction done: a no-op, rich's bar or the user's."""

    def __init__(self, progress):
        self.progress = progress
        self.bar = None

    def __enter__(self):
        if callable(self.progress):
            return self.progress
        if not self.progress:
            return lambda fraction: None
        from rich.progress import Progress

        self.bar = Progress(transient=True)
        self.bar.start()
        task = self.bar.add_task("simulating", total=1.0)
        return lambda fraction: self.bar.update(task, completed=fraction)

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.stop()
