"""Models torque law, generator and shaft balance of a geared turbine (theory.md, section 3)."""

from math import exp, isfinite, sqrt
from typing import NamedTuple

from fowt_env.errors import InputError, unknown
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.state import Command

REGION3 = ("constant_torque", "constant_power")


class TorqueCurve(NamedTuple):
    """Holds the generator torque over generator speed, both on the high-speed shaft (theory.md, section 3).

    In region 3 the torque is region3_torque + region3_power / speed; one of the two is zero.
    """

    cut_in_speed: float  # region 1 to 1.5, rad/s
    region2_start_speed: float  # region 1.5 to 2
    region25_start_speed: float  # region 2 to 2.5, where the parabola meets the slip line
    region3_start_speed: float  # region 2.5 to 3
    synchronous_speed: float  # where the slip line of region 2.5 meets zero torque
    region15_slope: float  # N m/(rad/s)
    region2_constant: float  # N m/(rad/s)^2
    region25_slope: float  # N m/(rad/s)
    region3_torque: float  # N m
    region3_power: float  # W
    region3_min_pitch: float  # region 3 whatever the speed at this blade pitch and above, rad
    maximum_torque: float  # N m


class Shaft(NamedTuple):
    """Holds the constants of a rigid shaft with gearbox, theory.md Eq. (7).

    inertia_row is I_rx = I_rotor + N_g^2 I_g, the inertia of the rotor-speed equation; coupling is
    H = I_rotor + N_g I_g, the angular momentum per unit rotor speed.
    """

    gear_ratio: float  # N_g
    inertia_row: float  # kg m2
    coupling: float  # kg m2
    mesh_loss: float  # zeta_m
    bearing_loss_coefficient: float  # zeta_v tau_0 / w_b0, N m/(rad/s)
    generator_efficiency: float  # electrical over mechanical generator power


class TorqueLimits(NamedTuple):
    """Holds the torque limits of generator and converter, on the high-speed shaft; the minimum is zero."""

    maximum: float  # N m
    rate_limit: float  # N m/s, in both directions


SLACK = 1e-9  # relative tolerance for rounding of a command at a limit


def build_torque_curve(torque_law, region3="constant_torque"):
    """Return the TorqueCurve of a TorqueLaw; region3 is "constant_torque" or "constant_power".

    The slip line of region 2.5 rises from the synchronous speed, region3_start/(1 + slip), to the
    region-3 torque at region3_start; it replaces the parabola from their intersection on.
    Raises: InputError for an unknown region3, or where line and parabola do not intersect in between.
    """
    if region3 not in REGION3:
        raise unknown("region3 law", region3, REGION3)
    constant = region3 == "constant_torque"
    start3 = torque_law.transition_speed
    torque3 = torque_law.rated_torque if constant else torque_law.rated_power / start3
    synchronous = start3 / (1.0 + 0.01 * torque_law.slip_percent)
    slope25 = torque3 / (start3 - synchronous)
    k2, start2 = torque_law.region2_constant, torque_law.region2_start_speed
    discriminant = slope25 * (slope25 - 4.0 * k2 * synchronous)
    start25 = (slope25 - sqrt(discriminant)) / (2.0 * k2) if discriminant >= 0.0 else float("nan")
    if not start2 <= start25 <= start3:
        raise InputError(
            f"torque_law.region2_constant = {k2}: region 2 does not meet the slip line of region 2.5 between"
            f" region2_start_speed = {start2} and transition_speed = {start3} rad/s; or change slip_percent"
        )
    return TorqueCurve(
        cut_in_speed=float(torque_law.cut_in_speed),
        region2_start_speed=float(start2),
        region25_start_speed=float(start25),
        region3_start_speed=float(start3),
        synchronous_speed=float(synchronous),
        region15_slope=float(k2 * start2**2 / (start2 - torque_law.cut_in_speed)),
        region2_constant=float(k2),
        region25_slope=float(slope25),
        region3_torque=float(torque_law.rated_torque) if constant else 0.0,
        region3_power=0.0 if constant else float(torque_law.rated_power),
        region3_min_pitch=float(torque_law.region3_min_pitch),
        maximum_torque=float(torque_law.max_torque),
    )


def build_drivetrain(turbine):
    """Return the Shaft of a descriptions.turbine.Turbine."""
    shaft, rotor_inertia = turbine.drivetrain, turbine.rotor.inertia
    ratio = shaft.gear_ratio
    rated_torque = ratio * turbine.torque_law.rated_torque  # tau_0, low-speed shaft
    return Shaft(
        gear_ratio=float(ratio),
        inertia_row=float(rotor_inertia + ratio**2 * shaft.generator_inertia),
        coupling=float(rotor_inertia + ratio * shaft.generator_inertia),
        mesh_loss=float(shaft.mesh_loss),
        bearing_loss_coefficient=float(shaft.bearing_loss * rated_torque / turbine.rated_rotor_speed),
        generator_efficiency=float(shaft.generator_efficiency),
    )


class TorqueLag(NamedTuple):
    """Models the first-order lag of generator and converter: the torque in force is a state."""

    time_constant: float  # s
    torque: int  # index in the state of the torque in force


def build_torque_limits(torque_law):
    """Return the TorqueLimits of a descriptions.turbine.TorqueLaw."""
    return TorqueLimits(maximum=float(torque_law.max_torque), rate_limit=float(torque_law.max_torque_rate))


@kernel
def clamp(value, low, high):
    """Return the value limited to [low, high]."""
    return min(max(value, low), high)


@kernel
def rate_limit(value, target, step):
    """Return the target, or the value moved towards it by at most a step."""
    return value + clamp(target - value, -step, step)


@kernel
def generator_torque(generator_speed, blade_pitch, curve):
    """Return the generator torque of the static curve, N m on the high-speed shaft (theory.md, section 3).

    Region 3 is tested first, so a blade pitch of region3_min_pitch and above forces region 3 at any
    forward speed, as published. At zero or negative speed the torque is zero: the generator brakes
    the rotor at most to rest and never drives the rotor.
    """
    if generator_speed <= 0.0:
        return 0.0
    if generator_speed >= curve.region3_start_speed or blade_pitch >= curve.region3_min_pitch:
        torque = curve.region3_torque + curve.region3_power / generator_speed
    elif generator_speed <= curve.cut_in_speed:
        torque = 0.0
    elif generator_speed < curve.region2_start_speed:
        torque = curve.region15_slope * (generator_speed - curve.cut_in_speed)
    elif generator_speed < curve.region25_start_speed:
        torque = curve.region2_constant * generator_speed**2
    else:
        torque = curve.region25_slope * (generator_speed - curve.synchronous_speed)
    return min(torque, curve.maximum_torque)


@kernel
def followed_torque(torque, command, period, limits):
    """Return the generator torque (N m) of a control period: the command within limits and rate.

    The command is limited to [0, maximum] and to the change from the last torque that the rate limit allows
    in a period (s). It acts from the start of the period, as a torque set by a Bladed-style DLL.
    """
    if not isfinite(command):  # clamp would turn it into a torque; the run stops instead
        return command
    target = clamp(command, 0.0, limits.maximum)
    step = limits.rate_limit * period
    change = target - torque
    if abs(change) <= step * (1.0 + SLACK):
        return target
    return torque + step if change > 0.0 else torque - step


@kernel
def torque_in_force(x, u, converter):
    """Return the current generator torque, N m: the command, or a state with a lag."""
    if converter is None:
        return u[Command.GENERATOR_TORQUE]
    return x[converter.torque]


@kernel
def advance_torque(x, u, after, converter, y):
    """Advance the torque in force from state x to y over a time `after` (s); nothing without a lag."""
    if converter is None:
        return
    command = u[Command.GENERATOR_TORQUE]
    left = exp(-after / converter.time_constant)
    y[converter.torque] = command + (x[converter.torque] - command) * left


@kernel
def fill_torque_rate(x, u, converter, dx):
    """Fill dx with the rate of the torque in force; nothing without a lag."""
    if converter is None:
        return
    dx[converter.torque] = (u[Command.GENERATOR_TORQUE] - x[converter.torque]) / converter.time_constant


@kernel
def lose_torque(x, converter):
    """Set the torque in force to zero at once, as off the grid; nothing without a lag."""
    if converter is None:
        return
    x[converter.torque] = 0.0


@kernel
def torque_was_limited(torque, command, limits):
    """Return whether a torque in force differs from its command by more than rounding."""
    return abs(torque - command) > SLACK * limits.maximum


@kernel
def shaft_torque(aerodynamic_torque, torque, rotor_speed, drivetrain):
    """Return the torque Q_b that accelerates the rotor, N m on the low-speed shaft (theory.md Eq. (7)).

    torque: of the generator on the high-speed shaft, positive against positive rotation. The mesh
    loss always dissipates power: it increases the torque where the rotor drives the generator, and
    reduces it where the generator drives the rotor.
    """
    gearbox = drivetrain.gear_ratio * torque
    if torque * rotor_speed >= 0.0:
        gearbox *= 1.0 + drivetrain.mesh_loss
    else:
        gearbox /= 1.0 + drivetrain.mesh_loss
    return aerodynamic_torque - gearbox - drivetrain.bearing_loss_coefficient * rotor_speed
