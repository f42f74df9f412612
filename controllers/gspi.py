"""Defines Jonkman's gain-scheduled PI controllers of the NREL 5 MW turbine at their published sampling.

Sources: NREL/TP-500-38060 (land: constant power above rated) and NREL/TP-500-47535 (OC3-Hywind: detuned
gains, constant torque above rated). The published laws run at every step of FAST, 0.0125 s. With a longer
control_dt the law runs periods of at most SAMPLING with speeds interpolated between the last two
measurements, so that filter, integral and rate limits are those of the published sampling; commands change
at control instants.

One difference: the blade-pitch rate is limited relative to the last command, in the published code relative
to the measured pitch, which with an actuator lag of 0.2 s would limit the blades to 0.5 deg/s
(controllers/openfast_baseline.py follows the published code, for the deck without an actuator).
"""

from math import ceil, isnan, nan

from fowt_env.control import check_control_dt
from fowt_env.controllers.pi import END, PI, Memory, PISettings, pi_step
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.measurement import Measure

SAMPLING = 0.0125  # s, longest period of the law


PERIODS = END  # parameter in addition to those of the PI law: law periods in one control_dt
LAST_SPEED = len(Memory)  # additional memory entry: generator speed of the last call, rad/s; NaN: no call yet


@control_kernel
def gspi_law(parameters, memory, measurement, command):
    """Advance the PI law by one control_dt in shorter periods, interpolating the measured speed linearly."""
    periods = int(parameters[PERIODS])
    speed, pitch = measurement[Measure.GENERATOR_SPEED], measurement[Measure.BLADE_PITCH]
    last = memory[LAST_SPEED]
    if isnan(last):  # first call: no time has elapsed
        periods, last = 1, speed
    for k in range(1, periods + 1):
        fraction = k / periods
        pi_step(parameters, memory, (1.0 - fraction) * last + fraction * speed, pitch, command)
    memory[LAST_SPEED] = speed


class GSPI(PI):
    """Implements the gain-scheduled PI of a PISettings in periods of at most SAMPLING per control_dt."""

    kernel = staticmethod(gspi_law)

    def __init__(self, settings, control_dt, name="gspi"):
        control_dt = check_control_dt(control_dt)
        self.periods = max(1, ceil(control_dt / SAMPLING - 1e-9))
        super().__init__(settings, control_dt / self.periods, name, 1, [self.periods])

    def reset(self, measurement):
        """Initialise as PI.reset: act() on the same measurement commands the measured blade pitch."""
        super().reset(measurement)
        self.memory[LAST_SPEED] = nan


def gspi_oc3(turbine, control_dt):
    """Apply Jonkman's gain-scheduled PI for OC3-Hywind: detuned, constant torque above rated."""
    return GSPI(PISettings.published(turbine), control_dt, "gspi_oc3")


def gspi_land(turbine, control_dt):
    """Apply Jonkman's gain-scheduled PI for land: constant power above rated. For comparison only."""
    return GSPI(PISettings.published(turbine, "land", "constant_power"), control_dt, "gspi_land")
