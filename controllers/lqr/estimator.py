"""Defines the Kalman filter of lqr: platform, rotor-averaged wind and waves from measured channels.

The parameter array has a head, the torque curve and one block per wind, interpolated between winds; the
memory begins with the estimate.
"""

from enum import IntEnum

from fowt_env.controllers.lqr.design import N_FEEDBACK, N_PLANT, N_SENSORS, N_STATE, WIND
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.drivetrain import TorqueCurve, clamp
from fowt_env.plant.measurement import Measure

ROTOR = 4  # index of rotor speed in PLANT


class Head(IntEnum):
    """Enumerates the first parameters; the torque curve follows, then one block per wind."""

    CONTROL_DT = 0
    RATED_SPEED = 1
    RATED_TORQUE = 2
    GEAR_RATIO = 3
    PITCH_MINIMUM = 4
    PITCH_MAXIMUM = 5
    PITCH_RATE_LIMIT = 6
    TORQUE_RATE_LIMIT = 7
    FIRST_WIND = 8
    WIND_STEP = 9
    WINDS = 10
    SCHEDULE_DECAY = 11
    TORQUE_LOW = 12
    TORQUE_HIGH = 13
    HANDOVER_LOW = 14
    HANDOVER_HIGH = 15
    POWER_HIGH = 16  # of torque and rotor speed
    CURVE = 17


BLOCKS = Head.CURVE + len(TorqueCurve._fields)
# offsets within the block of one wind
TRIM = 0
TORQUE = TRIM + N_PLANT
PITCH = TORQUE + 1
A = PITCH + 1
B = A + N_STATE * N_STATE
C = B + N_STATE * 2
L = C + N_SENSORS * N_STATE
K = L + N_STATE * N_SENSORS
BLOCK = K + 2 * N_FEEDBACK
# indices in the memory: absolute estimate, then
OPERATING_WIND = N_STATE
INTEGRAL = OPERATING_WIND + 1
TORQUE_COMMAND = INTEGRAL + 1
PITCH_COMMAND = TORQUE_COMMAND + 1
INNOVATION = PITCH_COMMAND + 1
DEVIATION = INNOVATION + N_SENSORS
FED_BACK = DEVIATION + N_STATE
STARTED = FED_BACK + N_FEEDBACK  # 0 until a command is in force
N_MEMORY = STARTED + 1


@kernel
def between(p, low, fraction, offset):
    """Return the block entry at `offset`, interpolated between two winds."""
    return (1.0 - fraction) * p[low + offset] + fraction * p[low + BLOCK + offset]


@kernel
def deviate(p, low, fraction, memory):
    """Fill DEVIATION with the estimate minus the trim of the operating wind."""
    for i in range(N_STATE):
        memory[DEVIATION + i] = memory[i]
    for i in range(N_PLANT):
        memory[DEVIATION + i] -= between(p, low, fraction, TRIM + i)
    memory[DEVIATION + WIND] -= memory[OPERATING_WIND]
    memory[DEVIATION + WIND + 1] -= memory[OPERATING_WIND]


@kernel
def correct(p, low, fraction, memory, measurement):
    """Correct the estimate by measurements of rotor, blades, platform and nacelle."""
    y = memory[INNOVATION : INNOVATION + N_SENSORS]
    y[0] = measurement[Measure.GENERATOR_SPEED] / p[Head.GEAR_RATIO] - between(p, low, fraction, TRIM + ROTOR)
    y[1] = measurement[Measure.BLADE_PITCH] - between(p, low, fraction, TRIM + ROTOR + 1)
    y[2] = measurement[Measure.PLATFORM_PITCH] - between(p, low, fraction, TRIM + 1)
    y[3] = measurement[Measure.PLATFORM_PITCH_RATE]
    y[4] = measurement[Measure.NACELLE_ACCELERATION]
    deviate(p, low, fraction, memory)
    for i in range(N_SENSORS):
        for j in range(N_STATE):
            y[i] -= between(p, low, fraction, C + i * N_STATE + j) * memory[DEVIATION + j]
    for i in range(N_STATE):
        for j in range(N_SENSORS):
            memory[i] += between(p, low, fraction, L + i * N_SENSORS + j) * y[j]


@kernel
def predict(p, low, fraction, memory, torque, pitch):
    """Advance the estimate by one period under the commands."""
    deviate(p, low, fraction, memory)
    torque -= between(p, low, fraction, TORQUE)
    pitch -= between(p, low, fraction, PITCH)
    for i in range(N_STATE):
        by_torque = between(p, low, fraction, B + 2 * i)
        change = by_torque * torque + between(p, low, fraction, B + 2 * i + 1) * pitch
        for j in range(N_STATE):
            change += between(p, low, fraction, A + i * N_STATE + j) * memory[DEVIATION + j]
        memory[i] += change - memory[DEVIATION + i]


@kernel
def block_of(p, memory):
    """Return (offset of the block below the operating wind, interpolation fraction to the next block)."""
    last = p[Head.FIRST_WIND] + (p[Head.WINDS] - 1.0) * p[Head.WIND_STEP]
    index = (clamp(memory[OPERATING_WIND], p[Head.FIRST_WIND], last) - p[Head.FIRST_WIND]) / p[Head.WIND_STEP]
    node = min(int(index), int(p[Head.WINDS]) - 2)
    return BLOCKS + node * BLOCK, index - node


@kernel
def estimate(p, memory, measurement, command):
    """Predict the estimate over the last period under its command, then correct by the measurement.

    At the first instant the estimate of reset is corrected without prediction.
    """
    if memory[STARTED] != 0.0:
        low, fraction = block_of(p, memory)
        predict(p, low, fraction, memory, command[0], command[1])
        decay = p[Head.SCHEDULE_DECAY]
        memory[OPERATING_WIND] = decay * memory[OPERATING_WIND] + (1.0 - decay) * memory[WIND + 1]
        memory[TORQUE_COMMAND], memory[PITCH_COMMAND] = command[0], command[1]
    memory[STARTED] = 1.0
    low, fraction = block_of(p, memory)
    correct(p, low, fraction, memory, measurement)


@control_kernel
def estimator_law(parameters, memory, measurement, command):
    """Advance the estimate; the applied command is an input and not changed."""
    estimate(parameters, memory, measurement, command)
