"""What dynamic inflow does to a run, and how near the look-up comes to blade-element momentum with it.

    python -m fowt_env.training.studies.dynamic_inflow           # the table of docs/results/model-choices.md
    python -m fowt_env.training.studies.dynamic_inflow --speed   # the time of a run with and without it

Class B turbulence, a sea of 7.5 m above rated and of 4 m below, 540 s after 60 s under `pi`, at fidelity
standard: rms differences from rotor = "bem" with dynamic inflow, over the standard deviations of that run.
"""

import argparse
import sys
from time import process_time

import numpy as np

from fowt_env.files.markdown import markdown_table
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene

CASES = (
    ("oc3_hywind", 8.0), ("oc3_hywind", 12.0), ("oc3_hywind", 18.0), ("oc3_hywind", 24.0),
    ("iea15_volturnus_s", 18.0),
)  # fmt: skip
KINDS = {
    "look-up": {"dynamic_inflow": True},
    "look-up, quasi-steady": {},
}
CHANNELS = {
    "thrust": "RtFldFxh_[N]",
    "torque": "RtFldMxh_[N-m]",
    "rotor speed": "RotSpeed_[rpm]",
    "platform pitch": "PtfmPitch_[deg]",
    "surge": "PtfmSurge_[m]",
    "yaw": "PtfmYaw_[deg]",
    "tower-base moment": "TwrBsMyt_[kN-m]",
}
RATED = 11.5
START, END = 60.0, 600.0
REPEATS = 9


def scene_of(platform, wind, **options):
    """Scene of a case at fidelity standard."""
    sea = {"kind": "jonswap", "Hs": 7.5, "Tp": 10.0}
    if wind < RATED:
        sea = {"kind": "jonswap", "Hs": 4.0, "Tp": 8.0}
    turbulence = {"kind": "ntm", "speed": wind, "class": "B"}
    return build_scene(platform, wind=turbulence, sea=sea, seed=1, fidelity="standard", **options)


def run_of(scene):
    """Frame of a run, from START on."""
    frame = simulate(scene, "pi", duration=END)
    return frame[frame["Time_[s]"] >= START]


def errors():
    """Rows of the table of errors."""
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
    """Rows of the table of speeds: CPU time of runs that alternate, medians."""
    scenes = {kind: scene_of(platform, wind, **options) for kind, options in KINDS.items()}
    times = {kind: [] for kind in scenes}
    for repeat in range(REPEATS + 1):
        for kind, scene in scenes.items():
            start = process_time()
            simulate(scene, "pi", duration=END)
            if repeat:  # the first run compiles
                times[kind].append(process_time() - start)
    plain = np.array(times["look-up, quasi-steady"])
    return [
        [kind, f"{END / np.median(taken):.0f}", f"{np.median(plain / np.array(taken)):.2f}"]
        for kind, taken in times.items()
    ]


def main(arguments=None):
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--speed", action="store_true", help="time of a run with and without it")
    if parser.parse_args(arguments).speed:
        print(markdown_table(["rotor", "times real time", "of the quasi-steady one's"], speeds()))
        return 0
    print(markdown_table(["platform", "wind, m/s", "rotor", *CHANNELS], errors()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
