"""Implements fowt report and fowt dev animate."""

from functools import partial
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fowt_env.descriptions.checks import parse_whole_numbers
from fowt_env.training.cli.arguments import parse_names, parse_pairs
from fowt_env.training.cli.console import command, dev, note, output, progress_bar
from fowt_env.training.cli.options import FidelityOption, OptionOption, SeaOption, WindOption


@command()
def report(
    folder: Annotated[str, Argument(help="Output folder of fowt evaluate.")],
    out_path: Annotated[str | None, Option("--out", help="Page; default: report.html in the folder.")] = None,
    cases: Annotated[str | None, Option(help="Cases with time series; default: all, up to 120 runs.")] = None,
    seeds: Annotated[str | None, Option(help="Seeds with time series: 1,2 or 1:6:1; default: all.")] = None,
    rate: Annotated[float | None, Option(help="Samples per second of time series; default: up to 2.")] = None,
    platform: Annotated[str | None, Option(help="Platform of the schedule; default: as evaluated.")] = None,
    schedule: Annotated[bool, Option("--schedule/--no-schedule", help="Show the steady schedule.")] = True,
):
    """Write an offline HTML report of an evaluation.

    Contains the leaderboard, Pareto and box plots, time series and spectra.

    Examples:
    fowt report results/demo  # results/demo/report.html
    fowt report results/suite --cases ntm_12,ntm_24 --seeds 1,2 --rate 5 --out page.html
    fowt report results/suite --platform mine.toml  # the steady schedule of another platform

    The page contains plotly.js and all data: 5 MB, and 25 kB per 10-minute run shown.
    """
    from fowt_env.training.reports.html_page import write_report

    numbers = None if seeds is None else parse_whole_numbers(seeds, "seeds")
    with progress_bar("report") as update:
        path = write_report(
            Path(folder), out_path, parse_names(cases), numbers, rate, platform, schedule, update
        )
    note(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")


@command(dev)
def animate(
    out_file: Annotated[str, Argument(help="Output animation: .gif or .mp4.")],
    controllers: Annotated[str, Option(help="One to four controllers, comma-separated.")] = "pi,pi_land",
    platform: Annotated[str, Option(help="Platform: a name or the path of a TOML file.")] = "oc3_hywind",
    wind: WindOption = '{"kind": "eog", "speed": 18, "start": 20}',
    sea: SeaOption = "jonswap:4:10",
    duration: Annotated[float, Option(help="Length of the runs, s.")] = 80.0,
    seed: Annotated[int, Option(help="Seed of wind and waves.")] = 0,
    start: Annotated[float, Option(help="Time of the first image, s.")] = 0.0,
    speed: Annotated[float, Option(help="Playback speed relative to real time.")] = 5.0,
    fps: Annotated[float, Option(help="Frames per second.")] = 15.0,
    width: Annotated[int, Option(help="Width, pixels.")] = 960,
    height: Annotated[int, Option(help="Height, pixels.")] = 540,
    fidelity: FidelityOption = "standard",
    option: OptionOption = None,
):
    """Animate controllers side by side, as .gif or .mp4.

    All controllers are simulated in the same wind and waves.

    Examples:
    fowt dev animate gust.gif  # OC3 and land gains in an extreme operating gust at 18 m/s
    fowt dev animate two.gif --controllers gspi_oc3,mpc --wind ntm:14:B --start 94 --duration 142  # later
    fowt dev animate run.mp4 --controllers pi --wind ntm:14:B --sea jonswap:4:9 --duration 120
    """
    from fowt_env.training.cli.simulate import compared_runs
    from fowt_env.visual.animation import animate as animate_runs
    from fowt_env.visual.animation import animation_path

    path = animation_path(output(out_file, "OUT_FILE"))  # check the ending before the runs
    options = {"platform": platform, "wind": wind, "sea": sea, "seed": seed, "fidelity": fidelity}
    options |= parse_pairs(option, "option")
    with progress_bar("simulating") as update:
        scene, runs = compared_runs(controllers, duration, update, **options)
        progress = partial(update, text="drawing")
        size = width, height
        animate_runs(scene, runs, path, speed=speed, fps=fps, size=size, start=start, progress=progress)
    note(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")
