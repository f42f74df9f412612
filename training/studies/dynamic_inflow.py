"""Computes the effect of dynamic inflow, and the error of the look-up rotor against blade-element momentum.

Class B turbulence, Hs 7.5 m above rated wind and 4 m below, 540 s after 60 s with `pi`, fidelity standard.
Errors are rms differences from rotor = "bem" with dynamic inflow, over the standard deviations of that run.
"""

from typing import Annotated

import numpy as np
import typer

from fowt_env.files.markdown import markdown_table
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.training.benchmarks.speed import paired_times

CASES = (
    ("oc3_hywind", 8.0), ("oc3_hywind", 12.0), ("oc3_hywind", 18.0), ("oc3_hywind", 24.0),
    ("iea15_volturnus_s", 18.0),
)  # fmt: skip
KINDS = {"look-up": {"dynamic_inflow": True}, "look-up, quasi-steady": {}}
CHANNELS = {
    "thrust": "RtFldFxh_[N]", "torque": "RtFldMxh_[N-m]", "rotor speed": "RotSpeed_[rpm]",
    "platform pitch": "PtfmPitch_[deg]", "surge": "PtfmSurge_[m]", "yaw": "PtfmYaw_[deg]",
    "tower-base moment": "TwrBsMyt_[kN-m]",
}  # fmt: skip
RATED = 11.5
START, END = 60.0, 600.0
REPEATS = 9


def scene_of(platform, wind, **options):
    """Return the scene of a case at fidelity standard."""
    sea = (
        {"kind": "jonswap", "Hs": 4.0, "Tp": 8.0}
        if wind < RATED
        else {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0}
    )
    turbulence = {"kind": "ntm", "speed": wind, "class": "B"}
    return build_scene(platform, wind=turbulence, sea=sea, seed=1, fidelity="standard", **options)


def errors():
    """Return the rows of the table of errors, from runs after START."""
    rows, channels = [], list(CHANNELS.values())
    for platform, wind in CASES:
        kinds = {"": {"rotor": "bem", "dynamic_inflow": True}, **KINDS}
        runs = {k: simulate(scene_of(platform, wind, **o), "pi", duration=END) for k, o in kinds.items()}
        runs = {kind: run.loc[run["Time_[s]"] >= START, channels] for kind, run in runs.items()}
        exact = runs.pop("")
        for kind, run in runs.items():
            error = ((run - exact) ** 2).mean() ** 0.5 / exact.std()
            rows.append([platform, f"{wind:g}", kind, *(f"{value:.1e}" for value in error)])
    return rows


def speeds():
    """Return the rows of the table of speeds: medians of the CPU time of alternating runs."""
    scenes = [scene_of("oc3_hywind", 18.0, **options) for options in KINDS.values()]
    times = paired_times([lambda s=s: simulate(s, "pi", duration=END) for s in scenes], REPEATS)
    ratio = np.median(times[:, -1:] / times, axis=0)  # relative to the last, quasi-steady one
    factors = END / np.median(times, axis=0)
    return [[k, f"{x:.0f}", f"{r:.2f}"] for k, x, r in zip(KINDS, factors, ratio, strict=True)]


def main(speed: Annotated[bool, typer.Option("--speed", help="Measure run times with and without.")] = False):
    """Print the errors of the look-up rotor with and without dynamic inflow."""
    if speed:
        print(markdown_table(["rotor", "times real time", "relative to quasi-steady"], speeds()))
    else:
        print(markdown_table(["platform", "wind, m/s", "rotor", *CHANNELS], errors()))


if __name__ == "__main__":
    typer.run(main)
