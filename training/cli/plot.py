"""Implements fowt plot: plots of saved runs and tables."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fowt_env.errors import InputError, unknown
from fowt_env.training.cli.console import command, plot_file, wrote

PLOTS = ("series", "spectra", "boxes", "raos", "schedule")


@command()
def plot(
    kind: Annotated[str, Argument(help="Kind of plot: series, spectra, boxes, raos or schedule.")],
    files: Annotated[list[str], Argument(help="Runs: .csv, .parquet or .outb; one line or box each.")],
    out_path: Annotated[str | None, Option("--out", help="Output plot; default: KIND.png.")] = None,
    skip: Annotated[float, Option(min=0.0, help="Initial time left out, s; in series it is shaded.")] = 0.0,
    title: Annotated[str | None, Option(help="Title of the plot.")] = None,
    platform: Annotated[str, Option(help="Platform of rated values and periods, or none.")] = "oc3_hywind",
):
    """Plot saved runs: time series, spectra, box plots.

    Also plots RAOs, and the steady schedule in a table of fowt model trim.

    Examples:
    fowt plot series run.csv  # stacked time series, in series.png
    fowt plot spectra pi.csv lqr.csv --skip 100 --out spectra.png  # two runs overlaid
    fowt plot series openfast.outb run.csv  # a run of OpenFAST and one of fowt simulate
    fowt plot boxes results/demo/runs/*/ntm_18_seed1.parquet --out boxes.png  # a box for each run
    fowt plot raos waves.parquet --skip 100  # motion per metre of wave, from a run in irregular waves
    fowt plot schedule steady.csv  # operating points saved by fowt model trim --out

    Runs are files of fowt simulate --out or of an evaluation's runs folder, or .outb files of OpenFAST.
    """
    import numpy as np

    from fowt_env.descriptions.checks import check_number
    from fowt_env.descriptions.platform import read_platform, turbine_of
    from fowt_env.descriptions.ratings import ratings
    from fowt_env.files.tables import read_series
    from fowt_env.visual import response, time_series
    from fowt_env.visual.time_series import TIME

    if kind not in PLOTS:
        raise unknown("kind of plot", kind, PLOTS)
    path = plot_file(kind if out_path is None else out_path)
    frames = {name: read_series(file, timed=kind != "schedule") for name, file in _names(files).items()}
    lengths = [np.ptp(frame[TIME]) for frame in frames.values() if TIME in frame and len(frame)]
    if lengths:
        check_number("skip", skip, 0.0, max(lengths), high_open=True)
    if len(frames) == 1:  # no legend
        frames = {"": next(iter(frames.values()))}
    known = None if platform.lower() == "none" else read_platform(platform)
    levels = {} if known is None else ratings(turbine_of(known))
    period = known and known.published.get("natural_periods", {}).get("pitch")
    if kind == "series":
        time_series.plot_runs(frames, path, title, skip=skip, ratings=levels)
    elif kind == "spectra":
        time_series.plot_spectra(frames, path, title, skip, platform_pitch_period=period)
    elif kind == "boxes":
        response.plot_boxes({"": frames}, path, title, skip)
    elif kind == "raos":
        response.plot_raos(frames, path, title, skip, platform_pitch_period=period)
    else:
        response.plot_schedule(frames, path, title, rated_wind=levels.get("rated_wind_speed_[m/s]"))
    wrote(path)


def _names(files):
    """Return {label: path}, the label being the part of the path that differs between the files."""
    if len(set(files)) < len(files):
        raise InputError(f"files {', '.join(files)}: each must be named once")
    parts = [[*Path(file).parts[:-1], Path(file).stem] for file in files]
    for end in (0, -1):
        while len({each[end] for each in parts}) == 1 and min(map(len, parts)) > 1:
            for each in parts:
                each.pop(end)
    names = ["/".join(each) for each in parts]
    if len(set(names)) < len(names):  # the same run as .csv and as .parquet
        names = files
    return dict(zip(names, files, strict=True))
