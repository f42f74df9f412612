"""Defines the rare events that kernels count, so that every run reports them.

An event is counted at every evaluation of the loads in which it occurs; an integrator makes one to four
evaluations a step.
"""

from enum import IntEnum
from typing import NamedTuple


class Counter(IntEnum):
    """Indexes the events in the (N_COUNTERS,) float64 counter array."""

    BEM_FALLBACK = 0
    HYDROSTATIC_FALLBACK = 1
    MOORING_UNCONVERGED = 2
    ROTOR_TABLE_CLAMPED = 3


class Event(NamedTuple):
    """Describes a counted event and its consequence for a run."""

    meaning: str
    advice: str  # recommended action
    harmful: bool  # whether the loads are less accurate


EVENTS = {
    Counter.BEM_FALLBACK: Event(
        "blade sections without a solution of the momentum balance, computed without induction",
        "check the polars and the chord of the turbine file, and the wind speed; a few during start-up or in"
        " reversed flow change little",
        True,
    ),
    Counter.HYDROSTATIC_FALLBACK: Event(
        "evaluations with the water plane outside the upper cylinder of the hull, integrated slice by slice",
        "none needed: the buoyancy is as accurate, only slower; the wave loads assume an upright hull",
        False,
    ),
    Counter.MOORING_UNCONVERGED: Event(
        "mooring lines whose catenary missed its tolerance, so that their tensions are approximate",
        "check length, EA and wet weight of the lines, and whether the platform has drifted off",
        True,
    ),
    Counter.ROTOR_TABLE_CLAMPED: Event(
        "evaluations with a wind gradient across the rotor above the range of its coefficient table,"
        " limited to that range",
        "use rotor='lookup' (fidelity 'standard'), which solves every blade section, for a rotor at"
        " standstill or with fast yaw",
        True,
    ),
}
N_COUNTERS = len(Counter)


def counted(counters):
    """Return the {event: count} of a counter array, without zeros."""
    return {event.name: int(counters[event]) for event in Counter if counters[event]}


def harm(events):
    """Return a warning of those of {event: count} that make the loads less accurate; None without any."""
    rows = [(name, count, EVENTS[Counter[name]]) for name, count in events.items() if count]
    lines = [f"{name} {count}: {e.meaning}; {e.advice}" for name, count, e in rows if e.harmful]
    return ". ".join(lines) if lines else None
