"""Lets a controller that is not compiled, a Python class or a library, be the baseline of an environment."""

import numpy as np

from fowt_env.control import CompiledController
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.state import N_COMMANDS, N_INDIVIDUAL_COMMANDS


@control_kernel
def stored_command(parameters, memory, measurement, command):
    """Command what the controller has returned for this control period."""
    for i in range(memory.shape[0]):
        command[i] = memory[i]


class ExternalBaseline(CompiledController):
    """Gives the command of a CheckedController, asked once in a control period, to the compiled loop."""

    kernel = staticmethod(stored_command)

    def __init__(self, controller):
        self.individual = controller.individual
        size = N_INDIVIDUAL_COMMANDS if self.individual else N_COMMANDS
        super().__init__(controller.name, np.zeros(0), size)
        self.controller, self.information = controller, controller.information
        self.preview_times, self.declared = controller.preview_times, controller.declared

    def prepare(self, scene):
        """Pass the scene of the episode to the controller."""
        self.controller.prepare(scene)

    def reset(self, measurement):
        """Reset the controller."""
        self.controller.reset(measurement)

    def act(self, measurement):
        """Return the controller's command."""
        return self.controller.act(measurement)

    def ask(self, measurement):
        """Store the controller's command for the control period that begins."""
        self.memory[:] = self.controller.act(measurement)

    def finish(self):
        """End the controller's run."""
        self.controller.finish()
