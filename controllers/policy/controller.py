"""Runs an exported policy network as a controller, evaluated with numpy only.

A policy file (network_file.py) is read without pickle, so that loading runs no code of the file's author.
`policy:NAME` is a file in the folder agents, `policy:PATH` any other file, also one with a network for
mpc_clone; a stable-baselines3 zip is rejected, because loading a zip executes code from it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from fowt_env.control import CompiledController, call_law, check_control_dt, hidden, view_of, wind_ahead
from fowt_env.controllers.lqr.law import WindEstimator
from fowt_env.controllers.mpc.clone import MPCClone, is_clone
from fowt_env.controllers.policy.network_file import read_policy
from fowt_env.envs.actions import (
    ACTION_MODES,
    ActionMode,
    action_of,
    build_action_map,
    command_of,
    start_tracking,
)
from fowt_env.envs.decisions import Decisions, DecisionSettings, wind_entry
from fowt_env.envs.observations import (
    ESTIMATE_CHANNELS,
    N_ACTIONS,
    PREVIEW,
    build_observation_map,
    entries,
    fill_observation,
    fill_signals,
)
from fowt_env.envs.tasks import Task
from fowt_env.errors import InputError, unknown
from fowt_env.loop.period import hide_command
from fowt_env.plant.drivetrain import followed_torque
from fowt_env.plant.measurement import Measurement

POLICY_PREFIX = "policy:"
AGENTS = Path(__file__).parent / "agents"


def shipped_agents():
    """Return the sorted names of the agents in controllers/policy/agents."""
    return sorted(path.stem for path in AGENTS.glob("*.npz"))


def policy_path(name):
    """Return the path of a policy file from the name after "policy:". Raises: InputError."""
    path = Path(name)
    if path.suffix == ".zip":
        raise InputError(
            f"controller 'policy:{name}': a stable-baselines3 zip runs code of its author when it is loaded;"
            " turn one that you trust into a policy file with fowt connect export-policy --trust-zip"
        )
    if path.suffix == ".npz":
        if not path.is_file():
            raise InputError(f"controller 'policy:{name}': there is no such file")
        return path
    if name not in shipped_agents():
        raise unknown("policy", name, [*shipped_agents(), "the path of a .npz file"])
    return AGENTS / f"{name}.npz"


class PolicyController:
    """Runs the agent of a policy file with observations, decisions and actions as in its training.

    information: measurements used by the agent or its baseline, and "wind_preview" if used.
    Raises: InputError for an invalid file, turbine or control period.
    """

    def __init__(self, path, turbine, control_dt, name):
        self.name = str(name)
        self.settings, self.network = read_policy(path)
        settings = self.settings
        where = f"policy file {str(path)!r}"
        if abs(check_control_dt(control_dt) - settings["control_dt"]) > 1e-9:
            raise InputError(f"{where}: control_dt = {control_dt}: must be {settings['control_dt']:g} s")
        self._mode = ACTION_MODES[settings["action_mode"]]
        preview = tuple(settings["wind_preview"])
        names = tuple(settings["observation"])
        if "azimuth" in names:
            raise InputError(f"{where}: the rotor azimuth is not a measurement of controllers")
        observed = entries(names, turbine, preview)
        self._observation_map = build_observation_map(observed, preview)
        chosen = DecisionSettings(**settings["decisions"])
        try:
            wind = wind_entry(chosen, self._mode, observed)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        self._decisions = Decisions(len(observed), chosen, control_dt, wind)
        if self.network.mean.shape != (self._decisions.size,):
            raise InputError(
                f"{where}: {self.network.mean.size} inputs: its observation has {self._decisions.size}"
            )
        task = replace(
            Task(name=self.name, wind=0.0, offsets={}),
            blade_pitch=tuple(settings["blade_pitch"]),
            setpoint=tuple(settings["setpoint"]),
            residual_torque=settings["residual_torque"],
            residual_pitch=settings["residual_pitch"],
        )
        self._actions = build_action_map(self._mode, task, turbine, control_dt)
        estimating = bool(set(ESTIMATE_CHANNELS) & set(names))
        self._estimator = WindEstimator(turbine, control_dt) if estimating else None
        self._baseline = self._baseline_law = None
        self._parameters, self._memory = np.zeros(1), np.zeros(1)
        if self._mode == ActionMode.RESIDUAL:
            from fowt_env.controllers import make

            self._baseline = make(settings["baseline"], turbine, control_dt)
            if not isinstance(self._baseline, CompiledController):
                raise InputError(f"{where}: baseline {settings['baseline']!r} is not a compiled controller")
            self._baseline_law = self._baseline.law
        self._signals = np.zeros(PREVIEW + len(preview))
        self._observation = np.zeros(len(observed), dtype=np.float32)
        self._u = np.zeros(2)
        self._accepted = np.zeros(N_ACTIONS)
        self._calls = 0
        self.information = self._information(names)
        observed_leads = preview if "wind_preview" in names else ()
        baseline_leads = () if self._baseline is None else self._baseline.preview_times
        self.preview_times = tuple(sorted({*observed_leads, *baseline_leads}))
        self._agent_leads, self._baseline_leads = (
            np.array([self.preview_times.index(lead) for lead in leads], dtype=int)
            for leads in (observed_leads, baseline_leads)
        )
        self._hidden = None if self._baseline is None else hidden(self._baseline)

    def _information(self, names):
        """Return the unique measurements and other inputs used by the agent and its baseline."""
        parts = [part for part in (self._baseline, self._estimator) if part is not None]
        used = [name for part in parts for name in part.information]
        used += [name for name in names if name in Measurement._fields or name == "wind_preview"]
        used += ["generator_torque", "blade_pitch"]  # initial commands
        if self._mode != ActionMode.RESIDUAL:
            used.append("rotor_speed")
        return tuple(dict.fromkeys(used))

    def prepare(self, scene):
        """Prepare baseline and estimator, which are designed on the plant."""
        for part in (self._baseline, self._estimator):
            if part is not None:
                part.prepare(scene)

    def reset(self, measurement):
        """Restart with the measured torque and pitch as command in force and an empty history."""
        self._u[:] = measurement.generator_torque, measurement.blade_pitch
        if self._baseline is not None:
            ahead = np.array(wind_ahead(measurement))[self._baseline_leads]
            self._baseline.reset(view_of(self._baseline)([*measurement, *ahead.tolist()]))
            self._parameters, self._memory = self._baseline.parameters, self._baseline.memory
        elif self._mode == ActionMode.SETPOINT:
            start_tracking(self._memory, measurement, self._actions)
        if self._estimator is not None:
            self._estimator.reset(measurement)
        speed = 0.0 if self._mode == ActionMode.RESIDUAL else float(measurement.rotor_speed)
        action_of(self._u, speed, self._actions, self._accepted)
        self._calls = 0

    def act(self, measurement):
        """Return (generator torque, blade pitch); the network is evaluated every `hold` calls."""
        values = np.array([*measurement], dtype=np.float64)
        ahead = np.array(wind_ahead(measurement))
        decisions = self._decisions
        if self._estimator is not None and self._calls > 0:  # reset has processed the first instant
            call_law(self._estimator.law, self._estimator.parameters, self._estimator.memory, values, self._u)
        if self._calls % decisions.settings.hold == 0:
            estimate = None if self._estimator is None else self._estimator.memory
            fill_signals(values, 0.0, self._accepted, estimate, 0.0, ahead[self._agent_leads], self._signals)
            fill_observation(self._signals, self._observation_map, self._observation)
            if self._calls == 0:
                decisions.restart(self._observation, self._accepted)
            else:
                decisions.append(self._observation)
            self._decision = self.network(decisions.features())
        self._calls += 1
        self._accepted[:] = np.clip(decisions.smooth(self._decision), -1.0, 1.0)
        command = self._u.copy()
        hide_command(self._hidden, False, None, command)
        reading = values if self._hidden is None else values + self._hidden
        command_of(
            self._accepted, self._actions, self._baseline_law, self._parameters, self._memory,
            np.concatenate([reading, ahead[self._baseline_leads]]), command,
        )  # fmt: skip
        limits, control_dt = self._actions.generator, self._actions.control_dt
        self._u[0] = followed_torque(self._u[0], command[0], control_dt, limits)
        self._u[1] = command[1]
        return tuple(command.tolist())


def policy(name):
    """Return the factory (turbine, control_dt) of the agent "policy:NAME" or "policy:PATH".

    A file with another network for mpc_clone is a compiled law.
    """
    path = policy_path(name.removeprefix(POLICY_PREFIX))
    if is_clone(path):
        return lambda turbine, control_dt: MPCClone(turbine, control_dt, path, name)
    return lambda turbine, control_dt: PolicyController(path, turbine, control_dt, name)
