"""Check of the units of a controller's commands."""

import warnings
from math import pi
from typing import Any

import numpy as np

from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import PlantWarning, level_outside

# A command above these for a second is in other units: kN m, MW or degrees. Of rated torque, and of
# rated rotor speed: close to it a law that means N m has more than a hundredth of rated torque, or none.
LITTLE_TORQUE, MUCH_TORQUE, TURNING = 0.01, 2.0, 0.9


class CommandUnits:
    """Warns once of commands that can hardly be in rad and N m, when they have been so for a second."""

    def __init__(self, who: str, turbine: Any, control_dt: float) -> None:
        self._who = who
        self._rated = turbine.torque_law.rated_torque
        self._few, self._many = LITTLE_TORQUE * self._rated, MUCH_TORQUE * self._rated
        self._turning = TURNING * turbine.rated_rotor_speed
        self._needed = max(1, round(1.0 / control_dt))
        self._count = 0
        self.said = ""  # the warning, once there was one

    def see(self, torque: float, blade_pitch: float, rotor_speed: float) -> None:
        """Take note of the command (N m, rad) of one control period at a rotor speed (rad/s)."""
        if -pi <= blade_pitch <= pi and (self._few <= torque <= self._many or torque <= 0.0):
            self._count = 0
        elif -pi <= blade_pitch <= pi and torque < self._few and rotor_speed <= self._turning:
            self._count = 0
        else:
            self._count += 1
            if self._count >= self._needed:
                self.warn(torque, blade_pitch)

    def is_little(self, torque: float) -> bool:
        """Whether a torque (N m) is one that a law in N m has for moments at most."""
        return 0.0 < torque < self._few

    def see_run(self, torque: np.ndarray, rotor_speed: np.ndarray, period: float) -> None:
        """Take note of the torque in force (n,) N m of a whole run, recorded every period (s)."""
        few = (torque > 0.0) & (torque < self._few) & (rotor_speed > self._turning)
        if np.count_nonzero(few) * period >= 1.0:
            self.warn(float(torque[few][0]), 0.0)

    def warn(self, torque: float, blade_pitch: float) -> None:
        """Say what was commanded, once."""
        if self.said:
            return
        if not -pi <= blade_pitch <= pi:
            said = f"blade pitch {blade_pitch:.3g} rad = {blade_pitch / DEGREE:.0f} deg"
        else:
            share = 100.0 * torque / self._rated
            said = f"generator torque {torque:.4g} N m, {share:.3g} % of the rated {self._rated:.0f} N m"
        self.said = (
            f"{self._who}: commanded {said}; commands are (generator torque in N m on the high-speed shaft,"
            " blade pitch in rad)"
        )
        warnings.warn(self.said, PlantWarning, stacklevel=level_outside())
