"""The commands that make things to look at: report, animate."""

from pathlib import Path
from typing import Annotated

import typer

from fowt_env.descriptions.checks import parse_whole_numbers
from fowt_env.training.cli.arguments import parse_pairs, parse_sea, parse_wind
from fowt_env.training.cli.console import OptionOption, app, note, output, progress_bar, reported

REPORT_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt report results/demo[/cyan]  # results/demo/report.html

[cyan]fowt report results/suite --cases ntm_12,ntm_24 --seeds 1,2 --rate 5 --out page.html[/cyan]

[cyan]fowt report results/suite --platform mine.toml[/cyan]  # the steady schedule of another platform

The page works offline: plotly.js and all data are in it, 5 MB and 25 kB for each run of 10 minutes that it
shows. It leads with a verdict on the paired differences, which needs 4 seeds or more."""


@app.command(epilog=REPORT_EXAMPLES)
@reported
def report(
    folder: Annotated[str, typer.Argument(help="Folder that fowt evaluate wrote.")],
    out_path: Annotated[
        str | None, typer.Option("--out", help="The page; default: report.html in the folder.")
    ] = None,
    cases: Annotated[
        str | None,
        typer.Option(help="Cases with time series, comma-separated; default: all, up to 120 runs."),
    ] = None,
    seeds: Annotated[
        str | None,
        typer.Option(help="Seeds whose time series go in: 1,2 or 1:6:1 (6 included); default: all."),
    ] = None,
    rate: Annotated[
        float | None, typer.Option(help="Samples per second of the time series; default: 2 or less.")
    ] = None,
    platform: Annotated[
        str | None, typer.Option(help="Whose steady schedule; default: that of the evaluation.")
    ] = None,
    schedule: Annotated[bool, typer.Option("--schedule/--no-schedule", help="Show it.")] = True,
):
    """One HTML page of an evaluation, to be read offline.

    Leaderboard, Pareto and box plots, time series and spectra.
    """
    from fowt_env.training.reports.html_page import write_report

    output(out_path)
    names = None if cases is None else [name.strip() for name in cases.split(",") if name.strip()]
    with progress_bar("report", None) as update:
        path = write_report(
            Path(folder),
            out_path,
            names,
            None if seeds is None else parse_whole_numbers(seeds, "seeds"),
            rate,
            platform,
            schedule,
            lambda done, total, text: update(done, f"report: {text}", total),
        )
    note(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")


ANIMATE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt animate gust.gif[/cyan]  # OC3 and land gains in an extreme operating gust at 18 m/s

[cyan]fowt animate run.mp4 --controllers pi --wind ntm:14:B --sea jonswap:4:9 --duration 120[/cyan]"""


@app.command(epilog=ANIMATE_EXAMPLES)
@reported
def animate(
    out_path: Annotated[str, typer.Argument(help="The animation: .gif or .mp4.")],
    controllers: Annotated[
        str, typer.Option(help="One to four, comma-separated; see fowt list controllers.")
    ] = "pi,pi_land",
    platform: Annotated[str, typer.Option(help="Platform: a name or a path.")] = "oc3_hywind",
    wind: Annotated[
        str, typer.Option(help="As of fowt simulate --help.")
    ] = '{"kind": "eog", "speed": 18, "start": 20}',
    sea: Annotated[str, typer.Option(help="As of fowt simulate --help.")] = "jonswap:4:10",
    duration: Annotated[float, typer.Option(help="Length of the runs, s.")] = 80.0,
    seed: Annotated[int, typer.Option(help="Seed of wind and waves.")] = 0,
    speed: Annotated[float, typer.Option(help="How many times faster than real time.")] = 5.0,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 15.0,
    width: Annotated[int, typer.Option(help="Pixels.")] = 960,
    height: Annotated[int, typer.Option(help="Pixels.")] = 540,
    fidelity: Annotated[str, typer.Option(help="reference, standard or fast.")] = "standard",
    option: OptionOption = None,
):
    """Animate controllers side by side, as .gif or .mp4.

    All of them meet the same wind and waves.
    """
    import fowt_env
    from fowt_env.visual.animation import animate as animate_runs
    from fowt_env.visual.animation import animation_path

    path = animation_path(output(out_path, "OUT_PATH"))  # a wrong ending should not cost a run
    names = list(dict.fromkeys(name.strip() for name in controllers.split(",") if name.strip()))
    options = {"duration": max(700.0, duration), **parse_pairs(option, "option")}
    scene = fowt_env.build_scene(
        platform, wind=parse_wind(wind), sea=parse_sea(sea), seed=seed, fidelity=fidelity, **options
    )
    runs = {}
    with progress_bar("simulating", None) as update:
        for name in names:
            runs[name] = fowt_env.simulate(scene, controller=name, duration=duration)
        animate_runs(
            scene,
            runs,
            path,
            speed=speed,
            fps=fps,
            size=(width, height),
            progress=lambda done, total: update(done, "drawing", total),
        )
    note(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")
