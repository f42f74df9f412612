"""Provides wrappers for safe learning: costs of exceeded limits, and a takeover by a baseline controller."""

from math import isfinite, pi
from typing import Any

import gymnasium

from fowt_env.control import check_pitches, known_scene
from fowt_env.descriptions.checks import is_number
from fowt_env.envs.assembly import named_baseline
from fowt_env.errors import InputError, unknown
from fowt_env.plant.measurement import Measure, Measurement

AHEAD = 1.0  # s, extrapolation of rotor speed for the overspeed check, because feathering takes time


class SafetyCosts(gymnasium.Wrapper):
    """Adds costs of exceeded limits to the info of a FowtEnv, in the convention of Safety-Gymnasium.

    env       a FowtEnv, wrapped or not
    limits    {field of Measurement: largest absolute value with zero cost, SI}, such as rotor_speed=1.4
              (rad/s), platform_pitch=0.1 (rad), nacelle_acceleration=2.0 (m/s2)

    info of each step has "cost_<field>" of each limit (1.0 if the true motion at the end of the step exceeds
    the limit, otherwise 0.0) and "cost", the sum of these costs. The reward is unchanged.

    Raises: InputError for unknown fields and limits that are not positive numbers.
    """

    def __init__(self, env: gymnasium.Env, **limits: float) -> None:
        super().__init__(env)
        if not limits:
            raise InputError("SafetyCosts: needs a limit, such as rotor_speed=1.4 (rad/s)")
        known = [name for name in Measurement._fields if name != "time"]
        for name, limit in limits.items():
            if name not in known:
                raise unknown("limit of SafetyCosts", name, known)
            if not is_number(limit) or not limit > 0.0:
                raise InputError(f"{name} = {limit!r}: must be a finite number above 0")
        self.limits = {name: float(limit) for name, limit in limits.items()}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance the environment by one step; return its result with the costs in info."""
        result = self.env.step(action)
        plant: Any = self.env.unwrapped
        reached = plant.true_measurement()
        costs = {
            f"cost_{name}": float(abs(reached[Measure[name.upper()]]) > limit)
            for name, limit in self.limits.items()
        }
        result[-1].update(costs, cost=sum(costs.values()))
        return result


class SafetyLayer(gymnasium.Wrapper):
    """Lets a baseline controller take over from the agent for a time when a limit is exceeded.

    env             a FowtEnv, wrapped or not
    overspeed       rotor speed over rated, extrapolated by AHEAD, above which the baseline takes over; while
                    above, the blades are feathered at the rate limit
    platform_rate   absolute platform-pitch rate (deg/s) above which the baseline takes over
    calm            s for which both must stay within `release` times their limits (rotor speed: this
                    fraction of the range from rated to the limit) before the agent regains control
    baseline        name of the compiled controller that takes over

    During a takeover the agent's actions are ignored; observations and rewards continue. info of each step
    has "guarded" (bool, whether the baseline had control) and "guarded_periods" (count in the episode).

    Raises: InputError for invalid limits.
    """

    def __init__(self, env, overspeed=1.2, platform_rate=1.2, calm=10.0, release=0.5, baseline="gspi_oc3"):
        super().__init__(env)
        for name, value, low in (("overspeed", overspeed, 1.0), ("platform_rate", platform_rate, 0.0)):
            if not (isfinite(value) and value > low):
                raise InputError(f"{name} = {value!r}: must be finite and above {low:g}")
        if not (isfinite(calm) and calm >= 0.0):
            raise InputError(f"calm = {calm!r}: must be 0 or more seconds")
        if not 0.0 < release <= 1.0:
            raise InputError(f"release = {release!r}: must be in (0, 1]")
        plant = env.unwrapped
        rated = plant.scene.turbine.rated_rotor_speed
        self._fastest = overspeed * rated
        self._slow = rated + release * (overspeed - 1.0) * rated
        self._steepest = platform_rate * pi / 180.0
        self._gentle = release * self._steepest
        self._calm = round(calm / plant.control_dt)
        self._baseline = named_baseline(baseline, plant.design_scene.turbine, plant.control_dt)
        check_pitches(self._baseline, plant.scene.model.pitches is not None)
        drive = plant.scene.turbine.pitch_drive
        # this command lead keeps a first-order pitch drive at its rate limit until the next command
        self._feather = drive.rate_limit * (drive.lag + plant.control_dt)
        self._highest = drive.maximum
        self._last_speed = None
        self._left = 0  # control periods until the agent regains control; 0: the agent has control
        self.guarded_periods = 0

    def reset(self, **options):
        """Reset the environment and return its result; the agent has control."""
        observation, info = self.env.reset(**options)
        self._baseline.prepare(known_scene(self.env.unwrapped.design_scene, self._baseline))
        self._left = 0
        self._last_speed = None
        self.guarded_periods = 0
        return observation, info

    def step(self, action):
        """Advance one control period under the action, or under the baseline's command."""
        plant = self.env.unwrapped
        measured = plant.measurement(self._baseline.preview_times)
        speed, rate = self._projected(measured.rotor_speed), abs(measured.platform_pitch_rate)
        if speed > self._fastest or rate > self._steepest:
            if self._left == 0:
                self._baseline.reset(measured)
            self._left = max(self._calm, 1)
        elif self._left > 0 and speed < self._slow and rate < self._gentle:
            self._left -= 1
            if self._left == 0:
                plant.restart_loops()
        guarded = self._left > 0
        if guarded:
            torque, *pitches = self._baseline.act(measured)
            if speed > self._fastest:
                low = measured.blade_pitch + self._feather
                pitches = [min(max(blade_pitch, low), self._highest) for blade_pitch in pitches]
                self._baseline.reset(measured)  # continues from the present pitch
            self.guarded_periods += 1
            result = plant.step_physical(torque, *pitches)
        else:
            result = self.env.step(action)
        info = result[-1]
        info["guarded"] = guarded
        info["guarded_periods"] = self.guarded_periods
        return result

    def _projected(self, speed):
        """Return the rotor speed (rad/s) extrapolated by AHEAD; a falling speed is returned unchanged."""
        last = speed if self._last_speed is None else self._last_speed
        self._last_speed = speed
        return speed + AHEAD * max(0.0, speed - last) / self.env.unwrapped.control_dt
