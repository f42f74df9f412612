"""Defines the stable-baselines3 environment for validation, which records its episodes."""

import numpy as np

from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.training.evaluation.metrics import STATISTICS, TOWER_EXPONENT, damage_equivalent_load, travel
from fowt_env.training.rl.sb3_env import FowtSB3VecEnv

SETTLED_AFTER = 300.0  # s, after which an episode of steady wind must be at rest
SWING_AFTER = 500.0  # s, after which its blade pitch must be at rest: surge has decayed
RECORDED = ("RotSpeed", "PtfmPitch", "BldPitch1", "GenTq")  # channels


class ValidationVecEnv(FowtSB3VecEnv):
    """Runs one environment per fixed validation episode, restarted by every reset, and records it.

    episodes: options of FowtEnv.reset, one dict each. After all episodes have ended once, figures() returns
    the metrics of each episode without its first `skip` seconds.
    Raises: InputError if skip is not less than the duration of an episode.
    """

    def __init__(self, episodes, skip=60.0, **settings):
        super().__init__(len(episodes), record=True, **settings)
        self.episodes = [{"offsets": {}} | episode for episode in episodes]
        first = self.env.envs[0]
        duration = first.task.duration
        allowed = f"less than the {duration:g} s of an episode"
        check_number("validation.skip", skip, 0.0, duration, high_open=True, allowed=allowed)
        self.skip = round(skip / first.control_dt)
        periods = round(duration / first.control_dt)
        self._record = np.full((periods + 1, len(episodes), len(RECORDED)), np.nan)
        self._over = np.zeros(len(episodes), dtype=bool)
        self._failed = np.zeros(len(episodes), dtype=bool)

    @property
    def over(self):
        """Return whether every episode has ended."""
        return bool(self._over.all())

    def reset(self):
        """Return observations at the start of the fixed episodes, with equal random seeds at every reset."""
        self._seeds = list(range(self.num_envs))
        self._options = [dict(episode) for episode in self.episodes]
        self._record[:] = np.nan
        self._over[:] = self._failed[:] = False
        return super().reset()

    def step_wait(self):
        """Step as FowtSB3VecEnv does and keep the rows of the first episode of each environment."""
        result = super().step_wait()
        _, _, dones, infos = result
        for i in np.flatnonzero(dones & ~self._over):
            self._failed[i] = not infos[i]["TimeLimit.truncated"]
            env = self.env.envs[i]
            names = [channel.name for channel in env.scene.channels]
            # the next episode has begun, but has stored no row
            self._record[:, i] = env.rows[:, [names.index(name) for name in RECORDED]]
        self._over |= dones
        return result

    def figures(self):
        """Return {metric: (n,)} of the recorded episodes by evaluation.metrics; NaN for failed episodes.

        Metrics are computed from outputs at the control periods; power is shaft power, before
        generator losses. The offset of the mean rotor speed from rated is over the time after SETTLED_AFTER,
        the peak-to-peak swing of the blade pitch over the time after SWING_AFTER.
        """
        record = np.where(self._failed[:, None], np.nan, self._record[self.skip :])
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
