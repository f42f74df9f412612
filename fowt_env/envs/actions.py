"""Maps actions in [-1, 1] to physical commands in each action mode.

The first action commands generator torque (or the rotor-speed set-point), the second blade pitch. In the
modes "individual" and "individual_residual" the second to fourth command the pitch of each blade.
"""

from enum import IntEnum
from math import isfinite, pi
from typing import NamedTuple

from fowt_env.errors import InputError
from fowt_env.plant.blade_pitches import FIRST_PITCH, spread_command
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.drivetrain import TorqueLimits, build_drivetrain, build_torque_limits, clamp
from fowt_env.plant.measurement import Measure
from fowt_env.plant.state import N_COMMANDS, N_INDIVIDUAL_COMMANDS, Command

# Set-point mode: PI control of rotor speed by torque with this natural frequency and damping ratio of the
# rigid rotor; faster than platform pitch (0.21 rad/s), slow enough for the torque rate limit.
TRACKING_FREQUENCY = 0.5  # rad/s
TRACKING_DAMPING = 1.0


class ActionMode(IntEnum):
    """Enumerates the action modes."""

    DIRECT = 0
    SETPOINT = 1
    RESIDUAL = 2
    INDIVIDUAL = 3
    INDIVIDUAL_RESIDUAL = 4


ACTION_MODES = {mode.name.lower(): mode for mode in ActionMode}
OF_EACH_BLADE = (ActionMode.INDIVIDUAL, ActionMode.INDIVIDUAL_RESIDUAL)
ADDING = (ActionMode.RESIDUAL, ActionMode.INDIVIDUAL_RESIDUAL)  # to the commands of a baseline


class ActionMap(NamedTuple):
    """Holds the command ranges of one action mode; SI."""

    mode: int
    low: float  # of the first action: N m (direct), rad/s (set-point)
    high: float
    pitch_low: float  # of the second action, rad
    pitch_high: float
    residual_torque: float  # largest additions of the residual mode, N m
    residual_pitch: float  # rad
    generator: TorqueLimits
    control_dt: float  # s
    tracking_gain: float  # set-point mode: N m per rad/s of rotor speed
    tracking_rate: float  # set-point mode: N m/s per rad/s
    individual: bool  # whether the baseline of the residual mode commands each blade


def n_actions(mode):
    """Return the number of actions of an ActionMode."""
    return N_INDIVIDUAL_COMMANDS if mode in OF_EACH_BLADE else N_COMMANDS


def build_action_map(mode, task, turbine, control_dt, individual=False):
    """Return the ActionMap of an ActionMode, a Task and a descriptions.turbine.Turbine.

    individual: whether the baseline of the residual mode commands each blade.
    Raises: InputError if the pitch action exceeds the range of the actuator.
    """
    law, drive = turbine.torque_law, turbine.pitch_drive
    reach = tuple(angle * pi / 180.0 for angle in task.blade_pitch)
    slack = 1e-9
    if reach[0] < drive.minimum - slack or reach[1] > drive.maximum + slack or reach[0] >= reach[1]:
        raise InputError(
            f"task {task.name!r}: blade_pitch = {task.blade_pitch}: must be a range within"
            f" [{drive.minimum * 180.0 / pi:g}, {drive.maximum * 180.0 / pi:g}] deg of the pitch actuator"
        )
    shaft = build_drivetrain(turbine)
    inertia = shaft.inertia_row / shaft.gear_ratio
    low, high = 0.0, law.max_torque
    if mode == ActionMode.SETPOINT:
        low, high = (fraction * turbine.rated_rotor_speed for fraction in task.setpoint)
        if low >= high:
            raise InputError(f"task {task.name!r}: setpoint = {task.setpoint}: must be a range (low, high)")
    return ActionMap(
        mode=int(mode),
        low=float(low),
        high=float(high),
        pitch_low=float(reach[0]),
        pitch_high=float(reach[1]),
        residual_torque=float(task.residual_torque * law.rated_torque),
        residual_pitch=float(task.residual_pitch * pi / 180.0),
        generator=build_torque_limits(law),
        control_dt=float(control_dt),
        tracking_gain=float(2.0 * TRACKING_DAMPING * TRACKING_FREQUENCY * inertia),
        tracking_rate=float(TRACKING_FREQUENCY**2 * inertia),
        individual=bool(individual),
    )


@kernel
def accept(action, accepted):
    """Copy an action, clipped to [-1, 1]. Returns 0; 1 if an entry was clipped, -1 if one is not finite."""
    saturated = 0
    for i in range(accepted.shape[0]):
        if not isfinite(action[i]):
            return -1
    for i in range(accepted.shape[0]):
        accepted[i] = clamp(action[i], -1.0, 1.0)
        if accepted[i] != action[i]:
            saturated = 1
    return saturated


@kernel
def unscale(action, low, high):
    """Return the value in [low, high] commanded by an action in [-1, 1]."""
    return low + 0.5 * (action + 1.0) * (high - low)


@kernel
def scale(value, low, high):
    """Return the action in [-1, 1] that commands a value, limited to [low, high]."""
    return clamp(2.0 * (value - low) / (high - low) - 1.0, -1.0, 1.0)


@kernel
def tracking_torque(speed, setpoint, memory, actions):
    """Return the torque, N m, that tracks a rotor-speed set-point (rad/s); memory[0]: integral part, N m."""
    error = speed - setpoint
    integral = memory[0] + actions.tracking_rate * error * actions.control_dt
    memory[0] = clamp(integral, 0.0, actions.generator.maximum)
    return clamp(actions.tracking_gain * error + memory[0], 0.0, actions.generator.maximum)


@kernel
def call_baseline(baseline_law, parameters, memory, reading, command):
    """Call the baseline law; None: the command is unchanged."""
    if baseline_law is None:
        return
    baseline_law(parameters, memory, reading, command)


@kernel
def command_of(action, actions, baseline_law, parameters, memory, reading, command):
    """Fill the command (generator torque N m, blade pitch or that of each blade rad) of an accepted action.

    reading: input of the baseline law; command: on entry the command in force, masked for this law.
    """
    if actions.mode == ActionMode.RESIDUAL or actions.mode == ActionMode.INDIVIDUAL_RESIDUAL:
        call_baseline(baseline_law, parameters, memory, reading, command)
        if not actions.individual:
            spread_command(command)
        command[0] += action[0] * actions.residual_torque
        for i in range(FIRST_PITCH, command.shape[0]):
            command[i] += action[min(i, action.shape[0] - 1)] * actions.residual_pitch
    else:
        command[0] = unscale(action[0], actions.low, actions.high)
        for i in range(FIRST_PITCH, action.shape[0]):
            command[i] = unscale(action[i], actions.pitch_low, actions.pitch_high)
        if actions.mode != ActionMode.INDIVIDUAL:
            spread_command(command)
        if actions.mode == ActionMode.SETPOINT:
            command[0] = tracking_torque(reading[Measure.ROTOR_SPEED], command[0], memory, actions)


@kernel
def action_of(u, rotor_speed, actions, action):
    """Set the action that commands the present state: u, with the rotor speed as set-point.

    In the residual modes this action is zero: no addition to the baseline.
    """
    if actions.mode == ActionMode.RESIDUAL or actions.mode == ActionMode.INDIVIDUAL_RESIDUAL:
        for i in range(action.shape[0]):
            action[i] = 0.0
        return
    first = rotor_speed if actions.mode == ActionMode.SETPOINT else u[Command.GENERATOR_TORQUE]
    action[0] = scale(first, actions.low, actions.high)
    for i in range(FIRST_PITCH, action.shape[0]):
        action[i] = scale(u[i], actions.pitch_low, actions.pitch_high)


def start_tracking(memory, measurement, actions):
    """Set the integral part such that the present speed as set-point commands the present torque."""
    memory[0] = min(max(measurement.generator_torque, 0.0), actions.generator.maximum)
