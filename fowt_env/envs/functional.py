"""Defines the environment as pure functions, in the functional API of Gymnasium (FuncEnv)."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from gymnasium.experimental.functional import FuncEnv

from fowt_env.descriptions.checks import check_whole_number
from fowt_env.envs.env import FowtEnv
from fowt_env.envs.snapshot import Snapshot

LARGEST_SEED = 2**31  # exclusive, of an episode


class FunctionalState(NamedTuple):
    """Holds a state of an environment; read only, can be pickled."""

    snapshot: Snapshot
    observation: np.ndarray  # (n,) float32
    reward: float  # of the transition to this state; 0 at the start
    terminated: bool
    truncated: bool
    info: dict[str, Any]  # of the reset or step that led to this state


class FowtFuncEnv(FuncEnv[FunctionalState, np.ndarray, npt.ArrayLike, float, bool, None, dict[str, Any]]):
    """Provides initial(rng) and transition(state, action) without hidden state; settings: see FowtEnv.

    rng: a numpy Generator or a seed. Transitions are deterministic, since all weather and sensor noise of an
    episode is drawn at its start: their rng is not used. params: options of FowtEnv.reset. States are
    independent values: one can be kept, compared, stored, and continued with several actions (tree search).
    A state costs a copy of the arrays of an environment; continuing from the newest one restores none.

    Raises: InputError as FowtEnv; ResetNeeded for a transition from the end of an episode.
    """

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__()
        self._env = FowtEnv(*arguments, **settings)
        self._newest: FunctionalState | None = None  # the state in which the environment is
        self.observation_space, self.action_space = self._env.observation_space, self._env.action_space

    def initial(
        self, rng: np.random.Generator | int, params: dict[str, Any] | None = None
    ) -> FunctionalState:
        """Return the start of a new episode, in weather drawn with rng."""
        if isinstance(rng, np.random.Generator):
            rng = int(rng.integers(LARGEST_SEED))
        self._newest = None
        observation, info = self._env.reset(seed=check_whole_number("rng", rng, 0), options=params)
        return self._state(observation, 0.0, False, False, info)

    def transition(
        self,
        state: FunctionalState,
        action: npt.ArrayLike,
        rng: Any = None,
        params: dict[str, Any] | None = None,
    ) -> FunctionalState:
        """Return the state one step after a state under an action (actions,) in [-1, 1]."""
        if state is not self._newest:
            self._env.set_state(state.snapshot)
        self._newest = None
        return self._state(*self._env.step(action))

    def _state(self, observation, reward, terminated, truncated, info):
        """Return the present state of the environment with read-only arrays."""
        snapshot = self._env.get_state()
        for array in (observation, *snapshot.arrays):
            if array is not None:
                array.setflags(write=False)
        self._newest = FunctionalState(snapshot, observation, float(reward), terminated, truncated, info)
        return self._newest

    def observation(
        self, state: FunctionalState, rng: Any = None, params: dict[str, Any] | None = None
    ) -> np.ndarray:
        """Return the observation (n,) float32 of a state."""
        return state.observation

    def reward(
        self,
        state: FunctionalState,
        action: npt.ArrayLike,
        next_state: FunctionalState,
        rng: Any = None,
        params: dict[str, Any] | None = None,
    ) -> float:
        """Return the reward of the transition that led to next_state."""
        return next_state.reward

    def terminal(self, state: FunctionalState, rng: Any = None, params: dict[str, Any] | None = None) -> bool:
        """Return whether an episode ended in this state by failure or at its duration."""
        return state.terminated or state.truncated

    def state_info(self, state: FunctionalState, params: dict[str, Any] | None = None) -> dict[str, Any]:
        """Return the info of the reset or step that led to a state."""
        return state.info

    def transition_info(
        self,
        state: FunctionalState,
        action: npt.ArrayLike,
        next_state: FunctionalState,
        params: dict[str, Any] | None = None,
    ) -> dict[str, Any]:
        """Return the info of the step that led to next_state."""
        return next_state.info
