"""Blades whose pitches differ: where each is in the state, and how it follows its command.

The first blade's pitch is State.BLADE_PITCH; those of the others are a block of their own. With one pitch for
all blades the part is None.
"""

from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.drivetrain import followed_pitch, pitch_after, pitch_rate
from fowt_env.plant.state import BLADES, Command, State

N_BLADE_LOAD = 6  # entries of a blade_shape.BladeLoad


class BladePitches(NamedTuple):
    """Blades with pitches of their own."""

    first: int  # index in the state of the second blade's pitch; the third's follows


@kernel
def pitch_of(blade, x, pitches):
    """Pitch of a blade (0, 1, 2), rad."""
    if pitches is None:
        return x[State.BLADE_PITCH]
    return x[State.BLADE_PITCH] if blade == 0 else x[pitches.first + blade - 1]


@kernel
def mean_pitch(x, pitches):
    """Mean of the blades' pitches, rad."""
    if pitches is None:
        return x[State.BLADE_PITCH]
    return (x[State.BLADE_PITCH] + x[pitches.first] + x[pitches.first + 1]) / BLADES


@kernel
def advance_pitches(x, u, after, actuator, pitches, y):
    """Put into y the pitches at a time `after` (s) the state x, under a constant command u."""
    y[State.BLADE_PITCH] = pitch_after(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], after, actuator)
    _advance_others(x, u, after, actuator, pitches, y)


@kernel
def _advance_others(x, u, after, actuator, pitches, y):
    if pitches is None:
        return
    for blade in range(1, BLADES):
        i = pitches.first + blade - 1
        y[i] = pitch_after(x[i], u[Command.BLADE_PITCH + blade], after, actuator)


@kernel
def fill_pitch_rates(x, u, actuator, pitches, dx):
    """Put the rates of the pitches into dx."""
    dx[State.BLADE_PITCH] = pitch_rate(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], actuator)
    _fill_other_rates(x, u, actuator, pitches, dx)


@kernel
def _fill_other_rates(x, u, actuator, pitches, dx):
    if pitches is None:
        return
    for blade in range(1, BLADES):
        i = pitches.first + blade - 1
        dx[i] = pitch_rate(x[i], u[Command.BLADE_PITCH + blade], actuator)


@kernel
def pitches_jump(x, u, dt, actuator, pitches):
    """Whether an actuator without lag moves a blade at the beginning of a step of dt (s)."""
    pitch = followed_pitch(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], dt, actuator)
    return pitch != x[State.BLADE_PITCH] or _others_jump(x, u, dt, actuator, pitches)


@kernel
def _others_jump(x, u, dt, actuator, pitches):
    if pitches is None:
        return False
    for blade in range(1, BLADES):
        i = pitches.first + blade - 1
        if followed_pitch(x[i], u[Command.BLADE_PITCH + blade], dt, actuator) != x[i]:
            return True
    return False


@kernel
def set_followed(x, u, dt, actuator, pitches):
    """Set the pitches of x to those that an actuator without lag has at the beginning of a step of dt (s)."""
    x[State.BLADE_PITCH] = followed_pitch(x[State.BLADE_PITCH], u[Command.BLADE_PITCH], dt, actuator)
    _set_others(x, u, dt, actuator, pitches)


@kernel
def _set_others(x, u, dt, actuator, pitches):
    if pitches is None:
        return
    for blade in range(1, BLADES):
        i = pitches.first + blade - 1
        x[i] = followed_pitch(x[i], u[Command.BLADE_PITCH + blade], dt, actuator)


@kernel
def spread_command(u, pitches):
    """Give the first blade's command to all; nothing with one pitch for all blades."""
    if pitches is None:
        return
    for blade in range(1, BLADES):
        u[Command.BLADE_PITCH + blade] = u[Command.BLADE_PITCH]
