"""One run of a scene with a controller, to a table of OpenFAST channels."""

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from math import exp, inf, isfinite, isinf, pi, radians
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from fowt_env.control import (
    EXACT,
    CommandUnits,
    CompiledController,
    check_pitches,
    foreseen,
    hidden,
    known_scene,
    make,
    preview_leads,
    view_of,
)
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.faults import BLADE_FAULTS, STOP_FAULTS, Fault, read_faults
from fowt_env.descriptions.protection import Protection, TripLimit, read_protection
from fowt_env.descriptions.ratings import ratings
from fowt_env.descriptions.sensors import SensorChain, sensors_of
from fowt_env.descriptions.units import RPM
from fowt_env.errors import (
    ControllerInputError,
    InputError,
    PlantWarning,
    SimulationStopped,
    level_outside,
)
from fowt_env.initial_conditions import initial_state
from fowt_env.plant.channels import Out
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.compile.handle import Handle
from fowt_env.plant.events import counted, harm
from fowt_env.plant.measurement import BladeMeasurement, Measurement
from fowt_env.plant.protection import Failure, Guard, Stop, Trip, Watch, build_guard
from fowt_env.plant.rollout import OVERSPEED, RUNNING, STOP_REASONS, Schedule, rollout
from fowt_env.plant.sensing import NacelleMotion, Reader, Setting, new_past, no_motion, open_reader
from fowt_env.plant.state import BLADES, N_COMMANDS, N_INDIVIDUAL_COMMANDS, Command, State
from fowt_env.scene.scene import Scene, check_scene
from fowt_env.weather.preview import Motion, Preview
from fowt_env.weather.sensor_noise import draw_sensors
from fowt_env.weather.wind_field import WindBox

# Ctrl-C is heard and progress shown between compiled calls. A call by itself costs 1e-4 s, so they
# grow longer until they last about CHUNK_TIME.
FIRST_CHUNK = 20.0  # simulated seconds
CHUNK_TIME = 0.05  # s of the clock
GIB = 2.0**30
MOST_MEMORY = 0.8  # of the machine's that a table may take
LIMITED = 0.5  # of a run's time with the generator torque limited, where it is worth a warning
FAILURES = {
    "stuck_pitch": Failure.STUCK,
    "pitch_runaway": Failure.RUNAWAY,
    "pitch_offset": Failure.OFFSET,
    "sensor_bias": Failure.BIAS,
    "sensor_freeze": Failure.FREEZE,
    "sensor_loss": Failure.LOSS,
}


@control_kernel
def hold(parameters, memory, measurement, command):
    """Leave the command as it is."""


@control_kernel
def given(parameters, memory, measurement, command):
    """The command that stands in parameters: torque, blade pitch or that of each blade."""
    for i in range(parameters.shape[0]):
        command[i] = parameters[i]


class HeldCommand(CompiledController):
    """The law of controller=None: the command stays as it is."""

    kernel = staticmethod(hold)
    information: tuple[str, ...] = ("generator_torque", "blade_pitch")

    def __init__(self, individual: bool = False) -> None:
        self.individual = individual
        super().__init__("none", np.zeros(1), 1)
        if individual:
            self.information += ("blade_pitch_1", "blade_pitch_2", "blade_pitch_3")

    def reset(self, measurement: Measurement) -> None:
        """Nothing to start."""


def steps_in(name: str, period: float, dt: float, step: str = "dt") -> int:
    """Number of steps of dt (s), called step, in a period. Raises: InputError if dt does not divide it."""
    for key, value in ((name, period), (step, dt)):
        check_number(key, value, 0.0, low_open=True, allowed="a positive number of seconds")
    count = round(period / dt)
    if count < 1 or abs(count * dt - period) > 1e-9 * period:
        raise InputError(f"{step} = {dt:g} s does not divide {name} = {period:g} s (ratio {period / dt:.6g})")
    return count


def check_duration(scene: Scene, duration: float) -> None:
    """Refuse a run that is longer than the scene's random or recorded weather."""
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
    """Refuse a run whose table this machine cannot hold. Raises: InputError."""
    rows, columns = round(duration / output_dt) + 1, len(scene.channels)
    needed, most = 8.0 * rows * columns, MOST_MEMORY * physical_memory()
    if needed > most:
        raise InputError(
            f"duration = {duration:g} s: a table of {rows} rows of {columns} channels takes"
            f" {needed / GIB:.3g} GiB, and {most / GIB:.3g} GiB are allowed here: take a longer output_dt"
            f" (now {output_dt:g} s), or several runs"
        )


def physical_memory() -> float:
    """Bytes of memory that this machine has; inf where it does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return inf


def simulate(
    scene: Scene,
    controller: Any = "pi",
    duration: float = 600.0,
    dt: float | None = None,
    control_dt: float = 0.1,
    output_dt: float = 0.1,
    start: str = "trim",
    initial: dict[str, float] | None = None,
    progress: bool | Callable[[float], object] = False,
    stop_overspeed: bool = False,
    grid_loss: float | None = None,
    trip: float | None = None,
    protection: str | Mapping[str, Any] | Protection | None = None,
    faults: Fault | Mapping[str, Any] | Sequence[Any] | None = None,
    sensors: str | SensorChain | None = None,
    preview: str | Preview | Callable[[Scene, tuple[float, ...]], Preview] = EXACT,
    nominal: Scene | None = None,
) -> pd.DataFrame:
    """DataFrame of one run, columns named as OpenFAST writes them (`PtfmPitch_[deg]`).

    scene       what build_scene makes: a platform in its wind and sea. A platform's name alone is refused
    controller  None: the rotor is held at the trim's speed and blade pitch (at rest without wind); a
                name of a built-in one or "module:Class"; an object with
                reset(measurement) and act(measurement) -> (generator torque N m, blade pitch rad), and
                prepare(scene) where it needs more than measurements; or a function of the measurement
                alone that returns this pair. One that commands each blade (control.py) needs a scene
                with pitch="individual"
    duration    s; rows run from 0 to duration inclusive, every output_dt
    dt          physics step, s; must divide control_dt and output_dt, and output_dt the duration.
                None: scene.dt (0.0125 s at fidelity "reference", 0.1 s at the others)
    start       "trim" or "zero"; initial then sets absolute values of named channels
    progress    True shows a bar; a callable is called with the fraction done
    stop_overspeed  end the run, as an environment does, at a control instant with a rotor speed beyond the
                turbine file's overspeed
    grid_loss   time (s) from which the generator is off the grid and has no torque; None: never
    trip        rotor speed over rated, above 1, beyond which the protection stops the turbine at once: the
                overspeed of `protection`, with an emergency stop. None: what `protection` has
    protection  trips by overspeed, overpower, tower-top acceleration and pitch deviation: "turbine" for those
                of the turbine file, a mapping of its [protection] keys in place of single ones of these
                (False: no such trip), or a Protection (fowt_env.descriptions.protection). From the trip on
                the controller is not heard and the blades feather to the drive's maximum: in an emergency
                stop without torque, in a normal one with a torque that falls with the rotor speed. The run
                goes on to its end. None: no trips
    faults      what goes wrong: a Fault (fowt_env.descriptions.faults), a mapping of its keys, or a list of
                these. The run goes on whatever the rotor speed, unless stop_overspeed
    sensors     what the controller reads: None or "exact" for the measurements as they are, the name of a
                built-in chain ("standard") or a SensorChain (fowt_env.descriptions.sensors). Rows are of
                the true motions; the noise follows from the scene's seed and is the same for every controller
    preview     where the controller has preview_times, what it is given of the wind ahead: "exact", a lidar
                ("four_beam_pulsed"), a Preview (fowt_env.weather.preview), or a function of (scene,
                preview_times) that returns one
    nominal     scene whose plant the controller is designed on, where that is not the one that runs

    A controller is given what its `information` declares and nothing else (fowt_env.control).

    The generator torque stays within [0, max_torque] of the turbine file and moves in a control period at
    most as far as its max_torque_rate allows, whatever is commanded: GenTq is the torque in force, and
    GenTqLim is 1 while it differs from the command.

    Columns have their unit in the name, as in OpenFAST's files: frame["RotSpeed_[rpm]"];
    frame.filter(like="RotSpeed") finds one without it. attrs["events"] of the DataFrame: {name: count} of
    what the plant met outside its usual range (fowt_env.plant.events), of those that happened.
    attrs["doubtful_commands"]: the warning about commands that can hardly be in N m and rad, "" for none.
    attrs["torque_limited"]: time (s) for which the generator torque was not the commanded one.
    attrs["tripped"]: time (s) at which the protection stopped the turbine, or None; attrs["trip"]: the trip
    that did, as "overspeed"; attrs["stop"]: "normal" or "emergency" where the turbine was being stopped at
    the end, by a trip or a fault, else None; attrs["ratings"]: rated rotor speed, overspeed, rated power and
    rated wind speed of the turbine (descriptions.ratings), which plots mark.

    Warns (PlantWarning) once of commands that can hardly be in N m and rad; and at the end of a run whose
    loads were less accurate for its events, whose rotor is beyond the overspeed, or whose torque was limited
    for half of the time (these two where nothing stops the turbine and there are no faults).

    Raises: InputError before anything runs (ControllerInputError where the controller raised it, whenever
    that is); SimulationStopped (with the rows so far) on capsize, a numerical blow-up, a
    non-finite state or command or, where it is to stop there, overspeed; ControllerError if a controller
    returns anything but two finite numbers or reads what it does not declare.
    """
    check_scene(scene)
    if dt is None:
        dt = min(scene.dt, control_dt, output_dt)
    per_control = steps_in("control_dt", control_dt, dt)
    per_output = steps_in("output_dt", output_dt, dt)
    last = steps_in("duration", duration, dt)
    steps_in("duration", duration, output_dt, "output_dt")
    check_duration(scene, duration)
    check_memory(scene, duration, output_dt)
    scene = scene.with_step(dt)
    if grid_loss is not None:
        check_number("grid_loss", grid_loss, allowed="a time in s, or None")
    if trip is not None:
        check_number("trip", trip, 1.0, low_open=True, allowed="above 1, of rated rotor speed, or None")
    limits = read_protection(protection, scene.turbine.protection)
    if trip is not None:
        limits = limits.model_copy(update={"overspeed": TripLimit(limit=trip)})
    chain = sensors_of(sensors, scene.turbine)
    held = controller is None
    wrong = read_faults(faults)
    if held and wrong:
        raise InputError(f"faults: {wrong[0].kind}: controller=None has nobody whom a fault could trouble")
    if not held:
        controller = make(controller, scene.turbine, control_dt)
        check_pitches(controller, scene.model.pitches is not None)
        with _controllers_own():
            controller.prepare(known_scene(scene if nominal is None else nominal, controller))
    x, u = initial_state(scene, start, initial)
    if held:
        scene = scene.with_model({"rigid_body.rotor_fixed": True})
        controller = HeldCommand(scene.model.pitches is not None)
        per_control = last  # nobody reads the measurements
        chain = None
    overspeed = scene.turbine.overspeed if stop_overspeed else inf
    losses = [inf if time is None else time for time in (grid_loss, *(fault.grid_loss for fault in wrong))]
    loss = min(losses) - 1e-9  # an instant may miss it by rounding
    ends = float(overspeed), float(loss)
    schedule = Schedule(float(dt), per_control, per_output, last, *ends, bool(controller.individual))
    guard = guard_of(scene, limits, wrong, per_control * dt)
    reader = reader_of(scene, controller, chain, preview, schedule)
    loop = _Loop(scene, controller, x, u, schedule, reader, guard)
    with _bar(progress) as report, _controllers_own():
        loop.go(report)
    frame = loop.frame()
    said = [harm(frame.attrs["events"])]
    if not (held or wrong or grid_loss is not None):
        said += loop.out_of_bounds(frame.attrs)
    if found := ". ".join(f"{text[0].upper()}{text[1:]}" for text in said if text):
        warnings.warn(f"{scene.label}: {found}", PlantWarning, stacklevel=level_outside())
    return frame


@contextmanager
def _controllers_own():
    """An InputError raised inside becomes a ControllerInputError with the same words."""
    try:
        yield
    except InputError as error:
        raise ControllerInputError(str(error)) from error


def guard_of(scene: Scene, limits: Protection, faults: Sequence[Fault], control_dt: float) -> Guard:
    """Guard of a run: the trips of a protection, and the faults. Raises: InputError."""
    turbine, drive = scene.turbine, scene.turbine.pitch_drive
    units = {
        Trip.OVERSPEED: turbine.rated_rotor_speed,
        Trip.OVERPOWER: turbine.torque_law.rated_power,
        Trip.ACCELERATION: 1.0,
        Trip.PITCH_DEVIATION: 1.0,
    }
    trips = []
    for kind, unit in units.items():
        found = getattr(limits, kind.name.lower())
        if found is None:
            trips.append((inf, 0.0, Stop.EMERGENCY))
        else:
            trips.append((float(found.limit * unit), found.time, Stop[found.stop.upper()]))
    ordered, rates, rows = [inf, inf], [limits.normal_rate, limits.emergency_rate], []
    for fault in faults:
        rows += _failures(scene, fault)
        stop = Stop.NORMAL if fault.kind == "normal_stop" else Stop.EMERGENCY
        if fault.kind in STOP_FAULTS or fault.delay is not None:
            ordered[stop] = min(ordered[stop], fault.time + (fault.delay or 0.0))
            if fault.rate is not None:
                rates[stop] = radians(fault.rate)
    steps = [min(rate, drive.rate_limit) * control_dt for rate in rates]
    off_speed = limits.off_speed * turbine.rated_rotor_speed
    return build_guard(trips, ordered, steps, drive.maximum, off_speed, rows)


def _failures(scene, fault):
    """Rows of Guard.faults of a Fault: (kind, time, place, value, backup)."""
    if fault.kind not in FAILURES:
        return []
    kind, time = FAILURES[fault.kind], fault.time
    individual = scene.model.pitches is not None
    if fault.kind not in BLADE_FAULTS:
        fields = (*Measurement._fields, *(BladeMeasurement._fields if individual else ()))
        if fault.field not in fields:
            raise InputError(
                f"faults: {fault.kind}: field = {fault.field!r}: needs a scene with pitch='individual'"
            )
        return [(kind, time, fields.index(fault.field), fault.value or 0.0, 0.0)]
    if fault.blades is not None and not individual:
        raise InputError(
            f"faults: {fault.kind}: blades = {list(fault.blades)}: needs a scene with pitch='individual'"
        )
    blades = range(BLADES if individual else 1)
    if fault.blades is not None:
        blades = [number - 1 for number in fault.blades]
    value = radians(fault.offset or 0.0)
    if fault.towards is not None:
        value = -1.0 if fault.towards == "fine" else 1.0
    return [(kind, time, blade, value, float(fault.backup)) for blade in blades]


def reader_of(
    scene: Scene,
    controller: Any,
    chain: SensorChain | None,
    preview: Any,
    schedule: Schedule,
) -> Reader:
    """Reader of a run: what the controller declares, through the chain (None: exact), and the wind ahead.

    Raises: InputError where the controller declares what the chain or the scene does not have.
    """
    control_dt, duration = schedule.per_control * schedule.dt, schedule.last * schedule.dt
    readings = -(-schedule.last // schedule.per_control) + 1
    individual = scene.model.pitches is not None
    sensors = draw_sensors(chain, control_dt, scene.seed, readings, individual)
    available = None if chain is None else (chain.name, chain.available + chain.available_of_blades)
    sensors.chain[Setting.HIDDEN] = hidden(controller, available, individual)
    leads = preview_leads(controller)
    time, values, motion = np.zeros(0), np.zeros((0, 0)), None
    if leads:
        time, values, motion = foreseen(scene, leads, preview, duration)
    moving = no_motion() if motion is None else nacelle_motion(motion, control_dt)
    reading = np.zeros(scene.n_measurements + len(leads))
    return Reader(sensors, new_past(sensors.chain), time, values, moving, reading)


def nacelle_motion(motion: Motion, control_dt: float) -> NacelleMotion:
    """The Motion of a preview at the control instants, between which the velocity is linear."""
    step = motion.corner * control_dt
    weight = np.array([0.0, 0.0, 1.0])
    if isfinite(step):
        decay = exp(-step)
        new = 1.0 - (1.0 - decay) / step  # exact for a ramp from one instant to the next
        weight = np.array([decay, 1.0 - decay - new, new])
    offsets, delays = (np.asarray(lag, dtype=float) / control_dt for lag in (motion.offset, motion.delay))
    size = int(max(offsets.max(), 0.0)) + int(max(delays.max(), 0.0)) + 3
    taps = np.zeros((len(delays), size))
    for j, delay in enumerate(delays):
        for offset, share in zip(offsets, motion.weight, strict=True):
            for late, part in _linear(delay):
                for later, piece in _linear(offset):
                    taps[j, late + later] += share * part * piece
    return NacelleMotion(taps, weight, np.zeros(size + 1))


def _linear(lag):
    """((instants ago, weight), ...) of a lag in control periods, linear between two of them; not ahead."""
    whole = int(max(lag, 0.0))
    part = max(lag, 0.0) - whole
    return (whole, 1.0 - part), (whole + 1, part)


class _Loop:
    """A run in chunks, compiled where the controller is."""

    def __init__(self, scene, controller, x, u, schedule, reader=None, guard=None):
        self.scene = scene
        self.controller = controller
        self.data = scene.data()
        self.handle = scene.handle(self.data)
        self.x, self.u, self.schedule = x, u, schedule
        self.dx = np.zeros_like(x)
        self.measurement = np.zeros(scene.n_measurements)
        self.guard = build_guard() if guard is None else guard
        self.guarding = Handle(None, self.guard)
        self.reader = open_reader(scene.n_measurements) if reader is None else reader
        self.given = Handle(None, self.reader)
        self.view = view_of(controller)
        self.rows = np.empty((schedule.last // schedule.per_output + 1, len(scene.channels)))
        self.filled = 0
        self.compiled = isinstance(controller, CompiledController)
        self.units = CommandUnits(
            f"controller {controller.name!r}", scene.turbine, schedule.per_control * schedule.dt
        )
        if self.compiled:
            self.law = controller.law, controller.parameters, controller.memory
            self.given_to_law = self.given
        else:
            size = N_INDIVIDUAL_COMMANDS if schedule.individual else N_COMMANDS
            self.law = given.compiled, np.zeros(size), np.zeros(1)
            # the controller has its reading already
            self.given_to_law = Handle(None, open_reader(scene.n_measurements))

    def go(self, report):
        """Run to the end. Raises: SimulationStopped; KeyboardInterrupt with the frame so far."""
        self.controller.reset(self._read(0))
        last = self.schedule.last
        size = max(1, round(FIRST_CHUNK / self.schedule.dt)) if self.compiled else self.schedule.per_control
        step = 0
        try:
            while step < last:
                began = perf_counter()
                if not self.compiled:
                    self._ask(step)
                step = self._roll(step, min(step + size, last), self.given_to_law)
                if self.compiled and perf_counter() - began < 0.25 * CHUNK_TIME:
                    size *= 4
                report(step / last)
        except KeyboardInterrupt as interrupt:
            interrupt.frame = self.frame()  # what is done is not lost: the caller may keep it
            raise

    def _roll(self, first, end, given):
        status, step, count = rollout(
            self.handle, self.x, self.u, *self.law, given, self.guarding, self.measurement, self.dx,
            self.schedule, first, end, self.rows[self.filled :],
        )  # fmt: skip
        self.filled += count
        if self.compiled and abs(pitch := self.u[Command.BLADE_PITCH]) > pi:
            self.units.warn(0.0, float(pitch))
        self._check(status, step)
        return step

    def _read(self, step):
        """What the controller is given at a step that is at hand."""
        self._roll(step, step, self.given)
        return self.view(self.reader.reading.tolist())

    def _ask(self, step):
        """Have a controller in Python say what to do from a step on; one that is stopped is not asked."""
        if self.x[State.ROTOR_SPEED] > self.schedule.overspeed:
            self._check(OVERSPEED, step)
        if self.guard.watch[Watch.STOP] < 0.0:
            command = self.controller.act(self._read(step))
            self.law[1][:] = command
            self.units.see(command[0], command[1], self.x[State.ROTOR_SPEED])

    def _check(self, status, step):
        if status != RUNNING:
            reason, time = STOP_REASONS[status], step * self.schedule.dt
            if fault := self.scene.first_nonfinite_load(self.data):
                reason = f"{reason}: {fault}"
            raise SimulationStopped(f"stopped at t = {time:.3f} s: {reason}", reason, time, self.frame())

    def frame(self):
        """Rows in channel units, at the end of the run: they are converted where they are."""
        values = self.scene.values(self.rows[: self.filled], overwrite=True)
        frame = pd.DataFrame(values, columns=[c.column for c in self.scene.channels])
        frame.attrs["events"] = counted(self.data.counters)
        period = self.schedule.per_output * self.schedule.dt
        frame.attrs["torque_limited"] = float(np.count_nonzero(values[:-1, Out.GENTQLIM]) * period)
        if self.compiled and self.units.is_little(self.u[Command.GENERATOR_TORQUE]):
            self.units.see_run(values[:, Out.GENTQ] * 1e3, values[:, Out.ROTSPEED] * RPM, period)
        frame.attrs["doubtful_commands"] = self.units.said
        watch = self.guard.watch
        tripped, stop = float(watch[Watch.TRIPPED_AT]), int(watch[Watch.STOP])
        known = not isinf(tripped)
        frame.attrs["tripped"] = tripped if known else None
        frame.attrs["trip"] = Trip(int(watch[Watch.TRIP])).name.lower() if known else None
        frame.attrs["stop"] = Stop(stop).name.lower() if stop >= 0 else None
        frame.attrs["ratings"] = ratings(self.scene.turbine)
        return frame

    def out_of_bounds(self, attrs):
        """Sentences on a turbine that nothing stops, at the end of a run without faults."""
        if attrs["stop"] is not None:
            return []
        found, turbine = [], self.scene.turbine
        speed, duration = float(self.x[State.ROTOR_SPEED]), self.schedule.last * self.schedule.dt
        if speed > turbine.overspeed:
            found.append(
                f"the rotor turns at {speed / RPM:.4g} rpm at the end, beyond the overspeed of"
                f" {turbine.overspeed / RPM:.4g} rpm in the turbine file (stop_overspeed=True ends the run"
                " there, protection='turbine' stops the turbine)"
            )
        limited = attrs["torque_limited"]
        if limited >= max(1.0, LIMITED * duration) and not self.units.said:
            law = turbine.torque_law
            found.append(
                f"the generator torque was limited for {limited:.4g} of {duration:.4g} s: controller"
                f" {self.controller.name!r} commanded less than 0 or more than"
                f" {law.max_torque * 1e-3:.4g} kN m, or changes faster than"
                f" {law.max_torque_rate * 1e-3:.4g} kN m/s (GenTqLim)"
            )
        return found


class _bar:
    """Context that hands out a callable taking the fraction done: nothing, rich's bar, or the user's own."""

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
