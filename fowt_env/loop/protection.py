"""Models protection and faults of a turbine: trips, stops, start-up, faults of drives, sensors and platform.

All of them act at control instants, in the order of loop/period.py. Python builds a Guard per run
(build_guard), whose memory is in InterfaceData: watch and held.
"""

from enum import IntEnum
from math import hypot, inf, isfinite, isinf, isnan
from typing import NamedTuple

import numpy as np

from fowt_env.plant.blade_pitches import halt_blade, pitch_of
from fowt_env.plant.channels import acceleration_at
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.compile.handle import by_reference
from fowt_env.plant.drivetrain import TorqueCurve, clamp, generator_torque
from fowt_env.plant.elastic.tower import bend_of, nacelle_rates, turned_pose
from fowt_env.plant.hydro.flooding import add_point_mass
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.mooring import is_lost, lose_line
from fowt_env.plant.state import BLADES, Command, State, pose_of

ROUNDING = 1e-9  # s, tolerance in comparisons of times
# stages of a start-up, in InterfaceData.watch[START]: none, or ended; idling until the ordered time; blades
# pitch towards fine; the rotor has the speed at which the law, once reset, takes over; the law commands, with
# a torque of at most the torque curve of fine pitch
PRODUCTION, PARKED, RUN_UP, READY, LOADING = 0, 1, 2, 3, 4
LONGEST_LOADING = 60.0  # s: a load stage in ROSCO's example of a start-up


class Trip(IntEnum):
    """Enumerates the rows of Guard.trips; each names a field of descriptions.protection.Protection."""

    OVERSPEED = 0  # rotor speed, rad/s
    OVERPOWER = 1  # mechanical power of the generator, W
    ACCELERATION = 2  # magnitude at the tower top, fore-aft and side-side, m/s2
    PITCH_DEVIATION = 3  # largest pitch error, encoder less command, or its spread among blades, rad


class Limit(IntEnum):
    """Enumerates the columns of Guard.trips."""

    VALUE = 0  # threshold; infinite: no trip
    TIME = 1  # s for which it must be exceeded without interruption
    STOP = 2  # the Stop that follows


class Stop(IntEnum):
    """Enumerates the ways to stop the turbine; a higher one supersedes a lower one."""

    NONE = -1
    NORMAL = 0  # feathering at the normal rate; torque falls with rotor speed until the generator is off
    EMERGENCY = 1  # zero torque at once, feathering at the highest rate
    END = 2  # end of the run at once


class Failure(IntEnum):
    """Enumerates the kinds of faults in Guard.faults."""

    STUCK = 0  # the blade stays at its pitch at the onset
    RUNAWAY = 1  # the blade moves to an end of the drive's range at the highest rate
    OFFSET = 2  # an angle adds to the pitch of the blade and is not in the encoder reading
    BIAS = 3  # a value adds to a reading
    FREEZE = 4  # a reading keeps its value
    LOSS = 5  # a reading is zero
    LINE_LOSS = 6  # a mooring line breaks at its fairlead


class Part(IntEnum):
    """Enumerates the columns of Guard.faults."""

    KIND = 0  # Failure
    TIME = 1  # s, onset
    PLACE = 2  # blade (0, 1, 2), field of the measurement, or mooring line from 0
    VALUE = 3  # offset (rad) or bias (SI); end of a runaway: below zero fine, above feather
    BACKUP = 4  # 1: in an emergency stop the blade still feathers, by its backup drive


class Flood(IntEnum):
    """Enumerates the columns of Guard.floods."""

    TIME = 0  # s, at which the compartment begins to fill
    DURATION = 1  # s of filling at a constant rate; 0: full at once
    MASS = 2  # kg of water when full
    X = 3  # m, its centre in body axes
    Y = 4
    Z = 5


class Watch(IntEnum):
    """Enumerates the entries of InterfaceData.watch, the memory of the protection."""

    TRIPPED_AT = 0  # s; infinite: not yet
    TRIP = 1  # the first Trip
    STOP = 2  # the Stop in progress
    TORQUE = 3  # N m at the start of a stop; zero once the generator is off
    SPEED = 4  # rotor speed at the start of a stop, rad/s
    SINCE = 5  # s, of each trip: time from which its limit is exceeded; infinite: not exceeded
    TARGET = 9  # rad, of each blade: pitch command of a stop or a start-up


# further entries: stage of the start-up, and the time (s) of its stage READY; infinite: not yet
START, CONNECTED = Watch.TARGET + BLADES, Watch.TARGET + BLADES + 1
N_WATCH = CONNECTED + 1


@by_reference
class Guard(NamedTuple):
    """Holds the protection and the faults of a run."""

    trips: np.ndarray  # (len(Trip), len(Limit))
    ordered: np.ndarray  # (2,) s, times of the ordered NORMAL and EMERGENCY stops
    rates: np.ndarray  # (2,) rad per control period, feathering rate of each stop
    feathered: float  # rad, pitch at which feathering ends
    off_speed: float  # rad/s, rotor speed at which a normal stop disconnects the generator
    grid_loss: float  # s, time of the grid loss
    faults: np.ndarray  # (n, len(Part))
    floods: np.ndarray  # (n, len(Flood))
    start: float  # s, time of an ordered start-up, before which the turbine idles; infinite: none
    start_rate: float  # rad per control period, pitch rate of a start-up
    fine: float  # rad, pitch at which it ends
    connect_speed: float  # rad/s, rotor speed at which the generator is connected
    curve: TorqueCurve  # which limits the torque of a start-up until the rotor has its speed


def new_watch(guard):
    """Return the initial InterfaceData.watch of a run, with neither trip nor stop."""
    watch = np.zeros(N_WATCH)
    watch[START] = PRODUCTION if isinf(guard.start) else PARKED
    watch[CONNECTED] = inf
    watch[Watch.TRIPPED_AT] = inf
    watch[Watch.STOP] = Stop.NONE
    watch[Watch.SINCE : Watch.SINCE + len(Trip)] = inf
    return watch


def build_guard(
    trips=None,
    ordered=(inf, inf),
    rates=(0.0, 0.0),
    feathered=0.0,
    off_speed=0.0,
    grid_loss=inf,
    faults=None,
    floods=None,
    start=inf,
    start_rate=0.0,
    fine=0.0,
    connect_speed=0.0,
    curve=None,
):
    """Return the Guard of a run; the defaults have no trips, stops, start-up or faults."""
    if trips is None:
        trips = [(inf, 0.0, Stop.EMERGENCY)] * len(Trip)
    return Guard(
        np.array(trips, dtype=np.float64),
        np.array(ordered, dtype=np.float64),
        np.array(rates, dtype=np.float64),
        float(feathered),
        float(off_speed),
        float(grid_loss),
        np.array(faults or np.zeros((0, len(Part))), dtype=np.float64),
        np.array(floods or np.zeros((0, len(Flood))), dtype=np.float64),
        float(start),
        float(start_rate),
        float(fine),
        float(connect_speed),
        TorqueCurve(*[0.0] * len(TorqueCurve._fields)) if curve is None else curve,
    )


@kernel
def tower_top_acceleration(x, dx, model):
    """Return the magnitude of the tower-top acceleration in the x-y plane of the nacelle, m/s2."""
    pose, top = pose_of(x), model.layout.tower_top
    bend = bend_of(x, model.tower)
    nacelle, moving = turned_pose(pose, bend), nacelle_rates(pose, x, bend, dx, model.tower)
    ax, ay, _ = acceleration_at(nacelle, moving, top[0], top[1], top[2])
    return hypot(ax, ay)


@kernel
def pitches_of(pitches):
    """Return the number of blade pitches: one for all blades, or one for each."""
    if pitches is None:
        return 1
    return BLADES


@kernel
def kind_now(k, t, guard):
    """Return the Failure of row k of the faults, -1 before its onset."""
    if t < guard.faults[k, Part.TIME] - ROUNDING:
        return -1
    return int(guard.faults[k, Part.KIND])


@kernel
def encoder_offset(blade, t, guard):
    """Return the angle (rad) by which the pitch of a blade exceeds its encoder reading."""
    faults, offset = guard.faults, 0.0
    for k in range(faults.shape[0]):
        active = kind_now(k, t, guard) == Failure.OFFSET and int(faults[k, Part.PLACE]) == blade
        if active:
            offset += faults[k, Part.VALUE]
    return offset


@kernel
def pitch_deviation(t, x, actuator, pitches, guard, command):
    """Return the pitch deviation (rad): largest error, encoder less command, or its spread among blades."""
    low = high = largest = 0.0
    for blade in range(pitches_of(pitches)):
        target = clamp(command[Command.BLADE_PITCH + blade], actuator.minimum, actuator.maximum)
        error = pitch_of(blade, x, pitches) - encoder_offset(blade, t, guard) - target
        low, high = (error, error) if blade == 0 else (min(low, error), max(high, error))
        largest = max(largest, abs(error))
    return max(largest, high - low)


@kernel
def watched(trip, t, x, model, guard, link):
    """Return the quantity that a trip compares with its limit."""
    if trip == Trip.OVERSPEED:
        return x[State.ROTOR_SPEED]
    if trip == Trip.OVERPOWER:
        return link.measurement[Measure.GENERATOR_SPEED] * link.measurement[Measure.GENERATOR_TORQUE]
    if trip == Trip.ACCELERATION:
        return tower_top_acceleration(x, link.dx, model)
    return pitch_deviation(t, x, model.actuator, model.pitches, guard, link.command)


@kernel
def watch_turbine(t, x, model, guard, link):
    """Compare the turbine with its trip limits at a control instant, and begin the resulting stop."""
    if guard is None:
        return
    watch, trips = link.watch, guard.trips
    stop = watch[Watch.STOP]
    for kind in range(guard.ordered.shape[0]):
        if t >= guard.ordered[kind] - ROUNDING:
            stop = max(stop, float(kind))
    for trip in range(trips.shape[0]):
        since = Watch.SINCE + trip
        if isinf(trips[trip, Limit.VALUE]):
            continue
        if not watched(trip, t, x, model, guard, link) > trips[trip, Limit.VALUE]:
            watch[since] = inf
            continue
        if isinf(watch[since]):
            watch[since] = t
        lasting = t - watch[since] >= trips[trip, Limit.TIME] - ROUNDING
        if lasting and trips[trip, Limit.STOP] > stop:
            stop = trips[trip, Limit.STOP]
            if isinf(watch[Watch.TRIPPED_AT]):
                watch[Watch.TRIPPED_AT], watch[Watch.TRIP] = t, trip
    if stop > watch[Watch.STOP]:
        if watch[Watch.STOP] < 0.0:
            watch[Watch.TORQUE] = link.measurement[Measure.GENERATOR_TORQUE]
            watch[Watch.SPEED] = x[State.ROTOR_SPEED]
            for blade in range(BLADES):
                pitch = pitch_of(blade, x, model.pitches) - encoder_offset(blade, t, guard)
                watch[Watch.TARGET + blade] = pitch
        watch[Watch.STOP] = stop
        watch[START] = PRODUCTION
    elif watch[START] > PRODUCTION:
        watch_start(t, x, model, guard, link.measurement, watch)


@kernel
def watch_start(t, x, model, guard, measurement, watch):
    """Advance the stage of a start-up at a control instant.

    It ends at the speed of region 3, once the blades are at fine pitch, where the torque law follows the
    rotor speed, or LONGEST_LOADING after the connection, for controllers that hold another speed.
    """
    if watch[START] == LOADING:
        done = measurement[Measure.GENERATOR_SPEED] >= guard.curve.region3_start_speed
        done = done or t - watch[CONNECTED] >= LONGEST_LOADING - ROUNDING
        if done or measurement[Measure.BLADE_PITCH] < guard.curve.region3_min_pitch:
            watch[START] = PRODUCTION
    elif watch[START] < RUN_UP:
        for blade in range(BLADES):
            pitch = pitch_of(blade, x, model.pitches) - encoder_offset(blade, t, guard)
            watch[Watch.TARGET + blade] = pitch
        if t >= guard.start - ROUNDING:
            watch[START] = RUN_UP
    elif x[State.ROTOR_SPEED] >= guard.connect_speed:
        watch[START] = READY  # until LOADING, when the controller has been reset
        watch[CONNECTED] = min(watch[CONNECTED], t)


@kernel
def is_supervised(guard, link):
    """Return whether the turbine is being stopped or started: commands of the law are then ignored."""
    if guard is None:
        return False
    return link.watch[Watch.STOP] >= 0.0 or PRODUCTION < link.watch[START] < LOADING


@kernel
def has_ended(guard, link):
    """Return whether a trip ended the run."""
    if guard is None:
        return False
    return int(link.watch[Watch.STOP]) == Stop.END


@kernel
def off_grid(t, guard, link):
    """Return whether the generator torque is zero: after a grid loss, and in an emergency stop."""
    if guard is None:
        return False
    return t >= guard.grid_loss or int(link.watch[Watch.STOP]) == Stop.EMERGENCY


@kernel
def supervise_turbine(x, guard, link):
    """Command the stop or the start-up that is under way."""
    if guard is None:
        return
    if link.watch[Watch.STOP] < 0.0:
        start_turbine(guard, link.watch, link.command)
    else:
        stop_turbine(x, guard, link)


@kernel
def start_turbine(guard, watch, command):
    """Command a start-up: no torque, and from the run-up on blades that pitch from feather towards fine."""
    rate = guard.start_rate if watch[START] >= RUN_UP else 0.0
    for blade in range(BLADES):
        target = max(watch[Watch.TARGET + blade] - rate, guard.fine)
        watch[Watch.TARGET + blade] = target
        if Command.BLADE_PITCH + blade < command.shape[0]:
            command[Command.BLADE_PITCH + blade] = target
    command[Command.GENERATOR_TORQUE] = 0.0


@kernel
def stop_turbine(x, guard, link):
    """Command the stop: blades feather from their pitch at its start, the torque falls with rotor speed."""
    watch, command = link.watch, link.command
    emergency = int(watch[Watch.STOP]) == Stop.EMERGENCY
    rate = guard.rates[1] if emergency else guard.rates[0]
    for blade in range(BLADES):
        target = min(watch[Watch.TARGET + blade] + rate, guard.feathered)
        watch[Watch.TARGET + blade] = target
        if Command.BLADE_PITCH + blade < command.shape[0]:
            command[Command.BLADE_PITCH + blade] = target
    speed = x[State.ROTOR_SPEED]
    if emergency or speed <= guard.off_speed or watch[Watch.SPEED] <= guard.off_speed:
        watch[Watch.TORQUE] = 0.0  # the generator stays disconnected
    span = max(watch[Watch.SPEED] - guard.off_speed, ROUNDING)
    fraction = clamp((speed - guard.off_speed) / span, 0.0, 1.0)
    command[Command.GENERATOR_TORQUE] = watch[Watch.TORQUE] * fraction


@kernel
def loaded_torque(torque, guard, link):
    """Return the generator torque (N m) of a command, in a start-up at most that of the torque curve.

    Torque laws with constant torque above a blade pitch would stop a rotor that is still slow.
    """
    if guard is None:
        return torque
    if link.watch[START] != LOADING or not isfinite(torque):
        return torque
    return min(torque, generator_torque(link.measurement[Measure.GENERATOR_SPEED], 0.0, guard.curve))


@kernel
def damage_platform(t, control_dt, guard, data):
    """Break mooring lines and fill flooded compartments at a control instant.

    A line that breaks and a compartment that fills at once are jumps of the load, at which the multistep
    integrators start again.
    """
    if guard is None:
        return
    for k in range(guard.faults.shape[0]):
        line = int(guard.faults[k, Part.PLACE])
        if kind_now(k, t, guard) == Failure.LINE_LOSS and not is_lost(line, data.lines):
            lose_line(line, data.lines)
            data.cache[LoadCache.VALID] = data.cache[LoadCache.STEPS] = 0.0
    fill_compartments(t, control_dt, guard.floods, data)


@kernel
def water_in(k, t, floods):
    """Return the mass (kg) of water in compartment k, which fills at a constant rate."""
    late, duration = t - floods[k, Flood.TIME], floods[k, Flood.DURATION]
    if late < -ROUNDING:
        return 0.0
    if late >= duration:
        return floods[k, Flood.MASS]
    return max(late, 0.0) / duration * floods[k, Flood.MASS]


@kernel
def is_sunk(x, model, guard):
    """Return whether flooded compartments have drawn the foot of the tower below still water."""
    if guard is None:
        return False
    return guard.floods.shape[0] > 0 and model.layout.base_height + x[State.HEAVE] < 0.0


@kernel
def fill_compartments(t, control_dt, floods, data):
    """Set the mass matrix of the water in the flooded compartments at a control instant."""
    total = 0.0
    for k in range(floods.shape[0]):
        total += water_in(k, t, floods)
    if total == data.flood[0, 0]:
        return
    for i in range(6):
        for j in range(6):
            data.flood[i, j] = 0.0
    for k in range(floods.shape[0]):
        x, y, z = floods[k, Flood.X], floods[k, Flood.Y], floods[k, Flood.Z]
        add_point_mass(water_in(k, t, floods), x, y, z, data.flood)
        late = t - floods[k, Flood.TIME]
        if floods[k, Flood.DURATION] == 0.0 and -ROUNDING <= late < control_dt - ROUNDING:
            data.cache[LoadCache.STEPS] = 0.0
    data.cache[LoadCache.VALID] = 0.0


@kernel
def break_drives(t, x, u, model, guard, link):
    """Apply the faults of pitch drives to the commanded pitches in u."""
    if guard is None:
        return
    for k in range(guard.faults.shape[0]):
        kind = kind_now(k, t, guard)
        blade, value = int(guard.faults[k, Part.PLACE]), guard.faults[k, Part.VALUE]
        i = Command.BLADE_PITCH + blade
        if guard.faults[k, Part.BACKUP] > 0.0 and int(link.watch[Watch.STOP]) == Stop.EMERGENCY:
            continue
        if kind == Failure.STUCK:
            if isnan(link.held[k]):
                link.held[k] = pitch_of(blade, x, model.pitches)
            u[i] = link.held[k]
            halt_blade(blade, x, model.actuator, model.pitches)
        elif kind == Failure.RUNAWAY:
            u[i] = model.actuator.minimum if value < 0.0 else model.actuator.maximum
        elif kind == Failure.OFFSET:
            u[i] += value


@kernel
def break_sensors(t, guard, link):
    """Apply the faults of sensors to the reading; fields without a sensor stay NaN."""
    if guard is None:
        return
    reading = link.reading
    for k in range(guard.faults.shape[0]):
        kind = kind_now(k, t, guard)
        field, value = int(guard.faults[k, Part.PLACE]), guard.faults[k, Part.VALUE]
        if kind == Failure.OFFSET and reading.shape[0] == N_MEASUREMENTS:
            reading[Measure.BLADE_PITCH] -= value
        elif kind == Failure.OFFSET:
            reading[Measure.BLADE_PITCH] -= value / BLADES
            reading[N_MEASUREMENTS + BladeMeasure.BLADE_PITCH_1 + field] -= value
        if kind == Failure.BIAS:
            reading[field] += value
        elif kind == Failure.FREEZE:
            if isnan(link.held[k]):
                link.held[k] = reading[field]
            reading[field] = link.held[k]
        elif kind == Failure.LOSS and isfinite(reading[field]):
            reading[field] = 0.0
