"""Rare events counted inside kernels, so that nothing unusual passes silently.

Each is counted at every evaluation of the loads in which it happens, of which an integrator makes one to
four a step.
"""

from enum import IntEnum
from typing import NamedTuple


class Counter(IntEnum):
    """Index of each event in the (N_COUNTERS,) float64 counter array."""

    BEM_FALLBACK = 0
    HYDROSTATIC_FALLBACK = 1
    MOORING_UNCONVERGED = 2
    ROTOR_TABLE_CLAMPED = 3


class Event(NamedTuple):
    """What a counter counts, and what it means for a run."""

    meaning: str
    advice: str  # what to do
    harmful: bool  # whether the loads are less accurate for it


EVENTS = {
    Counter.BEM_FALLBACK: Event(
        "blade sections without a solution of the momentum balance, which were given no induction",
        "check the polars and the chord of the turbine file, and the wind speed; a few during start-up or in"
        " reversed flow change little",
        True,
    ),
    Counter.HYDROSTATIC_FALLBACK: Event(
        "evaluations with the water plane off the upper cylinder of the hull, integrated slice by slice",
        "nothing: the buoyancy is as accurate, only slower; the wave loads assume a hull that floats upright",
        False,
    ),
    Counter.MOORING_UNCONVERGED: Event(
        "mooring lines whose catenary missed its tolerance, so that their tensions are approximate",
        "check length, EA and wet weight of the lines, and whether the platform has drifted off",
        True,
    ),
    Counter.ROTOR_TABLE_CLAMPED: Event(
        "evaluations with the wind changing more steeply across the rotor than its coefficient table takes,"
        " where the steepest was used",
        "rotor='lookup' (fidelity 'standard') solves every blade section: a rotor that stands still or yaws"
        " fast needs it",
        True,
    ),
}
N_COUNTERS = len(Counter)


def counted(counters):
    """{event: count} of a counter array, those that happened."""
    return {event.name: int(counters[event]) for event in Counter if counters[event]}


def harm(events):
    """Words on those of {event: count} for which the loads are less accurate; None where there are none."""
    found = [(name, count, EVENTS[Counter[name]]) for name, count in events.items() if count]
    lines = [f"{name} {count}: {e.meaning}; {e.advice}" for name, count, e in found if e.harmful]
    return ". ".join(lines) if lines else None
