"""Defines a controller with constant commands: specified values or those measured at the start."""

from enum import IntEnum

import numpy as np

from fowt_env.control import CompiledController, check_control_dt
from fowt_env.descriptions.checks import check_number
from fowt_env.plant.compile.decorators import control_kernel


class Memory(IntEnum):
    """Enumerates the entries of the law's memory array."""

    TORQUE_COMMAND = 0  # N m, high-speed shaft
    PITCH_COMMAND = 1  # rad


@control_kernel
def constant_law(parameters, memory, measurement, command):
    """Command the torque and blade pitch stored in memory."""
    command[0] = memory[Memory.TORQUE_COMMAND]
    command[1] = memory[Memory.PITCH_COMMAND]


class Constant(CompiledController):
    """Commands constant generator torque and blade pitch; None: the value measured at reset.

    Raises: InputError for a value that is not finite.
    """

    kernel = staticmethod(constant_law)
    information = ("generator_torque", "blade_pitch")

    def __init__(self, torque=None, blade_pitch=None, name="constant"):
        for key, value in (("torque", torque), ("blade_pitch", blade_pitch)):
            if value is not None:
                check_number(key, value, allowed="finite, or None for the measured one")
        super().__init__(name, np.zeros(0), len(Memory))
        self.torque = torque
        self.blade_pitch = blade_pitch

    def reset(self, measurement):
        """Store the commands, using the measured value for each that is None."""
        torque, pitch = self.torque, self.blade_pitch
        self.memory[Memory.TORQUE_COMMAND] = measurement.generator_torque if torque is None else torque
        self.memory[Memory.PITCH_COMMAND] = measurement.blade_pitch if pitch is None else pitch


def constant(turbine, control_dt):
    """Hold the generator torque and blade pitch measured at the start."""
    check_control_dt(control_dt)
    return Constant()
