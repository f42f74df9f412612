"""Implements fowt model linearize and fowt design: linear models, control design and performance limits."""

import shlex
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fowt_env.analysis.threads import one_thread
from fowt_env.descriptions.checks import parse_numbers, parse_whole_numbers
from fowt_env.errors import InputError
from fowt_env.files.tables import TABLE_SUFFIXES
from fowt_env.training.cli import options as shared
from fowt_env.training.cli.arguments import parse_names, parse_pairs
from fowt_env.training.cli.console import (
    add_group,
    command,
    model,
    note,
    output,
    progress_bar,
    save_table,
    wrote,
)
from fowt_env.training.cli.tables import out, print_table, show

design = add_group("design", "Design and tune controllers; compute their limits.")
WindsOption = Annotated[
    str | None, Option(help=f"Winds, m/s: {shared.RANGE}; default: all whole m/s above rated.")
]
SettingOption = Annotated[
    list[str] | None, Option(metavar="SETTING=VALUE", help="Setting of fowt design lqr; repeatable.")
]
SWEPT = f"Winds, m/s: {shared.RANGE}; default: all whole m/s from cut-in to cut-out."
VARIED = "Setting and its values; repeatable."
INFORMED = "Information available to the feedback (below), comma-separated; default: the usual sets."
SHOWN = (  # metrics of fowt design optimum
    "RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]", "RotTorq_DEL_[kN-m]",
    "TwrBsMyt_DEL_[kN-m]", "FAIRTEN_DEL_[kN]", "GenPwr_std_[kW]", "torque_travel_[kN-m/s]",
)  # fmt: skip
LINEARIZED = "Modes (.csv, .parquet), models (.json, .npz; one wind: .mat) or everything (a folder)."
SETTINGS = {  # field of LQGSettings -> its meaning
    "share": "weight of platform pitch in the cost; the remainder: rotor speed",
    "share_growth": "increase of share per m/s of wind",
    "travel": "limit of blade-pitch travel, relative to gspi_oc3",
    "travel_cap": "limit of blade-pitch travel, deg/s",
    "travel_near_rated": "limit of blade-pitch travel at the lowest design wind, deg/s",
    "power": "limit of the deviation of power, relative to gspi_oc3",
    "torque": "limit of the deviation of generator torque, over rated torque",
    "shaft": "limit of the deviation of shaft torque, relative to gspi_oc3",
    "shaft_near_rated": "limit of the deviation of shaft torque at the lowest design wind, over rated torque",
    "speed_integral": "cost of the integral of rotor speed",
    "torque_rate": "cost of the torque rate",
    "schedule_time": "time constant of the operating wind following the estimate, s",
}


def _scene_and_winds(platform, winds, default, **options):
    """Return (scene, winds in m/s, winds as text); default(turbine): the winds without a text."""
    import fowt_env

    speeds = None if winds is None else parse_numbers(winds, "winds")
    scene = fowt_env.build_scene(platform, wind=18.0 if speeds is None else speeds[0], **options)
    if speeds is None:
        speeds = [float(speed) for speed in default(scene.turbine)]
        winds = f"{speeds[0]:g}:{speeds[-1]:g}:1"
    return scene, speeds, winds


def _balanced(table):
    """Return the point of each Pareto front with the smallest sum of both ratios."""
    fronts = table[table["information"] != "gspi_oc3"]
    total = fronts["speed_ratio_[-]"] + fronts["pitch_ratio_[-]"]
    best = total.groupby([fronts["wind_[m/s]"], fronts["information"]], sort=False).idxmin()
    columns = ["wind_[m/s]", "information", "speed_ratio_[-]", "pitch_ratio_[-]", "torque_std_[%]"]
    return table.loc[best, columns]


@command(model)
@one_thread
def linearize(
    platform: shared.PlatformOption = "oc3_hywind",
    winds: Annotated[str | None, Option(help=SWEPT)] = None,
    target: Annotated[str | None, Option("--out", help=LINEARIZED)] = None,
):
    """Linearize the plant: modes, zeros, matrices.

    Each model is at the steady operating point of its wind.

    Examples:
    fowt model linearize --winds 18  # modes with periods and damping at one wind
    fowt model linearize --winds 4:25:1 --out modes.csv  # the sweep, cut-in to cut-out
    fowt model linearize --out study  # a folder: tables, models, pole map, damping and Bode plots
    fowt model linearize --winds 18 --out model.mat  # the matrices, for MATLAB and Simulink (write_mat)

    Modes are those of the plant at constant torque and blade pitch. A right-half-plane zero from blade pitch
    to rotor speed limits the bandwidth of any pitch controller that measures speed alone.
    """
    from fowt_env.controllers.lqr.design import design_winds
    from fowt_env.files.matlab import write_mat
    from fowt_env.files.tables import write_table
    from fowt_env.training.design import sweeps

    suffix, allowed = Path(target or "").suffix.lower(), (*TABLE_SUFFIXES, *sweeps.MODEL_SUFFIXES, ".mat")
    if suffix and suffix not in allowed:
        raise InputError(f"--out {target}: must be a folder or end with {', '.join(allowed)}")
    output(target, folder=not suffix)
    scene, speeds, _ = _scene_and_winds(platform, winds, design_winds)
    if suffix == ".mat" and len(speeds) > 1:
        raise InputError(f"--out {target}: a .mat contains the model of one wind, e.g. --winds 18")
    with progress_bar("linearising", len(speeds)) as update:
        models = sweeps.models_over(scene, speeds, update)
    modes, zeros = sweeps.mode_table(models), sweeps.zero_table(models)
    show(modes, f"{platform}: modes at constant torque and blade pitch")
    text = "right-half-plane zeros, blade pitch to rotor speed"
    show(zeros, text) if len(zeros) else out.print(f"no {text}")
    resting = [wind for wind, model in models.items() if model.pitch_rests]
    cut_out = scene.turbine.cut_out_wind_speed
    if max(models) > cut_out:
        out.print(
            f"above cut-out ({cut_out:g} m/s) a turbine stands still with feathered blades: the models there"
            " are of one that still runs"
        )
    if resting:
        out.print(
            f"up to {max(resting):g} m/s the blade pitch is at its minimum and pitch control is off:"
            " these winds are excluded from zeros and Bode plots"
        )
    if target is None:
        return
    if suffix in TABLE_SUFFIXES:
        written = write_table(modes, target)
    elif suffix == ".mat":
        written = write_mat(next(iter(models.values())), target)
    elif suffix:
        written = sweeps.save_models(models, target)
    else:
        written = sweeps.save_study(models, target, f"{platform}, {scene.options['fidelity']}")
    wrote(*written if isinstance(written, list) else [written])


@command(design)
@one_thread
def pi(
    omega: Annotated[float, Option(help="Frequency of the rotor loop, rad/s.")] = 0.2,
    zeta: Annotated[float, Option(help="Damping ratio of the rotor loop.")] = 0.7,
    schedule: Annotated[str, Option(help="loop (same loop at all winds) or published (Jonkman's).")] = "loop",
    winds: WindsOption = None,
    platform: shared.PlatformOption = "oc3_hywind",
    out_path: shared.DesignOption = None,
):
    """Design a gain-scheduled PI controller from frequency and damping of the rotor loop.

    Also prints the damping of platform pitch under these gains.

    Examples:
    fowt design pi --omega 0.2 --zeta 0.7 --out my.json  # the published values, for this rotor
    fowt evaluate --controllers gspi_oc3,design:my.json --cases ntm_18  # score it

    slope: rotor acceleration per blade pitch; KP, KI, omega, zeta: of the rotor loop at that wind;
    platform_zeta: damping of platform pitch under these gains, without viscous drag, negative where unstable.
    """
    import pandas as pd

    from fowt_env.controllers.design.pi import check_aims, design_pi
    from fowt_env.controllers.design.saved_files import save_design
    from fowt_env.controllers.lqr.design import winds_above_rated
    from fowt_env.training.design.sweeps import models_over

    check_aims(omega, zeta, schedule)  # before half a minute of linearising
    scene, speeds, winds = _scene_and_winds(platform, winds, winds_above_rated)
    with progress_bar("linearising", len(speeds)) as update:
        models = models_over(scene, speeds, update)
    result = design_pi(models, scene.turbine, omega, zeta, schedule)
    show(pd.DataFrame(result.table), f"{platform}: rotor loop {omega:g} rad/s, damping {zeta:g}")
    unstable = [row["wind_[m/s]"] for row in result.table if row["platform_zeta_[-]"] < 0.0]
    if unstable:
        out.print(f"the platform is unstable at {', '.join(f'{w:g}' for w in unstable)} m/s: reduce omega")
    gain = result.gain_schedule_pitch
    out.print(f"KP = {result.KP:.6g} s, KI = {result.KI:.6g}, gain_schedule_pitch = {gain:.6g} rad")
    if out_path is not None:
        settings = {key: getattr(result, key) for key in ("KP", "KI", "gain_schedule_pitch")}
        words = (
            f"fowt design pi --omega {omega:g} --zeta {zeta:g} --schedule {schedule}"
            f" --winds {winds} --platform {platform}"
        )
        wrote(save_design(out_path, "pi", scene, settings, words, table=result.table))


@command(design)
@one_thread
def bound(
    wind: Annotated[
        str | None, Option(help=f"Winds above rated, m/s: {shared.RANGE}; default: even m/s.")
    ] = None,
    information: Annotated[str | None, Option(help=INFORMED)] = None,
    travel: Annotated[float, Option(help="Limit of blade-pitch travel relative to gspi_oc3, or inf.")] = 1.0,
    power: Annotated[float, Option(help="Limit of power deviation relative to gspi_oc3, or inf.")] = 1.0,
    torque_std: Annotated[float, Option(help="Limit of torque deviation, %, or inf.")] = 5.0,
    torque_travel: Annotated[float, Option(help="Limit of mean torque rate, %/s, or inf.")] = float("inf"),
    previews: Annotated[str, Option(help="Preview times of the wind, s.")] = "3,11",
    sensors: Annotated[str, Option(help="Sensor chain whose noise acts on the feedback.")] = "standard",
    sea: Annotated[
        str | None, Option(help=f"Sea at all winds. {shared.AS_SIMULATE} Default: as in the suites.")
    ] = None,
    lidar: Annotated[str | None, Option(help="Lidar read besides the sensors, e.g. circular_cw.")] = None,
    distance: Annotated[float | None, Option(help="Its distance, m; default: the farthest.")] = None,
    fidelity: shared.FidelityOption = "standard",
    platform: shared.PlatformOption = "oc3_hywind",
    out_path: shared.TableOption = None,
    plot: shared.PlotOption = None,
):
    """Compute the performance limit of linear feedback.

    The limit is the smallest deviations of rotor speed and platform pitch that linear feedback can reach.

    Examples:
    fowt design bound --wind 18  # the performance limit of linear control, at 18 m/s
    fowt design bound --out bound.csv --plot bound.png  # all winds above rated
    fowt design bound --wind 18 --information measured,measured_pitch_only  # with and without torque control
    fowt design bound --wind 18 --previews 5 --information full,full_preview_5  # 5 s of wind preview
    fowt design bound --fidelity elastic --lidar circular_cw --information measured,measured_lidar

    Deviations are ratios to gspi_oc3 on the same model, with no more pitch travel or power deviation.
    Information: full (plant, wind and waves), measured (five sensors with noise) or speed (rotor speed and
    blade pitch); _preview_T adds the wind T s ahead, measured_lidar the reading of a lidar, _pitch_only
    excludes torque. fowt evaluate --of-limit compares each controller with the limit at its own travel,
    power and torque.
    """
    import fowt_env
    from fowt_env.descriptions.sea_state import sea_of, sea_state_of
    from fowt_env.training.design.bound_control import noise_of
    from fowt_env.training.design.linear_bound import INFORMATION, PLOTTED, bound_table, rounded

    output(out_path, endings=TABLE_SUFFIXES)
    speeds = None if wind is None else parse_numbers(wind, "wind")
    scene = fowt_env.build_scene(platform, wind=18.0 if speeds is None else speeds[0], fidelity=fidelity)
    with progress_bar("designing") as update:
        table = bound_table(
            scene,
            speeds,
            parse_names(information),
            travel=travel,
            power=power,
            torque_std=0.01 * torque_std,
            torque_travel=0.01 * torque_travel,
            lidar=lidar,
            distance=distance,
            previews=parse_numbers(previews, "previews"),
            noise=noise_of(sensors, scene.turbine),
            sea=None if sea is None else sea_state_of(sea_of(sea)),
            progress=update,
        )
    single = speeds is not None and len(speeds) == 1
    show(table if single else _balanced(table), f"{platform}: smallest deviations")
    if omitted := table.attrs.get("omitted"):
        note(f"no convergence, omitted: {'; '.join(omitted)}")
    if "fits" in table.attrs:
        show(table.attrs["fits"], "weather as filtered noise: errors of the fits; linear drag of the hull")
    save_table(rounded(table), out_path)
    if plot is not None:
        from fowt_env.training.design.plots import plot_bound

        shown = set(table["information"])
        names = {name: INFORMATION.get(name, name) for name in PLOTTED if name in shown}
        plot_bound(table, names or {name: name for name in shown - {"gspi_oc3"}}, path=plot)
    wrote(plot)


@command(design)
@one_thread
def optimum(
    cases: Annotated[str, Option(help="Cases of the suite, comma-separated.")] = "ntm_12",
    seeds: shared.ValidationSeeds = "1001,1002",
    suite: Annotated[str, Option(help="Suite with a score, of rigid turbines.")] = "above_rated",
    start: Annotated[str, Option(help="Controller of the first commands.")] = "mpc",
    iterations: Annotated[int, Option(help="Most iterations for each case and seed.")] = 15,
    out_folder: shared.FolderOption = "results/optimum",
):
    """Compute commands of least score in a known wind and sea.

    A clairvoyant optimum: what torque and blade pitch can reach if wind and waves of a run are known. Near
    rated wind, where no linear limit holds, it is an upper estimate of the limit, since it is reached.

    Examples:
    fowt design optimum  # 12 m/s, two seeds, started from mpc: about two minutes for each
    fowt design optimum --cases ntm_12,ntm_14 --seeds 1001:1003:1 --out results/optimum

    The score of each run is minimised by an iterative linear-quadratic regulator through the Jacobians of the
    plant, within the ranges and rates of torque and pitch and, as penalties, the limits of the suite and of
    above_rated_elastic. It is a local optimum: a search from other commands may end elsewhere.

    [bold]Files written[/bold]: history.csv (total, score and metrics after each iteration), results.csv
    (metrics as of fowt evaluate), commands_CASE_SEED.npz. The same command continues an interrupted search.
    """
    from fowt_env.training.design import optimum as search
    from fowt_env.training.evaluation.cases import read_suite
    from fowt_env.training.evaluation.leaderboard import leaderboard

    output(out_folder, folder=True)
    numbers = parse_whole_numbers(seeds, "seeds")
    with progress_bar("searching") as update:
        results, history = search.optimum(
            cases, numbers, out_folder, suite=suite, start=start, iterations=iterations, progress=update
        )
    columns = ["case", "seed", "iteration", "total", "score"]
    show(history[columns], "score after each iteration, with penalties: total")
    board = leaderboard(results, score=read_suite(suite).score)
    rows = []
    for entry in board["controllers"]:
        for case, figures in entry["cases"].items():
            means = (figures["metrics"][name]["mean"] for name in SHOWN)
            rows.append((entry["controller"], case, *means))
    scores = {entry["controller"]: entry["score"]["winds"]["mean"] for entry in board["controllers"]}
    print_table(("controller", "case", *SHOWN), rows, "means over seeds", left=(0, 1))
    out.print("score, mean of the cases: " + ", ".join(f"{k} {v:.3f}" for k, v in scores.items()))
    wrote(*(f"{out_folder}/{name}" for name in ("history.csv", "results.csv")))


@command(design)
@one_thread
def zeros(
    platform: shared.PlatformOption = "oc3_hywind",
    winds: WindsOption = None,
    out_path: shared.TableOption = None,
):
    """Find right-half-plane zeros that limit control by blade pitch.

    Lists zeros from blade pitch to rotor speed, with damping ratios under pi.

    Examples:
    fowt design zeros  # OC3-Hywind, whole m/s above rated
    fowt design zeros --platform nrel5mw_oc4_semi --out zeros.csv  # another platform, as a table

    No feedback of rotor speed alone can be faster than such a zero. pi: damping ratios of platform pitch (or
    of the rotor, if lower) and of surge under pi, without drag.
    """
    from fowt_env.controllers.lqr.design import winds_above_rated
    from fowt_env.training.design.sweeps import zeros_over

    output(out_path, endings=TABLE_SUFFIXES)
    # equals the linear model of "reference" within 1e-3, in a tenth of the time
    scene, speeds, _ = _scene_and_winds(platform, winds, winds_above_rated, fidelity="standard")
    with progress_bar("linearising") as update:
        table = zeros_over(scene, speeds, update)
    show(table, f"{platform}: zeros of blade pitch to rotor speed")
    save_table(table, out_path)


@command(design)
@one_thread
def front(
    runs: Annotated[str, Option(help="Output table of fowt design lqr-sweep.")],
    bound_path: Annotated[str, Option("--bound", help="Output table of fowt design bound.")],
    out_path: shared.TableOption = None,
    plot: shared.PlotOption = None,
):
    """Compare simulated designs with the performance limit.

    Examples:
    fowt design front --runs sweep.csv --bound bound.csv --plot front.png  # lqr and the limit
    """
    from fowt_env.files.tables import read_table
    from fowt_env.training.design.linear_bound import INFORMATION, PLOTTED, ratio_table

    fronts = read_table(bound_path)
    table = ratio_table(read_table(runs), fronts)
    show(table, "relative to gspi_oc3; of_bound: 1 at the limit")
    save_table(table, out_path)
    if plot is not None:
        from fowt_env.training.design.plots import plot_bound

        plot_bound(fronts, {name: INFORMATION[name] for name in PLOTTED}, table, path=plot)
    wrote(plot)


@command(design)
@one_thread
def lqr(
    setting: SettingOption = None,
    platform: shared.PlatformOption = "oc3_hywind",
    out_path: shared.DesignOption = None,
):
    """Design an LQG controller with your settings, and save it.

    Examples:
    fowt design lqr  # the settings and their defaults
    fowt design lqr --setting travel=0.8 --out my.json  # a design with less blade-pitch travel
    fowt simulate --controller design:my.json --wind ntm:18:B  # run it

    For sweeps over settings see fowt design lqr-sweep.
    """
    import fowt_env
    from fowt_env.controllers.design.saved_files import lqr_settings, save_design
    from fowt_env.controllers.lqr.design import LQGSettings, design_models

    output(out_path, endings=(".json",))
    fixed = parse_pairs(setting, "setting")
    default = LQGSettings()
    chosen = default.changed(**fixed)
    rows = [
        (name, f"{getattr(chosen, name):g}", f"{getattr(default, name):g}", text)
        for name, text in SETTINGS.items()
    ]
    headings = ("setting", "value", "default", "meaning")
    print_table(headings, rows, "settings of lqr", left=(0, 3), prose=(3,))
    if out_path is None:
        return
    words = ["fowt design lqr", *(f"--setting {key}={value}" for key, value in fixed.items())]
    words += [] if platform == "oc3_hywind" else [f"--platform {platform}"]
    with progress_bar("designing"):
        scene = fowt_env.build_scene(platform, wind=18.0)
        settings = lqr_settings(chosen, design_models(scene))
        path = save_design(out_path, "lqr", scene, settings, " ".join(words))
    note(f"wrote {path}; next: fowt simulate --controller {shlex.quote(f'design:{path}')} --wind ntm:18:B")


@command(design)
@one_thread
def lqr_sweep(
    vary: Annotated[list[str] | None, Option(metavar="SETTING=A,B,C", help=VARIED)] = None,
    setting: SettingOption = None,
    cases: Annotated[str, Option(help="Cases or suites, comma-separated.")] = "ntm_14,ntm_18,ntm_22",
    seeds: shared.ValidationSeeds = "1001,1002",
    platform: shared.PlatformOption = "oc3_hywind",
    out_path: Annotated[str | None, Option("--out", help="Output table of all runs: .csv.")] = None,
):
    """Simulate lqr designs over values of their settings, and gspi_oc3.

    Examples:
    fowt design lqr-sweep  # the shipped settings against gspi_oc3 on validation seeds
    fowt design lqr-sweep --vary share=0.3,0.5,0.7 --out sweep.csv  # three designs
    """
    from fowt_env.training.design.sweeps import SHOWN, sweep

    output(out_path, endings=(".csv",))
    variants = [parse_pairs(setting, "setting")]
    for pair in vary or ():
        name, _, values = pair.partition("=")
        numbers = parse_numbers(values, f"setting {name}")
        variants = [variant | {name: number} for variant in variants for number in numbers]
    numbers = parse_whole_numbers(seeds, "seeds")
    with progress_bar("simulating") as update:
        table = sweep(variants, cases, numbers, out_path, update, platform=platform)
    means = table.groupby(["case", "variant"], sort=False)[list(SHOWN)].mean().reset_index()
    show(means, f"means over seeds {numbers}")
    wrote(out_path)


@command(design)
@one_thread
def search(
    name: Annotated[str, Argument(help="Controller: pi_tuned, rosco_float, lqr, mpc, ...")],
    budget: Annotated[int, Option(help="Number of settings tried.")] = 40,
    suite: shared.SuiteOption = "above_rated",
    platform: shared.PlatformOption = "oc3_hywind",
    seeds: shared.ValidationSeeds = "1001,1002",
    preview: Annotated[str, Option(help="Wind preview: exact, or the name of a lidar.")] = "exact",
    aim: Annotated[str, Option(help="Aim: motions or scores, see below.")] = "motions",
    jobs: shared.JobsOption = 1,
    engine: shared.EngineOption = "processes",
    address: shared.AddressOption = None,
    keep: Annotated[bool, Option("--keep", help="Write the result to controllers/tuned.toml.")] = False,
    out_folder: shared.FolderOption = "results/tune",
):
    """Optimise the settings of a built-in controller.

    Objective, seeds and limits are the same for all controllers.

    Examples:
    fowt design search pi_tuned  # three factors on the published gains, 40 settings tried
    fowt design search rosco_float --jobs 2 --keep  # write the result to controllers/tuned.toml
    fowt design search mpc --aim scores --keep  # for both scores of the suite

    Cost: the aim, and penalties for exceeded limits of the suite, for energy below 99.5 % and for failed or
    tripped runs. Aims: motions, the mean lifetime ratio of rotor-speed and platform-pitch deviation to
    gspi_oc3's; scores, the mean of the suite's two scores, with limits of pitch travel, shaft torque,
    power and rotor-speed deviation in each wind.
    """
    from fowt_env.training.design.tune import tune, write_tuned
    from fowt_env.training.evaluation.engines import session

    numbers = tuple(parse_whole_numbers(seeds, "seeds"))
    if keep and platform != "oc3_hywind":
        raise InputError(f"--keep: controllers/tuned.toml is for OC3-Hywind; omit --keep for {platform!r}")
    settings = {"suite": suite, "seeds": numbers, "jobs": jobs, "engine": engine, "address": address}
    settings |= {} if platform == "oc3_hywind" else {"platform": platform}
    settings |= {} if preview == "exact" else {"preview": preview}
    settings |= {} if aim == "motions" else {"aim": aim}
    with progress_bar(f"tuning {name}", budget) as update, session(engine, jobs, address):

        def report(number, row):
            update(number, budget, f"tuning {name}, cost {row['cost']:.3f}")

        tuned, metrics, table = tune(name, budget, out_folder, report, **settings)
    show(table.nsmallest(10, "cost"), f"{name}: the best of {len(table)}")
    if keep:
        write_tuned(name, tuned, metrics, budget, settings)
        wrote("controllers/tuned.toml")
    wrote(f"{out_folder}/tune_{name}.csv")
