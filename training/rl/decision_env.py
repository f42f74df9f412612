"""Defines the stable-baselines3 environments for training and validation; one step is one decision."""

import numpy as np
from gymnasium.spaces import Box
from stable_baselines3.common.vec_env import VecEnvWrapper

from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.envs.actions import ACTION_MODES
from fowt_env.envs.decisions import Decisions, wind_entry
from fowt_env.envs.observations import BLADE_CHANNELS, N_ACTIONS
from fowt_env.errors import InputError
from fowt_env.plant.measurement import Measure
from fowt_env.training.evaluation.metrics import STATISTICS, TOWER_EXPONENT, damage_equivalent_load, travel
from fowt_env.training.rl.sb3_env import FowtSB3VecEnv

SETTLED_AFTER = 300.0  # s, after which an episode of steady wind must be at rest
SWING_AFTER = 500.0  # s, after which its blade pitch must be at rest: surge has decayed
KEPT = ("observations", "action", "memory")  # attributes of Decisions that are part of a state
RECORDED_FIELDS = (Measure.ROTOR_SPEED, Measure.PLATFORM_PITCH, Measure.BLADE_PITCH, Measure.GENERATOR_TORQUE)


class DecisionVecEnv(VecEnvWrapper):
    """Wraps a FowtSB3VecEnv so that one step is one decision of DecisionSettings: several control periods.

    The reward is the mean over the control periods of the decision. If an episode ends within a decision, the
    next episode starts at once, with the action in force held until the end of the decision.
    """

    def __init__(self, venv, settings):
        self.base = venv
        self.settings = settings
        self.channels = venv.observation_space.shape[0]
        first = venv.env.envs[0]
        of_blades = [entry.name for entry in first.observed if entry.name in BLADE_CHANNELS]
        if venv.action_space.shape != (N_ACTIONS,) or of_blades:
            seen = ", ".join(of_blades) or "no individual blades"
            raise InputError(
                f"environment: action_mode = {first.action_mode!r}, observation of {seen}: agents are trained"
                " only with collective pitch; use FowtEnv directly"
            )
        wind = wind_entry(settings, ACTION_MODES[first.action_mode], first.observed)
        self.decisions = Decisions(venv.num_envs, self.channels, settings, first.control_dt, wind)
        repeats = settings.history
        low, high = venv.observation_space.low, venv.observation_space.high
        space = Box(
            np.concatenate([low, np.tile(low - high, repeats)]),
            np.concatenate([high, np.tile(high - low, repeats)]),
        )
        super().__init__(venv, observation_space=space)
        self._decision = np.zeros_like(self.decisions.action)

    def _actions_in_force(self):
        return np.array([env.last_action for env in self.base.env.envs])

    def reset(self):
        """Return the features (n, size) at the start of new episodes."""
        observations = self.venv.reset()
        self.decisions.restart(slice(None), observations, self._actions_in_force())
        return self.decisions.features()

    def step_async(self, actions):
        """Store the decisions for step_wait."""
        self._decision = np.array(actions, dtype=np.float64)

    def step_wait(self):
        """Return (features, rewards, dones, infos) after one decision."""
        n, decisions = self.num_envs, self.decisions
        total = np.zeros(n)
        ended = np.zeros(n, dtype=bool)
        infos = None
        for _ in range(self.settings.hold):
            self.venv.step_async(decisions.smooth(self._decision))
            observations, rewards, dones, new = self.venv.step_wait()
            total += np.where(ended, 0.0, rewards)
            infos = (
                new if infos is None else [o if e else i for o, i, e in zip(infos, new, ended, strict=True)]
            )
            for i in np.flatnonzero(dones):
                if not ended[i]:
                    last = infos[i]["terminal_observation"]
                    infos[i]["terminal_observation"] = decisions.last_features(i, last)
                ended[i] = True
                decisions.restart(i, observations[i], self.base.env.envs[i].last_action)
                self._decision[i] = decisions.action[i]
        decisions.append(observations)
        for i in np.flatnonzero(ended):
            decisions.restart(i, observations[i], decisions.action[i])
        return decisions.features(), (total / self.settings.hold).astype(np.float32), ended, infos

    def get_state(self):
        """Return the picklable state of the episodes: plants, histories, actions."""
        return self.base.env.get_state(), *(getattr(self.decisions, name).copy() for name in KEPT)

    def set_state(self, state):
        """Restore a state of get_state; return the features at that state."""
        plants, *kept = state
        self.base.env.set_state(list(plants))
        for name, values in zip(KEPT, kept, strict=True):
            getattr(self.decisions, name)[:] = values
        return self.decisions.features()


class ValidationVecEnv(FowtSB3VecEnv):
    """Runs one environment per fixed validation episode, restarted by every reset, and records it.

    episodes: options of FowtEnv.reset, one dict each. After all episodes have ended once, figures() returns
    the metrics of each episode without its first `skip` seconds.
    Raises: InputError if skip is not less than the duration of an episode.
    """

    def __init__(self, episodes, skip=60.0, **settings):
        super().__init__(len(episodes), **settings)
        self.episodes = [{"offsets": {}} | episode for episode in episodes]
        first = self.env.envs[0]
        duration = first.task.duration
        allowed = f"less than the {duration:g} s of an episode"
        check_number("validation.skip", skip, 0.0, duration, high_open=True, allowed=allowed)
        self.skip = round(skip / first.control_dt)
        self._record = np.full((round(duration / first.control_dt), len(episodes), 4), np.nan)
        self._clock = 0
        self._over = np.zeros(len(episodes), dtype=bool)
        self._failed = np.zeros(len(episodes), dtype=bool)

    def reset(self):
        """Return observations at the start of the fixed episodes, with equal random seeds at every reset."""
        self._seeds = list(range(self.num_envs))
        self._options = [dict(episode) for episode in self.episodes]
        self._record[:], self._clock = np.nan, 0
        self._over[:] = self._failed[:] = False
        return super().reset()

    def step_wait(self):
        """Step as FowtSB3VecEnv does and record the measurements of each environment's first episode."""
        result = super().step_wait()
        _, _, dones, infos = result
        for i in np.flatnonzero(dones & ~self._over):
            self._failed[i] = not infos[i]["TimeLimit.truncated"]
        self._over |= dones
        if self._clock < len(self._record):
            row = np.array([env.view().measurement for env in self.env.envs])[:, RECORDED_FIELDS]
            self._record[self._clock, ~self._over] = row[~self._over]
        self._clock += 1
        return result

    def figures(self):
        """Return {metric: (n,)} of the recorded episodes by evaluation.metrics; NaN for failed episodes.

        Metrics are computed from measurable quantities at the control periods; power is shaft power, before
        generator losses. The offset of the mean rotor speed from rated is over the time after SETTLED_AFTER,
        the peak-to-peak swing of the blade pitch over the time after SWING_AFTER.
        """
        record = np.where(self._failed[:, None], np.nan, self._record[self.skip : self._clock - 1])
        speed, platform_pitch, blade_pitch, torque = np.moveaxis(record, 2, 0)
        first, mean, std = self.env.envs[0], STATISTICS["mean"].of, STATISTICS["std"].of
        time = first.control_dt * np.arange(len(record))
        turbine = first.scene.turbine
        gear, rated = turbine.drivetrain.gear_ratio, turbine.torque_law.rated_power
        power = speed * torque * gear * 1e-3
        # low-speed shaft torque: generator torque plus acceleration of the generator inertia
        acceleration = np.gradient(speed, first.control_dt, axis=0) if len(speed) > 1 else 0.0 * speed
        shaft = gear * (torque + gear * turbine.drivetrain.generator_inertia * acceleration) * 1e-3
        settled, still = (self._after(record, start) for start in (SETTLED_AFTER, SWING_AFTER))
        offset = mean(settled[:, :, 0]) / turbine.rated_rotor_speed - 1.0
        return {
            "rotor_speed_std_[rpm]": std(speed / RPM),
            "platform_pitch_std_[deg]": std(platform_pitch / DEGREE),
            "blade_pitch_travel_[deg/s]": travel(time, blade_pitch / DEGREE),
            "shaft_power_mean_[kW]": mean(power),
            "shaft_power_std_[kW]": std(power),
            "capped_power_mean_[kW]": mean(np.minimum(power, 1e-3 * rated)),
            "torque_travel_[kN-m/s]": travel(time, 1e-3 * torque),
            "shaft_torque_DEL_[kN-m]": np.array(
                [damage_equivalent_load(series, time[-1], TOWER_EXPONENT) for series in shaft.T]
            ),
            "rotor_speed_offset_[%]": 100.0 * np.abs(offset),
            "blade_pitch_swing_[deg]": np.ptp(still[:, :, 2], axis=0) / DEGREE,
            "failed": self._failed.astype(float),
        }

    def _after(self, record, start):
        """Return the rows of the record from a time of the episode on, s; one row of NaN without any."""
        rows = record[max(0, round(start / self.env.envs[0].control_dt) - self.skip) :]
        return rows if len(rows) else np.full((1, *record.shape[1:]), np.nan)
