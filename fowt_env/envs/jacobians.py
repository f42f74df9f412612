"""Computes the Jacobian of each control period of an episode by tangent columns.

A column is a copy of the plant that differs from the plant of the episode by a small multiple of a tangent
vector and is advanced by the same compiled kernels under the same command: every option of a scene is
differentiated, and there is no second model. A tangent vector also contains what the time step keeps of past
steps. After each period the vectors are combined anew, so that each is again the change of one state, with
the past derivatives that belong to it. A Jacobian is then that of the flow to the order of the multistep
scheme, and Jacobians of successive periods may be multiplied. With past derivatives unchanged, a change of
the state would act through the newest of them alone, with 55/24 of its effect.
"""

from typing import Any, NamedTuple

import gymnasium
import numpy as np
import numpy.typing as npt

from fowt_env.descriptions.checks import short
from fowt_env.envs.episode import STEP
from fowt_env.envs.snapshot import CARRIED
from fowt_env.errors import InputError
from fowt_env.plant.advance import advance
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import OUT_OF_PLANE, State

# arrays of plant.model.Data to which a tangent vector extends; the others of CARRIED are filled anew by each
# evaluation of the loads
PAST = ("lines", "user", "history", "samples", "blades", "elastic", "slow", "radiation")
# blocks of states that are the past of the air, the water and the lines
MEMORIES = ("wake", "airfoil", "filtered position", "radiation", "lines")
DIFFERENCE = 1e-7  # of a state, relative to its size: truncation and rounding are then both some 1e-8
SIZES = {  # SI, of the states of a block; others: 1, or the value at the beginning if that is larger
    "platform_position": (1.0, 1.0, 1.0, 0.1, 0.1, 0.1),
    "platform_velocity": (1.0, 1.0, 1.0, 0.1, 0.1, 0.1),
    "blade_pitch": 0.1,
    "other_blade_pitches": 0.1,
    "tower_deflection": 0.1,
    "shaft_twist": 1e-2,
}
TORQUE, PITCH, WIND = 1e7, 0.1, 1.0  # sizes of the inputs, N m, rad, m/s
# physics steps after which past derivatives that the columns did not follow have died out: to 1e-6, with the
# lag of the blade pitch
SETTLING = 30
LOST = 1e-12  # largest effect of a state that a period forgets: blade pitch without lag, unused states


class PeriodJacobian(NamedTuple):
    """Holds the derivatives of the plant's state at the end of a control period; SI, radians.

    The command is that in force, after sensors, controller and limits, which are not differentiated.
    """

    states: tuple[str, ...]  # names of the n states that move
    commands: tuple[str, ...]  # names of the m commands
    state: np.ndarray  # (n, n) with respect to the state at the beginning of the period
    command: np.ndarray  # (n, m) with respect to the command in force
    # (n,) with respect to a uniform change of the longitudinal wind; None without aerodynamics and in a box
    wind: np.ndarray | None
    end: np.ndarray  # (n,) the state at the end of the period


class PeriodJacobians(gymnasium.Wrapper):
    """Adds the Jacobian of the plant in each step to the info of a FowtEnv.

    env       a FowtEnv, wrapped or not, whose step is one control period
    memories  whether the states of MEMORIES are included; otherwise they are held within each period

    info["jacobian"] of each step is a PeriodJacobian. It is None where the columns do not know the past of
    the plant, in the first SETTLING physics steps after set_state and after the operation before a shutdown,
    and once the state is not finite. A step costs n + m + 2 advances of the plant with n states and m
    commands in addition to the environment's own step.

    Differences are one-sided: where a load has a corner (a table's knot, the drag of water at rest) the
    derivative is that on the side of growing states.

    Raises: InputError for an environment with decisions of several control periods.
    """

    def __init__(self, env: gymnasium.Env, memories: bool = False) -> None:
        super().__init__(env)
        self.memories = memories
        plant: Any = env.unwrapped
        if getattr(plant, "decisions", None) is not None:
            raise InputError("PeriodJacobians: a step must be one control period: needs decisions=None")
        self._columns: _Columns | None = None

    def reset(self, **keywords: Any) -> tuple[Any, dict[str, Any]]:
        """Reset the environment and start the columns at its first state."""
        result = self.env.reset(**keywords)
        self._columns = _Columns(self.env.unwrapped, self.memories)
        return result

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance the environment by one control period; return its result with the Jacobian in info."""
        return self._followed(self.env.step, action)

    def step_physical(self, *command: float) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance one control period under a command as FowtEnv.step_physical, with the Jacobian in info."""
        plant: Any = self.env.unwrapped
        return self._followed(plant.step_physical, *command)

    def shift(self, changes: npt.ArrayLike) -> None:
        """Change the state of the plant between two steps, as the correction of a Kalman filter does.

        changes (n,): of the states that PeriodJacobian names, SI, radians. What the time step keeps of past
        steps changes along, to first order, so that the next Jacobian is known as before. Observation and
        measurement follow with the next step.

        Raises: InputError for another number of changes or one that is not finite, and where the Jacobian of
        the next step would be None.
        """
        plant: Any = self.env.unwrapped
        columns = self._met(plant)
        values = np.asarray(changes, dtype=float)
        if values.shape != (columns.n,) or not np.isfinite(values).all():
            raise InputError(f"changes = {short(values)}: must be {columns.n} finite numbers, one per state")
        if not columns.known:
            raise InputError(f"changes: no Jacobian is known until {SETTLING} steps after set_state")
        columns.shift(plant, values)

    def _met(self, plant):
        """Return the columns at the state of the plant."""
        if self._columns is None or self._columns.scene is not plant.scene:
            self._columns = _Columns(plant, self.memories)
        self._columns.meet(plant)
        return self._columns

    def _followed(self, step, *arguments):
        """Return the result of a step with the Jacobian in info."""
        plant: Any = self.env.unwrapped
        columns = self._met(plant)
        result = step(*arguments)
        result[-1]["jacobian"] = columns.follow(plant)
        return result


class _Plant:
    """Holds a copy of a plant whose arrays are parts of one vector: the state, PAST, and the other arrays."""

    def __init__(self, scene, model=None):
        parts = _parts(scene.data())
        shapes = [(scene.n_state,), *(array.shape for array in parts)]
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        self.vector = np.zeros(ends[-1])
        views = [self.vector[end - np.prod(shape, dtype=int) : end].reshape(shape)
                 for end, shape in zip(ends, shapes, strict=True)]  # fmt: skip
        self.x = views[0]
        self.data = _with_parts(scene.data(), views[1:])
        scene = scene if model is None else scene.with_model(model)
        self.handle = scene.handle(self.data)
        self.extent = int(ends[_n_past(self.data)])

    def advance(self, vector, u, first, n, dt):
        """Advance the copy from a vector by n steps; return its vector."""
        self.vector[:] = vector
        self.data.cache[LoadCache.VALID] = 0.0
        advance(self.handle, self.x, u, first, n, dt)
        return self.vector


def _parts(data):
    """Return the arrays of Data that persist, PAST and those of the rotor first."""
    rotor = [] if data.rotor is None else [getattr(data.rotor, name) for name in CARRIED["rotor"]]
    others = [name for name in CARRIED["data"] if name not in PAST]
    return [*(getattr(data, name) for name in PAST), *rotor, *(getattr(data, name) for name in others)]


def _n_past(data):
    """Return the number of the first of _parts to which a tangent vector extends."""
    return len(PAST) + (0 if data.rotor is None else len(CARRIED["rotor"]))


def _with_parts(data, parts):
    """Return Data with other arrays in the order of _parts."""
    parts = iter(parts)
    past = {name: next(parts) for name in PAST}
    rotor = data.rotor
    if rotor is not None:
        rotor = rotor._replace(**{name: next(parts) for name in CARRIED["rotor"]})
    others = {name: next(parts) for name in CARRIED["data"] if name not in PAST}
    return data._replace(**past, **others, rotor=rotor)


def _names(scene):
    """Return the names of all states: those of State, then <block>_<number>."""
    names = [state.name.lower() for state in State if state < State.INTERNAL]
    for block in scene.blocks:
        if block.offset >= State.INTERNAL:
            names += [f"{block.name.replace(' ', '_')}_{number}" for number in range(1, block.size + 1)]
    return names


def _memory_states(scene):
    """Return the indices of the states of MEMORIES."""
    blocks = (block for block in scene.blocks if block.name in MEMORIES)
    return [i for block in blocks for i in range(block.offset, block.offset + block.size)]


def _fixed_states(scene):
    """Return the indices of states that do not move freely: out of plane, and blade pitch without lag."""
    plane = () if scene.model.rigid_body.plane is None else OUT_OF_PLANE
    lag = getattr(scene.model.actuator, "time_constant", 1.0)
    return (*plane, *(scene.pitch_states if lag <= 0.0 else ()))


def _sizes(scene, x):
    """Return the sizes (n_state,) of the states, by which their differences are scaled."""
    sizes = np.maximum(1.0, np.abs(x))
    for block in scene.blocks:
        if block.name in SIZES:
            sizes[block.offset : block.offset + block.size] = SIZES[block.name]
    return sizes


class _Columns:
    """Follows the plant of a FowtEnv with copies that differ in one state, one command or the wind."""

    def __init__(self, env, memories):
        scene = self.scene = env.scene
        self.base, self.copy, self.windy = _Plant(scene), _Plant(scene), _windy(scene)
        self.held = [] if memories else _memory_states(scene)
        others = {*self.held, *_fixed_states(scene)}
        self.moving = [i for i in range(scene.n_state) if i not in others]
        names = _names(scene)
        self.names = tuple(names[i] for i in self.moving)
        blades = scene.n_commands - 1
        pitches = ("blade_pitch",) if blades == 1 else tuple(f"blade_pitch_{i + 1}" for i in range(blades))
        self.commands = ("generator_torque", *pitches)
        self.n, inputs = len(self.moving), len(self.commands) + (self.windy is not None)
        # tangent vectors of the states, the commands and the wind
        self.vectors = np.zeros((self.n + inputs, self.base.extent))
        self.settled = 0  # physics step from which the past derivatives are those of the columns
        self.anchored = False

    def meet(self, env):
        """Start the columns again unless they are at the state of the environment."""
        if self.anchored and np.array_equal(self.base.x, env._episode.x):
            return
        self._anchor(env)
        begins = env._episode.data.cache[LoadCache.STEPS] == 0.0
        self.settled = self.first + (0 if begins else SETTLING)
        states = _sizes(env.scene, self.base.x)[self.moving]
        inputs = [TORQUE, *[PITCH] * (len(self.commands) - 1), *[WIND] * (self.windy is not None)]
        self.sizes = np.array([*states, *inputs])
        self.vectors[:] = 0.0
        self.vectors[range(self.n), self.moving] = 1.0

    @property
    def known(self):
        """Return whether the columns know the past of the plant, so that they give its Jacobian."""
        return self.anchored and self.first >= self.settled

    def shift(self, env, changes):
        """Change the states of the environment, and what belongs to them, by changes (n,)."""
        run = env._episode
        self.base.vector[: self.base.extent] += changes @ self.vectors[: self.n]
        run.x[:] = self.base.x
        for own, array in zip(_parts(self.base.data), _parts(run.data), strict=True):
            array[...] = own
        run.data.cache[LoadCache.VALID] = 0.0
        self.start = self.base.vector.copy()

    def _anchor(self, env):
        """Copy the state of the environment."""
        run = env._episode
        self.base.x[:] = run.x
        for own, array in zip(_parts(self.base.data), _parts(run.data), strict=True):
            own[...] = array
        self.start, self.first = self.base.vector.copy(), int(run.counts[STEP])
        self.anchored = True

    def follow(self, env):
        """Advance the columns as the environment was advanced. Returns a PeriodJacobian or None."""
        run, extent, n, m = env._episode, self.base.extent, self.n, len(self.commands)
        if not np.isfinite(run.x).all():
            self.anchored = False
            return None
        period = (self.first, int(run.counts[STEP]) - self.first, env.dt)
        known = self.known
        end = self.base.advance(self.start, run.u, *period)[:extent].copy()
        differences = (DIFFERENCE * self.sizes)[:, None]
        begun, commands = np.tile(self.start, (len(self.sizes), 1)), np.tile(run.u, (len(self.sizes), 1))
        begun[:, :extent] += differences * self.vectors
        commands[range(n, n + m), range(m)] += differences[n : n + m, 0]
        reached = np.empty_like(self.vectors)
        for k, (vector, u) in enumerate(zip(begun, commands, strict=True)):
            plant = self.copy if k < n + m else self.windy
            reached[k] = plant.advance(vector, u, *period)[:extent]
        changed = (reached - end) / differences
        moved = changed[:, self.moving].T.copy()
        self.vectors = self._combined(changed)
        self._anchor(env)
        if not known:
            return None
        wind = None if self.windy is None else moved[:, -1]
        effects = moved[:, :n], moved[:, n : n + m], wind
        return PeriodJacobian(self.names, self.commands, *effects, run.x[self.moving].copy())

    def _combined(self, changed):
        """Return the combinations of changed vectors (n + inputs, extent) that each change one entry by 1."""
        n, sizes = self.n, self.sizes[: self.n]
        moved = changed[:, self.moving]
        inverse = _inverse(moved[:n] * (sizes[:, None] / sizes))
        vectors = np.empty_like(changed)
        vectors[:n] = (inverse / sizes[:, None] * sizes) @ changed[:n]
        vectors[:n, self.moving] = np.eye(n)
        vectors[n:] = changed[n:] - moved[n:] @ vectors[:n]
        vectors[n:, self.moving] = 0.0
        vectors[:, self.held] = 0.0
        return vectors


def _inverse(matrix):
    """Return the inverse of a matrix (n, n), without the states that a period leaves no trace of."""
    size = np.abs(matrix)
    alive = np.flatnonzero((size.max(axis=0) > LOST) & (size.max(axis=1) > LOST))
    inverse = np.zeros_like(matrix)
    inverse[np.ix_(alive, alive)] = np.linalg.inv(matrix[np.ix_(alive, alive)])
    return inverse


def _windy(scene):
    """Return a copy of the plant in a uniformly faster wind; None without a wind series."""
    aero = scene.model.aero
    if aero is None or aero.field is not None or aero.wind is None:
        return None
    value = aero.wind.value.copy()
    value[:, 0] += DIFFERENCE * WIND
    return _Plant(scene, {"aero.wind": aero.wind._replace(value=value)})
