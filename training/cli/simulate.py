"""Implements fowt simulate and fowt model trim: single runs and steady operating points."""

from typing import Annotated

from typer import Option

from fowt_env.descriptions.checks import check_number, parse_numbers
from fowt_env.descriptions.sea_state import sea_of
from fowt_env.descriptions.wind import wind_of
from fowt_env.errors import SimulationStopped
from fowt_env.files.tables import SERIES_SUFFIXES, TABLE_SUFFIXES, write_table
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.arguments import parse_fault, parse_pairs, parse_protection
from fowt_env.training.cli.console import command, model, note, output, progress_bar, save_table, wrote
from fowt_env.training.cli.tables import print_table

ROUNDING = 1e-9  # fraction of a channel's largest value below which a statistic is rounding error
OF_BLADES = ("RootMyc1_[kN-m]", "LSSTipMys_[kN-m]", "LSSTipMzs_[kN-m]")  # only with individual pitch
LEAST_WAVES = 700.0  # s, weather duration of shorter runs
WIND = (
    "Wind speed, m/s; KIND:SPEED[:CLASS], e.g. ntm:18:B, eog:18 or mann:18:B (full field); a file: .csv (time"
    " and speed), .bts, .wnd, .hh; JSON, e.g. of kind box; or none. See fowt list winds."
)
SEA = "Name from fowt list seas, jonswap:HS:TP[:GAMMA], regular:H:T, JSON, or none (still water)."
CONTROLLER = (
    "Name from fowt list controllers, policy:NAME from fowt list agents, policy:FILE.npz, design:FILE.json,"
    " dll:FILE.so[,DISCON.IN] or your module:Name. none: constant rotor speed and blade pitch (at rest"
    " without wind); constant: constant"
    " torque and blade pitch, variable rotor speed."
)
FIDELITY = (
    "reference, standard (1000 times faster, within 0.1 %), elastic (standard with bending blades, tower and"
    " shaft), or fast (tabulated rotor)."
)
INITIAL = "Initial value in OpenFAST units; repeatable."
FAULT = "Fault, e.g. grid_loss:100; repeatable."
PROTECTION = "Trips: none, turbine (as in the turbine file), or JSON of single trips."
REPEATED = list[str] | None


@command()
def simulate(
    platform: shared.PlatformOption = "oc3_hywind",
    wind: Annotated[str, Option(help=WIND)] = "18",
    sea: Annotated[str, Option(help=SEA)] = "none",
    controller: Annotated[str, Option(help=CONTROLLER)] = "pi",
    duration: Annotated[float, Option(help="Length of the run, s.")] = 600.0,
    dt: Annotated[float | None, Option(help="Physics time step, s; default: set by the fidelity.")] = None,
    control_dt: Annotated[float, Option(help="Control period, s; a multiple of dt.")] = 0.1,
    output_dt: Annotated[float, Option(help="Output period, s; a multiple of dt.")] = 0.1,
    seed: Annotated[int, Option(help="Seed of wind and waves.")] = 0,
    fidelity: Annotated[str, Option(help=FIDELITY)] = "standard",
    rotor: shared.RotorOption = None,
    start: Annotated[str, Option(help="trim (steady state at the mean wind) or zero.")] = "trim",
    initial: Annotated[REPEATED, Option(metavar="CHANNEL=VALUE", help=INITIAL)] = None,
    fault: Annotated[REPEATED, Option(metavar="KIND:TIME or JSON", help=FAULT)] = None,
    protection: Annotated[str, Option(help=PROTECTION)] = "none",
    option: shared.OptionOption = None,
    out_path: Annotated[str | None, Option("--out", help="Time series: .csv, .parquet or .outb.")] = None,
    plot: shared.PlotOption = None,
):
    """Simulate one run: statistics, time series and a plot.

    Examples:
    fowt simulate --wind 18 --sea paper_wind_wave --plot run.png  # steady wind, irregular sea
    fowt simulate --wind ntm:18:B --seed 3 --controller gspi_oc3 --out run.csv  # turbulence
    fowt simulate --wind none --sea regular:3:5 --controller none --start zero  # waves alone
    fowt simulate --wind none --start zero --controller none --initial PtfmSurge=10  # free decay
    fowt simulate --wind '{"kind": "etm", "speed": 18, "class": "A"}'  # a wind as JSON
    fowt simulate --controller policy:ppo_lqr --wind ntm:16:B  # a trained agent
    fowt simulate --controller ipc --option pitch=individual  # individual blade pitch
    fowt simulate --wind 18 --fault grid_loss:100 --protection turbine  # a fault, with trips
    """
    import fowt_env

    output(out_path, endings=SERIES_SUFFIXES)  # before the run
    check_number("duration", duration, 0.0, low_open=True)
    scene = scene_of(platform, wind, sea, duration, seed, fidelity, option, rotor)
    title = f"{platform} · wind {wind} · sea {sea} · controller {controller} · seed {seed}"
    with progress_bar("simulating", 1.0) as update:
        try:
            frame = fowt_env.simulate(
                scene,
                controller=None if controller.lower() == "none" else controller,
                duration=duration,
                dt=dt,
                control_dt=control_dt,
                output_dt=output_dt,
                initial={"start": start} | parse_pairs(initial, "initial"),
                protection=parse_protection(protection),
                faults=[parse_fault(text) for text in fault or ()],
                progress=update,
            )
        except (SimulationStopped, KeyboardInterrupt) as error:
            save_run(getattr(error, "frame", None), out_path)  # the rows so far
            raise
    _print_channels(frame, title)
    _note_limits(frame, scene.turbine)
    if printed := frame.attrs.get("controller_output"):
        note(f"the controller says:\n{printed}")
    save_run(frame, out_path)
    if plot is not None:
        from fowt_env.visual.time_series import plot_run

        plot_run(frame, plot, title)
    wrote(plot)


def scene_of(platform, wind, sea, duration, seed, fidelity, option, rotor=None):
    """Return the scene of a command's options, with weather for a run of `duration` s."""
    import fowt_env

    options = {"duration": max(LEAST_WAVES, duration), **parse_pairs(option, "option")}
    options |= {"seed": seed, "rotor": rotor, "fidelity": fidelity}
    return fowt_env.build_scene(platform, wind=wind_of(wind), sea=sea_of(sea), **options)


def save_run(frame, path):
    """Write the rows of a run to the path of an option and print the path; None: do nothing."""
    if path is not None and frame is not None and len(frame):
        note(f"wrote {write_table(frame, path)} ({len(frame)} rows)")


def _note_limits(frame, turbine):
    """Print notes on torque at its limits, rotor speed above the overspeed limit, and a trip."""
    from fowt_env.descriptions.units import RPM

    limited = frame["GenTqLim_[-]"].mean()
    if limited > 0.0:
        note(
            f"generator torque at its range or rate limit for {100.0 * limited:.1f} % of the run: the"
            " generator cannot follow the commands"
        )
    fastest, limit = frame["RotSpeed_[rpm]"].max(), turbine.overspeed / RPM
    if fastest > limit:
        note(
            f"rotor speed reaches {fastest:.2f} rpm, above the turbine's overspeed of {limit:g} rpm, where an"
            " environment terminates and an evaluation counts the run as failed"
        )
    if frame.attrs.get("trip") is not None:
        trip = frame.attrs["trip"].replace("_", " ")
        note(f"{trip} trip at {frame.attrs['tripped']:.1f} s: {frame.attrs['stop']} stop")


def _print_channels(frame, title):
    """Print mean, standard deviation and range of the main channels."""
    from fowt_env.visual.time_series import PANELS

    main = (*(channel for _, channel in PANELS), "GenTq_[kN-m]", "RotThrust_[kN]", *OF_BLADES)
    x = frame[[channel for channel in dict.fromkeys(main) if channel in frame.columns]]
    largest, names = x.abs().max(), [channel.replace("_", " ") for channel in x.columns]
    shown = (s.where(s.abs() >= ROUNDING * largest, 0.0) for s in (x.mean(), x.std(ddof=0), x.min(), x.max()))
    rows = zip(names, *shown, strict=True)
    print_table(("channel", "mean", "std", "min", "max"), rows, title)


def compared_runs(controllers, duration, progress, platform="oc3_hywind", wind=None, sea=None, **options):
    """Return (scene, {controller: run}) of comma-separated controllers in the same wind and waves."""
    import fowt_env
    from fowt_env.controllers import controller_names

    options = {"duration": max(LEAST_WAVES, duration)} | options
    names, runs = list(dict.fromkeys(controller_names(controllers))), {}
    scene = fowt_env.build_scene(platform, wind=wind_of(wind), sea=sea_of(sea), **options)
    for number, name in enumerate(names, 1):
        runs[name] = fowt_env.simulate(scene, controller=name, duration=duration)
        progress(number, len(names), name)
    return scene, runs


TRIM_CHANNELS = (
    *("RotSpeed", "BldPitch1", "GenTq", "GenPwr", "RotThrust"),
    *("PtfmSurge", "PtfmHeave", "PtfmPitch", "FAIRTEN1"),
)


@command(model)
def trim(
    platform: shared.PlatformOption = "oc3_hywind",
    winds: Annotated[str, Option(help=f"Steady winds, m/s: {shared.RANGE}.")] = "4:24:1",
    fixed: Annotated[bool, Option("--fixed", help="Fix the platform.")] = False,
    rotor: shared.RotorOption = None,
    option: shared.OptionOption = None,
    out_path: shared.TableOption = None,
    plot: shared.PlotOption = None,
):
    """Compute steady operating points over wind speed.

    Examples:
    fowt model trim  # the floating turbine from cut-in to cut-out
    fowt model trim --winds 8,11.4,18 --fixed --out steady.csv  # fixed platform, saved to a file
    fowt model trim --plot schedule.png  # plot of the steady schedule
    """
    import pandas as pd

    import fowt_env

    output(out_path, endings=TABLE_SUFFIXES)
    speeds, options, rows = parse_numbers(winds, "winds"), parse_pairs(option, "option"), []
    with progress_bar("trimming", len(speeds)) as update:
        for number, speed in enumerate(speeds, 1):
            scene = fowt_env.build_scene(platform, wind=speed, rotor=rotor, **options)
            point = fowt_env.trim(scene, platform="fixed" if fixed else "floating")
            rows.append({"wind": speed, **point})
            update(number, text=f"wind {speed:g} m/s")
    units = {channel.name: channel.unit for channel in scene.channels}
    title = f"{platform}, {'fixed' if fixed else 'floating'}, steady wind"
    shown = [name for name in TRIM_CHANNELS if name in rows[0]]
    headings = ["wind\nm/s", *(f"{name}\n{units.get(name, '')}" for name in shown)]
    lines = [(f"{row['wind']:g}", *(row[name] for name in shown)) for row in rows]
    print_table(headings, lines, title, left=())
    names = {"wind": "Wind_[m/s]"} | {name: f"{name}_[{unit}]" for name, unit in units.items()}
    points = pd.DataFrame(rows).rename(columns=names)
    save_table(points, out_path)
    if plot is not None:
        from fowt_env.visual.response import plot_schedule

        plot_schedule(points, plot, title, rated_wind=scene.turbine.rated_wind_speed)
    wrote(plot)
