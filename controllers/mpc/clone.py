"""Defines mpc_clone, a compiled law with mpc's estimate, limits and low-wind curve and a network as its plan.

The network (multilayer perceptron, tanh) maps the inputs of a plan, the deviations from the trim at the
operating wind, to the rates of torque and blade pitch of the next period. Its weights come from imitation of
mpc on one plant (training/studies/clone_mpc.py: DAgger, Ross, Gordon and Bagnell, AISTATS 2011).
"""

from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from fowt_env.control import CompiledController, check_control_dt
from fowt_env.controllers.lqr.design import MOMENT, N_FEEDBACK, N_PLANT
from fowt_env.controllers.lqr.design import WIND as ESTIMATED_WIND
from fowt_env.controllers.lqr.estimator import BLOCK, BLOCKS, N_MEMORY, PITCH, TORQUE, TRIM, Head, between
from fowt_env.controllers.lqr.law import LQR
from fowt_env.controllers.mpc import law as mpc
from fowt_env.controllers.mpc.law import MPC, Entry, lowest_torque, move, observe
from fowt_env.controllers.mpc.model import COMMAND, FILTER, INTEGRAL
from fowt_env.controllers.mpc.model import TORQUE as TORQUE_STATE
from fowt_env.controllers.pi import curve_at
from fowt_env.descriptions.array_files import read_arrays
from fowt_env.descriptions.files import parse_json, raise_problems
from fowt_env.descriptions.records import Positive, Record, validate
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import control_kernel, entry, kernel
from fowt_env.plant.drivetrain import TorqueCurve, clamp

FILE = Path(__file__).with_name("clone.npz")
FORMAT = 1
MAX_BYTES = 1_000_000  # of the arrays
N_INPUTS = N_FEEDBACK + 2  # state of the plan, operating wind, lower limit of torque
HIDDEN = 64  # neurons in each of two layers
SHAPES = {
    "mean": (N_INPUTS,), "scale": (N_INPUTS,),
    "weight_0": (HIDDEN, N_INPUTS), "bias_0": (HIDDEN,), "weight_1": (HIDDEN, HIDDEN), "bias_1": (HIDDEN,),
    "weight_2": (2, HIDDEN), "bias_2": (2,),
}  # fmt: skip
SIZES = {name: int(np.prod(shape)) for name, shape in SHAPES.items()}
# the parameter array: those of mpc, torque curve, control periods between decisions, network, estimator
CURVE = len(Entry)
EVERY = CURVE + len(TorqueCurve._fields)
NETWORK = EVERY + 1
ESTIMATOR = NETWORK + sum(SIZES.values())
MEAN, SCALE, WEIGHT_0, BIAS_0, WEIGHT_1, BIAS_1, WEIGHT_2, BIAS_2 = (
    NETWORK + sum(list(SIZES.values())[:i]) for i in range(len(SIZES))
)


class CloneMemory(IntEnum):
    """Enumerates the entries of the memory array that follow those of mpc."""

    LOW_TORQUE = len(mpc.Memory)  # N m, lower limit until the next decision
    CALLS = LOW_TORQUE + 1  # control periods since the last decision
    INPUTS = CALLS + 1
    FIRST = INPUTS + N_INPUTS  # scratch: the layers
    SECOND = FIRST + HIDDEN
    ESTIMATE = SECOND + HIDDEN  # memory of the estimator


class CloneSettings(Record):
    """Defines the JSON text of a file with the network."""

    format: Literal[FORMAT]
    platform: Annotated[str, Field(min_length=1)]
    turbine: Annotated[str, Field(min_length=1)]
    period: Positive  # s between decisions
    integral_limit: Positive = 1.0  # rad, of the speed integral in training
    about: dict[str, Any]


@kernel
def fill_inputs(p, estimator, estimated, memory, low_torque, command, inputs):
    """Fill inputs (N_INPUTS,) of the network: the state from which mpc plans, operating wind and limit.

    p, memory: those of mpc; estimator, estimated: parameters and memory of the estimator.
    """
    last = estimator[Head.FIRST_WIND] + estimator[Head.WINDS] - 1.0
    wind = clamp(memory[mpc.Memory.OPERATING_WIND], estimator[Head.FIRST_WIND], last)
    index = wind - estimator[Head.FIRST_WIND]
    node = min(int(index), int(estimator[Head.WINDS]) - 2)
    low, fraction = BLOCKS + node * BLOCK, index - node
    for i in range(N_PLANT):
        inputs[i] = estimated[i] - between(estimator, low, fraction, TRIM + i)
    torque = command[0] - between(estimator, low, fraction, TORQUE)
    inputs[TORQUE_STATE] = torque / p[Entry.RATED_TORQUE]
    inputs[COMMAND] = command[1] - between(estimator, low, fraction, PITCH)
    inputs[INTEGRAL] = memory[mpc.Memory.INTEGRAL]
    for i in range(MOMENT - ESTIMATED_WIND):
        inputs[FILTER + i] = estimated[ESTIMATED_WIND + i]
    inputs[FILTER] -= wind
    inputs[FILTER + 1] -= wind
    inputs[N_FEEDBACK] = wind
    inputs[N_FEEDBACK + 1] = low_torque / p[Entry.RATED_TORQUE]


@entry
def inputs_of(p, estimator, estimated, memory, low_torque, command):
    """Return the inputs (N_INPUTS,) of fill_inputs."""
    inputs = np.empty(N_INPUTS)
    fill_inputs(p, estimator, estimated, memory, low_torque, command, inputs)
    return inputs


@kernel
def layer(p, weight, bias, source, size, memory, target, count):
    """Fill memory[target: target + count] with the weighted sums of memory[source: source + size]."""
    for i in range(count):
        total = p[bias + i]
        for j in range(size):
            total += p[weight + i * size + j] * memory[source + j]
        memory[target + i] = total


@kernel
def decide(p, memory):
    """Set the rates in memory from the inputs: outputs of the network over the limits of the rates."""
    inputs, first, second = CloneMemory.INPUTS, CloneMemory.FIRST, CloneMemory.SECOND
    for i in range(N_INPUTS):
        memory[inputs + i] = (memory[inputs + i] - p[MEAN + i]) / p[SCALE + i]
    layer(p, WEIGHT_0, BIAS_0, inputs, N_INPUTS, memory, first, HIDDEN)
    for i in range(HIDDEN):
        memory[first + i] = np.tanh(memory[first + i])
    layer(p, WEIGHT_1, BIAS_1, first, HIDDEN, memory, second, HIDDEN)
    for i in range(HIDDEN):
        memory[second + i] = np.tanh(memory[second + i])
    layer(p, WEIGHT_2, BIAS_2, second, HIDDEN, memory, inputs, 2)
    torque, pitch = p[Entry.TORQUE_RATE_LIMIT], p[Entry.PITCH_RATE_LIMIT]
    memory[mpc.Memory.TORQUE_RATE] = torque * clamp(memory[inputs], -1.0, 1.0)
    memory[mpc.Memory.PITCH_RATE] = pitch * clamp(memory[inputs + 1], -1.0, 1.0)


@control_kernel
def clone_law(p, memory, measurement, command):
    """Advance the estimate by one period, decide if it is time, and integrate the command."""
    estimator, estimated = p[ESTIMATOR:], memory[CloneMemory.ESTIMATE :]
    curve = curve_at(p, CURVE)
    observe(estimator, estimated, measurement, command, p, memory)
    if memory[CloneMemory.CALLS] == 0.0:
        memory[CloneMemory.LOW_TORQUE] = lowest_torque(estimated, p, curve)
        inputs = memory[CloneMemory.INPUTS : CloneMemory.FIRST]
        fill_inputs(p, estimator, estimated, memory, memory[CloneMemory.LOW_TORQUE], command, inputs)
        decide(p, memory)
    calls = memory[CloneMemory.CALLS] + 1.0
    memory[CloneMemory.CALLS] = calls if calls < p[EVERY] else 0.0
    move(estimated, p, memory, curve, memory[CloneMemory.LOW_TORQUE], command)


def read_clone(path=FILE):
    """Return (CloneSettings, {name: array of SHAPES}) of a file; loading it runs no code of its author.

    Raises: InputError naming the file and the problem.
    """
    where = f"file of a clone {str(path)!r}"
    try:
        arrays = read_arrays(path, MAX_BYTES)
        settings = parse_json(str(arrays["settings"]))
    except Exception as error:  # zipfile, zlib, numpy and json raise various errors for broken files
        raise InputError(f"{where}: cannot be read: {error!s:.300}") from error
    record, problems = validate(CloneSettings, settings)
    raise_problems(where, problems)
    for name, shape in SHAPES.items():
        array = arrays.get(name)
        if array is None or array.dtype.kind != "f" or array.shape != shape or not np.isfinite(array).all():
            raise InputError(f"{where}: {name}: must be finite numbers of shape {shape}")
    if not (arrays["scale"] > 0.0).all():
        raise InputError(f"{where}: scale: must be positive")
    return record, {name: arrays[name].astype(np.float64) for name in SHAPES}


def is_clone(path):
    """Return whether a file holds a network of a clone, valid or not, and not another policy."""
    try:
        settings = parse_json(str(read_arrays(path, MAX_BYTES)["settings"]))
    except Exception:  # whoever reads it as a policy names what is wrong
        return False
    return isinstance(settings, dict) and "period" in settings


class MPCClone(CompiledController):
    """Runs a network that imitates mpc, on the plant of its training; call prepare(scene) before reset.

    path: file of read_clone. Raises: InputError for an invalid file, and in prepare for another platform or
    turbine.
    """

    kernel = staticmethod(clone_law)
    information = LQR.information

    def __init__(self, turbine, control_dt, path=FILE, name="mpc_clone"):
        self.settings, arrays = read_clone(path)
        self.network = np.concatenate([np.ravel(array) for array in arrays.values()])
        self.control_dt = check_control_dt(control_dt)
        super().__init__(name, np.zeros(ESTIMATOR), CloneMemory.ESTIMATE + N_MEMORY)
        self.turbine = turbine
        self.every = max(1, round(self.settings.period / self.control_dt))
        self._planner = MPC(turbine, self.control_dt)  # estimator, limits and start are those of mpc
        self.prepared = False

    def prepare(self, scene):
        """Design the estimator on the scene's plant.

        Raises: InputError for another platform or turbine than in training, and a scene without wind.
        """
        chosen, made_for = (scene.platform.name, scene.turbine.name), self.settings
        if chosen != (made_for.platform, made_for.turbine):
            raise InputError(
                f"controller {self.name!r}: platform {chosen[0]!r} with turbine {chosen[1]!r}: must be"
                f" {made_for.platform!r} with {made_for.turbine!r}, on which its network was trained"
            )
        estimator = self._planner.estimator
        estimator.prepare(scene)
        planned, curve = self._planner.parameters.copy(), [*self._planner.curve]
        planned[Entry.INTEGRAL_LIMIT] = made_for.integral_limit
        parts = (planned, curve, [self.every], self.network, estimator.parameters)
        self.parameters = np.concatenate(parts, dtype=np.float64)
        self.prepared = True

    def reset(self, measurement):
        """Start as mpc, at the trim with the measured pitch. Raises: InputError before prepare()."""
        if not self.prepared:
            raise InputError(f"controller {self.name!r}: call prepare(scene) before reset(measurement)")
        estimator = self._planner.estimator
        estimator.reset(measurement)
        self.memory[:] = 0.0
        self.memory[CloneMemory.ESTIMATE :] = estimator.memory
        self.memory[mpc.Memory.OPERATING_WIND] = estimator.memory[ESTIMATED_WIND + 1]
        drive, torque = self.turbine.pitch_drive, measurement.generator_torque
        pitch = min(max(measurement.blade_pitch, drive.minimum), drive.maximum)
        rated = self.turbine.torque_law.rated_torque
        self.command[:] = torque if np.isfinite(torque) else rated, pitch  # for act()


def mpc_clone(turbine, control_dt):
    """Apply a network that imitates mpc on its platform, without its model and its solver."""
    return MPCClone(turbine, control_dt)
