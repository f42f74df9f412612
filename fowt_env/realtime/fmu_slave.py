"""Implements the plant that an FMU of fowt connect fmu runs; imported where the FMU is loaded."""

import json
from pathlib import Path

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Initial, Fmi2Slave, Real

from fowt_env.errors import InputError
from fowt_env.realtime.fmu import PLANT

COMMAND = "command."  # of the names of inputs: an output GenTq exists too
HELD: list[dict] = []  # globals of the modules of FMUs, see fowt_env.realtime.fmu.SOURCE
EVEN = 1e-6  # largest deviation of a communication step from whole control periods, as a fraction of one


class FloatingTurbine(Fmi2Slave):
    """Advances a SteppedRun in communication steps of whole control periods.

    Inputs are the commands, held for a step; outputs are the channels at its end, before the next command.
    A step fails after the end of the run, and for a plant that cannot continue.
    """

    author = "fowt_env"
    license = "Apache-2.0"
    description = "Floating wind turbine with its platform, mooring, wind and waves, without a controller"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self._described = json.loads((Path(self.resources) / PLANT).read_text(encoding="utf-8"))
        self._commands = list(self._described["start"])
        self._values = list(self._described["values"])
        self._plant = None
        self._start = 0.0
        run = self._described["run"]
        self.default_experiment = DefaultExperiment(0.0, run["duration"], run["control_dt"])
        for number, column in enumerate(self._described["commands"]):
            name, unit = column.rstrip("]").split("_[")
            self._register(COMMAND + name, f"command, {unit}", self._commands, number, Fmi2Causality.input)
        for number, (name, unit, meaning) in enumerate(self._described["outputs"]):
            words = f"{meaning}, {unit}" if meaning else unit
            self._register(name, words, self._values, number, Fmi2Causality.output)

    def _register(self, name, description, values, number, causality):
        def write(value):
            values[number] = value

        output = causality == Fmi2Causality.output
        initial = Fmi2Initial.exact if output else None
        self.register_variable(
            Real(
                name, description=description, causality=causality, initial=initial,
                getter=lambda: values[number], setter=None if output else write,
            ),
            nested=False,
        )  # fmt: skip

    def setup_experiment(self, start_time, stop_time, tolerance):
        """Store the time at which the run begins."""
        self._start = start_time

    def enter_initialization_mode(self):
        """Build the plant at its initial conditions."""
        from fowt_env import __version__, build_scene
        from fowt_env.run.stepped import SteppedRun

        if self._described["fowt_env"] != __version__:
            raise InputError(
                f"the FMU was written by fowt_env {self._described['fowt_env']}; installed is {__version__}"
            )
        self._plant = SteppedRun(build_scene(**self._described["scene"]), **self._described["run"])
        self._values[:] = self._plant.channels().tolist()

    def do_step(self, current_time, step_size):
        """Advance by a communication step under the present inputs.

        Raises: InputError for a step of other than whole control periods, or at another time than the
        plant's; SimulationStopped. PythonFMU logs the message and reports the status of an error.
        """
        plant = self._plant
        periods = step_size / plant.control_dt
        count = round(periods)
        if count < 1 or abs(periods - count) > EVEN:
            raise InputError(
                f"step of {step_size:g} s: must be whole control periods of {plant.control_dt:g} s"
            )
        if abs(current_time - self._start - plant.time) > EVEN * plant.control_dt:
            raise InputError(f"step from {current_time:g} s: the plant is at {self._start + plant.time:g} s")
        for _ in range(count):
            plant.advance(self._commands)
        self._values[:] = plant.channels().tolist()
        return True
