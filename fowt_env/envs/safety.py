"""Safe learning: costs of passing limits, and a guard that takes over from an agent."""

from math import isfinite, pi
from typing import Any

import gymnasium

from fowt_env.control import check_pitches, known_scene
from fowt_env.descriptions.checks import is_number
from fowt_env.envs.assembly import named_baseline
from fowt_env.errors import InputError, unknown
from fowt_env.plant.measurement import Measure, Measurement

AHEAD = 1.0  # s: the rotor speed is checked where it will be, since feathering takes its time


class SafetyCosts(gymnasium.Wrapper):
    """FowtEnv with costs of exceeded limits in its info, in the convention of Safety-Gymnasium.

    env       a FowtEnv, wrapped or not
    limits    {field of Measurement: the largest absolute value that costs nothing, SI}, as rotor_speed=1.4
              (rad/s), platform_pitch=0.1 (rad), nacelle_acceleration=2.0 (m/s2)

    info of each step has "cost_<field>" of each limit, 1.0 where the true motion at the end of the step
    exceeds it and else 0.0, and "cost", their sum. The reward is unchanged.

    Raises: InputError for unknown fields and limits that are not positive numbers.
    """

    def __init__(self, env: gymnasium.Env, **limits: float) -> None:
        super().__init__(env)
        if not limits:
            raise InputError("SafetyCosts: give a limit, such as rotor_speed=1.4 (rad/s)")
        known = [name for name in Measurement._fields if name != "time"]
        for name, limit in limits.items():
            if name not in known:
                raise unknown("limit of SafetyCosts", name, known)
            if not is_number(limit) or not limit > 0.0:
                raise InputError(f"{name} = {limit!r}: must be a finite number above 0")
        self.limits = {name: float(limit) for name, limit in limits.items()}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """As the environment's, with the costs in info."""
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
    """FowtEnv in which a baseline controller takes over for a while when a limit is passed.

    env             a FowtEnv, wrapped or not
    overspeed       rotor speed over rated, AHEAD of now as it accelerates, that hands over; while it lasts,
                    the blades are feathered as fast as their drive can
    platform_rate   platform-pitch rate (deg/s), either way, that hands over
    calm            s that both must stay within `release` of their limits (rotor speed: of the way from
                    rated to the limit) before the agent has the turbine back
    baseline        name of the compiled controller that takes over

    The agent's actions are ignored meanwhile; observations and rewards continue. info of each step has
    "guarded" (bool, whether this period was the guard's) and "guarded_periods" (of the episode so far).

    Raises: InputError for limits that cannot be used.
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
        # a command this far ahead of the blades keeps a first-order drive at its limit until the next one
        self._feather = drive.rate_limit * (drive.lag + plant.control_dt)
        self._highest = drive.maximum
        self._last_speed = None
        self._left = 0  # control periods until the agent has the turbine back; 0: it has
        self.guarded_periods = 0

    def reset(self, **options):
        """As the environment's; the agent has the turbine."""
        observation, info = self.env.reset(**options)
        self._baseline.prepare(known_scene(self.env.unwrapped.design_scene, self._baseline))
        self._left = 0
        self._last_speed = None
        self.guarded_periods = 0
        return observation, info

    def step(self, action):
        """One control period under the action, or under the guard's command."""
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
        """Rotor speed (rad/s) AHEAD of now; a falling one counts as it is."""
        last = speed if self._last_speed is None else self._last_speed
        self._last_speed = speed
        return speed + AHEAD * max(0.0, speed - last) / self.env.unwrapped.control_dt
