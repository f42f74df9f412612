"""Checks the units of a controller's commands."""

import warnings
from math import pi
from typing import Any

import numpy as np

from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import PlantWarning, level_outside

# Thresholds for commands in wrong units (kN m, MW, degrees) that last a second: fractions of rated torque,
# and of rated rotor speed, near which a torque in N m is above a hundredth of rated torque, or zero.
LITTLE_TORQUE, MUCH_TORQUE, TURNING = 0.01, 2.0, 0.9


class CommandUnits:
    """Warns once of commands that are implausible in rad and N m for a second."""

    def __init__(self, who: str, turbine: Any, control_dt: float) -> None:
        self._who = who
        self._rated = turbine.torque_law.rated_torque
        self._few, self._many = LITTLE_TORQUE * self._rated, MUCH_TORQUE * self._rated
        self._turning = TURNING * turbine.rated_rotor_speed
        self._needed = max(1, round(1.0 / control_dt))
        self._count = 0
        self.said = ""  # text of the warning, once issued

    def see(self, torque: float, blade_pitch: float, rotor_speed: float) -> None:
        """Check the command (N m, rad) of one control period at a rotor speed (rad/s)."""
        if -pi <= blade_pitch <= pi and (self._few <= torque <= self._many or torque <= 0.0):
            self._count = 0
        elif -pi <= blade_pitch <= pi and torque < self._few and rotor_speed <= self._turning:
            self._count = 0
        else:
            self._count += 1
            if self._count >= self._needed:
                self.warn(torque, blade_pitch)

    def is_little(self, torque: float) -> bool:
        """Return whether a torque (N m) is positive but implausibly small for a command in N m."""
        return 0.0 < torque < self._few

    def see_run(self, torque: np.ndarray, rotor_speed: np.ndarray, period: float) -> None:
        """Check the torque in force (n,) N m of a whole run, recorded every period (s)."""
        few = (torque > 0.0) & (torque < self._few) & (rotor_speed > self._turning)
        if np.count_nonzero(few) * period >= 1.0:
            self.warn(float(torque[few][0]), 0.0)

    def warn(self, torque: float, blade_pitch: float) -> None:
        """Issue the warning about a command (N m, rad), once."""
        if self.said:
            return
        if not -pi <= blade_pitch <= pi:
            text = f"blade pitch {blade_pitch:.3g} rad = {blade_pitch / DEGREE:.0f} deg"
        else:
            percent = 100.0 * torque / self._rated
            text = f"generator torque {torque:.4g} N m, {percent:.3g} % of the rated {self._rated:.0f} N m"
        self.said = (
            f"{self._who}: commanded {text}; commands are (generator torque in N m on the high-speed shaft,"
            " blade pitch in rad)"
        )
        warnings.warn(self.said, PlantWarning, stacklevel=level_outside())
