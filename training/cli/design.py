"""The commands of linear design: fowt linearize and fowt design."""

import json
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from fowt_env.descriptions.checks import parse_numbers, parse_whole_numbers
from fowt_env.errors import InputError
from fowt_env.files.tables import table_path
from fowt_env.training.cli.arguments import parse_pairs
from fowt_env.training.cli.console import (
    RANGE,
    PlatformOption,
    app,
    note,
    out,
    output,
    progress_bar,
    reported,
    show,
)
from fowt_env.training.cli.tables import print_table

design = typer.Typer(
    no_args_is_help=True, rich_markup_mode="rich", help="Design and tune controllers, and find their limits."
)
app.add_typer(design, name="design")

LINEARIZE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt linearize --winds 18[/cyan]  # modes with periods and damping at one wind

[cyan]fowt linearize --winds 4:25:1 --out modes.csv[/cyan]  # the sweep, cut-in to cut-out

[cyan]fowt linearize --out study[/cyan]  # a folder: tables, models, pole map, damping and Bode plots

[cyan]fowt linearize --winds 18 --out model.mat[/cyan]  # the matrices, for MATLAB and Simulink (write_mat)

[cyan]fowt linearize --winds 12:24:2 --out models.npz[/cyan]  # those of several winds, as arrays

In Python, fowt_env.linearize(scene).to_statespace() is the same model as a control.StateSpace.

Modes are those of the plant with torque and blade pitch held. A right-half-plane zero from blade pitch to
rotor speed bounds how fast any pitch controller on speed alone may be. Below rated the blade pitch rests on
its minimum: the zeros and Bode plots of blade pitch leave those winds out."""
PI_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt design pi --omega 0.2 --zeta 0.7 --out my.json[/cyan]  # the published aim, on this rotor

[cyan]fowt evaluate --controllers gspi_oc3,design:my.json --cases ntm_18[/cyan]  # score it

slope: rotor acceleration per blade pitch; KP, KI, omega, zeta: of the rotor loop at that wind;
platform_zeta: damping of platform pitch under these gains, without viscous drag, negative where unstable."""
BOUND_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt design bound --wind 18[/cyan]  # the performance limit of linear control, at 18 m/s

[cyan]fowt design bound --out bound.csv --plot bound.png[/cyan]  # all winds above rated

[cyan]fowt design bound --wind 18 --information measured,measured_pitch_only[/cyan]  # what torque is worth

[cyan]fowt design bound --wind 18 --previews 5 --information full,full_preview_5[/cyan]  # 5 s of wind ahead

Deviations are shown over those of gspi_oc3 on the same model, at no more pitch travel and power deviation.
Information: full (plant, wind and waves), measured (five sensors with their noise) or speed (rotor speed and
blade pitch); with _preview_T where the wind is known T s ahead, with _pitch_only without torque."""
ZEROS_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt design zeros[/cyan]  # OC3-Hywind, whole winds above rated

[cyan]fowt design zeros --platform nrel5mw_oc4_semi --out zeros.csv[/cyan]  # another platform, as a table

A zero in the right half plane, near the platform's own pitch, is where holding the rotor speed with the
blades takes the thrust that damps the platform: no feedback of rotor speed alone can be faster. pi: damping
ratios of platform pitch (or of the rotor, where that is less) and of surge under pi; drag is left out."""
TUNE_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt design tune pi_tuned[/cyan]  # three factors on the published gains, 40 settings tried

[cyan]fowt design tune rosco_float --jobs 2 --keep[/cyan]  # and put what it finds into controllers/tuned.toml

Cost: mean of rotor-speed and platform-pitch deviation over gspi_oc3's, over the lifetime, and penalties
beyond the limits of the suite, for energy below 99.5 % and for failed or tripped runs. Written:
OUT/tune_NAME.csv, a row per setting as soon as it has run."""
FRONT_EXAMPLES = """[bold]Example[/bold]

[cyan]fowt design front --runs sweep.csv --bound bound.csv --plot front.png[/cyan]  # lqr beside the limit

The tables are those of fowt design lqr-sweep --vary ... --out and fowt design bound --out."""
LQR_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt design lqr[/cyan]  # the settings and their defaults

[cyan]fowt design lqr --setting travel=0.8 --out my.json[/cyan]  # a design with less blade-pitch travel

[cyan]fowt simulate --controller design:my.json --wind ntm:18:B[/cyan]  # run it

share is that of platform pitch in what is minimised, the rest is rotor speed; travel, power, torque and shaft
are limits, see LQGSettings in controllers/lqr/design.py. Many values at once: fowt design lqr-sweep."""
SWEEP_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt design lqr-sweep[/cyan]  # the shipped settings against gspi_oc3 on validation seeds

[cyan]fowt design lqr-sweep --vary share=0.3,0.5,0.7 --out sweep.csv[/cyan]  # three designs

[cyan]fowt design front --runs sweep.csv --bound bound.csv[/cyan]  # beside the performance limit"""
SETTINGS = {  # of LQGSettings, in words
    "share": "of platform pitch in what is minimised; the rest: rotor speed",
    "share_growth": "of the share, per m/s",
    "travel": "limit of blade-pitch travel, over that of gspi_oc3",
    "travel_cap": "limit of the same, deg/s",
    "travel_near_rated": "limit of the same at the lowest design wind, deg/s",
    "power": "limit of the power's deviation, over that of gspi_oc3",
    "torque": "limit of the generator torque's deviation, of rated",
    "shaft": "limit of the shaft torque's deviation, over that of gspi_oc3",
    "shaft_near_rated": "limit of the same at the lowest design wind, of rated torque",
    "speed_integral": "cost of the integral of the rotor speed",
    "torque_rate": "cost of the torque's rate",
    "schedule_time": "s, over which the operating wind follows the estimate",
}


def save_lqr(settings, path, platform="oc3_hywind"):
    """The path written: lqr with these settings ({name: value}) on the models of a platform."""
    import fowt_env
    from fowt_env.controllers.design.saved_files import lqr_settings, save_design
    from fowt_env.controllers.lqr.design import LQGSettings, design_models

    chosen = LQGSettings().changed(**settings)
    scene = fowt_env.build_scene(platform, wind=18.0)
    given = [f"--setting {key}={value}" for key, value in settings.items()]
    if platform != "oc3_hywind":
        given.append(f"--platform {platform}")
    command = " ".join(["fowt design lqr", *given])
    return save_design(path, "lqr", scene, lqr_settings(chosen, design_models(scene)), command)


def _scene_and_winds(platform, winds, default, **options):
    """(scene, winds m/s, their text) of a platform; default(turbine): the winds where none are given."""
    import fowt_env

    speeds = None if winds is None else parse_numbers(winds, "winds")
    scene = fowt_env.build_scene(platform, wind=18.0 if speeds is None else speeds[0], **options)
    if speeds is None:
        found = default(scene.turbine)
        return scene, [float(speed) for speed in found], f"{found[0]}:{found[-1]}:1"
    return scene, speeds, winds


def _balanced(table):
    """The point of each Pareto front with the least sum of both ratios."""
    fronts = table[table["information"] != "gspi_oc3"]
    total = fronts["speed_ratio_[-]"] + fronts["pitch_ratio_[-]"]
    best = total.groupby([fronts["wind_[m/s]"], fronts["information"]], sort=False).idxmin()
    columns = ["wind_[m/s]", "information", "speed_ratio_[-]", "pitch_ratio_[-]", "torque_std_[%]"]
    return table.loc[best, columns]


@app.command(epilog=LINEARIZE_EXAMPLES)
@reported
def linearize(
    platform: PlatformOption = "oc3_hywind",
    winds: Annotated[
        str | None,
        typer.Option(help=f"Winds, m/s: {RANGE}; default: whole ones to cut-out."),
    ] = None,
    out_path: Annotated[
        str | None,
        typer.Option(
            "--out",
            help="Modes: .csv, .parquet; models: .json, .npz, of one wind .mat; all, with plots: a folder.",
        ),
    ] = None,
):
    """Linear models over the wind: modes, zeros, matrices."""
    from fowt_env.controllers.lqr.design import design_winds
    from fowt_env.files.matlab import write_mat
    from fowt_env.files.tables import TABLE_SUFFIXES, write_table
    from fowt_env.training.design.sweeps import (
        MODEL_SUFFIXES,
        mode_table,
        models_over,
        save_models,
        save_study,
        zero_table,
    )

    suffix = "" if out_path is None else Path(out_path).suffix.lower()
    if suffix and suffix not in (*TABLE_SUFFIXES, *MODEL_SUFFIXES, ".mat"):
        allowed = ", ".join((*TABLE_SUFFIXES, *MODEL_SUFFIXES, ".mat"))
        raise InputError(f"--out {out_path}: must be a folder or end with {allowed}")
    output(out_path, folder=not suffix)
    scene, speeds, _ = _scene_and_winds(platform, winds, design_winds)
    if suffix == ".mat" and len(speeds) > 1:
        raise InputError(f"--out {out_path}: a .mat holds the model of one wind, as --winds 18")
    with progress_bar("linearising", len(speeds)) as update:
        models = models_over(scene, speeds, lambda done, total: update(done, total=total))
    modes, zeros = mode_table(models), zero_table(models)
    show(modes, f"{platform}: modes, torque and blade pitch held")
    if len(zeros):
        show(zeros, "right-half-plane zeros, blade pitch to rotor speed")
    else:
        out.print("no right-half-plane zeros from blade pitch to rotor speed")
    resting = [wind for wind, model in models.items() if model.pitch_rests]
    if resting:
        out.print(
            f"up to {max(resting):g} m/s the blade pitch rests on its minimum: pitch control is off"
            " there, so these winds are left out of what concerns it"
        )
    if out_path is None:
        return
    if suffix in TABLE_SUFFIXES:
        written = [write_table(modes, out_path)]
    elif suffix == ".mat":
        written = [write_mat(next(iter(models.values())), out_path)]
    elif suffix:
        written = [save_models(models, out_path)]
    else:
        written = save_study(models, out_path)
    for path in written:
        note(f"wrote {path}")


@design.command(epilog=PI_EXAMPLES)
@reported
def pi(
    omega: Annotated[float, typer.Option(help="Frequency of the rotor loop, rad/s.")] = 0.2,
    zeta: Annotated[float, typer.Option(help="Its damping ratio.")] = 0.7,
    schedule: Annotated[
        str, typer.Option(help="loop (as designed at every wind) or published (Jonkman's, slower).")
    ] = "loop",
    winds: Annotated[
        str | None,
        typer.Option(help=f"Winds, m/s: {RANGE}; default: whole ones above rated."),
    ] = None,
    platform: PlatformOption = "oc3_hywind",
    out_path: Annotated[str | None, typer.Option("--out", help="Design: .json.")] = None,
):
    """Gains of a scheduled PI from frequency and damping of the rotor loop.

    With the damping of the platform's pitch that they leave.
    """
    import pandas as pd

    from fowt_env.controllers.design.pi import design_pi
    from fowt_env.controllers.design.saved_files import save_design
    from fowt_env.controllers.lqr.design import winds_above_rated
    from fowt_env.training.design.sweeps import models_over

    output(out_path)
    scene, speeds, winds = _scene_and_winds(platform, winds, winds_above_rated)
    with progress_bar("linearising", len(speeds)) as update:
        models = models_over(scene, speeds, lambda done, total: update(done, total=total))
    found = design_pi(models, scene.turbine, omega, zeta, schedule)
    show(pd.DataFrame(found.table), f"{platform}: rotor loop {omega:g} rad/s, damping {zeta:g}")
    unstable = [row["wind_[m/s]"] for row in found.table if row["platform_zeta_[-]"] < 0.0]
    if unstable:
        out.print(f"the platform is unstable at {', '.join(f'{w:g}' for w in unstable)} m/s: lower omega")
    out.print(
        f"KP = {found.KP:.6g} s, KI = {found.KI:.6g},"
        f" gain_schedule_pitch = {found.gain_schedule_pitch:.6g} rad"
    )
    if out_path is not None:
        settings = {key: getattr(found, key) for key in ("KP", "KI", "gain_schedule_pitch")}
        command = (
            f"fowt design pi --omega {omega:g} --zeta {zeta:g} --schedule {schedule}"
            f" --winds {winds} --platform {platform}"
        )
        note(f"wrote {save_design(out_path, 'pi', scene, settings, command, table=found.table)}")


@design.command(epilog=BOUND_EXAMPLES)
@reported
def bound(
    wind: Annotated[
        str | None, typer.Option(help=f"Winds above rated, m/s: {RANGE}; default: even ones.")
    ] = None,
    information: Annotated[
        str | None, typer.Option(help="What the feedback knows, comma-separated; default: the usual (below).")
    ] = None,
    travel: Annotated[float, typer.Option(help="Limit of blade-pitch travel over gspi_oc3's; or inf.")] = 1.0,
    power: Annotated[float, typer.Option(help="Limit of power deviation over gspi_oc3's; or inf.")] = 1.0,
    torque_std: Annotated[float, typer.Option(help="Limit of the torque's deviation, %; or inf.")] = 5.0,
    previews: Annotated[str, typer.Option(help="Seconds for which the wind is known ahead.")] = "3,11",
    sensors: Annotated[
        str, typer.Option(help="Chain of sensors, whose noise the feedback has.")
    ] = "standard",
    sea: Annotated[
        str | None, typer.Option(help="Sea of every wind, as fowt simulate takes it; default: the suites'.")
    ] = None,
    platform: PlatformOption = "oc3_hywind",
    out_path: Annotated[str | None, typer.Option("--out", help="Pareto fronts: .csv or .parquet.")] = None,
    plot: Annotated[str | None, typer.Option(help="Plot of the Pareto fronts, e.g. bound.png.")] = None,
):
    """Performance limit of linear feedback.

    The least deviations of rotor speed and platform pitch that any linear feedback can reach.
    """
    import fowt_env
    from fowt_env.descriptions.sea_state import sea_state_of
    from fowt_env.files.tables import write_table
    from fowt_env.training.cli.arguments import parse_sea
    from fowt_env.training.design.bound_control import noise_of
    from fowt_env.training.design.linear_bound import INFORMATION, PLOTTED, bound_table, rounded

    if out_path is not None:
        table_path(out_path)
    output(out_path)
    output(plot, "--plot")
    speeds = None if wind is None else parse_numbers(wind, "wind")
    scene = fowt_env.build_scene(platform, wind=18.0 if speeds is None else speeds[0])
    with progress_bar("designing", None) as update:
        table = bound_table(
            scene,
            speeds,
            None if information is None else [name.strip() for name in information.split(",")],
            travel=travel,
            power=power,
            torque_std=0.01 * torque_std,
            previews=parse_numbers(previews, "previews"),
            noise=noise_of(sensors, scene.turbine),
            sea=None if sea is None else sea_state_of(parse_sea(sea)),
            progress=lambda done, n: update(done, total=n),
        )
    single = speeds is not None and len(speeds) == 1
    show(table if single else _balanced(table), f"{platform}: least deviations")
    if "fits" in table.attrs:
        show(table.attrs["fits"], "weather as filters of noise: errors of the fits; linear drag of the hull")
    if out_path is not None:
        note(f"wrote {write_table(rounded(table), out_path)}")
    if plot is not None:
        from fowt_env.training.design.plots import plot_bound

        shown = set(table["information"])
        names = {name: INFORMATION.get(name, name) for name in PLOTTED if name in shown}
        plot_bound(table, names or {name: name for name in shown - {"gspi_oc3"}}, path=plot)
        note(f"wrote {plot}")


@design.command(epilog=ZEROS_EXAMPLES)
@reported
def zeros(
    platform: PlatformOption = "oc3_hywind",
    winds: Annotated[
        str | None,
        typer.Option(help=f"Winds above rated, m/s: {RANGE}; default: whole ones."),
    ] = None,
    out_path: Annotated[str | None, typer.Option("--out", help="Table: .csv or .parquet.")] = None,
):
    """Where right-half-plane zeros limit control by blade pitch.

    From blade pitch to rotor speed, and the damping under pi.
    """
    from fowt_env.controllers.lqr.design import winds_above_rated
    from fowt_env.files.tables import write_table
    from fowt_env.training.design.sweeps import zeros_over

    if out_path is not None:
        table_path(out_path)
    output(out_path)
    # the linear model of "reference" within 1e-3, at a tenth of the time
    scene, speeds, _ = _scene_and_winds(platform, winds, winds_above_rated, fidelity="standard")
    with progress_bar("linearising", None) as update:
        table = zeros_over(scene, speeds, lambda done, total: update(done, total=total))
    show(table, f"{platform}: zeros of blade pitch to rotor speed")
    if out_path is not None:
        note(f"wrote {write_table(table, out_path)}")


@design.command(epilog=FRONT_EXAMPLES)
@reported
def front(
    runs: Annotated[str, typer.Option(help="Table of fowt design lqr-sweep --out.")],
    bound_path: Annotated[str, typer.Option("--bound", help="Table of fowt design bound --out.")],
    out_path: Annotated[str | None, typer.Option("--out", help="Ratios: .csv or .parquet.")] = None,
    plot: Annotated[str | None, typer.Option(help="Plot of the Pareto fronts, e.g. front.png.")] = None,
):
    """Simulated designs beside the performance limit."""
    from fowt_env.files.tables import read_table, write_table
    from fowt_env.training.design.linear_bound import INFORMATION, PLOTTED, ratio_table

    output(out_path)
    output(plot, "--plot")
    fronts = read_table(bound_path)
    table = ratio_table(read_table(runs), fronts)
    show(table, "over gspi_oc3; of_bound: 1 on the limit")
    if out_path is not None:
        note(f"wrote {write_table(table, out_path)}")
    if plot is not None:
        from fowt_env.training.design.plots import plot_bound

        plot_bound(fronts, {name: INFORMATION[name] for name in PLOTTED}, table, path=plot)
        note(f"wrote {plot}")


SettingOption = Annotated[
    list[str] | None, typer.Option(metavar="SETTING=VALUE", help="A setting of fowt design lqr; repeats.")
]


@design.command(epilog=LQR_EXAMPLES)
@reported
def lqr(
    setting: SettingOption = None,
    platform: PlatformOption = "oc3_hywind",
    out_path: Annotated[str | None, typer.Option("--out", help="The design, .json.")] = None,
    vary: Annotated[list[str] | None, typer.Option(hidden=True)] = None,
):
    """Design an LQG controller with settings of your own, and save it."""
    from fowt_env.controllers.lqr.design import LQGSettings

    if vary or (out_path is not None and not out_path.lower().endswith(".json")):
        given = f"--vary {vary[0]}" if vary else f"--out {out_path}"
        raise InputError(f"{given}: fowt design lqr saves one design as .json; for a sweep: lqr-sweep")
    fixed = parse_pairs(setting, "setting")
    chosen, default = asdict(LQGSettings().changed(**fixed)), asdict(LQGSettings())
    rows = [(name, f"{value:g}", f"{default[name]:g}", SETTINGS[name]) for name, value in chosen.items()]
    headings = ("setting", "value", "default", "what it is")
    print_table(out, headings, rows, "settings of lqr", left=(0, 3), prose=(3,))
    if out_path is None:
        return
    output(out_path)
    with progress_bar("designing", None):
        path = save_lqr(fixed, out_path, platform)
    note(f"wrote {path}; next: fowt simulate --controller {shlex.quote(f'design:{path}')} --wind ntm:18:B")


@design.command(name="lqr-sweep", epilog=SWEEP_EXAMPLES)
@reported
def lqr_sweep(
    vary: Annotated[
        list[str] | None, typer.Option(metavar="SETTING=A,B,C", help="Setting and its values; repeats.")
    ] = None,
    setting: SettingOption = None,
    cases: Annotated[str, typer.Option(help="Cases or suites.")] = "ntm_14,ntm_18,ntm_22",
    seeds: Annotated[
        str, typer.Option(help="Validation seeds, 1000 and above: 1001,1002 or 1001:1006:1 (1006 included).")
    ] = "1001,1002",
    platform: PlatformOption = "oc3_hywind",
    out_path: Annotated[str | None, typer.Option("--out", help="All runs, .csv.")] = None,
):
    """Run designs of lqr over values of its settings, beside gspi_oc3."""
    from fowt_env.training.design.sweeps import SHOWN, sweep

    if out_path is not None:
        table_path(out_path, (".csv",))
    variants = [parse_pairs(setting, "setting")]
    for pair in vary or ():
        name, _, values = pair.partition("=")
        numbers = parse_numbers(values, f"setting {name}")
        variants = [variant | {name: number} for variant in variants for number in numbers]
    numbers = parse_whole_numbers(seeds, "seeds")
    output(out_path)
    with progress_bar("simulating", None) as update:
        table = sweep(
            variants,
            cases,
            numbers,
            out_path,
            lambda done, total: update(done, total=total),
            platform=platform,
        )
    means = table.groupby(["case", "variant"], sort=False)[list(SHOWN)].mean().reset_index()
    show(means, f"means over seeds {json.dumps(numbers)}")
    if out_path is not None:
        note(f"wrote {out_path}")


@design.command(name="tune", epilog=TUNE_EXAMPLES)
@reported
def tune_command(
    name: Annotated[
        str, typer.Argument(help="pi_tuned, floating_feedback, rosco_float, lqr, mpc, mpc_preview, ...")
    ],
    budget: Annotated[int, typer.Option(help="Settings that are tried.")] = 40,
    suite: Annotated[str, typer.Option(help="Suite whose cases are run.")] = "above_rated",
    platform: PlatformOption = "oc3_hywind",
    seeds: Annotated[
        str, typer.Option(help="Validation seeds, 1000 or more: 1001,1002 or 1001:1006:1 (1006 included).")
    ] = "1001,1002",
    preview: Annotated[str, typer.Option(help="Wind ahead: exact, or a lidar by its name.")] = "exact",
    jobs: Annotated[int, typer.Option(help="Worker processes.")] = 1,
    engine: Annotated[str, typer.Option(help="Where the runs go: processes or ray.")] = "processes",
    address: Annotated[str | None, typer.Option(help="Of a Ray cluster that is running.")] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Write what is found to controllers/tuned.toml.")
    ] = False,
    out_folder: Annotated[str, typer.Option("--out", help="Folder of the table.")] = "results/tune",
):
    """Search the settings of a built-in controller.

    One objective, one set of seeds and limits for all of them.
    """
    from fowt_env.training.design.tune import tune, write_tuned
    from fowt_env.training.evaluation.engines import session

    numbers = tuple(int(seed) for seed in parse_whole_numbers(seeds, "seeds"))
    if keep and platform != "oc3_hywind":
        raise InputError(f"--keep: controllers/tuned.toml is OC3-Hywind's; {platform!r} is tuned for a table")
    asked = {"suite": suite, "seeds": numbers, "jobs": jobs, "engine": engine, "address": address}
    asked |= {} if platform == "oc3_hywind" else {"platform": platform}
    asked |= {} if preview == "exact" else {"preview": preview}
    output(out_folder, folder=True)
    with progress_bar(f"tuning {name}", budget) as update, session(engine, jobs, address):

        def report(number, row):
            update(number, f"tuning {name}, cost {row['cost']:.3f}", budget)

        settings, figures, table = tune(name, budget, out_folder, report, **asked)
    show(table.nsmallest(10, "cost"), f"{name}: the best of {len(table)}")
    if keep:
        write_tuned(name, settings, figures, budget, asked)
        note("wrote controllers/tuned.toml")
    note(f"wrote tune_{name}.csv in {out_folder}")
