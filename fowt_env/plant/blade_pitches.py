"""Defines individual blade pitches: their indices in the state, and their response to commands.

The first blade's pitch is State.BLADE_PITCH; the other blades have a separate block. With one pitch for all
blades the part is None.
"""

from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.drivetrain import advance_torque
from fowt_env.plant.pitch_actuator import PitchActuator, followed_pitch, pitch_after, pitch_rate
from fowt_env.plant.pitch_drive import PitchDrive, advance_drive, fill_drive_rates, halt_drive, keep, stays
from fowt_env.plant.state import BLADES, Command, State

FIRST_PITCH = int(Command.BLADE_PITCH)  # numba has no int() of an enum


class BladePitches(NamedTuple):
    """Locates the individual pitches of the blades in the state."""

    first: int  # index in the state of the second blade's pitch; the third's follows


@kernel
def pitch_of(blade, x, pitches):
    """Return the pitch of a blade (0, 1, 2), rad."""
    if pitches is None:
        return x[State.BLADE_PITCH]
    return x[State.BLADE_PITCH] if blade == 0 else x[pitches.first + blade - 1]


@kernel
def mean_pitch(x, pitches):
    """Return the mean of the blades' pitches, rad."""
    if pitches is None:
        return x[State.BLADE_PITCH]
    return (x[State.BLADE_PITCH] + x[pitches.first] + x[pitches.first + 1]) / BLADES


@kernel
def _advance_lagging(blade, i, x, u, after, actuator, y):
    y[i] = pitch_after(x[i], u[Command.BLADE_PITCH + blade], after, actuator)


@kernel
def _fill_lagging(blade, i, x, u, actuator, dx):
    dx[i] = pitch_rate(x[i], u[Command.BLADE_PITCH + blade], actuator)


@kernel
def _lagging_jumps(blade, i, x, u, dt, actuator):
    return followed_pitch(x[i], u[Command.BLADE_PITCH + blade], dt, actuator) != x[i]


@kernel
def _set_lagging(blade, i, x, u, dt, actuator):
    x[i] = followed_pitch(x[i], u[Command.BLADE_PITCH + blade], dt, actuator)


@kernel
def _halt_lagging(blade, i, x, actuator):
    return


# of one blade, whose pitch has index i in the state
advance_pitch = chosen_by_class("actuator", {PitchActuator: _advance_lagging, PitchDrive: advance_drive})
fill_rates = chosen_by_class("actuator", {PitchActuator: _fill_lagging, PitchDrive: fill_drive_rates})
jumps = chosen_by_class("actuator", {PitchActuator: _lagging_jumps, PitchDrive: stays})
halt = chosen_by_class("actuator", {PitchActuator: _halt_lagging, PitchDrive: halt_drive})
set_at_once = chosen_by_class("actuator", {PitchActuator: _set_lagging, PitchDrive: keep})


@kernel
def advance_pitches(x, u, after, actuator, pitches, y):
    """Advance the pitches from state x to y over a time `after` (s) under a constant command u."""
    advance_pitch(0, State.BLADE_PITCH, x, u, after, actuator, y)
    _advance_others(x, u, after, actuator, pitches, y)


@kernel
def advance_actuators(x, u, after, model, y):
    """Advance pitches and torque in force from state x to y over a time `after` (s) under a constant u."""
    advance_pitches(x, u, after, model.actuator, model.pitches, y)
    advance_torque(x, u, after, model.converter, y)


@kernel
def _advance_others(x, u, after, actuator, pitches, y):
    if pitches is None:
        return
    for blade in range(1, BLADES):
        advance_pitch(blade, pitches.first + blade - 1, x, u, after, actuator, y)


@kernel
def fill_pitch_rates(x, u, actuator, pitches, dx):
    """Fill dx with the rates of the pitches."""
    fill_rates(0, State.BLADE_PITCH, x, u, actuator, dx)
    _fill_other_rates(x, u, actuator, pitches, dx)


@kernel
def _fill_other_rates(x, u, actuator, pitches, dx):
    if pitches is None:
        return
    for blade in range(1, BLADES):
        fill_rates(blade, pitches.first + blade - 1, x, u, actuator, dx)


@kernel
def pitches_jump(x, u, dt, actuator, pitches):
    """Return whether an actuator without lag moves a blade at the beginning of a step of dt (s)."""
    return jumps(0, State.BLADE_PITCH, x, u, dt, actuator) or _others_jump(x, u, dt, actuator, pitches)


@kernel
def _others_jump(x, u, dt, actuator, pitches):
    if pitches is None:
        return False
    for blade in range(1, BLADES):
        if jumps(blade, pitches.first + blade - 1, x, u, dt, actuator):
            return True
    return False


@kernel
def set_followed(x, u, dt, actuator, pitches):
    """Set the pitches of x to those of an actuator without lag at the beginning of a step of dt (s)."""
    set_at_once(0, State.BLADE_PITCH, x, u, dt, actuator)
    _set_others(x, u, dt, actuator, pitches)


@kernel
def _set_others(x, u, dt, actuator, pitches):
    if pitches is None:
        return
    for blade in range(1, BLADES):
        set_at_once(blade, pitches.first + blade - 1, x, u, dt, actuator)


@kernel
def halt_blade(blade, x, actuator, pitches):
    """Set the pitch rate of a stuck blade (0, 1, 2) to zero, where the actuator has such a state."""
    if pitches is None:
        halt(0, State.BLADE_PITCH, x, actuator)
        return
    halt(blade, State.BLADE_PITCH if blade == 0 else pitches.first + blade - 1, x, actuator)


@kernel
def spread_command(command):
    """Set the pitch commands of all blades to that of the first."""
    for i in range(FIRST_PITCH + 1, command.shape[0]):
        command[i] = command[Command.BLADE_PITCH]
