"""What dynamic inflow does to a run, and how near the look-up comes to blade-element momentum with it.

    python -m fowt_env.training.studies.dynamic_inflow           # the table of docs/results/model-choices.md
    python -m fowt_env.training.studies.dynamic_inflow --speed   # the time of a run with and without it

Class B turbulence, a sea of 7.5 m above rated and of 4 m below, 540 s after 60 s under `pi`, at fidelity
standard: rms differences from rotor = "bem" with dynamic inflow, over the standard deviations of that run.
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
    height, period = (4.0, 8.0) if wind < RATED else (7.5, 10.0)
    sea = {"kind": "jonswap", "Hs": height, "Tp": period}
    turbulence = {"kind": "ntm", "speed": wind, "class": "B"}
    return build_scene(platform, wind=turbulence, sea=sea, seed=1, fidelity="standard", **options)


def run_of(scene):
    """Return the frame of a run, from START on."""
    frame = simulate(scene, "pi", duration=END)
    return frame[frame["Time_[s]"] >= START]


def errors():
    """Return the rows of the table of errors."""
    rows = []
    for platform, wind in CASES:
        exact = run_of(scene_of(platform, wind, rotor="bem", dynamic_inflow=True))
        for kind, options in KINDS.items():
            run = run_of(scene_of(platform, wind, **options))
            row = [platform, f"{wind:g}", kind]
            for channel in CHANNELS.values():
                error = np.sqrt(np.mean((run[channel] - exact[channel]) ** 2)) / exact[channel].std()
                row.append(f"{error:.1e}")
            rows.append(row)
    return rows


def speeds(platform="oc3_hywind", wind=18.0):
    """Return the rows of the table of speeds: CPU time of runs that alternate, medians."""
    scenes = [scene_of(platform, wind, **options) for options in KINDS.values()]
    times = paired_times([lambda s=s: simulate(s, "pi", duration=END) for s in scenes], REPEATS)
    plain = times[:, list(KINDS).index("look-up, quasi-steady")]
    return [
        [kind, f"{END / np.median(taken):.0f}", f"{np.median(plain / taken):.2f}"]
        for kind, taken in zip(KINDS, times.T, strict=True)
    ]


def main(speed: Annotated[bool, typer.Option("--speed", help="Time of a run with and without it.")] = False):
    """Print the errors of the look-up rotor with and without dynamic inflow."""
    if speed:
        print(markdown_table(["rotor", "times real time", "of the quasi-steady one's"], speeds()))
    else:
        print(markdown_table(["platform", "wind, m/s", "rotor", *CHANNELS], errors()))


if __name__ == "__main__":
    typer.run(main)
