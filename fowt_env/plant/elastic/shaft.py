"""Models the torsion of the shaft between generator and rotor, and advances it exactly over a step.

The twist q is the azimuth of the rotor less that of the generator, on the low-speed side, and the shaft
carries the torque K q + C q' (ElastoDyn's DrTrDOF). With the torque T that a rigid shaft would carry, the
mobility k of the twist and the accelerations e of all other velocities by a unit acceleration of the twist
(chain.py),

    q'' = k (T - K q - C q'),    v' = r + e q''

where T and the rates r are those of the turbine with a rigid shaft, without the fast oscillation. A step
extrapolates T as a polynomial in time, less the share of the generator torque, which is known over the step;
solves for the oscillation exactly; and replaces the quadrature of q'' in every velocity by its exact change.
"""

from math import sqrt
from typing import NamedTuple

from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.drivetrain import shaft_torque, torque_in_force
from fowt_env.plant.elastic.oscillator import swung
from fowt_env.plant.state import Command, State

# entries of RotorScratch.shaft_torque: mobility k, 1/(kg m2), now and at the beginning of the step; torque of
# a rigid shaft, N m, by all but the generator, which is smooth, and by the generator
MOBILITY, MOBILITY_BEGUN, SMOOTH, SHARE = 0, 1, 2, 3


class Torsion(NamedTuple):
    """Holds stiffness and damping of a shaft that twists, on the low-speed side."""

    first: int  # index in the state of the twist, rad; its rate follows
    stiffness: float  # N m/rad
    damping: float  # N m s/rad


@kernel
def generator_speed(x, shaft):
    """Return the generator's speed on the low-speed side, rad/s: the rotor's with a rigid shaft."""
    if shaft is None:
        return x[State.ROTOR_SPEED]
    return x[State.ROTOR_SPEED] - x[shaft.first + 1]


@kernel
def torsion_torque(x, shaft):
    """Return the torque in the twisted shaft, N m."""
    return shaft.stiffness * x[shaft.first] + shaft.damping * x[shaft.first + 1]


@kernel
def fill_twist_rate(x, shaft, dx):
    """Fill dx with the rate of the twist; no-op for a rigid shaft."""
    if shaft is None:
        return
    dx[shaft.first] = x[shaft.first + 1]


@kernel
def record_twist(x, shaft, row):
    """Fill the channels of the group "shaft" into row; nothing with a rigid shaft."""
    if shaft is None:
        return
    row[0], row[1] = x[shaft.first], x[shaft.first + 1]


@kernel
def twist_channels(shaft):
    """Return the number of channels of the group "shaft"."""
    if shaft is None:
        return 0
    return 2


@kernel
def keep_smooth(shaft, work, dx):
    """Put the smooth torque of the last evaluation into dx in place of the rate of the twist."""
    if shaft is None:
        return
    dx[shaft.first] = work.shaft_torque[SMOOTH]


@kernel
def rate_by_twist(i, more, shaft, work, dx):
    """Return the part of the rate of velocity i in dx that the twist causes, accelerated by more (1/s2)."""
    if shaft is None:
        return 0.0
    return work.twist[0, i] * (dx[shaft.first + 1] + more)


@kernel
def begin_twist(shaft, work):
    """Keep mobility and accelerations of the twist at the last evaluation, at which a step begins."""
    if shaft is None:
        return
    for i in range(work.twist.shape[1]):
        work.twist[1, i] = work.twist[0, i]
    work.shaft_torque[MOBILITY_BEGUN] = work.shaft_torque[MOBILITY]


@kernel
def smooth_of(shaft, dx):
    """Return the smooth torque that keep_smooth put into dx, N m; zero for a rigid shaft."""
    if shaft is None:
        return 0.0
    return dx[shaft.first]


@kernel
def _middle_torque(begun, ended, u, converter):
    """Return the generator torque (N m) in the middle of a step, in which a lag approaches its command."""
    if converter is None:
        return begun
    command = u[Command.GENERATOR_TORQUE]
    rest = sqrt(abs((begun - command) * (ended - command)))
    return command + (rest if begun > command else -rest)


@inlined_kernel
def share_over(x, u, shaft, model, work, y):
    """Return the generator's share of the torque in a rigid shaft over the step from x to y, N m.

    As coefficients (3) of the square in s, 0 to 1, through its values at both ends and in the middle.
    """
    share, speed = 1.0 - work.twist[1, State.ROTOR_SPEED], generator_speed(x, shaft)
    first, last = torque_in_force(x, u, model.converter), torque_in_force(y, u, model.converter)
    half = _middle_torque(first, last, u, model.converter)
    begun = -share * shaft_torque(0.0, first, speed, model.drivetrain)
    middle = -share * shaft_torque(0.0, half, speed, model.drivetrain)
    ended = -share * shaft_torque(0.0, last, speed, model.drivetrain)
    return begun, 4.0 * middle - 3.0 * begun - ended, 2.0 * (begun - 2.0 * middle + ended)


@inlined_kernel
def _no_twist(x, u, after, c0, c1, c2, c3, shaft, model, work, y):
    return


@inlined_kernel
def _twist(x, u, after, c0, c1, c2, c3, shaft, model, work, y):
    e, k, over = work.twist[1], work.shaft_torque[MOBILITY_BEGUN], 1.0 / after
    s0, s1, s2 = share_over(x, u, shaft, model, work, y)
    c0, c1, c2, c3 = c0 + s0, (c1 + s1) * over, (c2 + s2) * over * over, c3 * over * over * over
    q, rate = swung(
        x[shaft.first], x[shaft.first + 1], k * c0, k * c1, k * c2, k * c3, after, k * shaft.stiffness,
        0.5 * k * shaft.damping,
    )  # fmt: skip
    change = rate - y[shaft.first + 1]
    for i in range(State.VX, y.shape[0]):
        y[i] += e[i] * change
    y[shaft.first] = q


# (x, u, after, c0, c1, c2, c3, shaft, model, work, y): twist and its rate in y, a time `after` (s) from x,
# and its share in all velocities of y, which hold the quadrature of their rates. The smooth torque (N m) is
# c0 + c1 s + c2 s2 + c3 s3, s from 0 to 1 over the time
advance_twist = chosen_by_class("shaft", {type(None): _no_twist, Torsion: _twist})
