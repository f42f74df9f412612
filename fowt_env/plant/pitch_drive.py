"""Models a second-order blade-pitch drive with limits, deadband and friction (theory.md, section 3).

    pitch'' = w^2 (target - pitch) - 2 zeta w pitch' - w^2 friction sign(pitch')

The command is constant over a control period, so the drive is solved in closed form from one event (a limit,
a stop) to the next. Friction is Coulomb friction with an equal breakaway force (Armstrong-Helouvry, Dupont
and Canudas de Wit, Automatica 30 (1994) 1083): for slow commands a backlash of half width `friction`.
"""

from math import cos, cosh, exp, sin, sinh, sqrt
from typing import NamedTuple

from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.drivetrain import clamp
from fowt_env.plant.state import Command

# Longest piece between two checks for events, times w. Within a piece an acceleration may exceed its limit
# undetected by TURN^2/8 of the limit, and no other event can occur twice.
TURN = 0.1
HALVINGS = 45  # of a piece, to locate an event
PIECES = 10_000  # upper bound in a step, far above any drive's number
SETTLED = 1e-12  # rad: tolerance of the pitch at equilibrium; times w (rad/s) that of the rate


class PitchDrive(NamedTuple):
    """Holds the parameters of a second-order blade-pitch drive, collective or one per blade."""

    natural_frequency: float  # rad/s
    damping: float  # ratio
    rate_limit: float  # rad/s
    acceleration_limit: float  # rad/s2; infinite: no limit
    deadband: float  # rad, change of the command that is ignored
    friction: float  # rad, distance from the command at which a blade at rest begins to move
    minimum: float  # rad
    maximum: float  # rad
    rate: int  # index in the state of the first blade's pitch rate, followed by the other blades
    held: object  # the same of the followed command, or None without a deadband


@kernel
def propagator(t, drive):
    """Return (a, b, c, d) without limits: pitch error a e + b r and rate c e + d r after t (s)."""
    w, decay = drive.natural_frequency, drive.damping * drive.natural_frequency
    square = (1.0 - drive.damping * drive.damping) * w * w
    fade = exp(-decay * t)
    if square > 0.0:
        turning = sqrt(square)
        even, odd = fade * cos(turning * t), fade * sin(turning * t) / turning
    elif square < 0.0:
        turning = sqrt(-square)
        even, odd = fade * cosh(turning * t), fade * sinh(turning * t) / turning
    else:
        even, odd = fade, fade * t
    return even + decay * odd, odd, -w * w * odd, even - decay * odd


@kernel
def pull(pitch, rate, rest, drive):
    """Return the acceleration of the drive towards an equilibrium pitch (rest) without limits, rad/s2."""
    w = drive.natural_frequency
    return w * w * (rest - pitch) - 2.0 * drive.damping * w * rate


@kernel
def drive_after(pitch, rate, target, after, drive):
    """Return (pitch, rate) after a time `after` (s) for a constant target within the position limits."""
    w = drive.natural_frequency
    error = pitch - target
    reach = sqrt((w * error) ** 2 + rate * rate)  # never grows: it bounds rate, distance and acceleration
    if reach < SETTLED * w:
        return target, 0.0
    if drive.friction <= 0.0 and reach <= drive.rate_limit:
        strongest = w * reach * sqrt(1.0 + 4.0 * drive.damping**2)
        inside = target - reach / w >= drive.minimum and target + reach / w <= drive.maximum
        if inside and strongest <= drive.acceleration_limit:
            a, b, c, d = propagator(after, drive)
            return target + a * error + b * rate, c * error + d * rate
    return _limited_after(pitch, rate, target, after, drive)


@kernel
def _limited_after(pitch, rate, target, after, drive):
    """Return drive_after where a limit or friction may act: in pieces, each with one equation of motion."""
    w, fastest, strongest = drive.natural_frequency, drive.rate_limit, drive.acceleration_limit
    pitch = clamp(pitch, drive.minimum, drive.maximum)
    rate = clamp(rate, -fastest, fastest)
    left, longest = after, TURN / w
    whole = propagator(longest, drive)
    for _ in range(PIECES):
        if left <= 0.0:
            break
        if rate == 0.0:
            if abs(target - pitch) <= drive.friction + SETTLED:
                break  # sticks
            way = 1.0 if target > pitch else -1.0
        else:
            way = 1.0 if rate > 0.0 else -1.0
        rest = target - way * drive.friction
        if abs(rest - pitch) < SETTLED and abs(rate) < SETTLED * w:
            return rest, 0.0
        now = pull(pitch, rate, rest, drive)
        if abs(now) <= SETTLED * w * w:
            now = 0.0  # rounding at the end of slewing would change its sign at once
        if way * rate >= fastest and way * now > 0.0:  # slews until the acceleration vanishes
            spell = min(way * (rest - pitch) / fastest - 2.0 * drive.damping / w, left)
            pitch += way * fastest * spell
            left -= spell
            continue
        law = clamp(now, -strongest, strongest)
        saturated = law != now
        length = min(left, longest)
        motion = whole if length == longest else propagator(length, drive)
        new, speed = _piece(pitch, rate, rest, law, saturated, length, motion)
        if _over(new, speed, way, rest, now, saturated, drive):
            low, high = 0.0, length
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                motion = propagator(middle, drive)
                new, speed = _piece(pitch, rate, rest, law, saturated, middle, motion)
                if _over(new, speed, way, rest, now, saturated, drive):
                    high = middle
                else:
                    low = middle
            length = high
            new, speed = _piece(pitch, rate, rest, law, saturated, high, propagator(high, drive))
            if way * speed < 0.0:
                speed = 0.0
            speed = clamp(speed, -fastest, fastest)
            if new < drive.minimum or new > drive.maximum:
                new, speed = clamp(new, drive.minimum, drive.maximum), 0.0
        pitch, rate = new, speed
        left -= length
    return pitch, rate


@kernel
def _piece(pitch, rate, rest, law, saturated, length, motion):
    """Return (pitch, rate) after a piece of motion: at constant acceleration, or without limits."""
    if saturated:
        return pitch + length * (rate + 0.5 * length * law), rate + length * law
    a, b, c, d = motion
    error = pitch - rest
    return rest + a * error + b * rate, c * error + d * rate


@kernel
def _over(pitch, rate, way, rest, before, saturated, drive):
    """Return whether an event ends the piece of motion before this state: reversal, a limit met or left."""
    if way * rate < 0.0 or abs(rate) > drive.rate_limit:
        return True
    if pitch < drive.minimum or pitch > drive.maximum:
        return True
    now = pull(pitch, rate, rest, drive)
    if saturated:
        return abs(now) < drive.acceleration_limit or now * before < 0.0
    return abs(now) > drive.acceleration_limit or now * before < 0.0


@kernel
def drive_acceleration(pitch, rate, target, drive):
    """Return the current pitch acceleration, rad/s2."""
    if rate == 0.0:
        if abs(target - pitch) <= drive.friction:
            return 0.0
        way = 1.0 if target > pitch else -1.0
    else:
        way = 1.0 if rate > 0.0 else -1.0
    now = pull(pitch, rate, target - way * drive.friction, drive)
    if way * rate >= drive.rate_limit and way * now > 0.0:
        return 0.0
    return clamp(now, -drive.acceleration_limit, drive.acceleration_limit)


@kernel
def followed_command(previous, command, drive):
    """Return the followed command, within the position limits: in the deadband the previous one."""
    if abs(command - previous) <= drive.deadband:
        command = previous
    return clamp(command, drive.minimum, drive.maximum)


@kernel
def target_of(blade, x, u, drive, followed):
    """Return the target pitch of a blade, rad."""
    command = u[Command.BLADE_PITCH + blade]
    if followed is None:
        return clamp(command, drive.minimum, drive.maximum)
    return followed_command(x[followed + blade], command, drive)


@kernel
def _store_followed(blade, target, followed, y):
    """Store the followed command of a blade in y; nothing without a deadband."""
    if followed is None:
        return
    y[followed + blade] = target


@kernel
def advance_drive(blade, i, x, u, after, actuator, y):
    """Advance a blade's drive from state x to y over a time `after` (s); i: index of its pitch."""
    target = target_of(blade, x, u, actuator, actuator.held)
    pitch, rate = drive_after(x[i], x[actuator.rate + blade], target, after, actuator)
    y[i], y[actuator.rate + blade] = pitch, rate
    _store_followed(blade, target, actuator.held, y)


@kernel
def fill_drive_rates(blade, i, x, u, actuator, dx):
    """Fill dx with the rates of a blade's drive; i: index of its pitch."""
    target = target_of(blade, x, u, actuator, actuator.held)
    rate = x[actuator.rate + blade]
    dx[i], dx[actuator.rate + blade] = rate, drive_acceleration(x[i], rate, target, actuator)
    _store_followed(blade, 0.0, actuator.held, dx)


@kernel
def halt_drive(blade, i, x, actuator):
    """Stop a blade at its current pitch; i: index of its pitch."""
    x[actuator.rate + blade] = 0.0
    _store_followed(blade, x[i], actuator.held, x)


@kernel
def stays(blade, i, x, u, dt, actuator):
    """Return False: a drive with inertia has no jumps of blade pitch."""
    return False


@kernel
def keep(blade, i, x, u, dt, actuator):
    """Keep the blade pitch: a drive with inertia has no jumps."""
