"""Checks a library with the Bladed interface without a plant: records, demands, messages, times, determinism.

The library is called on a series of an operating point above rated wind speed: the rotor's speed and the
tower top oscillate, and torque and pitch follow the demands. Which records it reads is found by changing
groups of them, halved where the demands change; which it writes by values that no library would return.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from math import pi, sin
from typing import Any

import numpy as np

from fowt_env.controllers.bladed.controller import START_LIMIT, BladedLibrary
from fowt_env.controllers.bladed.elf import check_library
from fowt_env.controllers.bladed.process import LibraryFailure
from fowt_env.controllers.bladed.records import FROM, RECORDS, SIZE, START, STEP, TO, Record
from fowt_env.errors import ControllerError
from fowt_env.plant.measurement import Measurement

STEPS = 300  # calls of a series
PROBE_STEPS = 40  # calls of a series that finds which records are read
WIND, PITCH = 18.0, 0.26  # m/s, rad: steady state of the NREL 5 MW turbine
SWING, PERIOD = 0.03, 10.0  # fraction of the speed, s
LAG = 0.3  # fraction of the way to the demanded pitch in a period
SLOW_START = 1.0  # s
STARTS = 40  # of a library that reads some eight records
UNTOUCHED = -12345.678  # value of a record that the library has not written
CHANGE = 0.1, 0.15  # range of changes of a probed record: fraction of its value, or the change of a zero
GOLDEN = 0.6180339887498949  # its multiples spread evenly between 0 and 1
# sizes of buffers and places of arrays: a library that is given others may write where it must not
NOT_PROBED = (
    "message_size", "input_file_size", "output_name_size", "output_name_capacity", "most_logs", "log_start",
    "torque_table_start", "torque_table_points", "platform_start", "size", "status", "blades",
)  # fmt: skip


@dataclass
class DllCheck:
    """Holds what check_dll has found; faults: what keeps the library from being used, a sentence each."""

    exported: list[str]
    read: list[Record] = field(default_factory=list)
    written: list[Record] = field(default_factory=list)
    overwritten: list[Record] = field(default_factory=list)  # records to the library that it has changed
    unnamed: list[int] = field(default_factory=list)  # numbers of written records without a name
    torque: tuple[float, float] | None = None  # N m, smallest and largest demand
    pitch: tuple[float, float] | None = None  # rad
    start: float = 0.0  # s, loading and the first call
    call: float = 0.0  # s, median
    slowest: float = 0.0  # s, of the other calls
    output: str = ""
    faults: list[str] = field(default_factory=list)


def check_dll(
    library: BladedLibrary, turbine: Any, control_dt: float = 0.1, note: Callable[[str], object] | None = None
) -> DllCheck:
    """Return the DllCheck of a library called every control_dt (s) with the values of a turbine.

    note: function that is told (a text) that the check of a slow library will take long.
    """
    result = DllCheck(check_library(library.files[0], library.symbol))
    try:
        first = _whole_series(library, turbine, control_dt, result)
    except ControllerError as error:
        result.faults.append(str(error))
        return result
    if note is not None and result.start > SLOW_START:
        note(f"a start takes {result.start:.1f} s, the check some {STARTS} starts: {library.files[0]}")
    second, beside = _two_at_once(library, turbine, control_dt)
    if not np.array_equal(first, second, equal_nan=True):
        result.faults.append("two runs of the same series differ in their demands")
    elif not np.array_equal(first, beside, equal_nan=True):
        result.faults.append("a library that runs at the same time changes the demands")
    _find_written(library, turbine, control_dt, result)
    if not result.faults:
        _find_read(library, turbine, control_dt, result)
    return result


def start_once(library: BladedLibrary, turbine: Any, control_dt: float) -> None:
    """Load a library, which reads its input file at its first call, and end it, without a plant.

    Raises: ControllerError if it cannot be loaded, or if this call fails.
    """
    controller = library(turbine, control_dt)
    try:
        controller.reset(_OperatingPoint(turbine, control_dt).at(0))
    finally:
        controller.finish()


class _OperatingPoint:
    """Provides the measurements of the series, which follow the demands."""

    def __init__(self, turbine, control_dt):
        self._turbine, self._control_dt = turbine, control_dt
        self._torque, self._pitch = turbine.torque_law.rated_torque, PITCH

    def at(self, step):
        """Return the Measurement of a step."""
        moment = step * self._control_dt
        swing = sin(2.0 * pi * moment / PERIOD)
        speed = (1.0 + SWING * swing) * self._turbine.torque_law.rated_speed
        readings = dict.fromkeys(Measurement._fields, 0.0) | {
            "time": moment,
            "generator_speed": speed,
            "rotor_speed": speed / self._turbine.drivetrain.gear_ratio,
            "generator_torque": self._torque,
            "blade_pitch": self._pitch,
            "wind_speed": WIND,
            "nacelle_acceleration": 0.1 * swing,
            "platform_pitch": 0.05,
        }
        return Measurement(**readings)

    def follow(self, torque, *pitches):
        """Let torque and blade pitch follow the demands."""
        self._torque, self._pitch = torque, self._pitch + LAG * (float(np.mean(pitches)) - self._pitch)


def _whole_series(library, turbine, control_dt, result):
    """Return the demands (STEPS, n) of a series, and keep what a run would show in the DllCheck."""
    point, controller, demands, durations = _OperatingPoint(turbine, control_dt), None, [], []
    controller = library(turbine, control_dt)
    try:
        began = time.perf_counter()
        controller.reset(point.at(0))
        result.start = time.perf_counter() - began
        for step in range(STEPS):
            measurement, began = point.at(step), time.perf_counter()
            demands.append(controller.act(measurement))
            durations.append(time.perf_counter() - began)
            point.follow(*demands[-1])
    finally:
        controller.finish()
        result.output = controller.console_output
    demands = np.array(demands)
    result.call, result.slowest = float(np.median(durations[1:])), max(durations[1:])
    result.torque = float(demands[:, 0].min()), float(demands[:, 0].max())
    result.pitch = float(demands[:, 1:].min()), float(demands[:, 1:].max())
    if not np.isfinite(demands).all():
        result.faults.append("a demand is not a finite number")
    return demands


def _two_at_once(library, turbine, control_dt):
    """Return the demands of two series of the same library whose calls alternate."""
    points = [_OperatingPoint(turbine, control_dt) for _ in range(2)]
    controllers = [library(turbine, control_dt) for _ in range(2)]
    demands = [[], []]
    try:
        for controller, point in zip(controllers, points, strict=True):
            controller.reset(point.at(0))
        for step in range(STEPS):
            for controller, point, found in zip(controllers, points, demands, strict=True):
                found.append(controller.act(point.at(step)))
                point.follow(*found[-1])
    finally:
        for controller in controllers:
            controller.finish()
    return np.array(demands[0]), np.array(demands[1])


def _calls(library, turbine, control_dt, change):
    """Yield the records before and after each call of a short series; change(records) changes those before.

    Ends early if the library fails.
    """
    point = _OperatingPoint(turbine, control_dt)
    process, swap = library.start(turbine, control_dt)
    try:
        for step in range(PROBE_STEPS):
            swap.fill(STEP if step else START, point.at(step))
            change(swap.records)
            before = swap.records.copy()
            process.call(library.limit if step else max(START_LIMIT, library.limit))
            yield before, swap.records.copy()
            if swap.failure < 0:
                return
            point.follow(*swap.demands())
    except LibraryFailure:
        return
    finally:
        process.end()


def _find_written(library, turbine, control_dt, result):
    """Find the records that the library writes, from values that it would hardly return."""
    named = {record.index: record for record in RECORDS}
    free = [i for i in range(SIZE) if i not in named or named[i].direction != TO]

    def mark(records):
        records[free] = UNTOUCHED

    written = set()
    for before, after in _calls(library, turbine, control_dt, mark):
        written |= set(np.flatnonzero((before != after) & ~(np.isnan(before) & np.isnan(after))).tolist())
    known = [named[index] for index in sorted(written & set(named))]
    result.written = [record for record in known if record.direction != TO]
    result.overwritten = [record for record in known if record.direction == TO]
    result.unnamed = [index + 1 for index in sorted(written - set(named))]


def _find_read(library, turbine, control_dt, result):
    """Find the records to the library whose change changes what it writes.

    Each series starts the library anew, which takes seconds where its law runs in Python: hence the groups.
    """
    places = [record.index for record in result.written]

    def answers(change):
        return [after[places] for _, after in _calls(library, turbine, control_dt, change)]

    usual = answers(lambda records: None)

    def matter(group):
        indices = np.array([record.index for record in group])
        # a change of its own for each: a law of the ratio of two records would hide the same change of both
        fractions = CHANGE[0] + (CHANGE[1] - CHANGE[0]) * (GOLDEN * indices % 1.0)

        changed = np.full(len(group), np.nan)

        def change(records):
            values = records[indices]
            new = values + fractions * np.where(values == 0.0, 1.0, values)
            records[indices] = np.where(values == changed, values, new)  # constants are given once
            changed[:] = records[indices]

        found = answers(change)
        return len(found) < len(usual) or not np.array_equal(found, usual, equal_nan=True)

    probed = [record for record in RECORDS if record.direction != FROM and record.name not in NOT_PROBED]
    result.read = _those_that_matter(probed, matter)


def _those_that_matter(items, matter, known=False):
    """Return the items that matter on their own; matter(items): whether a list has some; known: it has."""
    if not items or not ((known and len(items) > 1) or matter(items)):
        return []
    if len(items) == 1:
        return items
    half = len(items) // 2
    first = _those_that_matter(items[:half], matter)
    return first + _those_that_matter(items[half:], matter, known=not first)
