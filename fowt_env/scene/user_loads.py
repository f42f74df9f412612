"""Compiles user-defined loads into the plant: a kernel, its parameters and the point of action."""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import update_wrapper
from hashlib import sha256
from math import isfinite
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core.errors import NumbaError
from scipy.spatial.transform import Rotation

from fowt_env.descriptions.records import is_number
from fowt_env.errors import InputError
from fowt_env.plant.channels import channels
from fowt_env.plant.compile.decorators import FLOATS
from fowt_env.plant.user_loads import MOST_LOADS, N_FORCE, N_MOTION, Motion, UserLoads

AXES = ("inertial", "body")
SIGNATURE = types.void(FLOATS, FLOATS, FLOATS)
KERNEL_ARGUMENTS = 3
MOST_STATES = 100  # of one load
IN_PLANE = 1e-9  # fraction of a force out of the plane of a planar scene that rounding may leave
TRIALS = (  # states for checks of a load: surge, sway, heave, roll, pitch, yaw, and their rates
    (np.zeros(6), np.zeros(6)),
    (np.array([12.0, -3.0, -1.5, 0.01, 0.07, -0.02]), np.array([0.7, -0.2, 0.4, 0.002, 0.01, 0.001])),
    (np.array([-4.0, 2.0, 1.0, -0.02, -0.03, 0.03]), np.array([-0.9, 0.3, -0.6, 0.003, -0.02, 0.002])),
)


class LoadKernel(types.WrapperAddressProtocol):
    """Wraps a function for load_kernel: callable in Python, and a first-class function in compiled code."""

    def __init__(self, function: Callable[..., None]) -> None:
        self.function = function
        update_wrapper(self, function)
        without_jit = numba.config.DISABLE_JIT  # type: ignore[attr-defined] # set when numba starts
        self._compiled: Any = None if without_jit else _compiled(function)

    def __wrapper_address__(self) -> int:
        return self._compiled.address

    def signature(self) -> Any:
        """Return the numba signature."""
        return SIGNATURE

    def __call__(self, parameters: np.ndarray, motion: np.ndarray, force: np.ndarray) -> None:
        """Run the function as plain Python."""
        self.function(parameters, motion, force)

    def __reduce__(self) -> str:
        return self.function.__qualname__  # pickled by name, as functions are

    def __repr__(self) -> str:
        return f"<load kernel {self.function.__module__}.{self.function.__qualname__}>"

    def fingerprint(self) -> str:
        """Return a hash of the function's code and constants, identical in every process."""
        return sha256(repr(_meaning(self.function)).encode()).hexdigest()


def _compiled(function):
    """Return the function as a numba.cfunc, compiled in each process in a tenth of a second.

    Numba's cache on disk would not notice an edit of a called function in another file.
    """
    try:
        return numba.cfunc(SIGNATURE, error_model="numpy")(function)
    except NumbaError as error:
        reason = "\n".join(line for line in str(error).splitlines() if line.strip())
        raise InputError(f"load kernel {function.__name__!r}: numba cannot compile it: {reason}") from error


def _meaning(function, above=()):
    """Return code, constants and outer numbers of a function and of those it calls, as plain values."""
    code, above = function.__code__, (*above, function)
    cells = (cell.cell_contents for cell in function.__closure__ or ())
    outer = function.__globals__ | dict(zip(code.co_freevars, cells, strict=True))
    known = _known(outer, (*code.co_names, *code.co_freevars), above)
    constants = [repr(constant) for constant in code.co_consts if not isinstance(constant, CodeType)]
    return code.co_code.hex(), code.co_names, constants, known


def _known(outer, names, above):
    """Return the plain values of the names in a mapping, and of the same names in its modules."""
    known = {}
    for name in sorted(set(names) & outer.keys()):
        value = outer[name]
        if isinstance(value, int | float | tuple):
            known[name] = value
        elif isinstance(value, np.ndarray):
            known[name] = value.dtype.str, value.shape, value.tobytes()
        elif isinstance(value, ModuleType) and value not in above:
            known[name] = _known(vars(value), names, (*above, value))
        elif isinstance(called := getattr(value, "py_func", None), FunctionType) and called not in above:
            known[name] = _meaning(called, above)
    return known


def load_kernel(function: Callable[..., None]) -> LoadKernel:
    """Return the LoadKernel of a function (parameters, motion, force) that numba can compile; a decorator.

    parameters  (n,) numbers of the Load; read only
    motion      (N_MOTION + states,) inputs of the load, indexed by Motion; read only
    force       (N_FORCE + states,) zeros to be filled, indexed by Force: force (N) at the load's point and
                moment (N m) about it, in the axes of the load, and the rates of its states

    It must be a function of a module (worker processes import it by name), depend only on its arguments, and
    have no memory between calls: several calls make one step.

    Raises: InputError for another number of arguments, or what numba cannot compile.
    """
    if isinstance(function, LoadKernel):
        return function
    if not isinstance(function, FunctionType):
        raise InputError(f"load_kernel: {function!r} must be a plain Python function")
    if len(inspect.signature(function).parameters) != KERNEL_ARGUMENTS:
        raise InputError(
            f"load kernel {function.__name__!r}: must take three arguments (parameters, motion, force)"
        )
    return LoadKernel(function)


@dataclass(frozen=True)
class Load:
    """Defines a user load on the floating platform or the tower and nacelle, for build_scene(loads=...).

    name        prefix of its output channels NAMEFxi ... NAMEMzi: force (N) and moment about the body
                origin (N m) in inertial axes
    kernel      result of load_kernel
    parameters  numbers passed to the kernel: a list, an array or a NamedTuple
    point       point of action, body axes, m: x downwind, z up from the still-water level. At or above the
                tower base the load is included in the tower-base loads and, with a flexible tower, acts on
                the nacelle: motion and body axes are then those of the nacelle, angles those of the platform
    axes        "inertial" or "body": of velocities and force
    water       whether the kernel reads the motion of the water at its point (Motion.WATER_X ...), whose
                sum over 225 wave components takes 6 microseconds, as long as three steps at fidelity
                "standard" without wind (without water: 0.4 microseconds a step, eight loads: 0.6)
    states      number of states, integrated with the plant: motion[Motion.STATE + i] is a state and
                force[Force.RATE + i] its rate. A run starts with zero rates, as in a trim

    A load may depend on wind, waves, rotor and time, but not on accelerations: put mass and added mass into
    the platform file. It acts on the rotor shaft only through the platform. Trims and linear models evaluate
    it at time 0.

    Raises: InputError that names the load and the invalid setting.
    """

    name: str
    kernel: LoadKernel
    parameters: Sequence[float] = ()
    point: Sequence[float] = (0.0, 0.0, 0.0)
    axes: str = "inertial"
    water: bool = False
    states: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise InputError(f"load: name = {self.name!r}: must be a word of letters, digits and _")
        where = f"load {self.name!r}"
        if not isinstance(self.kernel, LoadKernel):
            raise InputError(
                f"{where}: kernel = {self.kernel!r}: must be a function decorated with @fowt_env.load_kernel"
            )
        object.__setattr__(self, "parameters", _numbers(where, "parameters", self.parameters))
        object.__setattr__(self, "point", _numbers(where, "point", self.point))
        if len(self.point) != 3:
            raise InputError(f"{where}: point = {self.point!r}: must be three numbers (x, y, z), m")
        if self.axes not in AXES:
            raise InputError(f"{where}: axes = {self.axes!r}: allowed 'inertial', 'body'")
        if not isinstance(self.water, bool):
            raise InputError(f"{where}: water = {self.water!r}: allowed False, True")
        whole = isinstance(self.states, int) and not isinstance(self.states, bool)
        if not (whole and 0 <= self.states <= MOST_STATES):
            raise InputError(
                f"{where}: states = {self.states!r}: must be a whole number from 0 to {MOST_STATES}"
            )

    def key(self) -> tuple:
        """Return all properties as plain values, identical in every process."""
        basic = self.name, self.kernel.fingerprint(), self.parameters, self.point, self.axes, self.water
        return (*basic, self.states)


def _numbers(where, key, values):
    """Return the values as a tuple of floats. Raises: InputError."""
    try:
        listed = tuple(values)
    except TypeError:
        listed = (None,)
    if isinstance(values, str) or not all(is_number(value) for value in listed):
        raise InputError(f"{where}: {key} = {values!r}: must be a list of finite numbers")
    return tuple(float(value) for value in listed)


def checked_loads(loads: Any, n_lines: int, planar: bool) -> tuple[Load, ...]:
    """Check the loads by plain Python calls in some states; return them as a tuple.

    Raises: InputError that names the load.
    """
    if isinstance(loads, Load):
        loads = (loads,)
    try:
        listed = tuple(loads or ())
    except TypeError:
        listed = (loads,)
    for load in listed:
        if not isinstance(load, Load):
            raise InputError(f"loads: {load!r}: must be a fowt_env.Load")
    if len(listed) > MOST_LOADS:
        raise InputError(f"loads: {len(listed)} of them: at most {MOST_LOADS}; a kernel may hold several")
    taken = {channel.name for channel in channels(n_lines)}
    for load in listed:
        new = {channel.name for channel in channels(0, (load.name,))} - {c.name for c in channels(0)}
        if taken & new or not new:
            raise InputError(
                f"load {load.name!r}: its channel {load.name}Fxi exists already: choose another name"
            )
        taken |= new
        for position, rate in TRIALS:
            _try(load, position, rate, planar)
    return listed


def _rotation(position):
    """Return the rotation matrix from body to inertial axes of 3-2-1 Euler angles."""
    return Rotation.from_euler("ZYX", position[:2:-1]).as_matrix()


def _motion(load, position, rate):
    """Return motion array of a state: six positions, and velocity and angular velocity in inertial axes."""
    turn = _rotation(position)
    arm = turn @ load.point
    axes = turn.T if load.axes == "body" else np.eye(3)
    motion = np.zeros(N_MOTION + load.states)
    motion[Motion.X : Motion.Z + 1] = position[:3] + arm
    motion[Motion.VX : Motion.VZ + 1] = axes @ (rate[:3] + np.cross(rate[3:], arm))
    motion[Motion.WX : Motion.WZ + 1] = axes @ rate[3:]
    motion[Motion.SURGE : Motion.YAW + 1] = position
    motion[Motion.R11 : Motion.R33 + 1] = turn.ravel()
    motion[Motion.ROTOR_SPEED] = 1.2
    return motion


def _try(load, position, rate, planar):
    """Run the load as plain Python, where wrong indices show, in a state. Raises: InputError."""
    if planar:
        position, rate = position.copy(), rate.copy()
        position[[1, 3, 5]] = rate[[1, 3, 5]] = 0.0
    where = f"load {load.name!r}"
    motion, force = _motion(load, position, rate), np.zeros(N_FORCE + load.states)
    parameters = np.array(load.parameters)
    motion.flags.writeable = parameters.flags.writeable = False
    try:
        with np.errstate(all="ignore"):
            returned = load.kernel(parameters, motion, force)
    except Exception as error:  # any error of a user's code
        raise InputError(f"{where}: its kernel failed: {type(error).__name__}: {error}") from error
    if returned is not None:
        raise InputError(
            f"{where}: its kernel returned {returned!r}: must write to its third argument instead"
        )
    if not all(isfinite(value) for value in force):
        raise InputError(
            f"{where}: its kernel gave force = {force.tolist()}: must be {force.size} finite numbers"
        )
    if planar:
        arm = _rotation(position) @ load.point if load.axes == "inertial" else np.array(load.point)
        moment = force[3:6] + np.cross(arm, force[:3])
        out = max(abs(force[1]), abs(moment[0]) / 100.0, abs(moment[2]) / 100.0)  # over an arm of 100 m
        if out > IN_PLANE * np.abs(force[[0, 2]]).max():
            raise InputError(
                f"{where}: acts out of the plane, force = {force.tolist()}; a planar scene needs loads"
                " in the plane (planar = False)"
            )


def build_user_loads(loads: Sequence[Load], base_height: float, first_state: int) -> UserLoads | None:
    """Return the UserLoads part of checked loads, None without loads, with states from first_state."""
    if not loads:
        return None
    sizes = [len(load.parameters) for load in loads]
    spare = [loads[0].kernel] * (MOST_LOADS - len(loads))  # never called
    return UserLoads(
        np.array([value for load in loads for value in load.parameters], dtype=np.float64),
        np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        np.array([load.point for load in loads], dtype=np.float64).reshape(-1, 3),
        np.array([load.axes == "body" for load in loads]),
        np.array([load.point[2] >= base_height for load in loads]),
        np.array([load.water for load in loads]),
        first_state + np.concatenate([[0], np.cumsum([load.states for load in loads])]).astype(np.int64),
        max(load.states for load in loads),
        *(load.kernel for load in loads),
        *spare,
    )


def first_nonfinite_load(loads: Sequence[Load], user_data: np.ndarray) -> str | None:
    """Return a text on the first load with a force that is not finite; None if all are finite.

    user_data: filled by plant.user_loads.evaluate_user_loads.
    """
    if not loads or not user_data[6 * len(loads)]:
        return None
    load = loads[int(user_data[6 * len(loads)]) - 1]
    return f"load {load.name!r} gave a force that is not finite"
