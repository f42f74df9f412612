"""Defines the interface between a plant and its controller: the constants and the variables of a run.

A part that a run lacks is None, and the compiler then omits it; simulate always has sensors and a guard, so
that one compiled loop serves all of its runs.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.loop.protection import Guard, new_watch
from fowt_env.loop.sensing import Sensors, WindAhead, new_past
from fowt_env.plant.compile.handle import by_reference


@by_reference
class Interface(NamedTuple):
    """Holds the constants of a run between plant and controller."""

    control_dt: float  # s
    sensors: Sensors | None  # None: readings are the measurements
    hidden: np.ndarray | None  # (n,) GIVEN or HIDDEN of each measured quantity; None: no law
    ahead: WindAhead | None  # wind ahead that the law reads; None: no law
    guard: Guard | None  # trips, stops and faults; None: none of them


@by_reference
class InterfaceData(NamedTuple):
    """Holds the variables of a run between plant and controller."""

    measurement: np.ndarray  # (n,) of the current control instant
    reading: np.ndarray  # (n,) output of the sensors; without sensors the measurement itself
    law_reading: np.ndarray  # (n + leads,) input of the law; without a law the reading itself
    command: np.ndarray  # (n_commands,) of the law, a stop or a start-up, before faults and generator limits
    past: np.ndarray | None  # memory of the sensors (new_past); None without sensors
    motion: np.ndarray | None  # memory of a lidar on the nacelle (WindAhead); None without a law
    watch: np.ndarray | None  # (N_WATCH,) memory of the protection; None without a guard
    held: np.ndarray | None  # (faults,) pitch or reading that a fault freezes, NaN: none yet
    dx: np.ndarray  # (n_state,) derivative of the state at the current control instant


def interface_data(interface, n_state, n_commands, size):
    """Return the initial InterfaceData of a run. size: number of measured quantities."""
    sensors, hidden, ahead, guard = interface.sensors, interface.hidden, interface.ahead, interface.guard
    measurement = np.zeros(size)
    reading = measurement if sensors is None else np.zeros(size)
    leads = 0 if ahead is None else ahead.values.shape[0]
    return InterfaceData(
        measurement=measurement,
        reading=reading,
        law_reading=reading if hidden is None else np.zeros(size + leads),
        command=np.zeros(n_commands),
        past=None if sensors is None else new_past(sensors.chain),
        motion=None if ahead is None else ahead.new_memory(),
        watch=None if guard is None else new_watch(guard),
        held=None if guard is None else np.full(len(guard.faults), np.nan),
        dx=np.zeros(n_state),
    )
