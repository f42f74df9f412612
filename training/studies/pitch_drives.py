"""Compares runs without pitch drive, with a first-order and with a second-order one.

Conditions: 18 m/s, class B turbulence, the sea for that wind at the site of the suites, three seeds, 600 s
after 100 s, fidelity standard. The second-order drive is that of the turbine file; the first-order one has
the lag of the file or, without one, that of the second-order drive.
"""

from typing import Annotated

import numpy as np
import typer

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.sea_state import joint_sea_state
from fowt_env.descriptions.turbine import read_turbine, with_second_order_drive
from fowt_env.files.markdown import markdown_table
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.training.benchmarks.speed import paired_times

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


def drives(platform):
    """Return {name: Turbine}: the turbine of a platform with each pitch drive."""
    turbine = read_turbine(read_platform(platform).turbine)
    second = with_second_order_drive(turbine)
    drive, lag = second.pitch_drive, turbine.pitch_drive.lag or second.pitch_drive.lag

    def first(time_constant):
        changed = turbine.pitch_drive.model_copy(update={"time_constant": time_constant})
        return turbine.model_copy(update={"pitch_drive": changed})

    return {
        "none": first(0.0),
        f"first order, {lag:.2g} s": first(lag),
        f"second order, {drive.natural_frequency:g} rad/s, {drive.damping:g}": second,
    }


def scene_of(platform, turbine, seed):
    """Return the scene of a run: platform, turbine and seed."""
    return build_scene(
        platform, wind={"kind": "ntm", "speed": WIND, "class": "B"}, turbine=turbine, fidelity="standard",
        sea=joint_sea_state("gulf_of_maine_normal", WIND), seed=seed, duration=END,
    )  # fmt: skip


def table():
    """Return the rows of the study: platform, drive, controller, and means of FIGURES over the seeds."""
    rows = []
    for platform in PLATFORMS:
        for drive, turbine in drives(platform).items():
            scenes = [scene_of(platform, turbine, seed) for seed in SEEDS]
            for controller in CONTROLLERS:
                runs = [simulate(scene, controller, duration=END) for scene in scenes]
                runs = [run[run["Time_[s]"] >= START] for run in runs]
                means = [np.mean([figure(run) for run in runs]) for figure in FIGURES.values()]
                rows.append([platform, drive, controller, *(f"{mean:.4g}" for mean in means)])
    return rows


def speed(rounds):
    """Return rows: platform, real-time factors without and with the second-order drive, their ratio."""
    rows = []
    for platform in PLATFORMS:
        plain, *_, second = drives(platform).values()
        scenes = [scene_of(platform, turbine, 1) for turbine in (plain, second)]
        times = paired_times([lambda s=s: simulate(s, "gspi_oc3", duration=END) for s in scenes], rounds)
        ratio = np.median(times[:, 1] / times[:, 0])
        rows.append([platform, *(f"{END / t:,.0f}" for t in np.median(times, axis=0)), f"{1.0 / ratio:.3f}"])
    return rows


def main(
    timed: Annotated[bool, typer.Option("--speed", help="Measure run time instead.")] = False,
    rounds: Annotated[int, typer.Option(help="Pairs of runs to time.")] = 15,
):
    """Print the effect of no, a first-order and a second-order pitch drive on runs."""
    if timed:
        heading = ["platform", "x real time without a drive", "with second-order drive", "speed ratio"]
        print(markdown_table(heading, speed(rounds)))
    else:
        print(markdown_table(["platform", "pitch drive", "controller", *FIGURES], table()))


if __name__ == "__main__":
    typer.run(main)
