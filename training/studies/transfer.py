"""Compares controllers in OpenFAST and here, in the same wind and waves: does their order hold in OpenFAST?

    STUDY = python -m fowt_env.training.studies.transfer
    STUDY openfast DECKS OPENFAST TURBSIM FOLDER    runs OpenFAST with every controller as a library
    STUDY here FOLDER                               runs the models of this package in the same wind and waves
    STUDY table FOLDER --out figures.csv            adds the figures of finished runs to the file
    STUDY table figures.csv                         prints the tables of the file
    STUDY spread FOLDER --winds 12 --seeds 1        prints how far the ratios depend on the start of the runs

A finished run is not repeated: both commands continue where they stopped, and with --done figures.csv where
the runs of another machine stopped. A run of OpenFAST is kept as a series of CHANNELS, so that its figures
can be computed anew without OpenFAST.

Both codes have one wind, a TurbSim box sampled at every blade station (`uniform`: its rotor average), and one
sea, the same components. Controllers are those of `fowt connect export`, designed for the published platform;
here they run on the model that has the figures of the deck. Runs start at the trim of the rigid model.
"""

import json
import os
import re
import shutil
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import combinations
from math import nan, pi
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from fowt_env.analysis.trim import trim
from fowt_env.controllers.export.library import export_library
from fowt_env.descriptions.checks import parse_names, parse_numbers, parse_whole_numbers
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.sea_state import joint_sea_state
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import replacing
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import read_series, read_table, write_table
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.scene.options import OPTIONS
from fowt_env.training.evaluation.metrics import TIME, mean_exponent, turbine_metrics
from fowt_env.training.evaluation.provenance import code_commit
from fowt_env.training.evaluation.run_case import CONTROL_DT
from fowt_env.training.validation.reference import openfast_decks
from fowt_env.weather.waves import jonswap
from fowt_env.weather.wind_field import read_box, rotor_average

SITE = "gulf_of_maine_normal"  # joint table of wind and sea
BASELINE = "gspi_oc3"
LAWS = (BASELINE, "floating_feedback", "rosco_float", "lqr", "mpc", "policy:ppo_lqr")
WINDS, SEEDS = (14.0, 18.0, 12.0, 22.0), (1, 2, 3, 4)  # m/s; of wind and waves
ALL_LAWS = ",".join(LAWS)
ALL_WINDS, ALL_SEEDS = (",".join(f"{value:g}" for value in values) for values in (WINDS, SEEDS))
DURATION, BEGIN = 500.0, 100.0  # s; start-up that is left out
STARTS = {"PtfmPitch": 0.2, "RotSpeed": 0.2, "PtfmSurge": 1.0}  # deg, rpm, m: changes of `spread`, both ways
OUTPUT_DT = 0.1  # s, of both codes
WAVE_PERIOD = 720.0  # s, WaveTMax of openfast_decks: components are its harmonics
SEA_STREAM = 7  # of the random generator of wave phases
SPARE = 30.0  # s of wind beyond the run: half the grid and the drift of the platform
FIGURES = {  # name in the tables: metric
    "rotor speed std": "RotSpeed_std_[rpm]",
    "platform pitch std": "PtfmPitch_std_[deg]",
    "power std": "GenPwr_std_[kW]",
    "pitch travel": "blade_pitch_travel_[deg/s]",
    "tower base DEL": "TwrBsMyt_DEL_[kN-m]",
    "shaft torque DEL": "RotTorq_DEL_[kN-m]",
    "hub tilt DEL": "LSSTipMys_DEL_[kN-m]",
    "blade root flap DEL": "RootMyc_DEL_[kN-m]",
    "fairlead DEL": "FAIRTEN_DEL_[kN]",
}
MEANS = ("Wind1VelX", "RotSpeed", "GenPwr", "BldPitch1", "PtfmPitch", "PtfmSurge")  # kept with the figures
CLOSE = 5.0  # points: the difference of a ratio that is small
KEY = ["platform", "model", "law", "wind", "seed"]
COMMIT = "commit"  # column of the figures: of the code of law and models; empty: not recorded
CHANNELS = (  # of ElastoDyn
    "Azimuth", "RotSpeed", "GenSpeed", *(f"BldPitch{k}" for k in (1, 2, 3)), "RotThrust", "RotTorq",
    *openfast_decks.MOTIONS, "NcIMUTAxs", "NcIMUTAys", "TTDspFA", "TTDspSS", "TwrBsMyt", "TwrBsMxt",
    *(f"RootM{axis}c{k}" for axis in "xy" for k in (1, 2, 3)), "LSSTipMys", "LSSTipMzs", "YawBrMyp",
    "YawBrMzp", "OoPDefl1", "IPDefl1",
)  # fmt: skip
OTHERS = ("Wind1VelX", "Wave1Elev", "GenTq", "GenPwr", "RtFldFxh", "RtFldMxh")  # kept of other modules
TENSION = re.compile(r"T\[(\d)\]_\[N\]")  # of MAP++
OPENFAST = ("openfast", "openfast_rigid")  # models of OpenFAST
REFERENCE = OPENFAST[0]


@dataclass(frozen=True)
class Subject:
    """Holds the deck of a platform, and the same platform here."""

    deck: str  # class of openfast_decks
    plant: str  # platform here with the figures of the deck
    grid: tuple  # of the wind box: points up and height (m), to below the tower; points across and width
    elastic: dict  # settings of the deck's elastic structure
    shaft: bool  # whether the drivetrain twists in it
    dt: float  # s, largest step of OpenFAST with which FIGURES converge
    seconds: float  # of one core for a second of OpenFAST with this step, as measured; for the estimate
    options: dict = field(default_factory=dict)  # of build_scene


SUBJECTS = {
    "oc3_hywind": Subject(
        deck="Oc3", plant="oc3_hywind_openfast", grid=(17, 170.0, 15, 145.0), shaft=True,
        elastic={"blades": 3, "tower": 2, "torsion": True}, dt=0.025, seconds=0.24,
    ),
    "iea15_volturnus_s": Subject(
        deck="Volturnus", plant="iea15_volturnus_s", grid=(17, 284.0, 17, 280.0), shaft=False,
        elastic={"blades": 3, "tower": 2}, dt=0.0125, seconds=0.46, options={"skewed_wake": True},
    ),
}  # fmt: skip


def models(platform):
    """Return {name: (platform here, options of build_scene)} of the models here. Raises: InputError."""
    chosen("platform", platform, SUBJECTS)
    subject = SUBJECTS[platform]
    parts = {"tower": {"tower": "modes2"}, "blades": {"blades": "modes2"}}
    if subject.shaft and "shaft" in OPTIONS:
        parts["shaft"] = {"shaft": "torsion"}
    elastic = {key: value for part in parts.values() for key, value in part.items()}
    changes = {"rigid": {}, **parts, "elastic": elastic, "uniform": {}}
    found = {name: (subject.plant, subject.options | change) for name, change in changes.items()}
    return found | {"published": (platform, {})}


@dataclass(frozen=True)
class Case:
    """Names one run."""

    platform: str
    model: str
    law: str
    wind: float  # m/s
    seed: int

    def path(self, folder):
        """Return the path of what is kept of the run."""
        ending = "npz" if self.model in OPENFAST else "csv"
        name = f"{self.law.replace(':', '-')}_{self.wind:g}mps_seed{self.seed}.{ending}"
        return Path(folder, self.platform, self.model, name)

    @property
    def weather(self):
        """Return the key of wind and waves."""
        return self.platform, self.wind, self.seed

    def __str__(self):
        return f"{self.platform} {self.model} {self.law} {self.wind:g} m/s seed {self.seed}"


def cases(platform, names, laws, winds, seeds):
    """Return the Cases in their order of use: seed by seed, wind by wind, model by model."""
    return [
        Case(platform, model, law, wind, seed)
        for seed in seeds for wind in winds for model in names for law in laws
    ]  # fmt: skip


def sea_components(wind, seed):
    """Return the DataFrame of wave components (rad/s, m, deg) of the sea at a wind, JONSWAP of SITE.

    Elevation at the origin: sum of amplitude cos(omega t + phase).
    """
    sea, step = joint_sea_state(SITE, wind), 2.0 * pi / WAVE_PERIOD
    peak = 2.0 * pi / sea.Tp
    omega = step * np.arange(np.ceil(0.5 * peak / step), np.floor(5.0 * peak / step) + 1)
    amplitude = np.sqrt(2.0 * jonswap(omega, sea.Hs, sea.Tp, sea.gamma) * step)
    amplitude *= sea.Hs / (4.0 * np.sqrt(0.5 * np.sum(amplitude**2)))
    phase = np.random.default_rng([seed, SEA_STREAM]).uniform(0.0, 360.0, omega.size)
    return pd.DataFrame({"omega_rad_s": omega, "amplitude_m": amplitude, "phase_deg": phase})


def sea_here(components):
    """Return the sea specification of build_scene, whose phases have the other sign."""
    omega, amplitude, phase = components.to_numpy().T
    return {"kind": "components", "omega": omega, "amplitude": amplitude, "phase": -np.radians(phase)}


def box_path(folder, platform, wind, seed):
    """Return the path of a wind box."""
    return Path(folder, platform, "wind", f"{wind:g}mps_seed{seed}.bts").resolve()


def box_input(platform, wind, seed, duration):
    """Return the text of TurbSim's input: class B, Kaimal, normal turbulence, power law 0.14."""
    rows, height, columns, width = SUBJECTS[platform].grid
    hub = hub_height(platform)
    return "v5\n-\n" + openfast_decks.filled(
        openfast_decks.TURBSIM, RandSeed1=100003 * seed + round(10.0 * wind), NumGrid_Z=rows,
        NumGrid_Y=columns, GridHeight=height, GridWidth=width, TimeStep=OUTPUT_DT,
        AnalysisTime=duration + SPARE, UsableTime=duration + SPARE, HubHt=hub, RefHt=hub, URef=wind,
        PLExp=0.14,
    )  # fmt: skip


def hub_height(platform):
    """Return the hub height of a platform's turbine, m."""
    return read_turbine(read_platform(SUBJECTS[platform].plant).turbine).rotor.hub_height


def make_box(program, folder, platform, wind, seed, duration):
    """Make the wind box of a wind and seed by TurbSim, unless it is there."""
    path = box_path(folder, platform, wind, seed)
    if path.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f"new_{path.name}")
    new.with_suffix(".inp").write_text(box_input(platform, wind, seed, duration))
    done = subprocess.run(
        [program, new.with_suffix(".inp").name], cwd=path.parent, capture_output=True, text=True
    )
    if done.returncode or not new.exists():
        raise RuntimeError(f"TurbSim failed: {(done.stdout + done.stderr)[-1000:]}")
    new.rename(path)


def start(platform, wind):
    """Return {channel: value} of the trim of the rigid model in a steady wind."""
    subject = SUBJECTS[platform]
    point = trim(build_scene(subject.plant, wind=wind, **subject.options))
    names = ("PtfmSurge", "PtfmHeave", "PtfmPitch", "RotSpeed", "BldPitch1")
    return {name: float(point[name]) for name in names}


def deck_case(case, folder, duration, dt, begin):
    """Return the settings of a run for openfast_decks; begin: of `start`."""
    subject = SUBJECTS[case.platform]
    motion = {name: value for name, value in begin.items() if name.startswith("Ptfm")}
    return {
        "t": duration, "dt": dt, "dtout": OUTPUT_DT, "control": True, "control_dt": f"{dt:g}", "waves": True,
        "wind": box_path(folder, case.platform, case.wind, case.seed), "channels": CHANNELS,
        "rpm": begin["RotSpeed"], "pitch": begin["BldPitch1"], **motion,
        **(subject.elastic if case.model == REFERENCE else {}),
    }  # fmt: skip


def write_deck(case, folder, decks, library, duration, dt, begin, place):
    """Write the inputs of a run of OpenFAST into a new folder `place`."""
    deck = getattr(openfast_decks, SUBJECTS[case.platform].deck)(decks)
    settings, library = deck_case(case, folder, duration, dt, begin), Path(library).resolve()
    components = sea_components(case.wind, case.seed)
    deck.write(place, settings, components=components, rosco=library, baseline=library)


def named(frame):
    """Return an OpenFAST output with the names and units of this package, and only channels that are used."""
    tensions = {column: match[1] for column in frame if (match := TENSION.fullmatch(column))}
    wanted = {TIME.partition("_[")[0], *CHANNELS, *OTHERS}
    kept = frame[[column for column in frame if column.partition("_[")[0] in wanted]]
    return kept.assign(**{f"FAIRTEN{line}_[kN]": 1e-3 * frame[column] for column, line in tensions.items()})


def run_deck(program, place):
    """Run model.fst in a folder, and return the s it took. Raises: RuntimeError with its last words."""
    began = time.perf_counter()
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run([program, "model.fst"], cwd=place, capture_output=True, text=True, env=environment)
    text = done.stdout + done.stderr
    if done.returncode or "terminated normally" not in text:
        raise RuntimeError(f"OpenFAST failed: {text.strip()[-1000:]}")
    return time.perf_counter() - began


def run_openfast(case, folder, decks, program, duration, dt, begin, commit):
    """Run OpenFAST in a case and keep its series. Raises: RuntimeError with the end of its messages."""
    path, library = case.path(folder), library_path(folder, case)
    place = path.with_suffix("")
    shutil.rmtree(place, ignore_errors=True)
    write_deck(case, folder, decks, library, duration, dt, begin, place)
    seconds = run_deck(program, place)
    about = {"seconds": seconds, "duration": duration, "dt": dt, COMMIT: commit}
    keep_series(path, named(read_series(place / "model.out")), **about)
    shutil.rmtree(place)


def library_path(folder, case):
    """Return the path of the library of a case's controller."""
    return Path(folder, case.platform, "libraries", f"lib{case.law.replace(':', '-')}.so")


def keep_series(path, frame, **about):
    """Write a series to six digits as .npz, with settings of the run."""
    values = frame.to_numpy(dtype=np.float32)
    with replacing(path) as new:
        np.savez_compressed(new, columns=list(frame.columns), values=values, about=json.dumps(about))


def kept_series(path):
    """Return (DataFrame, settings) of a series written by keep_series."""
    with np.load(path) as data:
        frame = pd.DataFrame(data["values"].astype(np.float64), columns=data["columns"])
        about = json.loads(str(data["about"]))
    frame[TIME] = OUTPUT_DT * np.round(frame[TIME] / OUTPUT_DT)
    return frame, about


def figures_of(frame, turbine):
    """Return {metric: value} of FIGURES and of the MEANS of a run after its start-up."""
    values = turbine_metrics(frame, turbine, skip=BEGIN)
    means = {name: value for name, value in values.items() if name.partition("_mean_")[0] in MEANS}
    return {metric: values[metric] for metric in FIGURES.values()} | {
        name: value for name, value in means.items() if "_mean_" in name
    }


def wind_here(case, box, scene):
    """Return the wind of a case here: the box, or for the model `uniform` the series of its rotor average."""
    spec = {"kind": "bts", "path": str(box)}
    if case.model != "uniform":
        return spec
    hub, diameter = scene.turbine.rotor.hub_height, 2.0 * scene.turbine.rotor.tip_radius
    when, value = rotor_average(read_box(spec, hub_height=hub, rotor_diameter=diameter), hub, diameter)
    return {"kind": "series", "time": when, "speed": value[:, 0]}


def run_here(case, folder, duration, change=None):
    """Return the DataFrame of a run here; change: {channel: value} added to its start."""
    platform, options = models(case.platform)[case.model]
    nominal = build_scene(case.platform, wind=case.wind)
    begin = {k: v + (change or {}).get(k, 0.0) for k, v in start(case.platform, case.wind).items()}
    scene = build_scene(
        platform, wind=wind_here(case, box_path(folder, *case.weather), nominal),
        sea=sea_here(sea_components(case.wind, case.seed)), duration=duration + SPARE,
        **{"pitch": "individual", **options},
    )  # fmt: skip
    return simulate(
        scene, case.law, duration, control_dt=CONTROL_DT, output_dt=OUTPUT_DT, initial=begin,
        nominal=nominal,
    )  # fmt: skip


def collected(folder):
    """Return a DataFrame of all finished runs in a folder: KEY, and figures."""
    rows = []
    for path in sorted(Path(folder).glob("*/*/*_seed*")):
        platform, model = path.parts[-3:-1]
        match = re.fullmatch(r"(.+)_([\d.]+)mps_seed(\d+)", path.stem)
        if platform not in SUBJECTS or match is None or path.suffix not in (".npz", ".csv"):
            continue
        law, wind, seed = match[1].replace("policy-", "policy:"), float(match[2]), int(match[3])
        if path.suffix == ".npz":
            turbine = read_turbine(read_platform(SUBJECTS[platform].plant).turbine)
            frame, about = kept_series(path)
            values = figures_of(frame, turbine) | {"duration_[s]": about["duration"]}
            values[COMMIT] = about.get(COMMIT, "")
        else:
            values = read_table(path).iloc[0].to_dict()
        rows.append(dict(zip(KEY, (platform, model, law, wind, seed), strict=True)) | values)
    if not rows:
        raise InputError(f"folder = {str(folder)!r}: has no finished run; run `openfast` and `here` first")
    return pd.DataFrame(rows)


def merged(old, new):
    """Return the rows of two DataFrames of runs in the order of KEY; of a run in both, the row of `new`."""
    rows = pd.concat([old, new], ignore_index=True).drop_duplicates(KEY, keep="last")
    return rows.sort_values(KEY, ignore_index=True)


def finished(path):
    """Return the set of Cases of a CSV of figures, none without a path. Raises: InputError."""
    if path is None:
        return set()
    rows = read_table(path)
    if missing := [name for name in KEY if name not in rows]:
        raise InputError(f"done = {str(path)!r}: is no CSV of `table --out`: it has no {', '.join(missing)}")
    return {Case(*key) for key in rows[KEY].itertuples(index=False, name=None)}


def check_decks(platform, decks):
    """Check that the files of a platform's deck are there. Raises: InputError with those that are not."""
    deck = getattr(openfast_decks, SUBJECTS[platform].deck)(decks)
    # the library of a law takes the place of the deck's own controller, which is source
    needed = [path for path in deck.inputs({"wind": "box", "control": True}) if path.suffix != ".f90"]
    if lost := [str(path.relative_to(decks)) for path in needed if not path.exists()]:
        raise InputError(f"decks = {str(decks)!r}: lacks {', '.join(lost)}; NOTICE has the sources of decks")


def comparable(rows, names, laws):
    """Return the rows of those winds and seeds for which every model and law has a run."""
    rows = rows[rows["model"].isin(names) & rows["law"].isin(laws)]
    count = rows.groupby(["wind", "seed"])["law"].transform("size")
    rows = rows[count == len(names) * len(laws)]
    return rows.sort_values("law", key=lambda column: column.map(list(laws).index), kind="stable")


def averages(rows):
    """Return a DataFrame (model, law) of FIGURES, means over winds and seeds with the exponents of metrics.

    The exponents add variances and damage.
    """
    powers = pd.Series({metric: mean_exponent(metric) for metric in FIGURES.values()})
    values = rows.set_index(["model", "law"])[list(powers.index)] ** powers
    means = values.groupby(level=[0, 1], sort=False).mean() ** (1.0 / powers)
    return means.rename(columns={metric: name for name, metric in FIGURES.items()})


def ratios(means):
    """Return a DataFrame (model, law) of averages over those of BASELINE in the same model, %."""
    base = means.xs(BASELINE, level="law").reindex(means.index.get_level_values("model"))
    return 100.0 * means / base.to_numpy()


def rank_correlation(one, other):
    """Return Spearman's correlation of two Series over laws; nan if one of them does not vary."""
    one, other = one.rank(), other.reindex(one.index).rank()
    return float(one.corr(other)) if one.std() > 0.0 and other.std() > 0.0 else nan


def exchanged(one, other):
    """Return [(law, law, gap, gap)] of pairs that two Series of ratios order differently, gaps in points."""
    pairs = []
    for a, b in combinations(one.index, 2):
        gaps = one[a] - one[b], other[a] - other[b]
        if gaps[0] * gaps[1] < 0.0:
            pairs.append((a, b, *map(float, gaps)))
    return pairs


def baseline_table(means, names):
    """Return the Markdown table of the figures of BASELINE in each model."""
    rows = []
    for figure, metric in FIGURES.items():
        unit = metric.rstrip("]").partition("_[")[2]
        rows.append([figure, unit, *(f"{means.loc[(name, BASELINE), figure]:.4g}" for name in names)])
    return markdown_table([f"`{BASELINE}`", "unit", *names], rows)


def ratio_table(table, names):
    """Return the Markdown table of ratios, differences from REFERENCE in points, and how many are small."""
    others, rows = names[1:], []
    for figure in FIGURES:
        theirs = table.loc[REFERENCE, figure]
        for law in theirs.index.drop(BASELINE):
            row = [figure, f"`{law}`", f"{theirs[law]:.1f}"]
            for name in others:
                ours = table.loc[(name, law), figure]
                row += [f"{ours:.1f}", f"{ours - theirs[law]:+.1f}"]
            rows.append(row)
    heads = [cell for name in others for cell in (f"{name}, %", "points")]
    counts = ["", f"within {CLOSE:g} points", ""]
    for column in range(4, 3 + 2 * len(others), 2):
        counts += ["", f"{sum(abs(float(row[column])) <= CLOSE for row in rows)} of {len(rows)}"]
    return markdown_table(["figure", "controller", f"{REFERENCE}, %", *heads], [*rows, counts])


def order_table(table, names):
    """Return the Markdown table of the order in REFERENCE and of the rank correlations of other models."""
    rows = []
    for figure in FIGURES:
        theirs = table.loc[REFERENCE, figure].sort_values(kind="stable")
        found = (f"{rank_correlation(theirs, table.loc[name, figure]):.2f}" for name in names[1:])
        rows.append([figure, ", ".join(f"`{law}`" for law in theirs.index), *found])
    head = ["figure", f"order in {REFERENCE}, least first", *(f"rank correlation, {n}" for n in names[1:])]
    return markdown_table(head, rows)


def exchanged_table(table, names):
    """Return the Markdown table of pairs of controllers that a model has in another order.

    A pair is a tie, and counted only, where the gaps of the two models are less than CLOSE points apart.
    """
    rows, ties = [], dict.fromkeys(names[1:], 0)
    for figure in FIGURES:
        theirs = table.loc[REFERENCE, figure]
        for name in names[1:]:
            for a, b, one, other in exchanged(theirs, table.loc[name, figure]):
                if abs(one - other) < CLOSE:
                    ties[name] += 1
                else:
                    rows.append((figure, name, f"`{a}`, `{b}`", f"{one:+.1f}", f"{other:+.1f}"))
    head = ("pair in another order", "model", "controllers", f"gap in {REFERENCE}, points", "in the model")
    rows += [("ties", name, f"{count} pairs", "", "") for name, count in ties.items()]
    return markdown_table(head, rows)


def weather_table(rows, names):
    """Return the Markdown table of each wind and seed alone: small differences, and the largest."""
    lines = []
    for (wind, seed), group in rows.groupby(["wind", "seed"]):
        table, line = ratios(averages(group)), [f"{wind:g}", str(seed)]
        theirs = table.loc[REFERENCE].drop(index=BASELINE)
        for name in names[1:]:
            gaps = (table.loc[name].drop(index=BASELINE) - theirs).stack()
            law, figure = gaps.abs().idxmax()
            line += [f"{int((gaps.abs() <= CLOSE).sum())} of {gaps.size}"]
            line += [f"{gaps[(law, figure)]:+.1f}, {figure}, `{law}`"]
        lines.append(line)
    heads = [cell for name in names[1:] for cell in (f"{name}, within {CLOSE:g} points", "largest, points")]
    return markdown_table(["one wind, m/s", "one seed", *heads], lines)


def mixed_code(rows):
    """Return [text] that names the commits of the laws whose runs are of more than one; [] if none is."""
    if COMMIT not in rows:
        return []
    commits = rows[COMMIT].fillna("").map(lambda text: text[:8] or "not recorded")
    found = {law: sorted(set(group)) for law, group in commits.groupby(rows["law"], sort=False)}
    words = [f"`{law}` ({', '.join(names)})" for law, names in found.items() if len(names) > 1]
    return [f"Averages over runs of different commits: {'; '.join(words)}."] if words else []


def report(rows, platform, names=None, laws=None, winds=None):
    """Return the Markdown text of a platform: baseline, ratios, order, and exchanged pairs.

    names: of models, None: those that have runs; REFERENCE is always among them. winds: None: all.
    Raises: InputError if no wind and seed has all runs.
    """
    rows = rows[rows["platform"] == platform]
    rows = rows if winds is None else rows[rows["wind"].isin(winds)]
    have, known = set(rows["model"]), [*OPENFAST, *models(platform)]
    names = [name for name in known if name in have] if names is None else [REFERENCE, *names]
    names = list(dict.fromkeys(names))
    made = sorted(set(rows["law"]))
    laws = [law for law in dict.fromkeys((*LAWS, *made)) if law in made] if laws is None else list(laws)
    rows = comparable(rows, names, laws)
    if rows.empty or REFERENCE not in names or BASELINE not in laws:
        raise InputError(
            f"platform = {platform!r}: no wind and seed has runs of every model ({', '.join(names)}) and law"
            f" ({', '.join(laws)}); choose fewer by --models and --laws (with {BASELINE!r}) or run the others"
        )
    means = averages(rows)
    table = ratios(means)
    weather = sorted(set(zip(rows["wind"], rows["seed"], strict=True)))
    words = "; ".join(
        f"{wind:g} m/s: seed {', '.join(str(seed) for speed, seed in weather if speed == wind)}"
        for wind in dict.fromkeys(speed for speed, _ in weather)
    )
    parts = [f"{platform}, {words}; ratios to `{BASELINE}` in %", baseline_table(means, names)]
    parts += [make(table, names) for make in (ratio_table, order_table, exchanged_table)]
    if len(weather) > 1:
        parts.append(weather_table(rows, names))
    parts += mixed_code(rows)
    return "\n\n".join(parts)


def spread_table(wanted, folder, duration):
    """Return the Markdown table of the least and greatest ratio to BASELINE over starts changed by STARTS.

    wanted: Cases of one model, those of BASELINE among them. Averages are those of `averages`.
    """
    turbine = read_turbine(read_platform(SUBJECTS[wanted[0].platform].plant).turbine)
    changes = [{}, *({name: sign * size} for name, size in STARTS.items() for sign in (1.0, -1.0))]
    tables = []
    for change in changes:
        figures = [figures_of(run_here(case, folder, duration, change), turbine) for case in wanted]
        rows = [vars(case) | values for case, values in zip(wanted, figures, strict=True)]
        tables.append(ratios(averages(pd.DataFrame(rows))))
    every = pd.concat(tables, keys=range(len(tables)))
    low, high = (getattr(every.groupby(level=["model", "law"], sort=False), end)() for end in ("min", "max"))
    rows = [
        [figure, f"`{law}`", *(f"{table.loc[(model, law), figure]:.1f}" for table in (tables[0], low, high))]
        for figure in FIGURES for model, law in low.index if law != BASELINE
    ]  # fmt: skip
    return markdown_table(["figure", "controller", "ratio, %", "least", "greatest"], rows)


def chosen(what, names, known):
    """Return the names of a text with commas. Raises: InputError for one that is not known."""
    names = parse_names(names)
    for name in names:
        if name not in known:
            raise unknown(what, name, known)
    return names


def program(name, path):
    """Return the path of an executable. Raises: InputError if there is none."""
    found = shutil.which(path)
    if found is None:
        raise InputError(
            f"{name} = {path!r}: no such program; give the path of {name} 5, built from the sources of"
            " OpenFAST (https://github.com/OpenFAST/openfast)"
        )
    return str(Path(found).resolve())


def expected(waiting, folder, duration, jobs):
    """Return the expected time (s) of runs: that of finished ones of the platform, else as measured once."""
    total = 0.0
    for case in waiting:
        done = [kept_series(p)[1] for p in case.path(folder).parent.glob("*.npz")]
        rate = np.mean([a["seconds"] / a["duration"] for a in done]) if done else 0.0
        total += duration * (rate or SUBJECTS[case.platform].seconds)
    return total / jobs


def at_once(function, waiting, jobs):
    """Call function(case) for each case in `jobs` threads, print each end, return the number of failures."""
    failed = 0

    def work(case):
        began = time.perf_counter()
        try:
            function(case)
        except RuntimeError as error:
            return case, time.perf_counter() - began, str(error)
        return case, time.perf_counter() - began, None

    with ThreadPoolExecutor(jobs) as pool:
        for number, (case, seconds, error) in enumerate(pool.map(work, waiting), 1):
            failed += error is not None
            text = "done" if error is None else f"FAILED: {error}"
            print(f"{number}/{len(waiting)} {case}: {seconds:.0f} s, {text}", flush=True)
    return failed


app = typer.Typer(help=__doc__.splitlines()[0], no_args_is_help=True, add_completion=False)
Platform = Annotated[str, typer.Option(help=f"Platform: {', '.join(SUBJECTS)}.")]
Laws = Annotated[str, typer.Option(help="Controllers, comma-separated.")]
Winds = Annotated[str, typer.Option(help="Mean winds in m/s, comma-separated, in the order of the runs.")]
Seeds = Annotated[str, typer.Option(help="Seeds of wind and waves, comma-separated.")]
Duration = Annotated[float, typer.Option(help="Length of a run, s.")]
Done = Annotated[
    Path | None, typer.Option(help="CSV of `table --out`: runs whose figures it has are not repeated.")
]


def _chosen_cases(platform, names, known, laws, winds, seeds):
    """Return the Cases of texts of the command line. Raises: InputError."""
    chosen("platform", platform, SUBJECTS)
    names = chosen("model", names, known)
    winds, seeds = parse_numbers(winds, "winds"), parse_whole_numbers(seeds, "seeds")
    return cases(platform, names, parse_names(laws), winds, seeds)


@app.command()
def openfast(
    decks: Annotated[Path, typer.Argument(help="Folder of the public decks of openfast_decks.py.")],
    executable: Annotated[str, typer.Argument(metavar="OPENFAST", help="OpenFAST v5.0.0.")],
    turbsim: Annotated[str, typer.Argument(help="TurbSim.")],
    folder: Annotated[Path, typer.Argument(help="Folder of the runs.")],
    platform: Platform = "oc3_hywind",
    laws: Laws = ALL_LAWS,
    winds: Winds = ALL_WINDS,
    seeds: Seeds = ALL_SEEDS,
    names: Annotated[str, typer.Option("--models", help=f"Of {', '.join(OPENFAST)}.")] = REFERENCE,
    duration: Duration = DURATION,
    dt: Annotated[
        float | None, typer.Option(min=0.001, help="Step of OpenFAST, s; default: of the platform.")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Runs at the same time.")] = 1,
    done: Done = None,
):
    """Run OpenFAST with controllers as libraries; finished runs are not repeated."""
    executable, turbsim = program("OpenFAST", executable), program("TurbSim", turbsim)
    wanted, known = _chosen_cases(platform, names, OPENFAST, laws, winds, seeds), finished(done)
    check_decks(platform, decks)
    waiting = [case for case in wanted if case not in known and not case.path(folder).exists()]
    hours, dt = expected(waiting, folder, duration, jobs) / 3600.0, dt or SUBJECTS[platform].dt
    print(f"{len(waiting)} of {len(wanted)} runs of OpenFAST, about {hours:.1f} h with {jobs} at a time")
    commit = code_commit()
    for path, law in {library_path(folder, case): case.law for case in waiting}.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        export_library(law, path, platform, CONTROL_DT)  # anew: one of an earlier call may be of other code
    starts = {wind: start(platform, wind) for wind in dict.fromkeys(case.wind for case in waiting)}

    def work(case):
        make_box(turbsim, folder, *case.weather, duration)
        run_openfast(case, folder, decks, executable, duration, dt, starts[case.wind], commit)

    # the boxes first where runs are at the same time, so that no two make the same
    if jobs > 1:
        for weather in dict.fromkeys(case.weather for case in waiting):
            make_box(turbsim, folder, *weather, duration)
    if failed := at_once(work, waiting, jobs):
        raise InputError(f"{failed} runs failed; their inputs and outputs are in {folder}")


@app.command()
def here(
    folder: Annotated[Path, typer.Argument(help="Folder of the runs.")],
    platform: Platform = "oc3_hywind",
    laws: Laws = ALL_LAWS,
    winds: Winds = ALL_WINDS,
    seeds: Seeds = ALL_SEEDS,
    names: Annotated[
        str, typer.Option("--models", help="rigid, tower, blades, elastic, uniform, published.")
    ] = ("rigid,elastic"),
    duration: Duration = DURATION,
    again: Annotated[bool, typer.Option(help="Repeat finished runs, after a change of the code.")] = False,
    done: Done = None,
):
    """Run the models of this package in the wind boxes that `openfast` made."""
    wanted = _chosen_cases(platform, names, models(platform), laws, winds, seeds)
    wanted, known = [case for case in wanted if box_path(folder, *case.weather).exists()], finished(done)
    waiting = [case for case in wanted if again or case not in known and not case.path(folder).exists()]
    print(f"{len(waiting)} of {len(wanted)} runs here, about 10 s each: weather that has its wind box")
    turbine, commit = read_turbine(read_platform(SUBJECTS[platform].plant).turbine), code_commit()

    def work(case):
        row = {"duration_[s]": duration} | figures_of(run_here(case, folder, duration), turbine)
        row[COMMIT] = commit
        case.path(folder).parent.mkdir(parents=True, exist_ok=True)
        write_table(pd.DataFrame([row]), case.path(folder))

    if failed := at_once(work, waiting, 1):
        raise InputError(f"{failed} runs failed")


@app.command()
def spread(
    folder: Annotated[Path, typer.Argument(help="Folder of the runs, with the wind boxes.")],
    platform: Platform = "oc3_hywind",
    laws: Laws = ALL_LAWS,
    winds: Winds = ALL_WINDS,
    seeds: Seeds = ALL_SEEDS,
    model: Annotated[str, typer.Option(help="Of `here`.")] = "elastic",
    duration: Duration = DURATION,
):
    """Print how far the ratios here depend on the start: platform pitch, rotor speed and surge both ways."""
    names = f"{BASELINE},{laws}"
    wanted = list(dict.fromkeys(_chosen_cases(platform, model, models(platform), names, winds, seeds)))
    for case in wanted:
        if not box_path(folder, *case.weather).exists():
            raise InputError(f"{case}: has no wind box in {str(folder)!r}; run `openfast` first")
    print(spread_table(wanted, folder, duration))


@app.command()
def table(
    source: Annotated[Path, typer.Argument(help="Folder of the runs, or the CSV that --out wrote.")],
    platform: Platform = "oc3_hywind",
    names: Annotated[str | None, typer.Option("--models", help="Models; default: those with runs.")] = None,
    laws: Annotated[str | None, typer.Option(help="Controllers; default: those with runs.")] = None,
    winds: Annotated[str | None, typer.Option(help="Mean winds, m/s; default: those with runs.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="CSV to which the figures of all finished runs are added; its other runs stay."),
    ] = None,
):
    """Print the ratios to the baseline in each code, their differences and the order of the controllers."""
    rows = read_table(source) if source.suffix == ".csv" else collected(source)
    if out is not None:
        rows = merged(read_table(out), rows) if out.exists() else rows.sort_values(KEY)
        write_table(rows, out)
    speeds = winds and parse_numbers(winds, "winds")
    print(report(rows, platform, names and parse_names(names), laws and parse_names(laws), speeds))


def main(arguments=None):
    """Run the command line; an InputError ends it with its message."""
    try:
        app(arguments)
    except InputError as error:
        raise SystemExit(f"transfer: {error}") from None


if __name__ == "__main__":
    main()
