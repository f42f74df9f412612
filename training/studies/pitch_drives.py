"""What the pitch drive does to a run: none, one of first order, one of second order.

    python -m fowt_env.training.studies.pitch_drives              # the table of docs/results/model-choices.md
    python -m fowt_env.training.studies.pitch_drives --speed      # time of a run with and without inertia

18 m/s, class B turbulence, the sea of that wind at the site of the suites, three seeds, 600 s after 100 s, at
fidelity standard. The drive of second order is that of the turbine file, the one of first order lags as long;
where the file has a lag of its own it is that one.
"""

import argparse
import sys
from time import process_time

import numpy as np

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.sea_state import joint_sea_state
from fowt_env.descriptions.turbine import read_turbine, with_second_order_drive
from fowt_env.files.markdown import markdown_table
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene

PLATFORMS = ("oc3_hywind", "iea15_volturnus_s")
CONTROLLERS = ("pi", "gspi_oc3")
WIND = 18.0
SEEDS = (1, 2, 3)
START, END = 100.0, 700.0
FIGURES = {
    "platform pitch std, deg": lambda run: run["PtfmPitch_[deg]"].std(),
    "rotor speed std, rpm": lambda run: run["RotSpeed_[rpm]"].std(),
    "pitch travel, deg/s": lambda run: run["BldPitch1_[deg]"].diff().abs().sum() / (END - START),
}


def drives(turbine):
    """{name: Turbine} with each of the drives."""
    second = with_second_order_drive(turbine)
    own, lag = turbine.pitch_drive, turbine.pitch_drive.lag or second.pitch_drive.lag

    def first(time_constant):
        drive = own.model_copy(update={"time_constant": time_constant})
        return turbine.model_copy(update={"pitch_drive": drive})

    figures = second.pitch_drive
    return {
        "none": first(0.0),
        f"first order, {lag:.2g} s": first(lag),
        f"second order, {figures.natural_frequency:g} rad/s, {figures.damping:g}": second,
    }


def scene_of(platform, turbine, seed):
    """Scene of the study."""
    return build_scene(
        platform,
        wind={"kind": "ntm", "speed": WIND, "class": "B"},
        sea=joint_sea_state("gulf_of_maine_normal", WIND),
        seed=seed,
        duration=END,
        fidelity="standard",
        turbine=turbine,
    )


def table():
    """Rows of the study: platform, drive, controller and the means of FIGURES over the seeds."""
    rows = []
    for platform in PLATFORMS:
        for drive, turbine in drives(read_turbine(read_platform(platform).turbine)).items():
            scenes = [scene_of(platform, turbine, seed) for seed in SEEDS]
            for controller in CONTROLLERS:
                runs = [simulate(scene, controller, duration=END) for scene in scenes]
                runs = [run[run["Time_[s]"] >= START] for run in runs]
                means = [np.mean([figure(run) for run in runs]) for figure in FIGURES.values()]
                rows.append([platform, drive, controller, *(f"{mean:.4g}" for mean in means)])
    return rows


def speed(rounds):
    """Rows: platform, median time with the second-order drive over that without a drive, of paired runs."""
    rows = []
    for platform in PLATFORMS:
        made = list(drives(read_turbine(read_platform(platform).turbine)).values())
        pair = [scene_of(platform, turbine, 1) for turbine in (made[0], made[-1])]
        times = np.empty((rounds + 1, 2))
        for i in range(rounds + 1):  # the first compiles
            for j, scene in enumerate(pair):
                began = process_time()
                simulate(scene, "gspi_oc3", duration=END)
                times[i, j] = process_time() - began
        ratio = np.median(times[1:, 1] / times[1:, 0])
        rows.append(
            [platform, *(f"{END / t:,.0f}" for t in np.median(times[1:], axis=0)), f"{1.0 / ratio:.3f}"]
        )
    return rows


def main(arguments=None):
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--speed", action="store_true", help="time of a run instead")
    parser.add_argument("--rounds", type=int, default=15, help="pairs of runs to time")
    chosen = parser.parse_args(arguments)
    if chosen.speed:
        heading = ["platform", "x real time without a drive", "with that of second order", "speed ratio"]
        print(markdown_table(heading, speed(chosen.rounds)))
    else:
        print(markdown_table(["platform", "pitch drive", "controller", *FIGURES], table()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
