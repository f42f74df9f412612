"""Controllers for tests: a built-in law without its kernel, and laws that keep all that they are given."""

from math import cos, pi

from fowt_env.control import CompiledController
from fowt_env.controllers import make
from fowt_env.plant.compile.decorators import control_kernel
from fowt_env.plant.measurement import N_BLADE_MEASUREMENTS, N_MEASUREMENTS

TORQUE, PITCH = 43093.55, 0.26


class Delegate:
    """The law of a compiled controller, called from Python; keeps what it reads."""

    def __init__(self, turbine, control_dt, name="pi"):
        self.inner = make(name, turbine, control_dt)
        self.information = (*self.inner.information, "blade_pitch", "platform_pitch")
        self.read = []

    def prepare(self, scene):
        self.inner.prepare(scene)

    def reset(self, measurement):
        self.inner.reset(measurement)

    def act(self, measurement):
        m = measurement
        self.read.append((m.time, m.generator_speed, m.blade_pitch, m.platform_pitch))
        return self.inner.act(measurement)


@control_kernel
def remember(parameters, memory, measurement, command):
    """Keep each reading and the command in force, and command TORQUE and PITCH, turning with the azimuth."""
    size, commands, leads = int(parameters[0]), int(parameters[1]), int(parameters[2])
    place = 1 + int(memory[0]) * (size + commands)
    memory[0] += 1.0
    for i in range(size):
        memory[place + i] = measurement[i]
    for i in range(commands):
        memory[place + size + i] = command[i]
    command[0], command[1] = parameters[3], parameters[4]
    if commands > 2:
        azimuth = measurement[22 + leads]
        for blade in range(3):
            command[1 + blade] = parameters[4] + parameters[5] * cos(azimuth + 2.0 * pi * blade / 3.0)


class Recorder(CompiledController):
    """A compiled law that keeps what it reads.

    cycle: rad, of one that commands the pitch of each blade; leads: number of values of a lidar.
    """

    kernel = staticmethod(remember)

    def __init__(self, information, preview_times=(), calls=60, cycle=None, leads=None):
        self.information, self.preview_times = tuple(information), tuple(preview_times)
        self.individual = cycle is not None
        commands, leads = 4 if self.individual else 2, leads or len(self.preview_times)
        size = N_MEASUREMENTS + leads + N_BLADE_MEASUREMENTS * self.individual
        parameters = [size, commands, leads, TORQUE, PITCH, cycle or 0.0]
        super().__init__("recorder", parameters, 1 + calls * (size + commands))
        self.shape = calls, size + commands

    def reset(self, measurement):
        self.first = measurement
        self.memory[:] = 0.0

    def seen(self, memory=None):
        """(calls, readings and the command in force), of its own memory or of a copy's."""
        memory = self.memory if memory is None else memory
        return memory[1:].reshape(self.shape)[: int(memory[0])]
