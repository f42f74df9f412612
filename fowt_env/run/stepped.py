"""Advances a run by single control periods under commands from outside, in OpenFAST units."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
import pandas as pd

from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.loop.protection import Stop
from fowt_env.plant.advance import output
from fowt_env.plant.state import BLADES, Command
from fowt_env.run.simulation import build_run
from fowt_env.scene.scene import Scene

TORQUE, PITCH = "GenTq_[kN-m]", "BlPitchC{}_[deg]"  # commands, by the names of ServoDyn's outputs
KILO = 1e3


class Outside:
    """Takes the place of a controller in a run whose commands come from outside."""

    name = "outside"
    information = ()

    def __init__(self, individual: bool) -> None:
        self.individual = individual

    def reset(self, measurement: Any) -> None:
        """Do nothing: the run has no control law."""

    def act(self, measurement: Any) -> tuple[float, ...]:
        """Raise RuntimeError: SteppedRun.advance has the commands."""
        raise RuntimeError("the commands of this run come from outside")


class SteppedRun:
    """Advances a run by control periods, with the rows of simulate under the same commands.

    At a control instant `channels()` are the outputs before the command of the period; `advance` applies a
    command for one period. Generator-torque limits, actuators, protection and faults act as in simulate.

    scene, duration (s), control_dt (s) and settings (dt, initial, protection, faults) as in simulate; rows
    are stored every control period. Raises: InputError as simulate.
    """

    def __init__(self, scene: Scene, duration: float, control_dt: float = 0.1, **settings: Any) -> None:
        individual = scene.model.pitches is not None
        periods = {"control_dt": control_dt, "output_dt": control_dt}
        self._run = build_run(scene, Outside(individual), duration, **periods, **settings)
        self._run.rows.fill(0.0)  # pages of memory are mapped now, not during the run
        self.scene = self._run.scene
        self.control_dt = float(control_dt)
        pitches = range(1, BLADES + 1) if individual else (1,)
        self.command_columns = (TORQUE, *(PITCH.format(blade) for blade in pitches))
        self._factors = (KILO, *(DEGREE for _ in pitches))
        self._row = np.empty((1, len(self.scene.channels)))
        self._step = 0
        self._frame: pd.DataFrame | None = None  # once asked for: its rows are those of the run in place
        self.is_stopping = bool(self._run.begin(0))

    @property
    def time(self) -> float:
        """Return the time of the present control instant, s."""
        return self._step * self._run.schedule.dt

    @property
    def periods(self) -> int:
        """Return the number of control periods of the run."""
        return -(-self._run.schedule.last // self._run.schedule.per_control)

    @property
    def has_ended(self) -> bool:
        """Return whether the run has reached its end."""
        return self._step >= self._run.schedule.last

    @property
    def command(self) -> tuple[float, ...]:
        """Return the command in force, in the units of command_columns."""
        in_force = self._run.u
        return tuple(
            float(in_force[Command.GENERATOR_TORQUE + i] / factor) for i, factor in enumerate(self._factors)
        )

    def channels(self) -> np.ndarray:
        """Return the values (n_channels,) of scene.channels in their units at the present instant.

        Channels that depend on the generator torque at once (GenTq, GenPwr, RotTorq, accelerations and
        tower loads) are those of the command in force; a row of frame() has the next command.
        """
        run = self._run
        output(run.handle, run.x, run.u, self.time, run.link.dx, self._row[0])
        return self.scene.values(self._row)[0]

    def advance(self, command: Sequence[float]) -> None:
        """Advance by one control period under a command in the units of command_columns.

        While a trip, a fault or stop() is stopping the turbine, or it starts up, the command is ignored.
        Raises: InputError for anything but finite numbers, one for each column, and after the end of the run;
        SimulationStopped as simulate.
        """
        if len(command) != len(self._factors) or not all(isfinite(value) for value in command):
            raise InputError(
                f"command = {tuple(command)!r}: must be finite numbers, {', '.join(self.command_columns)}"
            )
        run, per_control, last = self._run, self._run.schedule.per_control, self._run.schedule.last
        if self.has_ended or self._frame is not None:
            raise InputError(f"command at {self.time:g} s: the run has ended")
        if not self.is_stopping:
            run.take([value * factor for value, factor in zip(command, self._factors, strict=True)])
        try:
            self._step = run.roll(self._step, min(self._step + per_control, last))
        except SimulationStopped as error:
            self._frame = error.frame
            raise
        if not self.has_ended:
            self.is_stopping = bool(run.begin(self._step))

    def stop(self, kind: Stop) -> None:
        """Order a stop of the turbine from the next control period on: Stop.NORMAL or Stop.EMERGENCY."""
        ordered = self._run.interface.guard.ordered
        ordered[kind] = min(ordered[kind], self.time)

    def frame(self) -> pd.DataFrame:
        """Return the DataFrame of the rows so far, as simulate does; no further period can follow."""
        if self._frame is None:
            self._frame = self._run.frame()
        return self._frame
