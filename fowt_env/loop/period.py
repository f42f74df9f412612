"""Defines the control period: no other file orders its parts.

begin_period: check the trips, read the sensors, apply sensor faults, fill the input of the law.
Then the law, a stop or a start-up writes InterfaceData.command.
apply_command: apply faults of platform and pitch drives, limit the torque; the plant then advances under u.
"""

from math import isfinite

from fowt_env.loop.protection import (
    break_drives,
    break_sensors,
    damage_platform,
    is_supervised,
    loaded_torque,
    off_grid,
    watch_turbine,
)
from fowt_env.loop.sensing import inform_law, take_reading
from fowt_env.plant.compile.decorators import kernel, separate_kernel
from fowt_env.plant.drivetrain import followed_torque, lose_torque, torque_was_limited
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import BLADES, Command


@separate_kernel
def begin_period(period, t, x, model, interface, link):
    """Begin a control period after its measurement. Returns whether the turbine is being stopped or started.

    period: number of control instants before this one; t: time, s.
    """
    watch_turbine(t, x, model, interface.guard, link)
    take_reading(interface.sensors, period, link.measurement, link.past, link.reading)
    break_sensors(t, interface.guard, link)
    inform_law(interface.hidden, interface.ahead, period, t, link)
    return is_supervised(interface.guard, link)


@kernel
def show_command(u, interface, individual, pitches, link):
    """Copy the command in force to link.command, which the law overwrites; undeclared parts are NaN.

    individual: whether the law commands each blade.
    """
    link.command[Command.GENERATOR_TORQUE] = u[Command.GENERATOR_TORQUE]
    show_pitches(u, interface.guard, link.command)
    hide_command(interface.hidden, individual, pitches, link.command)


@kernel
def show_pitches(u, guard, command):
    """Copy the pitches in force to the command; with a guard the command keeps the commanded pitches."""
    if guard is None:
        for i in range(Command.BLADE_PITCH, u.shape[0]):
            command[i] = u[i]


@kernel
def hide_command(hidden, individual, pitches, command):
    """Set the parts of the command in force that the law does not declare to NaN."""
    if hidden is None:
        return
    command[Command.GENERATOR_TORQUE] += hidden[Measure.GENERATOR_TORQUE]
    if not hide_pitches(hidden, individual, pitches, command):
        command[Command.BLADE_PITCH] += hidden[Measure.BLADE_PITCH]


@kernel
def hide_pitches(hidden, individual, pitches, command):
    """Hide pitches as hide_command, for a law that commands each blade. Returns whether the law does so."""
    if pitches is None:
        return False
    if individual:
        for blade in range(BLADES):
            command[Command.BLADE_PITCH + blade] += hidden[
                N_MEASUREMENTS + BladeMeasure.BLADE_PITCH_1 + blade
            ]
    return individual


@separate_kernel
def apply_command(t, x, u, model, data, interface, link):
    """Fill u with link.command after faults and torque limits, for the control period from t (s).

    On entry u holds the torque in force. Off the grid the torque is zero at once, whatever the command.
    """
    torque, command = u[Command.GENERATOR_TORQUE], link.command[Command.GENERATOR_TORQUE]
    for i in range(Command.BLADE_PITCH, u.shape[0]):
        u[i] = link.command[i]
    damage_platform(t, interface.control_dt, interface.guard, data)
    break_drives(t, x, u, model, interface.guard, link)
    if off_grid(t, interface.guard, link):
        u[Command.GENERATOR_TORQUE] = 0.0
        data.cache[LoadCache.TORQUE_LIMITED] = 0.0
        lose_torque(x, model.converter)
        return
    allowed = loaded_torque(command, interface.guard, link)
    reached = followed_torque(torque, allowed, interface.control_dt, model.generator)
    u[Command.GENERATOR_TORQUE] = reached
    limited = torque_was_limited(reached, command, model.generator)
    data.cache[LoadCache.TORQUE_LIMITED] = 1.0 if limited else 0.0


@kernel
def all_finite(values):
    """Return whether every entry of an array is finite."""
    for value in values:
        if not isfinite(value):
            return False
    return True
