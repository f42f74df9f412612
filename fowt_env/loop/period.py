"""The control period: the order of its parts is defined here alone.

begin_period: watch the turbine, read the sensors, break them, inform the law.
command of the law or of a stop, in InterfaceData.command.
apply_command: break the pitch drives, limit the torque; the plant then advances under u.
"""

from math import isfinite

from fowt_env.loop.protection import break_drives, break_sensors, is_stopping, off_grid, watch_turbine
from fowt_env.loop.sensing import inform_law, take_reading
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.drivetrain import followed_torque, lose_torque, torque_was_limited
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import BLADES, Command


@kernel
def begin_period(period, t, x, model, interface, link):
    """Begin a control period whose measurement is taken. Returns whether the turbine is being stopped.

    period: number of control instants before this one; t: time, s.
    """
    watch_turbine(t, x, model, interface.guard, link)
    take_reading(interface.sensors, period, link.measurement, link.past, link.reading)
    break_sensors(t, interface.guard, link)
    inform_law(interface.hidden, interface.ahead, period, t, link)
    return is_stopping(interface.guard, link)


@kernel
def show_command(u, interface, individual, pitches, link):
    """Put the command in force into link.command, which the law overwrites; undeclared parts are NaN.

    individual: whether the law commands each blade.
    """
    link.command[Command.GENERATOR_TORQUE] = u[Command.GENERATOR_TORQUE]
    show_pitches(u, interface.guard, link.command)
    hide_command(interface.hidden, individual, pitches, link.command)


@kernel
def show_pitches(u, guard, command):
    """Put the pitches in force into the command, where no guard keeps those that were commanded."""
    if guard is None:
        for i in range(Command.BLADE_PITCH, u.shape[0]):
            command[i] = u[i]


@kernel
def hide_command(hidden, individual, pitches, command):
    """Hide of the command in force what a law that is about to overwrite it does not declare."""
    if hidden is None:
        return
    command[Command.GENERATOR_TORQUE] += hidden[Measure.GENERATOR_TORQUE]
    if not hide_pitches(hidden, individual, pitches, command):
        command[Command.BLADE_PITCH] += hidden[Measure.BLADE_PITCH]


@kernel
def hide_pitches(hidden, individual, pitches, command):
    """Hide pitches as hide_command, of a law that commands each blade. Returns whether the law does."""
    if pitches is None:
        return False
    if individual:
        for blade in range(BLADES):
            command[Command.BLADE_PITCH + blade] += hidden[
                N_MEASUREMENTS + BladeMeasure.BLADE_PITCH_1 + blade
            ]
    return individual


@kernel
def apply_command(t, x, u, model, data, interface, link):
    """Put into u what pitch drives and generator make of link.command in the control period from t (s) on.

    The torque in u is the one in force until then. Off the grid the generator has no torque at once,
    whatever is commanded.
    """
    torque, command = u[Command.GENERATOR_TORQUE], link.command[Command.GENERATOR_TORQUE]
    for i in range(Command.BLADE_PITCH, u.shape[0]):
        u[i] = link.command[i]
    break_drives(t, x, u, model, interface.guard, link)
    if off_grid(t, interface.guard, link):
        u[Command.GENERATOR_TORQUE] = 0.0
        data.cache[LoadCache.TORQUE_LIMITED] = 0.0
        lose_torque(x, model.converter)
        return
    reached = followed_torque(torque, command, interface.control_dt, model.generator)
    u[Command.GENERATOR_TORQUE] = reached
    limited = torque_was_limited(reached, command, model.generator)
    data.cache[LoadCache.TORQUE_LIMITED] = 1.0 if limited else 0.0


@kernel
def all_finite(values):
    """Whether every entry is finite."""
    for value in values:
        if not isfinite(value):
            return False
    return True
