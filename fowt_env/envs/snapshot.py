"""The whole state of an environment at one instant, for what-if, tree search and predictive control."""

from collections.abc import Mapping
from typing import Any, NamedTuple

# arrays of episode.EpisodeData that outlive a control period, and of plant.model.Data: those that carry
# over, and stages, whose first row holds the wake's rates as long as the cached loads are fresh
CARRIED = (
    "x", "u", "memory", "estimate", "action", "measurement", "reading", "baseline_reading", "past",
    "observation", "counts", "reference", "terms",
)  # fmt: skip
DATA_CARRIED = (
    "lines", "counters", "stages", "cache", "added_mass", "user", "history", "samples", "radiation",
    "blades", "elastic",
)  # fmt: skip


class Snapshot(NamedTuple):
    """What FowtEnv.get_state returns; read only."""

    kind: tuple  # settings that an environment must share to go on from here
    scene: Any  # scene.Scene with the weather of the episode
    arrays: tuple  # copies, in the order of CARRIED and DATA_CARRIED; None for what the run lacks
    running: bool
    generator: Mapping[str, Any] | None  # state of the random generator; None before the first draw
    seed: int | None  # that the generator was made from
    end: str = ""  # why and when the episode ended
