"""Defines the state of an environment at one instant, for what-if studies, tree search and MPC."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from fowt_env.plant.elastic.structure import RotorScratch

# arrays kept between control periods: in episode.EpisodeData, its InterfaceData, and plant.model.Data
# (stages: the first row has the wake rates while the cached loads are valid, others those of keep_rates)
CARRIED = {
    "": (
        "x", "u", "memory", "estimate", "action", "ahead", "motion", "observation", "counts", "reference",
        "terms", "rows",
    ),
    "link": ("measurement", "reading", "law_reading", "command", "past", "motion", "watch", "held"),
    "data": (
        "lines", "flood", "counters", "stages", "cache", "added_mass", "matrix", "user", "history", "samples",
        "radiation", "blades", "elastic", "slow",
    ),
    "decided": ("observations", "seen", "smoothed", "lasting", "wind", "decision"),
    "rotor": RotorScratch._fields,  # of Data, if parts are elastic
}  # fmt: skip


class Snapshot(NamedTuple):
    """Holds the result of FowtEnv.get_state; read only."""

    kind: tuple  # settings that must be equal in an environment that continues from this state
    scene: Any  # scene.Scene with the weather of the episode
    faults: tuple  # of the episode
    arrays: tuple  # copies, in the order of CARRIED; None for arrays that the run lacks
    running: bool
    generator: Mapping[str, Any] | None  # state of the random generator; None before the first draw
    seed: int | None  # seed of the generator
    end: str = ""  # why and when the episode ended


def carried(episode):
    """Return the arrays of EpisodeData in the order of CARRIED; None for arrays that the run lacks."""
    data = episode.data
    parts = {
        "": episode, "link": episode.link, "data": data, "decided": episode.decided, "rotor": data.rotor,
    }  # fmt: skip
    return [getattr(parts[part], name, None) for part, names in CARRIED.items() for name in names]


def fill_carried(episode, arrays):
    """Fill the arrays of EpisodeData from copies in the order of CARRIED."""
    for array, saved in zip(carried(episode), arrays, strict=True):
        if array is not None:
            array[...] = saved
