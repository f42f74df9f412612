"""Runs the robustness study: parts stored as JSON, checks of each part, and the report."""

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.errors import unknown
from fowt_env.files.atomic import replacing
from fowt_env.files.markdown import markdown_table
from fowt_env.files.tables import write_table
from fowt_env.plant.advance import RUNNING
from fowt_env.plant.integrators import INTEGRATORS
from fowt_env.training.benchmarks.speed import header, silent
from fowt_env.training.studies.robustness import (
    extremes,
    long_runs,
    random_cases,
    step_limits,
    without_compiler,
)

MEMORY_MB = 5.0  # allowed memory growth: less than a byte per step of the documented run
# relative changes of the free body over 10000000 default steps: kinetic energy, linear momentum, angular
# momentum about the centre of mass, in inertial axes. The momenta rotate with the attitude error, which
# grows with time.
DRIFT = {
    "rk4": {"energy": 1e-10, "linear": 1e-8, "angular": 1e-8},
    "heun": {"energy": 1e-5, "linear": 1e-3, "angular": 1e-4},
    "abm4": {"energy": 1e-8, "linear": 1e-6, "angular": 1e-6},
    "ab4": {"energy": 1e-7, "linear": 1e-5, "angular": 1e-6},
}
FLOATING_DRIFT = {"rk4": 1e-5, "ab4": 1e-2}  # of the energy of motion, over as many steps
SECULAR_STEPS = 10_000  # 600 s are 6000 to 12000 default steps
ORDER_SLACK = 0.35  # allowed shortfall of a measured order
TURNED = 1e-6  # allowed difference of entries of a rotation matrix
PLAIN = 1e-9  # rounding: Python and the compiler use different math libraries
STEP_CHANGE = 0.05  # allowed relative change of a peak with half the step
ROWS_SHOWN = 10  # of a table in the report


@dataclass
class RobustnessClaim:
    """Holds one check of a part: one row of its summary."""

    what: str
    count: str
    found: str
    target: str
    holds: bool


@dataclass
class Found:
    """Collects the results of a part: claims, and tables as [title, columns, rows of texts]."""

    claims: list = field(default_factory=list)
    tables: list = field(default_factory=list)

    def claim(self, what, count, found, target, holds):
        """Add a RobustnessClaim."""
        self.claims.append(RobustnessClaim(what, str(count), found, target, bool(holds)))

    def none(self, what, count, number, words, target="none"):
        """Add a claim that a number of misses is zero; words: text printed after the number."""
        self.claim(what, count, f"{number} {words}".rstrip(), target, number == 0)


@dataclass(frozen=True)
class Sizes:
    """Holds the sizes of the parts; the documented run has 100000 cases and 10000000 steps."""

    cases: int = 2000
    steps: int = 200_000
    hostile_steps: int = 600
    seed: int = 0


def map_part(sizes, folder, progress):
    """Compute the stability map and return its Found."""
    table, found = step_limits.stability_map(progress=progress), Found()
    for integrator, rows in table.groupby("integrator", sort=False):
        least = rows.loc[rows["margin"].idxmin()]
        what = f"{integrator}: default step of {INTEGRATORS[integrator].dt:g} s"
        text = f"least margin {least['margin']:.1f} ({least['kind']})"
        target, holds = f"factor {step_limits.MARGIN:g}", least["margin"] >= step_limits.MARGIN
        found.claim(what, f"{len(rows)} kinds of scene", text, target, holds)
    both = table[np.isfinite(table["theory_s"]) & np.isfinite(table["measured_s"])]
    ratio = both["measured_s"] / both["theory_s"]
    count = f"{len(table)} limits, {len(both)} below {step_limits.LARGEST_STEP:g} s in both"
    text = f"{ratio.min():.2f} to {ratio.max():.2f}, median {ratio.median():.3f}"
    found.claim("measured over theoretical limit", count, text, "none below 0.8", ratio.min() > 0.8)

    def limit(value):
        return f"{value:.3f}" if np.isfinite(value) else f"> {step_limits.LARGEST_STEP:g}"

    rows = [
        [row["kind"], row["integrator"], f"{row['default_s']:g}", limit(row["measured_s"]),
         limit(row["theory_s"]), f"{row['margin']:.1f}" if np.isfinite(row["margin"]) else "-",
         row["mode"].replace("_", " "), f"{row['fastest_1_per_s']:.2f}"]
        for row in table.to_dict("records")
    ]  # fmt: skip
    columns = ["scene", "integrator", "default, s", "largest stable step, s", "theory, s", "margin",
               "first unstable state", "fastest mode, 1/s"]  # fmt: skip
    found.tables.append(["Largest stable step", columns, rows])
    return found


def cases_part(sizes, folder, progress, fraction=1, plants=random_cases.PLANTS, failures="failures"):
    """Run cases / fraction random cases and return their Found; failures are stored for replay."""
    count = max(1, sizes.cases // fraction)
    tally = random_cases.random_cases(count, sizes.seed, plants=plants, progress=progress)
    paths = random_cases.store_case(tally.failures, Path(folder) / failures)
    reasons = [reason for _, reason in tally.failures]
    broken = sum("exception" in reason or "non-finite" in reason for reason in reasons)
    found = Found()
    spread = ", ".join(f"{count} {plant}" for plant, count in tally.per_plant.items())
    what = f"{tally.cases} states in {tally.weathers} weathers ({spread})"
    found.none("NaN or exception", what, broken, "")
    words = f"above; largest ratio to the energy bound {tally.worst_ratio:.2f}"
    target = "none, and no stop that a finer step does not have"
    found.none("kinetic energy and rotor speed bounded", tally.cases, len(reasons) - broken, words, target)
    what, most = "peak energy with a quarter of the step, every twentieth weather", random_cases.AGREE
    text, holds = f"largest change {tally.difference:.2%}", tally.difference <= most
    found.claim(what, tally.checked, text, f"{most:.0%}", holds)
    found.none("mooring lines that missed their tolerance", tally.cases, tally.unconverged, "")
    peak = tally.peak
    rows = [
        ["kinetic energy of the platform", f"{peak[0] * 1e-6:.0f} MJ"],
        ["roll or platform pitch", f"{peak[1] / DEGREE:.1f} deg"],
        ["distance of the body origin from rest", f"{peak[2]:.1f} m"],
        ["rotor speed", f"{peak[3] / RPM:.1f} rpm"],
        ["capsizes, each confirmed at a quarter of the step", f"{tally.capsizes}"],
    ]
    found.tables.append(["Largest values of completed cases", ["", "largest"], rows])
    if paths:
        rows = [[path.name, reason] for path, reason in zip(paths, reasons, strict=True)]
        found.tables.append(["Failures, stored for --replay", ["file", "reason"], rows[:100]])
    return found


def hostile_part(sizes, folder, progress):
    """Apply hostile actions to environments and return Found."""
    table, found = extremes.hostile(steps=sizes.hostile_steps, progress=progress), Found()
    refused = table[table["policy"] == "NaN and infinity"]
    attacks = table.drop(refused.index)
    what = "state, observation and reward finite, or termination with a reason"
    count = f"{attacks['steps'].sum()} control periods, {len(attacks)} policies, modes and tasks"
    found.none(what, count, (~attacks["finite"]).sum(), "not finite")
    what, count = "NaN or infinity refused, state untouched", refused["steps"].sum()
    found.none(what, count, (~refused["finite"]).sum(), "accepted", "all refused")
    rows = [
        [row["task"], row["mode"], row["policy"], str(row["steps"]),
         "; ".join(f"{reason}: {count}" for reason, count in row["ends"].items()) or "none",
         "finite" if row["finite"] else "NOT FINITE"]
        for row in table.to_dict("records")
    ]  # fmt: skip
    columns = ["task", "action mode", "policy", "periods", "episodes ended early, by reason", "verdict"]
    found.tables.append(["Hostile actions", columns, rows])
    return found


def extremes_part(sizes, folder, progress):
    """Run the extreme events and return Found."""
    table, found = extremes.extremes(seed=sizes.seed + 1, progress=progress), Found()
    sizes_of_groups = table.groupby("group", sort=False).size().items()
    groups = ", ".join(f"{count} {group}" for group, count in sizes_of_groups)
    stops = (~table["verdict"].str.startswith("finite")).sum()
    words, broken = f"not finite, {stops} stopped with a reason", (~table["finite"]).sum()
    found.none("state finite to the end", f"{len(table)} runs: {groups}", broken, words, "all finite")
    changes = table["step_change"].dropna()
    text, holds = f"largest change {changes.max():.2%}", (changes <= STEP_CHANGE).all()
    found.claim("peaks with half the step", f"{len(changes)} runs", text, f"{STEP_CHANGE:.0%}", holds)
    columns = ["run", "rotor, rpm", "tilt, deg", "yaw, deg", "offset, m", "heave, m", "tension, MN",
               "change with half the step", "verdict"]  # fmt: skip
    rows = [
        [row["case"], *(f"{row[key]:.2f}" for key in extremes.PEAKS),
         "-" if np.isnan(row["step_change"]) else f"{row['step_change']:.2%}", row["verdict"]]
        for row in table.to_dict("records")
    ]  # fmt: skip
    found.tables.append(["Extremes: largest values of the whole run", columns, rows])
    return found


def long_part(sizes, folder, progress):
    """Run long simulations, measure orders, compare with a quaternion attitude; return Found."""
    found = Found()
    runs = [(i, n, long_runs.free_drift, "free", DRIFT[i])
            for i in INTEGRATORS for n in (min(SECULAR_STEPS, sizes.steps), sizes.steps)]  # fmt: skip
    runs += [(i, sizes.steps, long_runs.floating_drift, "floating", {"energy": most})
             for i, most in FLOATING_DRIFT.items()]  # fmt: skip
    for integrator, steps, measure, body, limits in runs:
        drift = measure(integrator, steps, progress=progress)
        holds = drift["status"] == RUNNING and all(drift[key] <= limits[key] for key in limits)
        what, count = f"{body} body, {integrator}", f"{steps} steps of {INTEGRATORS[integrator].dt:g} s"
        text = ", ".join(f"{drift[key]:.1e}" for key in limits)
        found.claim(what, count, text, ", ".join(f"{most:.0e}" for most in limits.values()), holds)
    plant = long_runs.plant_memory(sizes.steps, progress)
    env = long_runs.environment_memory(max(2000, sizes.steps // 50), progress)
    for what, count, memory in (
        ("memory, full plant in turbulence and waves", f"{plant['steps']} steps", plant),
        ("memory, environment", f"{env['steps']} control periods, {env['resets']} resets", env),
    ):
        text = f"{memory['growth_MB']:.2f} MB after the first tenth"
        holds = memory.get("status", RUNNING) == RUNNING and memory["growth_MB"] <= MEMORY_MB
        found.claim(what, count, text, f"{MEMORY_MB:g} MB", holds)
    for integrator, order in long_runs.measured_orders().items():
        least = INTEGRATORS[integrator].order - ORDER_SLACK
        what, count = f"order of {integrator}", "steps of 0.05 and 0.025 s"
        found.claim(what, count, f"{order:.2f}", f"{least:.2f} or more", order >= least)
    difference, turned = long_runs.quaternion_difference()
    what = "tumbling body: Euler angles against a quaternion"
    text = f"rotation matrices differ by {difference:.1e}, turned by {turned / DEGREE:.0f} deg"
    found.claim(what, "60 s, 61 instants", text, f"{TURNED:.0e}", difference <= TURNED)
    return found


def plain_part(sizes, folder, progress):
    """Compare runs with and without the compiler and return Found."""
    progress("runs without the compiler", 0, 1)
    differences, found = without_compiler.differences(), Found()
    worst = max(differences, key=differences.get)
    text = f"largest difference {differences[worst]:.1e} ({worst})"
    count, target = f"{len(differences)} runs", f"{PLAIN:.0e} of 1 or the number"
    found.claim("NUMBA_DISABLE_JIT=1 against compiled", count, text, target, differences[worst] <= PLAIN)
    rows = [[name, f"{value:.1e}"] for name, value in differences.items()]
    found.tables.append(["Without the compiler: largest difference", ["run", "difference"], rows])
    return found


@dataclass(frozen=True)
class Part:
    """Describes a part: function, title and method in the report, (field of Sizes, CLI option) or None."""

    run: Callable
    title: str
    method: str
    size: tuple | None = None


PARTS = {
    "map": Part(
        map_part,
        "Stability map",
        f"Each run starts with all states displaced from the operating point, has a constant command and"
        f" lasts {step_limits.DURATION:g} s. It is unstable if it stops, or if a peak of its second half is"
        f" more than {step_limits.GROWTH:g} times that with steps of {step_limits.FINE_STEP:g} s. Theory is"
        " the amplification matrix of the integrator on the linear model, which has no drag: some limits"
        " therefore exceed the theoretical ones. Yaw and rotor speed limit the step. If the blades of an"
        " idling rotor damp its speed, ab4 corrects its step as abm4 does (`integrators.FEATHERING`).",
    ),
    "cases": Part(
        cases_part,
        "Random scenes and initial states",
        "Wind from still air to 70 m/s (steady, NTM, ETM, EWM, gusts; any direction), seas to Hs 17 m or a"
        " regular wave to 30 m, up to breaking steepness; initial offsets to 30 m, tilt and yaw to 30 deg,"
        " speeds to 3 m/s and 0.1 rad/s, rotor to 150 %, any blade pitch. A third under the PI, a"
        f" third under a constant command, a third under a random one every second; {random_cases.DURATION:g}"
        " s each. The bound on the kinetic energy of the platform is"
        f" {random_cases.FACTOR:g} times the sum of its initial energy, its kinetic energy at the speed of"
        " the water, and the largest work of the thrust; that on the rotor speed a tip-speed ratio of"
        f" {random_cases.FASTEST_TIP:g}.",
        ("cases", "--cases"),
    ),
    "tower": Part(
        partial(
            cases_part, fraction=20, plants=(f"standard{random_cases.BENDS}",), failures="tower_failures"
        ),
        "Random scenes with a flexible tower",
        'A twentieth as many with `tower="modes"`, initial deflections to 1 m and rates to 2 m/s.',
        ("cases", "--cases"),
    ),
    "hostile": Part(
        hostile_part,
        "Hostile actions",
        "Environment with default settings; episodes that end early are restarted. Policies: bang-bang at"
        " Nyquist, constant corners, random, platform-pitch resonance, far outside the range.",
        ("hostile_steps", "--hostile"),
    ),
    "extremes": Part(
        extremes_part,
        "Extremes",
        f"Standard fidelity, {extremes.DURATION:g} s, the event at {extremes.EVENT:g} s,"
        " PI control if the rotor operates. Lines have no breaking strength and the rotor no"
        " aerodynamic brake: a finite state does not show that a turbine survives.",
    ),
    "long": Part(
        long_part,
        "Long runs, order and attitude",
        "The free body drifts and nutates in empty space with its rotor spinning: relative drifts of its"
        " energy, linear and angular momentum. The floating body has hull, weight and lines, but no drag,"
        " damping or added mass: drift of its energy over the energy of motion.",
        ("steps", "--steps"),
    ),
    "plain": Part(
        plain_part,
        "Without the compiler",
        f"{without_compiler.STEPS_PER_SCENE} steps of each scene by each integrator, and"
        f" {without_compiler.ENV_STEPS} control periods of environments.",
    ),
}


def study(folder, parts=None, sizes=None, progress=silent):
    """Run the chosen parts (default: all), write folder/<part>.json and return {part: Found}.

    progress: called with (text, done, total). Raises: InputError for an unknown part.
    """
    sizes, results = sizes or Sizes(), {}
    for part in parts or PARTS:
        if part not in PARTS:
            raise unknown("part", part, PARTS)
    for part in parts or PARTS:
        began = time.perf_counter()
        found = results[part] = PARTS[part].run(sizes, folder, progress)
        about = {"about": header(), "minutes": (time.perf_counter() - began) / 60.0}
        about |= {"date": f"{datetime.now(UTC):%Y-%m-%d}", "sizes": asdict(sizes)}
        with replacing(Path(folder) / f"{part}.json") as temporary:
            temporary.write_text(json.dumps(about | asdict(found), indent=1) + "\n")
    return results


def write_robustness_report(folder, path):
    """Write the Markdown report of all parts stored in a folder; return the path.

    Tables of more than ROWS_SHOWN rows are written as CSV to a folder next to the report, with its name.
    """
    path = Path(path)
    paths = {part: Path(folder) / f"{part}.json" for part in PARTS}
    parts = {part: json.loads(file.read_text()) for part, file in paths.items() if file.is_file()}
    verdicts = [claim["holds"] for stored in parts.values() for claim in stored["claims"]]
    lines = [
        "# Numerical robustness", "",
        f"{len(verdicts)} checks, {verdicts.count(False)} of them missed. Version {fowt_env.__version__};"
        " each part states the date and commit of its runs and the command to repeat them.",
    ]  # fmt: skip
    for name, stored in parts.items():
        part, sizes = PARTS[name], stored["sizes"]
        about = dict(line.partition(": ")[::2] for line in stored["about"])
        command = f"fowt dev benchmark stability --parts {name}"
        if part.size is not None:
            command += f" {part.size[1]} {sizes[part.size[0]]}"
        if sizes["seed"]:
            command += f" --seed {sizes['seed']}"
        words = f"{stored['date']}, {about['commit'][:7]}, `{command}`. {part.method}"
        lines += ["", f"## {part.title}", "", words, ""]
        rows = [
            [c["what"], c["count"], c["found"] if c["holds"] else f"**MISSED**: {c['found']}", c["target"]]
            for c in stored["claims"]
        ]
        lines.append(markdown_table(["check", "count", "result", "target"], rows))
        for number, (title, columns, rows) in enumerate(stored["tables"]):
            if len(rows) <= ROWS_SHOWN:
                lines += ["", f"**{title}**", "", markdown_table(columns, rows)]
                continue
            file = f"{name}_{number + 1}.csv" if number else f"{name}.csv"
            write_table(pd.DataFrame(rows, columns=columns), path.with_suffix("") / file)
            lines += ["", f"[{title}, {len(rows)} rows]({path.stem}/{file})."]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
