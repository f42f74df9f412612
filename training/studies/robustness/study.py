"""Stability under stress: the parts of the study, what each claims, and the report.

Each part stores what it found as JSON beside the others, so that a report can join runs of several days.
"""

import json
import time
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
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
from fowt_env.training.benchmarks.speed import header
from fowt_env.training.studies.robustness import extremes as stability_extremes
from fowt_env.training.studies.robustness import long_runs, random_cases, step_limits, without_compiler

MEMORY_MB = 5.0  # growth that counts as none: less than a byte per step of the documented run
# relative changes of the free body over 10000000 default steps: kinetic energy, linear momentum, angular
# momentum about the centre of mass, in inertial axes. The momenta turn with the error of the attitude, which
# grows with time.
DRIFT = {
    "rk4": {"energy": 1e-10, "linear": 1e-8, "angular": 1e-8},
    "heun": {"energy": 1e-5, "linear": 1e-3, "angular": 1e-4},
    "abm4": {"energy": 1e-8, "linear": 1e-6, "angular": 1e-6},
    "ab4": {"energy": 1e-7, "linear": 1e-5, "angular": 1e-6},
}
FLOATING_DRIFT = {"rk4": 1e-5, "ab4": 1e-2}  # of the energy of motion, over as many
SECULAR_STEPS = 10_000  # 600 s are 6000 to 12000 default steps
ORDER_SLACK = 0.35  # that a measured order may lie below the method's
TURNED = 1e-6  # entries of a rotation matrix
PLAIN = 1e-9  # rounding of functions that Python and the compiler take from different libraries
STEP_CHANGE = 0.05  # of an extreme's peak with half the step
ROWS_SHOWN = 10  # of a table in the report


@dataclass
class RobustnessClaim:
    """One row of the summary."""

    what: str
    count: str
    found: str
    target: str
    holds: bool


@dataclass
class Found:
    """What a part came to: claims, and tables as (title, columns, rows of texts)."""

    claims: list = field(default_factory=list)
    tables: list = field(default_factory=list)

    def claim(self, what, count, found, target, holds):
        """Add a RobustnessClaim."""
        self.claims.append(RobustnessClaim(what, str(count), found, target, bool(holds)))


@dataclass(frozen=True)
class Sizes:
    """How much is run; the documented run has 100000 cases and 10000000 steps."""

    cases: int = 2000
    per_weather: int = random_cases.PER_WEATHER
    steps: int = 200_000
    hostile_steps: int = 600
    seed: int = 0
    kinds: tuple | None = None  # of the map; None: all
    extremes: tuple | None = None
    map_duration: float = step_limits.DURATION


def map_part(sizes, folder, progress):
    """Found of the stability map."""
    table = step_limits.stability_map(sizes.kinds, duration=sizes.map_duration, progress=progress)
    found = Found()
    for integrator in INTEGRATORS:
        rows = table[table["integrator"] == integrator]
        least = rows.loc[rows["margin"].idxmin()]
        found.claim(
            f"{integrator}: default step of {INTEGRATORS[integrator].dt:g} s",
            f"{len(rows)} kinds of scene",
            f"least margin {least['margin']:.1f} ({least['kind']})",
            f"factor {step_limits.MARGIN:g}",
            least["margin"] >= step_limits.MARGIN,
        )
    both = table[np.isfinite(table["theory_s"]) & np.isfinite(table["measured_s"])]
    ratio = both["measured_s"] / both["theory_s"]
    found.claim(
        "measured limit over linear theory's",
        f"{len(table)} limits, {len(both)} below {step_limits.LARGEST_STEP:g} s in both",
        f"{ratio.min():.2f} to {ratio.max():.2f}, median {ratio.median():.3f}" if len(both) else "none",
        "none below 0.8",
        len(both) == 0 or ratio.min() > 0.8,
    )
    rows = [
        [row["kind"], row["integrator"], f"{row['default_s']:g}", _limit(row["measured_s"]),
         _limit(row["theory_s"]), _factor(row["margin"]), row["mode"].replace("_", " "),
         f"{row['fastest_1_per_s']:.2f}"]
        for row in table.to_dict("records")
    ]  # fmt: skip
    columns = ["scene", "integrator", "default, s", "largest stable step, s", "theory, s", "margin",
               "grows first", "fastest mode, 1/s"]  # fmt: skip
    found.tables.append(["Largest step without blow-up", columns, rows])
    return found


def _limit(value):
    return f"{value:.3f}" if np.isfinite(value) else f"> {step_limits.LARGEST_STEP:g}"


def _factor(value):
    return f"{value:.1f}" if np.isfinite(value) else "-"


def cases_part(sizes, folder, progress):
    """Found of the random scenes and states; failures are stored as replayable files in folder/failures."""
    tally = random_cases.random_cases(sizes.cases, sizes.seed, sizes.per_weather, progress=progress)
    return _found_of(tally, Path(folder) / "failures")


def tower_part(sizes, folder, progress):
    """Found of a twentieth as many random scenes and states with a tower that bends, as cases_part."""
    plants = (f"standard{random_cases.BENDS}",)
    tally = random_cases.random_cases(
        max(1, sizes.cases // 20), sizes.seed, sizes.per_weather, plants=plants, progress=progress
    )
    return _found_of(tally, Path(folder) / "tower_failures")


def _found_of(tally, failures):
    """Found of a Tally, whose failures go into a folder."""
    paths = random_cases.store_case(tally.failures, failures)
    reasons = [reason for _, reason in tally.failures]
    broken = sum("exception" in reason or "non-finite" in reason for reason in reasons)
    found = Found()
    spread = ", ".join(f"{count} {plant}" for plant, count in tally.per_plant.items())
    what = f"{tally.cases} states in {tally.weathers} weathers ({spread})"
    found.claim("NaN or exception", what, f"{broken}", "none", broken == 0)
    found.claim(
        "kinetic energy and rotor speed bounded",
        f"{tally.cases}",
        f"{len(reasons) - broken} above; largest ratio to the energy bound {tally.worst_ratio:.2f}",
        "none, nor a stop that a finer step lacks",
        len(reasons) == broken,
    )
    found.claim(
        "peak energy with a quarter of the step, every twentieth weather",
        f"{tally.checked}",
        f"largest change {tally.difference:.2%}",
        f"{random_cases.AGREE:.0%}",
        tally.difference <= random_cases.AGREE,
    )
    found.claim(
        "mooring lines that missed their tolerance", f"{tally.cases}", f"{tally.unconverged}", "none",
        tally.unconverged == 0,
    )  # fmt: skip
    peak = tally.peak
    rows = [
        ["kinetic energy of the platform", f"{peak[0] * 1e-6:.0f} MJ"],
        ["roll or platform pitch", f"{peak[1] / DEGREE:.1f} deg"],
        ["distance of the body origin from rest", f"{peak[2]:.1f} m"],
        ["rotor speed", f"{peak[3] / RPM:.1f} rpm"],
        ["capsizes, each confirmed at a quarter of the step", f"{tally.capsizes}"],
    ]
    found.tables.append(["Largest values of cases that ran to their end", ["", "largest"], rows])
    if paths:
        rows = [[path.name, reason] for path, reason in zip(paths, reasons, strict=True)]
        found.tables.append(["Failures, stored for --replay", ["file", "reason"], rows[:100]])
    return found


def hostile_part(sizes, folder, progress):
    """Found of hostile actions on the environment."""
    table = stability_extremes.hostile(steps=sizes.hostile_steps, progress=progress)
    found = Found()
    refused = table["policy"] == "NaN and infinity"
    attacks = table[~refused]
    found.claim(
        "state, observation and reward finite, or an end with its reason",
        f"{int(attacks['steps'].sum())} control periods, {len(attacks)} policies, modes and tasks",
        f"{int((~attacks['finite']).sum())} not finite",
        "none",
        attacks["finite"].all(),
    )
    found.claim(
        "NaN or infinity refused, state untouched",
        f"{int(table[refused]['steps'].sum())}",
        f"{int((~table[refused]['finite']).sum())} accepted",
        "all refused",
        table[refused]["finite"].all(),
    )
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
    """Found of the extreme events."""
    table = stability_extremes.extremes(sizes.extremes, seed=sizes.seed + 1, progress=progress)
    found = Found()
    groups = ", ".join(
        f"{count} {group}" for group, count in table.groupby("group", sort=False).size().items()
    )
    stops = (~table["verdict"].str.startswith("finite")).sum()
    found.claim(
        "state finite to the end", f"{len(table)} runs: {groups}",
        f"{(~table['finite']).sum()} not finite, {stops} stopped with their reason", "all finite",
        table["finite"].all(),
    )  # fmt: skip
    changes = table["step_change"].dropna()
    found.claim(
        "peaks with half the step",
        f"{len(changes)} runs",
        f"largest change {changes.max():.2%}" if len(changes) else "none",
        f"{STEP_CHANGE:.0%}",
        (changes <= STEP_CHANGE).all(),
    )
    columns = ["run", "rotor, rpm", "tilt, deg", "yaw, deg", "offset, m", "heave, m", "tension, MN",
               "change with half the step", "verdict"]  # fmt: skip
    rows = [
        [row["case"], *(f"{row[key]:.2f}" for key in stability_extremes.PEAKS),
         "-" if np.isnan(row["step_change"]) else f"{row['step_change']:.2%}", row["verdict"]]
        for row in table.to_dict("records")
    ]  # fmt: skip
    found.tables.append(["Extremes: largest values from the start of the run on", columns, rows])
    return found


def long_part(sizes, folder, progress):
    """Found of the long runs, the orders and the quaternion."""
    long, found = long_runs, Found()
    for integrator in INTEGRATORS:
        for steps in (min(SECULAR_STEPS, sizes.steps), sizes.steps):
            drift = long.free_drift(integrator, steps, progress=progress)
            limits = DRIFT[integrator]
            text = ", ".join(f"{drift[key]:.1e}" for key in limits)
            good = drift["status"] == RUNNING and all(drift[key] <= limits[key] for key in limits)
            target = ", ".join(f"{most:.0e}" for most in limits.values())
            found.claim(
                f"free body, {integrator}",
                f"{steps} steps of {INTEGRATORS[integrator].dt:g} s", text, target, good,
            )  # fmt: skip
    for integrator, most in FLOATING_DRIFT.items():
        drift = long.floating_drift(integrator, sizes.steps, progress=progress)
        found.claim(
            f"floating body, {integrator}",
            f"{sizes.steps} steps of {INTEGRATORS[integrator].dt:g} s", f"{drift['energy']:.1e}",
            f"{most:.0e}", drift["status"] == RUNNING and drift["energy"] <= most,
        )  # fmt: skip
    memory = long.plant_memory(sizes.steps, progress)
    found.claim(
        "memory, full plant in turbulence and waves", f"{memory['steps']} steps",
        f"{memory['growth_MB']:.2f} MB after the first tenth", f"{MEMORY_MB:g} MB",
        memory["status"] == RUNNING and memory["growth_MB"] <= MEMORY_MB,
    )  # fmt: skip
    memory = long.environment_memory(max(2000, sizes.steps // 50), progress)
    found.claim(
        "memory, environment", f"{memory['steps']} control periods, {memory['resets']} resets",
        f"{memory['growth_MB']:.2f} MB after the first tenth", f"{MEMORY_MB:g} MB",
        memory["growth_MB"] <= MEMORY_MB,
    )  # fmt: skip
    for integrator, order in long.measured_orders().items():
        least = INTEGRATORS[integrator].order - ORDER_SLACK
        found.claim(
            f"order of {integrator}", "steps of 0.05 and 0.025 s", f"{order:.2f}", f"{least:.2f} or more",
            order >= least,
        )  # fmt: skip
    difference, turned = long.quaternion_difference()
    found.claim(
        "tumbling body: Euler angles against a quaternion", "60 s, 61 instants",
        f"rotation matrices differ by {difference:.1e}, turned by {turned / DEGREE:.0f} deg",
        f"{TURNED:.0e}", difference <= TURNED,
    )  # fmt: skip
    return found


def plain_part(sizes, folder, progress):
    """Found of the runs without the compiler."""
    found = Found()
    if progress is not None:
        progress("runs without the compiler", 0, 1)
    differences = without_compiler.differences()
    worst = max(differences, key=differences.get)
    found.claim(
        "NUMBA_DISABLE_JIT=1 against compiled",
        f"{len(differences)} runs", f"largest difference {differences[worst]:.1e} ({worst})",
        f"{PLAIN:.0e} of 1 or the number", differences[worst] <= PLAIN,
    )  # fmt: skip
    rows = [[name, f"{value:.1e}"] for name, value in differences.items()]
    found.tables.append(["Without the compiler: largest difference", ["run", "difference"], rows])
    return found


PARTS = {
    "map": map_part,
    "cases": cases_part,
    "tower": tower_part,
    "hostile": hostile_part,
    "extremes": extremes_part,
    "long": long_part,
    "plain": plain_part,
}
TITLES = {
    "map": "Stability map",
    "cases": "Random scenes and initial states",
    "tower": "The same with a tower that bends",
    "hostile": "Hostile actions",
    "extremes": "Extremes",
    "long": "Long runs, order and attitude",
    "plain": "Without the compiler",
}


def study(folder, parts=None, sizes=None, progress=None):
    """{part: Found} of the chosen parts (default: all); each is written to folder/<part>.json as it ends.

    progress: called with (text, done, total). Raises: InputError for an unknown part.
    """
    sizes = Sizes() if sizes is None else sizes
    chosen = list(parts or PARTS)
    for part in chosen:
        if part not in PARTS:
            raise unknown("part", part, PARTS)
    results = {}
    for part in chosen:
        began = time.perf_counter()
        found = PARTS[part](sizes, folder, progress)
        results[part] = found
        stored = {
            "about": header(),
            "minutes": (time.perf_counter() - began) / 60.0,
            "date": f"{datetime.now(UTC):%Y-%m-%d}",
            "sizes": asdict(sizes),
            "claims": [asdict(claim) for claim in found.claims],
            "tables": found.tables,
        }
        with replacing(Path(folder) / f"{part}.json") as temporary:
            Path(temporary).write_text(json.dumps(stored, indent=1) + "\n")
    return results


def stored_parts(folder):
    """{part: what study stored of it} of a folder, in the order of PARTS."""
    paths = {part: Path(folder) / f"{part}.json" for part in PARTS}
    return {part: json.loads(path.read_text()) for part, path in paths.items() if path.is_file()}


def write_robustness_report(folder, path):
    """Write the Markdown report of every part that the folder holds; returns the path.

    Tables of more than ROWS_SHOWN rows become CSV files in a folder beside the report, of its name.
    """
    path = Path(path)
    parts = stored_parts(folder)
    verdicts = [claim["holds"] for stored in parts.values() for claim in stored["claims"]]
    lines = [
        "# Numerical robustness", "",
        f"{len(verdicts)} checks, {verdicts.count(False)} of them missed. Version {fowt_env.__version__};"
        " each part names the date and commit of its runs and the command that repeats them.",
    ]  # fmt: skip
    for part, stored in parts.items():
        lines += ["", f"## {TITLES[part]}", "", f"{_origin(part, stored)} {METHODS[part]}", ""]
        rows = [
            [c["what"], c["count"], c["found"] if c["holds"] else f"**MISSED**: {c['found']}", c["target"]]
            for c in stored["claims"]
        ]
        lines.append(markdown_table(["check", "count", "found", "target"], rows))
        for number, (title, columns, rows) in enumerate(stored["tables"]):
            if len(rows) <= ROWS_SHOWN:
                lines += ["", f"**{title}**", "", markdown_table(columns, rows)]
                continue
            name = f"{part}_{number + 1}.csv" if number else f"{part}.csv"
            write_table(pd.DataFrame(rows, columns=columns), path.with_suffix("") / name)
            lines += ["", f"[{title}, {len(rows)} rows]({path.stem}/{name})."]
    with replacing(path) as temporary:
        Path(temporary).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _origin(part, stored):
    """When a part was run, on what source, and the command that repeats it."""
    about = dict(line.partition(": ")[::2] for line in stored["about"])
    sizes = Sizes(**stored["sizes"])
    words = [f"{option} {getattr(sizes, name)}" for name, option in REPEATED[part]]
    words += [f"--seed {sizes.seed}"] if sizes.seed else []
    commit = about["commit"][:7]
    command = " ".join(["fowt benchmark stability --parts", part, *words])
    return f"{stored['date']}, {commit}, `{command}`."


CASES = (("cases", "--cases"),)
REPEATED = {  # sizes that the command of a part takes: (field of Sizes, option)
    "map": (),
    "cases": CASES,
    "tower": CASES,
    "hostile": (("hostile_steps", "--hostile"),),
    "extremes": (),
    "long": (("steps", "--steps"),),
    "plain": (),
}
METHODS = {
    "map": (
        f"Each run starts off its operating point in every state, keeps its command and lasts"
        f" {step_limits.DURATION:g} s. It has blown up where it stops, or where a peak of its second half is"
        f" more than {step_limits.GROWTH:g} times that with steps of {step_limits.FINE_STEP:g} s. Theory is"
        " the amplification matrix of the integrator on the linear model, which has no drag: some limits"
        " are therefore higher than its own. Yaw and rotor speed limit. Where the blades of an"
        " idling rotor damp its speed, ab4 corrects its step as abm4 does (`integrators.FEATHERING`)."
    ),
    "cases": (
        "Wind from still air to 70 m/s (steady, NTM, ETM, EWM, gusts; any direction), seas to Hs 17 m or a"
        " regular wave to 30 m as steep as it may be; at the start offsets to 30 m, tilt and yaw to 30 deg,"
        " speeds to 3 m/s and 0.1 rad/s, rotor to 150 %, any blade pitch. A third under the PI, a"
        f" third under a constant command, a third under a random one every second; {random_cases.DURATION:g}"
        " s each. The bound on the kinetic energy of the platform is"
        f" {random_cases.FACTOR:g} times the sum of its energy at the start, its own at the speed of"
        " the water, and the work that thrust can do; that on the rotor speed a tip-speed ratio of"
        f" {random_cases.FASTEST_TIP:g}."
    ),
    "tower": (
        'A twentieth as many with `tower="modes"`, deflections to 1 m and rates to 2 m/s at the start.'
    ),
    "hostile": (
        "Environment at its defaults; episodes that end early restart. Policies: bang-bang at"
        " Nyquist, constant corners, random, platform-pitch resonance, far outside the range."
    ),
    "extremes": (
        f"Standard fidelity, {stability_extremes.DURATION:g} s, the event at {stability_extremes.EVENT:g} s,"
        " PI control where the rotor runs. Lines have no breaking strength and the rotor no"
        " aerodynamic brake: a finite state does not say that a turbine survives."
    ),
    "long": (
        "The free body drifts and nutates in empty space with its rotor turning: relative drifts of its"
        " energy, linear and angular momentum. The floating body has hull, weight and lines, but no drag,"
        " damping or added mass: drift of its energy over the energy of motion."
    ),
    "plain": (
        f"{without_compiler.STEPS_PER_SCENE} steps of each scene by each integrator, and"
        f" {without_compiler.ENV_STEPS} control periods of environments."
    ),
}
