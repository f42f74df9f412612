"""Rare events counted inside kernels, so that nothing unusual passes silently."""

from enum import IntEnum


class Counter(IntEnum):
    """Index of each event in the (N_COUNTERS,) float64 counter array."""

    BEM_FALLBACK = 0  # no bracket for the inflow angle: the station got no induction
    HYDROSTATIC_FALLBACK = 1  # water plane left the upper cylinder: numerical slices
    MOORING_UNCONVERGED = 2  # catenary Newton ended above its tolerance


N_COUNTERS = len(Counter)


def counted(counters):
    """{event: count} of a counter array, those that happened."""
    return {event.name: int(counters[event]) for event in Counter if counters[event]}
