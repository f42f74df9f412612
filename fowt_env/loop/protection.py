"""Protection and faults of a turbine: trips, stops, faults of pitch drives and of sensors.

All of it happens at control instants, in the order of loop/period.py. Python builds a Guard per run
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
from fowt_env.plant.drivetrain import clamp
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.state import BLADES, Command, State, pose_of
from fowt_env.plant.tower.modes import bend_of, turned_pose
from fowt_env.plant.tower.rates import nacelle_rates

ROUNDING = 1e-9  # s, by which a control instant may miss a time


class Trip(IntEnum):
    """Rows of Guard.trips; each names a field of descriptions.protection.Protection."""

    OVERSPEED = 0  # rotor speed, rad/s
    OVERPOWER = 1  # mechanical power of the generator, W
    ACCELERATION = 2  # of the tower top, along and across the nacelle together, m/s2
    PITCH_DEVIATION = 3  # between a blade's measured pitch and its command, or of that among blades, rad


class Limit(IntEnum):
    """Columns of Guard.trips."""

    VALUE = 0  # it trips above; infinite: never
    TIME = 1  # s for which it must be passed without a break
    STOP = 2  # what follows, of Stop


class Stop(IntEnum):
    """How the turbine is stopped; a later one takes over from an earlier one."""

    NONE = -1
    NORMAL = 0  # feathers at a normal rate; the torque falls with the rotor speed, until the generator is off
    EMERGENCY = 1  # no torque at once, feathers at the highest rate
    END = 2  # the run ends at once


class Failure(IntEnum):
    """Kinds of what breaks, in Guard.faults."""

    STUCK = 0  # a blade stays where it is then
    RUNAWAY = 1  # it goes to an end of the drive's range as fast as the drive can
    OFFSET = 2  # its true pitch is its command and an angle; its encoder shows it without
    BIAS = 3  # a value is added to a reading
    FREEZE = 4  # the reading keeps its value
    LOSS = 5  # a reading is zero


class Part(IntEnum):
    """Columns of Guard.faults."""

    KIND = 0  # Failure
    TIME = 1  # s from which it is there
    PLACE = 2  # blade (0, 1, 2), or field of the measurement
    VALUE = 3  # of an offset (rad) or bias (SI); a runaway's end: below zero fine, above feather
    BACKUP = 4  # 1: in an emergency stop the blade feathers all the same, by its backup drive


class Watch(IntEnum):
    """Entries of InterfaceData.watch, the memory of the protection."""

    TRIPPED_AT = 0  # s; infinite: not yet
    TRIP = 1  # which
    STOP = 2  # under way, of Stop
    TORQUE = 3  # N m at the beginning of a stop; zero once the generator is off
    SPEED = 4  # rotor speed then, rad/s
    SINCE = 5  # s, of each trip: from when its limit is passed; infinite: it is not
    TARGET = 9  # rad, of each blade: pitch that a stop commands


N_WATCH = Watch.TARGET + BLADES


@by_reference
class Guard(NamedTuple):
    """Protection and faults of one run."""

    trips: np.ndarray  # (len(Trip), len(Limit))
    ordered: np.ndarray  # (2,) s, times from which a NORMAL and an EMERGENCY stop are ordered
    rates: np.ndarray  # (2,) rad in a control period, feathering of each stop
    feathered: float  # rad, where it ends
    off_speed: float  # rotor speed (rad/s) at which a normal stop takes the generator off
    grid_loss: float  # s, time from which the generator is off the grid
    faults: np.ndarray  # (n, len(Part))


def new_watch():
    """Return InterfaceData.watch of a turbine on which nothing has happened."""
    watch = np.zeros(N_WATCH)
    watch[Watch.TRIPPED_AT] = inf
    watch[Watch.STOP] = Stop.NONE
    watch[Watch.SINCE : Watch.SINCE + len(Trip)] = inf
    return watch


def build_guard(
    trips=None, ordered=(inf, inf), rates=(0.0, 0.0), feathered=0.0, off_speed=0.0, grid_loss=inf, faults=None
):
    """Return the Guard of a run; without arguments there are no trips, stops and faults."""
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
    )


@kernel
def tower_top_acceleration(x, dx, model):
    """Size of the tower top's acceleration in the plane of the nacelle, m/s2."""
    pose, top = pose_of(x), model.layout.tower_top
    bend = bend_of(x, model.tower)
    nacelle, moving = turned_pose(pose, bend), nacelle_rates(pose, bend, dx, model.tower)
    ax, ay, _ = acceleration_at(nacelle, moving, top[0], top[1], top[2])
    return hypot(ax, ay)


@kernel
def pitches_of(pitches):
    """Number of pitches that the blades have: one for all, or one each."""
    if pitches is None:
        return 1
    return BLADES


@kernel
def kind_now(k, t, guard):
    """Failure of a row of the faults, -1 before its time."""
    if t < guard.faults[k, Part.TIME] - ROUNDING:
        return -1
    return int(guard.faults[k, Part.KIND])


@kernel
def encoder_offset(blade, t, guard):
    """Angle (rad) by which a blade's pitch exceeds the reading of its encoder."""
    faults, offset = guard.faults, 0.0
    for k in range(faults.shape[0]):
        wrong = kind_now(k, t, guard) == Failure.OFFSET and int(faults[k, Part.PLACE]) == blade
        if wrong:
            offset += faults[k, Part.VALUE]
    return offset


@kernel
def pitch_deviation(t, x, actuator, pitches, guard, command):
    """Greatest difference (rad) of encoder and command of a blade, and of that between two blades."""
    low = high = largest = 0.0
    for blade in range(pitches_of(pitches)):
        target = clamp(command[Command.BLADE_PITCH + blade], actuator.minimum, actuator.maximum)
        error = pitch_of(blade, x, pitches) - encoder_offset(blade, t, guard) - target
        low, high = (error, error) if blade == 0 else (min(low, error), max(high, error))
        largest = max(largest, abs(error))
    return max(largest, high - low)


@kernel
def watched(trip, t, x, model, guard, link):
    """Return the quantity that a trip watches."""
    if trip == Trip.OVERSPEED:
        return x[State.ROTOR_SPEED]
    if trip == Trip.OVERPOWER:
        return link.measurement[Measure.GENERATOR_SPEED] * link.measurement[Measure.GENERATOR_TORQUE]
    if trip == Trip.ACCELERATION:
        return tower_top_acceleration(x, link.dx, model)
    return pitch_deviation(t, x, model.actuator, model.pitches, guard, link.command)


@kernel
def watch_turbine(t, x, model, guard, link):
    """Compare the turbine with its limits at a control instant, and begin the stop that follows."""
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


@kernel
def is_stopping(guard, link):
    """Whether the turbine is being stopped, so that the law's commands are ignored."""
    if guard is None:
        return False
    return link.watch[Watch.STOP] >= 0.0


@kernel
def has_ended(guard, link):
    """Whether a trip ended the run."""
    if guard is None:
        return False
    return int(link.watch[Watch.STOP]) == Stop.END


@kernel
def off_grid(t, guard, link):
    """Whether the generator has no torque: from the loss of the grid on, and in an emergency stop."""
    if guard is None:
        return False
    return t >= guard.grid_loss or int(link.watch[Watch.STOP]) == Stop.EMERGENCY


@kernel
def stop_turbine(x, guard, link):
    """Command the stop: blades feather from the pitch at which it began, the torque falls."""
    if guard is None:
        return
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
        watch[Watch.TORQUE] = 0.0  # off the grid, and it stays so
    span = max(watch[Watch.SPEED] - guard.off_speed, ROUNDING)
    share = clamp((speed - guard.off_speed) / span, 0.0, 1.0)
    command[Command.GENERATOR_TORQUE] = watch[Watch.TORQUE] * share


@kernel
def break_drives(t, x, u, model, guard, link):
    """Put into u what faulty pitch drives make of the commanded pitches in it."""
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
    """Put into the reading what faulty sensors make of it; what the sensors lack stays NaN."""
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
