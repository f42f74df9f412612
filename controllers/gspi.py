"""Defines Jonkman's gain-scheduled PI controllers of the NREL 5 MW turbine at their published sampling.

Sources: NREL/TP-500-38060 (land: constant power above rated) and NREL/TP-500-47535 (OC3-Hywind: detuned
gains, constant torque above rated). The published laws run at every step of FAST, 0.0125 s. With a longer
control_dt the law runs periods of at most SAMPLING on the line through the last two measured speeds, so that
filter, integral and rate limits are those of the published sampling; commands change at control instants.

One difference: the rate limit of the blade pitch counts from the last command, in the published code from
the measured pitch, which with an actuator lag of 0.2 s would limit the blades to 0.5 deg/s
(controllers/openfast_baseline.py does so, for the deck without an actuator).
"""

from math import ceil, isnan, nan

from fowt_env.control import check_control_dt
from fowt_env.controllers.pi import END, PI, Memory, PISettings, pi_step
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.measurement import Measure

SAMPLING = 0.0125  # s, longest period of the law itself


PERIODS = END  # parameter beyond those of the PI law: of the law in one control_dt
LAST_SPEED = len(Memory)  # memory beyond that of it: generator speed of the last call, rad/s; NaN: none yet


@control_kernel
def gspi_law(parameters, memory, measurement, command):
    """One control_dt: the PI law at its own periods, on the line from the last to this measured speed."""
    periods = int(parameters[PERIODS])
    speed, pitch = measurement[Measure.GENERATOR_SPEED], measurement[Measure.BLADE_PITCH]
    last = memory[LAST_SPEED]
    if isnan(last):  # the first call: no time has passed yet
        periods, last = 1, speed
    for k in range(1, periods + 1):
        fraction = k / periods
        pi_step(parameters, memory, (1.0 - fraction) * last + fraction * speed, pitch, command)
    memory[LAST_SPEED] = speed


class GSPI(PI):
    """Gain-scheduled PI of a PISettings with periods of at most SAMPLING inside each control_dt."""

    kernel = staticmethod(gspi_law)

    def __init__(self, settings, control_dt, name="gspi"):
        control_dt = check_control_dt(control_dt)
        self.periods = max(1, ceil(control_dt / SAMPLING - 1e-9))
        super().__init__(settings, control_dt / self.periods, name, 1, [self.periods])

    def reset(self, measurement):
        """Start so that act() on this same measurement commands the measured blade pitch, as PI.reset."""
        super().reset(measurement)
        self.memory[LAST_SPEED] = nan


def gspi_oc3(turbine, control_dt):
    """Jonkman's gain-scheduled PI with the OC3-Hywind changes: detuned, constant torque above rated."""
    return GSPI(PISettings.published(turbine), control_dt, "gspi_oc3")


def gspi_land(turbine, control_dt):
    """Jonkman's gain-scheduled PI as published for land: constant power above rated. For comparison only."""
    return GSPI(PISettings.published(turbine, "land", "constant_power"), control_dt, "gspi_land")
