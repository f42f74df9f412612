"""Collects the outcome of a run or an episode: its DataFrame, and when and why the turbine was stopped."""

from math import isinf
from typing import Any

import numpy as np
import pandas as pd

from fowt_env.descriptions.ratings import ratings
from fowt_env.loop.protection import CONNECTED, Stop, Trip, Watch
from fowt_env.plant.channels import Out
from fowt_env.plant.events import counted
from fowt_env.scene.scene import Scene


def trip_name(watch: np.ndarray) -> str:
    """Return the name of the trip in InterfaceData.watch, such as "overspeed"."""
    return Trip(int(watch[Watch.TRIP])).name.lower()


def stop_facts(watch: np.ndarray) -> dict[str, Any]:
    """Return {"tripped": time (s) of the trip, "trip": its name, "stop": its kind}, None without one.

    After a start-up also "connected": time (s) at which it connected the generator.
    """
    tripped, stop = float(watch[Watch.TRIPPED_AT]), int(watch[Watch.STOP])
    connected = float(watch[CONNECTED])
    return ({} if isinf(connected) else {"connected": connected}) | {
        "tripped": None if isinf(tripped) else tripped,
        "trip": None if isinf(tripped) else trip_name(watch),
        "stop": Stop(stop).name.lower() if stop >= 0 else None,
    }


def run_frame(
    scene: Scene, rows: np.ndarray, counters: np.ndarray, watch: np.ndarray | None, period: float
) -> pd.DataFrame:
    """Return the DataFrame of output rows (n, n_channels) in SI, which are overwritten.

    counters: plant.model.Data.counters; watch: InterfaceData.watch, or None without a guard; period: s
    between rows. See simulate for attrs.
    """
    values = scene.values(rows, overwrite=True)
    frame = pd.DataFrame(values, columns=[c.column for c in scene.channels])
    frame.attrs["events"] = counted(counters)
    limited = values[:-1, int(Out["GENTQLIM"])]
    frame.attrs["torque_limited"] = float(np.count_nonzero(limited) * period)
    frame.attrs["doubtful_commands"] = ""
    facts = dict.fromkeys(("tripped", "trip", "stop")) if watch is None else stop_facts(watch)
    frame.attrs |= facts
    frame.attrs["ratings"] = ratings(scene.turbine)
    return frame
