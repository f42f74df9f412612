"""Run time against error of the whole model: what every cheaper choice costs, and what it saves.

Reference of a seed: the exact parts (BEM rotor, exact waves, Runge-Kutta 4) at the finest step; half as fine
a step shows that it has converged. Error of a variant: rms difference over the standard deviation of the
reference, of each motion, the rotor speed and a fairlead tension; the worst of them counts. The wind and the
sea of a seed are the same for all variants, and the controller acts at 10 Hz whatever the step. Cost: the
CPU time of simulate and of the compiled loop alone, as real-time factors.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.errors import InputError, unknown
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.run.initial_conditions import initial_state
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.scene.options import FIDELITIES
from fowt_env.training.benchmarks.speed import SEA, TURBULENCE, TimedScene, calibration, header, loop_time
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
# OpenFAST on the rigid model, 18 m/s uniform turbulence, Hs 7.5 m: (step and strips, real-time factor
# (CPU), largest |difference| in 40 s to its own reference: surge m, platform pitch deg, rotor speed rpm),
# and the standard deviations of the same case over 500 s that turn them into fractions
OPENFAST = (
    ("0.0125 s, 1 m: its reference", 1.9, (0.0, 0.0, 0.0)),
    ("0.0125 s, 2 m", 2.9, (0.0025, 0.0013, 0.0009)),
    ("0.025 s, 2 m", 6.0, (0.0062, 0.0044, 0.0036)),
    ("0.05 s, 4 m", 15.0, (0.0214, 0.0133, 0.0133)),
    ("0.0125 s, 0.5 m,\ntight coupling", 1.1, (0.0199, 0.0156, 0.0088)),
)
OPENFAST_STD = (2.005, 1.308, 1.617)


@dataclass(frozen=True)
class Variant:
    """One choice of parts and step, with the axis that it is a point of; the defaults are exact."""

    axis: str
    integrator: str = "rk4"
    dt: float = 0.025
    rotor: str = "bem"
    wave_loads: str = "exact"
    # further options of build_scene, as (name, value); "strongest": that many of the sea's components
    options: tuple = ()

    @property
    def fidelity(self):
        """Level that has these waves, for what a variant leaves open: the memory of a potential-flow body."""
        return "reference" if self.wave_loads == "exact" else "standard"

    @property
    def name(self):
        """Name in tables, which tells step and parts."""
        parts = [f"{self.integrator} {self.dt:g} s", self.rotor, f"{self.wave_loads} waves"]
        for name, value in self.options:
            parts.append(f"{value:g} {UNITS[name]}" if name in UNITS else f"{name} by {value}")
        return ", ".join(parts)


REFERENCE = "reference"  # axis of the runs at twice the finest step
LARGER_STEPS = {"rk4": 0.1}  # s, largest of the sweep where it is not the default step
TABLED = (("mooring", "table"),)
BENDING = (("tower", "modes"),)  # another plant, with a reference of its own


def step_sizes(integrator):
    """Return three steps of an integrator, s, each twice the one before."""
    largest = LARGER_STEPS.get(integrator, INTEGRATORS[integrator].dt)
    return (0.25 * largest, 0.5 * largest, largest)


def _axis(integrator):
    """Return the axis of the rows that compare integrators with the BEM rotor."""
    return "BEM once per step" if INTEGRATORS[integrator].evaluations == 1 else "integrator and step"


def variants():
    """Return every variant of the sweep: one part changed at a time, then all together, cheapest parts last.

    ab4 evaluates the loads once per step, so that its rows with the BEM rotor show the BEM solved once per
    step against at every stage (rk4 of the same step).
    """
    found = [Variant(_axis(name), name, dt) for name in INTEGRATORS for dt in step_sizes(name)]
    found += [Variant("rotor", rotor=rotor) for rotor in ("lookup", "table")]
    found += [Variant("waves", wave_loads="fast"), Variant("mooring", options=TABLED)]
    for axis, option, waves, values in (
        ("wave components", "strongest", "fast", (200, 100, 50)),
        ("stations per blade", "blade_stations", "exact", (13, 9, 6)),
        ("strips", "strip_length", "exact", (1.5, 6.0, 12.0)),
    ):
        found += [Variant(axis, wave_loads=waves, options=((option, value),)) for value in values]
    found += [
        Variant("rotor loads per step", "ab4", 0.1, "lookup", "fast", (("rotor_samples", n),))
        for n in (1, 2, 3, 4)
    ]
    return found + [
        Variant("all together", name, dt, rotor, "fast", options)
        for rotor, options in (("lookup", ()), ("table", TABLED))
        for name in INTEGRATORS
        for dt in step_sizes(name)[-2:]
    ]


# which variants are the levels of build_scene
LEVELS = {
    "ab4 0.1 s, lookup, fast waves": "standard",
    "ab4 0.1 s, table, fast waves, mooring by table": "fast",
    f"rk4 {FIDELITIES['reference'].dt:g} s, bem, exact waves": "reference",
}


def level_steps():
    """Return variants of build_scene's levels at several steps, and of one part of `standard` at a time."""
    axis, alone = "steps of the levels", "parts of standard alone"
    return [
        *(Variant(axis, dt=dt) for dt in (0.0125, 0.025, 0.05, 0.1)),
        *(Variant(axis, "ab4", dt, "lookup", "fast") for dt in (0.025, 0.05, 0.1)),
        *(Variant(axis, "ab4", dt, "table", "fast", TABLED) for dt in (0.025, 0.05, 0.1)),
        Variant(alone, rotor="lookup"),
        Variant(alone, options=(("radiation", "state_space"),)),
    ]


def bending_steps():
    """Return variants with a tower that bends in its first modes, at several steps."""
    axis = "bending tower"
    return [
        *(Variant(axis, dt=dt, options=BENDING) for dt in (0.0125, 0.025, 0.05, 0.1)),
        *(Variant(axis, "rk4", dt, "lookup", "fast", BENDING) for dt in (0.0125, 0.05, 0.1)),
        *(Variant(axis, "ab4", dt, "lookup", "fast", BENDING) for dt in (0.025, 0.05, 0.1)),
    ]


def select(names):
    """Return the variants of the axes named. Raises: InputError for an unknown axis.

    "levels" selects the variants that are levels of build_scene; "steps of the levels" are these at several
    steps, "parts of standard alone" what one of them replaces and "bending tower" a plant of its own, none
    of them part of the sweep of all;
    "reference" adds none to those of every study.
    """
    apart = [*level_steps(), *bending_steps()]
    known = [REFERENCE, "levels", *dict.fromkeys(v.axis for v in (*variants(), *apart))]
    for name in names:
        if name not in known:
            raise unknown("axis", name, known)
    chosen = [v for v in variants() if v.axis in names or ("levels" in names and v.name in LEVELS)]
    return chosen + [v for v in apart if v.axis in names]


@dataclass(frozen=True)
class Setting:
    """Platform, weather and length (s) of all runs of a study."""

    platform: str
    wind: object
    sea: object
    duration: float

    def scene(self, variant, seed):
        """Return the scene of a variant."""
        options = dict(variant.options)
        strongest = options.pop("strongest", None)

        def build(sea):
            return build_scene(
                self.platform, wind=self.wind, sea=sea, seed=seed, duration=max(100.0, self.duration),
                fidelity=variant.fidelity, rotor=variant.rotor, wave_loads=variant.wave_loads,
                integrator=variant.integrator, **options,
            )  # fmt: skip

        return build(
            self.sea if strongest is None else _thinned(build(self.sea).model.hydro.waves, strongest)
        )

    def run(self, scene, variant):
        """Return the DataFrame of a run of a variant's scene."""
        return simulate(scene, "pi", duration=self.duration, dt=variant.dt)


def _thinned(waves, count):
    """Return the sea (dict) of the strongest components of Waves, phases kept."""
    kept = np.sort(np.argsort(waves.amplitude)[-count:])
    heading = np.degrees(np.arctan2(waves.sin_heading, waves.cos_heading))
    return {
        "kind": "components", "omega": waves.omega[kept], "amplitude": waves.amplitude[kept],
        "phase": waves.phase[kept], "heading": heading[kept], "ramp": waves.ramp,
    }  # fmt: skip


def errors(frame, reference):
    """Return {quantity: rms difference over standard deviation} of a run."""
    return {name: normalised_rms(frame[channel], reference[channel]) for name, channel in CHANNELS.items()}


def accuracy(
    seeds=(1, 2, 3), duration=600.0, finest=0.00625, chosen=None, out=None, wind=None, sea=None, repeats=5,
    progress=None, platform=PLATFORM,
):  # fmt: skip
    """Return a DataFrame with a row per seed and variant, beginning with the reference at twice its step.

    finest    step of the reference, s
    repeats   of the timing of runs shorter than TIMED; the median counts
    chosen    variants (default: variants()); () leaves the reference at twice its step
    out       CSV that grows by a row as each run ends; rows already there are kept and not run again
    progress  called with (text, done, total)
    platform  name of a platform: each needs a CSV of its own
    """
    setting = Setting(platform, wind or TURBULENCE, SEA if sea is None else sea, duration)
    plan = [Variant(REFERENCE, dt=2.0 * finest), *(variants() if chosen is None else chosen)]
    if not is_field(setting.wind):
        plan = [v for v in plan if ("rotor_samples", 1) not in v.options]  # what it is anyway
    rows = _finished(out)
    known = {(row["seed"], row["axis"], row["variant"], row["seconds"], row["finest_s"]) for row in rows}
    total, done = len(seeds) * len(plan), 0
    for seed in seeds:
        missing = [v for v in plan if (seed, v.axis, v.name, float(duration), float(finest)) not in known]
        done += len(plan) - len(missing)
        references = {}
        for variant in missing:
            plant = tuple(option for option in variant.options if option in BENDING)
            if plant not in references:
                if progress is not None:
                    progress(f"seed {seed}: reference", done, total)
                exact = Variant(REFERENCE, dt=finest, options=plant)
                references[plant] = setting.run(setting.scene(exact, seed), exact)
            if progress is not None:
                progress(f"seed {seed}: {variant.name}", done, total)
            rows.append(_row(variant, seed, setting, finest, references[plant], repeats))
            _append(out, rows[-1])
            done += 1
    return pd.DataFrame(rows, columns=COLUMNS)


def _row(variant, seed, setting, finest, reference, repeats):
    scene, duration = setting.scene(variant, seed), setting.duration
    simulate(scene, "pi", duration=1.0, dt=variant.dt)  # compiles
    frame, cost = _timed(lambda: setting.run(scene, variant), repeats)
    kernel_seconds = min(duration, max(1.0, float(round(0.2 * TIMED * duration / cost))))
    kind = TimedScene(wind=setting.wind)
    kernel = loop_time(scene, kind, *initial_state(scene), variant.dt, kernel_seconds, repeats)
    found = errors(frame, reference)
    worst = max(found, key=found.get)
    waves = scene.model.hydro.waves
    return {
        "seed": seed, "variant": variant.name, "axis": variant.axis, "integrator": variant.integrator,
        "dt_s": variant.dt, "rotor": variant.rotor, "wave_loads": variant.wave_loads,
        "components": 0 if waves is None else int(waves.omega.shape[0]), "seconds": float(duration),
        "finest_s": float(finest), "worst": found[worst], "worst_of": worst, **found,
        "real_time_factor": duration / cost, "kernel_factor": kernel_seconds / kernel,
        "calibration_ms": calibration(),
    }  # fmt: skip


def _timed(call, repeats):
    """Return (result, CPU time of this thread) of a call: the median of repeats, or of those in TIMED s."""
    times = []
    while len(times) < repeats and sum(times) < TIMED:
        start = time.thread_time()
        result = call()
        times.append(time.thread_time() - start)
    return result, float(np.median(times))


def _finished(out):
    """Return the rows (list of dict) of an earlier, perhaps interrupted study."""
    if out is None:
        return []
    out = Path(out)
    if out.suffix.lower() != ".csv":
        raise InputError(f"accuracy table {str(out)!r}: must end with .csv")
    if not out.is_file():
        return []
    table = pd.read_csv(out, comment="#")
    if tuple(table.columns) != COLUMNS:
        raise InputError(f"accuracy table {str(out)!r}: holds other columns; move it away")
    return table.to_dict("records")


def read_accuracy(path):
    """Return a CSV of accuracy() as a DataFrame. Raises: InputError for none, and for another file."""
    if not Path(path).is_file():
        raise InputError(f"accuracy table {str(path)!r} does not exist")
    return pd.DataFrame(_finished(path), columns=COLUMNS)


def _append(out, row):
    """Add a row to the CSV, which begins with where it was made."""
    if out is None:
        return
    out = Path(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    new = not out.is_file()
    with out.open("a", encoding="utf-8", newline="") as file:
        if new:
            for line in header():
                file.write(f"# {line}\n")
        pd.DataFrame([row], columns=COLUMNS).to_csv(file, index=False, header=new, float_format="%.8g")


def accuracy_summary(table):
    """Return a DataFrame by variant: means of error and real-time factor over seeds; whether on the front."""
    if table.empty:
        raise InputError("nothing to summarise: the table has no rows")
    groups = table.groupby(["variant", "axis"], sort=False)
    mean = groups[["worst", "real_time_factor", "kernel_factor", *CHANNELS]].mean().reset_index()
    mean["worst_of"] = groups["worst_of"].agg(lambda names: names.mode()[0]).to_numpy()
    mean["front"] = pareto(mean["worst"], mean["real_time_factor"])
    return mean


def pareto(error, speed):
    """Return (n,) bool: no other point is as fast and more accurate, or as accurate and faster. NaN: no."""
    error, speed = np.asarray(error, dtype=float), np.asarray(speed, dtype=float)
    front = np.isfinite(error) & np.isfinite(speed)
    for i in np.flatnonzero(front):
        better = (error <= error[i]) & (speed >= speed[i]) & ((error < error[i]) | (speed > speed[i]))
        front[i] = not better.any()
    return front


def openfast_points():
    """Return [(setting, error, real-time factor)] of OpenFAST.

    Its differences are the largest in 40 s, in surge, platform pitch and rotor speed: divided by the standard
    deviations of the case they are upper bounds of the rms measure used here, over fewer quantities.
    """
    return [
        (name, max(d / s for d, s in zip(largest, OPENFAST_STD, strict=True)), factor)
        for name, factor, largest in OPENFAST
    ]


def plot_accuracy(table, path=None, openfast=True, beside=None):
    """Return a Figure of error over real-time factor, logarithmic, with Pareto front and OpenFAST's points.

    openfast: whether those points, which are of OC3-Hywind, are drawn; beside: (name, table) of another
    platform, whose points of the same variants are hollow.
    """
    points = accuracy_summary(table)
    points = points[np.isfinite(points["real_time_factor"]) & (points["worst"] > 0.0)]
    figure = new_figure(8.5, 5.5)
    axes = figure.subplots()
    style_axes(axes)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for index, (axis, group) in enumerate(points.groupby("axis", sort=False)):
        axes.plot(
            group["real_time_factor"], group["worst"], "osD"[index // len(COLOURS)], markersize=5,
            color=COLOURS[index % len(COLOURS)], label=axis, linestyle="none",
        )  # fmt: skip
    front = points[points["front"]].sort_values("real_time_factor")
    axes.plot(front["real_time_factor"], front["worst"], color=INK, linewidth=1.0, label="Pareto front")
    if openfast:
        _draw_openfast(axes)
    if beside is not None:
        name, other = beside[0], accuracy_summary(beside[1])
        other = other[other["variant"].isin(set(points["variant"])) & other["axis"].isin(set(points["axis"]))]
        axes.plot(
            other["real_time_factor"], other["worst"], "s", color=INK, markerfacecolor="none", markersize=6,
            label=f"{name}, the same variants", linestyle="none",
        )  # fmt: skip
    _name_front(axes, front)
    axes.set_xlabel("real-time factor of simulate (CPU, one core)", color=INK, fontsize=9)
    axes.set_ylabel("worst rms difference / standard deviation", color=INK, fontsize=9)
    axes.margins(x=0.12)
    axes.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return save_figure(figure, path)


def _draw_openfast(axes):
    """Draw OpenFAST's points; its reference, whose difference is zero, on the lower edge."""
    theirs = openfast_points()
    style = {"color": "black", "markersize": 6, "markerfacecolor": "none", "linestyle": "none"}
    differing = [p for p in theirs if p[1] > 0.0]
    axes.plot(
        [p[2] for p in differing], [p[1] for p in differing], marker="^", **style,
        label="OpenFAST, step and strips\n(largest difference in 40 s of\n"
        "surge, pitch, rotor speed over std)",
    )  # fmt: skip
    note = {"fontsize": 6, "color": INK, "textcoords": "offset points"}
    for name, error, factor in differing:
        axes.annotate(name, (factor, error), xytext=(6, -2), **note)
    for name, _, factor in (p for p in theirs if p[1] == 0.0):
        edge = axes.get_xaxis_transform()
        axes.plot([factor], [0.015], marker="v", transform=edge, clip_on=False, **style)
        axes.annotate(name, (factor, 0.015), xycoords=edge, xytext=(-5, 8), **note)


def _name_front(axes, front):
    """Write numbers at the points of the Pareto front, names at those of levels; all names beside it."""
    lines = []
    for number, row in enumerate(front.to_dict("records"), 1):
        level = LEVELS.get(row["variant"])
        name = row["variant"].replace(", mooring", ",\n    mooring")
        lines.append(f"{number}  {name}")
        axes.annotate(
            str(number) if level is None else f"{number} {level}", (row["real_time_factor"], row["worst"]),
            fontsize=7 if level is None else 9, color=INK, ha="left", va="top", xytext=(4, -3),
            fontweight="normal" if level is None else "bold", textcoords="offset points",
        )  # fmt: skip
    axes.text(1.02, 0.02, "\n".join(lines), transform=axes.transAxes, fontsize=7, color=INK, va="bottom")
