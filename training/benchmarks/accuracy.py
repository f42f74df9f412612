"""Measures run time against error of the whole model for every cheaper choice of parts.

Reference of a seed: the exact parts (BEM rotor, exact waves, Runge-Kutta 4) at the finest step; runs at twice
the step show convergence. Error of a variant: the largest rms difference of CHANNELS over the standard
deviation of the reference, in the same wind and sea, controller at 10 Hz. Cost: the CPU time of simulate and
of the compiled loop alone, as real-time factors.
"""

import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.errors import InputError, unknown
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.run.initial_conditions import initial_state
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.scene.options import FIDELITIES
from fowt_env.training.benchmarks.speed import SEA, TURBULENCE, calibration, header, loop_time, silent
from fowt_env.training.reports.evaluation_plots import label_marks
from fowt_env.training.validation.signal_errors import normalised_rms
from fowt_env.visual.style import COLOURS, INK, new_figure, save_figure, style_axes
from fowt_env.weather.wind_field import is_field

CHANNELS = {
    "surge": "PtfmSurge_[m]", "sway": "PtfmSway_[m]", "heave": "PtfmHeave_[m]", "roll": "PtfmRoll_[deg]",
    "platform_pitch": "PtfmPitch_[deg]", "yaw": "PtfmYaw_[deg]", "rotor_speed": "RotSpeed_[rpm]",
    "fairlead_tension": "FAIRTEN1_[kN]",
}  # fmt: skip
PLATFORM = "oc3_hywind"
UNITS = {"strongest": "strongest components", "blade_stations": "stations", "strip_length": "m strips",
         "rotor_samples": "rotor loads a step"}  # fmt: skip
TIMED = 1.0  # s of CPU time: shorter runs are repeated until then, longer ones timed once
COLUMNS = (
    "seed", "variant", "axis", "integrator", "dt_s", "rotor", "wave_loads", "components", "seconds",
    "finest_s", "worst", "worst_of", *CHANNELS, "real_time_factor", "kernel_factor", "calibration_ms",
)  # fmt: skip
# OpenFAST with the rigid model, 18 m/s uniform turbulence, Hs 7.5 m: (step and strips, real-time factor
# (CPU), largest |difference| in 40 s to this reference: surge m, platform pitch deg, rotor speed rpm),
# and the standard deviations of the same case over 500 s for normalisation
OPENFAST = (
    ("0.0125 s, 1 m:\nits reference", 1.9, (0.0, 0.0, 0.0)),
    ("0.0125 s, 2 m", 2.9, (0.0025, 0.0013, 0.0009)),
    ("0.025 s, 2 m", 6.0, (0.0062, 0.0044, 0.0036)),
    ("0.05 s, 4 m", 15.0, (0.0214, 0.0133, 0.0133)),
    ("0.0125 s, 0.5 m,\ntight coupling", 1.1, (0.0199, 0.0156, 0.0088)),
)
OPENFAST_STD = (2.005, 1.308, 1.617)


@dataclass(frozen=True)
class Variant:
    """Defines a choice of parts and step, with its axis in the sweep; the defaults are exact."""

    axis: str
    integrator: str = "rk4"
    dt: float = 0.025
    rotor: str = "bem"
    wave_loads: str = "exact"
    # further options of build_scene, as (name, value); "strongest": number of strongest sea components kept
    options: tuple = ()

    @property
    def fidelity(self):
        """Return the fidelity with these waves; it sets the radiation memory of a potential-flow body."""
        return "reference" if self.wave_loads == "exact" else "standard"

    @property
    def name(self):
        """Return the variant's name in tables: step and parts."""
        parts = [f"{self.integrator} {self.dt:g} s", self.rotor, f"{self.wave_loads} waves"]
        for name, value in self.options:
            parts.append(f"{value:g} {UNITS[name]}" if name in UNITS else f"{name} by {value}")
        return ", ".join(parts)

    def scene(self, platform, wind, sea, seed, duration):
        """Return the scene of the variant for a wind and a sea state."""
        options = dict(self.options)
        strongest = options.pop("strongest", None)

        def build(sea):
            return build_scene(
                platform, wind=wind, sea=sea, seed=seed, duration=max(100.0, duration), rotor=self.rotor,
                fidelity=self.fidelity, wave_loads=self.wave_loads, integrator=self.integrator, **options,
            )  # fmt: skip

        return build(sea if strongest is None else _thinned(build(sea).model.hydro.waves, strongest))


REFERENCE = "reference"  # axis of the runs at twice the finest step
LARGER_STEPS = {"rk4": 0.1}  # s, largest of the sweep where it is not the default step
TABLED = (("mooring", "table"),)
# other plants, each with a separate reference
BENDING = (("tower", "modes"),)
ELASTIC = tuple(
    (option, getattr(FIDELITIES["elastic"], option))
    for option in ("blades", "tower", "shaft", "dynamic_inflow")
)


def step_sizes(integrator):
    """Return three time steps of an integrator, s, each twice the previous one."""
    largest = LARGER_STEPS.get(integrator, INTEGRATORS[integrator].dt)
    return (0.25 * largest, 0.5 * largest, largest)


def variants():
    """Return all variants of the sweep: one part changed at a time, then all together, cheapest parts last.

    ab4 evaluates the loads once per step, so that its rows with the BEM rotor show the BEM solved once per
    step against at every stage (rk4 of the same step).
    """
    axes = {1: "BEM once per step"}
    sweep = [
        Variant(axes.get(kind.evaluations, "integrator and step"), name, dt)
        for name, kind in INTEGRATORS.items() for dt in step_sizes(name)
    ]  # fmt: skip
    sweep += [Variant("rotor", rotor=rotor) for rotor in ("lookup", "table")]
    sweep += [Variant("waves", wave_loads="fast"), Variant("mooring", options=TABLED)]
    for axis, option, waves, values in (
        ("wave components", "strongest", "fast", (200, 100, 50)),
        ("stations per blade", "blade_stations", "exact", (13, 9, 6)),
        ("strips", "strip_length", "exact", (1.5, 6.0, 12.0)),
    ):
        sweep += [Variant(axis, wave_loads=waves, options=((option, value),)) for value in values]
    for n in (1, 2, 3, 4):
        sweep.append(Variant("rotor loads per step", "ab4", 0.1, "lookup", "fast", (("rotor_samples", n),)))
    return sweep + [
        Variant("all together", name, dt, rotor, "fast", options)
        for rotor, options in (("lookup", ()), ("table", TABLED))
        for name in INTEGRATORS
        for dt in step_sizes(name)[-2:]
    ]


def variants_apart():
    """Return variants outside the sweep: levels at several steps, parts of one level, a flexible tower."""
    axis, alone, bending = "steps of the levels", "parts of standard alone", "bending tower"
    steps, multistep = (0.0125, 0.025, 0.05, 0.1), (0.025, 0.05, 0.1)
    return [
        *(Variant(axis, dt=dt) for dt in steps),
        *(Variant(axis, "ab4", dt, "lookup", "fast") for dt in multistep),
        *(Variant(axis, "ab4", dt, "table", "fast", TABLED) for dt in multistep),
        Variant(alone, rotor="lookup"),
        Variant(alone, options=(("radiation", "state_space"),)),
        *(Variant(bending, dt=dt, options=BENDING) for dt in steps),
        *(Variant(bending, "rk4", dt, "lookup", "fast", BENDING) for dt in (0.0125, 0.05, 0.1)),
        *(Variant(bending, "ab4", dt, "lookup", "fast", BENDING) for dt in multistep),
        *(Variant("bending turbine", "ab4", dt, "lookup", "fast", ELASTIC) for dt in (0.0125, 0.025, 0.05)),
    ]


MARKS = "osDPXphd*<>H8"  # one for each axis
# variants that are fidelity levels of build_scene
LEVELS = {
    "ab4 0.1 s, lookup, fast waves": "standard",
    "ab4 0.1 s, table, fast waves, mooring by table": "fast",
    f"rk4 {FIDELITIES['reference'].dt:g} s, bem, exact waves": "reference",
}


def select(names):
    """Return the variants of the named axes. Raises: InputError for an unknown axis.

    "levels" selects the variants that are levels of build_scene; those of variants_apart must be named;
    "reference" adds no variant: the reference is in every study.
    """
    sweep, apart = variants(), variants_apart()
    known = [REFERENCE, "levels", *dict.fromkeys(v.axis for v in (*sweep, *apart))]
    for name in names:
        if name not in known:
            raise unknown("axis", name, known)
    chosen = [v for v in sweep if v.axis in names or ("levels" in names and v.name in LEVELS)]
    return chosen + [v for v in apart if v.axis in names]


def _thinned(waves, count):
    """Return the sea (dict) of the strongest components of Waves, with their phases."""
    kept = np.sort(np.argsort(waves.amplitude)[-count:])
    heading = np.degrees(np.arctan2(waves.sin_heading, waves.cos_heading))
    return {
        "kind": "components", "omega": waves.omega[kept], "amplitude": waves.amplitude[kept],
        "phase": waves.phase[kept], "heading": heading[kept], "ramp": waves.ramp,
    }  # fmt: skip


def accuracy(
    seeds=(1, 2, 3), duration=600.0, finest=0.00625, chosen=None, out=None, wind=None, sea=None, repeats=5,
    progress=silent, platform=PLATFORM,
):  # fmt: skip
    """Return a DataFrame of errors and speeds per seed and variant, first the reference at twice its step.

    finest: step of the reference, s; repeats: timings of runs shorter than TIMED (median);
    chosen: variants (default: variants()), (): only the reference at twice its step; out: CSV per platform,
    appended by a row after each run; existing rows are kept and not run again;
    progress: called with (text, done, total).
    """
    wind, sea = wind or TURBULENCE, SEA if sea is None else sea
    plan = [Variant(REFERENCE, dt=2.0 * finest), *(variants() if chosen is None else chosen)]
    if not is_field(wind):
        plan = [v for v in plan if ("rotor_samples", 1) not in v.options]  # the default
    rows = _finished(out)
    known = {(row["seed"], row["axis"], row["variant"], row["seconds"], row["finest_s"]) for row in rows}
    total, done = len(seeds) * len(plan), 0

    def run(scene, variant):
        return simulate(scene, "pi", duration=duration, dt=variant.dt)

    for seed in seeds:
        missing = [v for v in plan if (seed, v.axis, v.name, float(duration), float(finest)) not in known]
        done += len(plan) - len(missing)
        references = {}
        for variant in missing:
            plant = tuple(option for option in variant.options if option in BENDING + ELASTIC)
            if plant not in references:
                progress(f"seed {seed}: reference", done, total)
                exact = Variant(REFERENCE, dt=finest, options=plant)
                references[plant] = run(exact.scene(platform, wind, sea, seed, duration), exact)
            progress(f"seed {seed}: {variant.name}", done, total)
            scene = variant.scene(platform, wind, sea, seed, duration)
            row = {"seed": seed, "seconds": float(duration), "finest_s": float(finest)}
            row |= _row(variant, scene, partial(run, scene, variant), duration, references[plant], repeats)
            rows.append(row)
            _append(out, row)
            done += 1
    return pd.DataFrame(rows, columns=COLUMNS)


def _row(variant, scene, run, duration, reference, repeats):
    """Return the errors and speeds (dict) of a variant, with the median CPU time of the runs in TIMED s."""
    simulate(scene, "pi", duration=1.0, dt=variant.dt)  # compiles
    times = []
    while len(times) < repeats and sum(times) < TIMED:
        start = time.thread_time()
        frame = run()
        times.append(time.thread_time() - start)
    cost = float(np.median(times))
    kernel_seconds = min(duration, max(1.0, float(round(0.2 * TIMED * duration / cost))))
    kernel = loop_time(scene, True, *initial_state(scene), variant.dt, kernel_seconds, repeats)
    errors = {name: normalised_rms(frame[column], reference[column]) for name, column in CHANNELS.items()}
    worst, waves = max(errors, key=errors.get), scene.model.hydro.waves
    return {
        "variant": variant.name, "axis": variant.axis, "integrator": variant.integrator,
        "dt_s": variant.dt, "rotor": variant.rotor, "wave_loads": variant.wave_loads,
        "components": 0 if waves is None else int(waves.omega.shape[0]), "worst": errors[worst],
        "worst_of": worst, **errors, "real_time_factor": duration / cost,
        "kernel_factor": kernel_seconds / kernel, "calibration_ms": calibration(),
    }  # fmt: skip


def _finished(out):
    """Return the rows (list of dict) of an earlier, possibly interrupted study."""
    if out is None:
        return []
    out = Path(out)
    if out.suffix.lower() != ".csv":
        raise InputError(f"accuracy table {str(out)!r}: must end with .csv")
    if not out.is_file():
        return []
    table = pd.read_csv(out, comment="#")
    if tuple(table.columns) != COLUMNS:
        raise InputError(f"accuracy table {str(out)!r}: has other columns; move the file away")
    return table.to_dict("records")


def read_accuracy(path):
    """Return a CSV of accuracy() as a DataFrame. Raises: InputError for a missing or another file."""
    if not Path(path).is_file():
        raise InputError(f"accuracy table {str(path)!r} does not exist")
    return pd.DataFrame(_finished(path), columns=COLUMNS)


def _append(out, row):
    """Append a row to the CSV, after a header with machine and versions in a new file."""
    if out is None:
        return
    out = Path(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    new = not out.is_file()
    with out.open("a", encoding="utf-8", newline="") as file:
        if new:
            file.writelines(f"# {line}\n" for line in header())
        pd.DataFrame([row], columns=COLUMNS).to_csv(file, index=False, header=new, float_format="%.8g")


def accuracy_summary(table):
    """Return a DataFrame per variant: mean error and real-time factor over seeds; whether on the front."""
    if table.empty:
        raise InputError("nothing to summarise: the table has no rows")
    groups = table.groupby(["variant", "axis"], sort=False)
    mean = groups[["worst", "real_time_factor", "kernel_factor", *CHANNELS]].mean().reset_index()
    mean["worst_of"] = groups["worst_of"].agg(lambda names: names.mode()[0]).to_numpy()
    mean["front"] = pareto(mean["worst"], mean["real_time_factor"])
    return mean


def pareto(error, speed):
    """Return whether each of n points is Pareto-optimal in error and speed, (n,) bool; NaN: False."""
    error, speed = np.asarray(error, dtype=float), np.asarray(speed, dtype=float)
    front = np.isfinite(error) & np.isfinite(speed)
    for i in np.flatnonzero(front):
        better = (error <= error[i]) & (speed >= speed[i]) & ((error < error[i]) | (speed > speed[i]))
        front[i] = not better.any()
    return front


def plot_accuracy(table, path=None, openfast=True, beside=None):
    """Return a Figure of error over real-time factor, logarithmic, with Pareto front and OpenFAST points.

    openfast: whether OpenFAST points (OC3-Hywind) are drawn; beside: (name, table) of another platform.
    """
    points = accuracy_summary(table).drop_duplicates("variant")  # the reference is a level too
    points = points[np.isfinite(points["real_time_factor"]) & (points["worst"] > 0.0)]
    figure = new_figure(8.5, 5.5)
    axes = figure.subplots()
    style_axes(
        axes, "real-time factor of simulate (CPU, one core)", "worst rms difference / standard deviation"
    )
    axes.set(xscale="log", yscale="log")
    hollow = {"markersize": 6, "markerfacecolor": "none", "linestyle": "none"}
    for index, (axis, group) in enumerate(points.groupby("axis", sort=False)):
        axes.plot(
            group["real_time_factor"], group["worst"], MARKS[index], markersize=5,
            color=COLOURS[index % len(COLOURS)], label=axis, linestyle="none",
        )  # fmt: skip
    front = points[points["front"]].sort_values("real_time_factor")
    axes.plot(front["real_time_factor"], front["worst"], color=INK, linewidth=1.0, label="Pareto front")
    if openfast:
        _draw_openfast(axes, hollow | {"color": "black"})
    if beside is not None:
        name, other = beside[0], accuracy_summary(beside[1]).drop_duplicates("variant")
        other = other[other["variant"].isin(set(points["variant"]))]
        label = f"{name}, the same variants"
        axes.plot(other["real_time_factor"], other["worst"], "s", color=INK, label=label, **hollow)
    # points of the front are numbered, levels also named; all names are listed next to the plot
    numbered = list(enumerate(front["variant"], 1))
    texts = {name: f"{number} {LEVELS.get(name, '')}".strip() for number, name in numbered}
    names = [f"{number}  " + name.replace(", mooring", ",\n    mooring") for number, name in numbered]
    axes.text(1.02, 0.02, "\n".join(names), transform=axes.transAxes, fontsize=7, color=INK, va="bottom")
    axes.margins(x=0.12)
    axes.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    places, n = points[["real_time_factor", "worst"]].to_numpy(), len(points)
    labels = [texts.get(name, "") for name in points["variant"]]
    label_marks(figure, axes, labels, places, np.full(n, 25.0), [(None, None, None)] * n)
    return save_figure(figure, path)


def _draw_openfast(axes, style):
    """Draw the OpenFAST points; the OpenFAST reference, with zero difference, is on the lower edge."""
    label = "OpenFAST, step and strips\n(largest difference in 40 s of\nsurge, pitch, rotor speed over std)"
    note, edge = {"fontsize": 6, "color": INK, "textcoords": "offset points"}, axes.get_xaxis_transform()
    for name, factor, largest in OPENFAST:
        # normalised maxima: upper bounds of the rms measure used here, over fewer quantities
        error = max(d / s for d, s in zip(largest, OPENFAST_STD, strict=True))
        if error > 0.0:
            axes.plot([factor], [error], marker="^", label=label, **style)
            axes.annotate(name, (factor, error), xytext=(6, -2), **note)
            label = None  # label only the first point
        else:
            axes.plot([factor], [0.015], marker="v", transform=edge, clip_on=False, **style)
            axes.annotate(name, (factor, 0.015), xycoords=edge, xytext=(-5, 8), **note)
