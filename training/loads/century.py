"""Samples a century of hours of production at a site: the values of a return period without extrapolation.

    century.json            settings, and the stages of the sample: number of hours, share of each stratum
    hours/<stage>_<n>.npz   largest and smallest values of each load in the hours of one block

Each hour is a state of wind and sea drawn from the joint distribution of the site, with turbulence and waves
of its own. Time outside production (parked, or not available) counts as time without an exceedance.

Plain sampling draws the states as often as they occur. Importance sampling draws them from strata (bins of
wind and of the quantile of Hs in that wind) in other shares. The weight of an hour is the probability of its
stratum over the mean of its shares in all stages (balance heuristic: Veach and Guibas, SIGGRAPH 1995), so
that the hours of all stages are one sample. The shares of a further stage follow from those before: hours of
a stratum in proportion to p sqrt(P(exceeded | stratum)), the least variance of a stratified sample (Neyman),
with exceedances from a Gumbel distribution whose mean and scale are fitted over wind and Hs. The fit chooses
states; it does not enter the values.

Limits of a rate of exceedance are those of a weighted sum of Poisson counts (Fay and Feuer, Statistics in
Medicine 16, 1997, with the mean weight of Tiwari, Clegg and Zou, Statistical Methods in Medical Research 15,
2006), for equal weights the exact ones.
"""

import json
import time
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import chi2

from fowt_env.descriptions.checks import check_number, check_whole_number
from fowt_env.descriptions.files import parse_json
from fowt_env.descriptions.platform import read_platform, turbine_of
from fowt_env.errors import InputError
from fowt_env.files.atomic import remove_leftovers, replacing
from fowt_env.training.evaluation import provenance
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.engines import outcomes
from fowt_env.training.evaluation.locks import locked
from fowt_env.training.evaluation.results import finite, write_json
from fowt_env.training.evaluation.run_case import FAILED, OK, Run, scored
from fowt_env.training.loads.extrapolation import conditions_of_runs, extrapolate
from fowt_env.training.loads.matrix import TRIP
from fowt_env.training.loads.site import YEAR, climate_of
from fowt_env.training.loads.statistics import EXTRAPOLATED, RESULTANTS

FORMAT = 1  # of the folder
HOUR = 3600.0  # s
BLOCK = 20  # hours of a task and its file
HEIGHTS = (0.0, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0)  # quantiles of Hs in a wind between strata
DEFENCE = 0.25  # share of plain sampling in a stage of importance sampling: no weight exceeds its inverse
CONFIDENCE = 0.95
LEAST_PILOT = 60  # hours from which exceedances in states can be fitted
TIME_LIMIT = 3600.0  # s of wall clock of an hour
STATE = ("wind", "Hs", "Tp", "misalignment")


@dataclass(frozen=True)
class Century:
    """Defines a sample of the hours of a site: what is simulated and from which states.

    platform: name or path; controller: name; options: of build_scene; seed: of the sample.
    """

    platform: str
    site: Any  # site.SiteFile
    controller: str
    fidelity: str = "standard"
    sensors: str = "standard"
    seed: int = 1

    @cached_property
    def turbine(self):
        """Return the turbine of the platform."""
        return turbine_of(read_platform(self.platform))

    @cached_property
    def climate(self):
        """Return the Climate of the site at the hub."""
        return climate_of(self.site, self.turbine)

    @cached_property
    def edges(self):
        """Return the edges (m/s) of the bins of wind, from cut-in to cut-out."""
        low, high = self.turbine.cut_in_wind_speed, self.turbine.cut_out_wind_speed
        return np.linspace(low, high, int(np.ceil((high - low) / self.site.design.bin_width - 1e-9)) + 1)

    @cached_property
    def probabilities(self):
        """Return the probabilities (strata,) of the strata, given production."""
        wind = np.diff(self.climate.below(self.edges))
        return np.outer(wind / wind.sum(), np.diff(HEIGHTS)).ravel()

    @property
    def production(self):
        """Return the fraction of time in production: the wind is between its limits, and it is available."""
        below = self.climate.below(self.edges[[0, -1]])
        return float(below[1] - below[0]) * self.site.design.availability

    def hours(self, years):
        """Return the hours of production in some years."""
        return round(years * YEAR * self.production)

    def state(self, share, stage, number):
        """Return ({key: value of STATE}, stratum, weather seed) of an hour of a stage.

        share: (strata,) of the stage, cumulated to the stratum that is drawn.
        """
        draw = np.random.default_rng([self.seed, stage, number])
        stratum = int(np.searchsorted(np.cumsum(share), draw.random() * share.sum(), side="right"))
        stratum = min(stratum, len(share) - 1)
        i, j = divmod(stratum, len(HEIGHTS) - 1)
        below = self.climate.below(self.edges[i : i + 2])
        wind = float(self.climate.wind_at(below[0] + draw.random() * (below[1] - below[0])))
        quantile = HEIGHTS[j] + draw.random() * (HEIGHTS[j + 1] - HEIGHTS[j])
        Hs = float(self.climate.height_at(quantile, wind))
        Tp = float(self.climate.period_at(draw.random(), Hs, wind))
        angles = [each.misalignment for each in self.site.direction]
        angle = float(draw.choice(angles, p=[each.probability for each in self.site.direction]))
        return dict(zip(STATE, (wind, Hs, Tp, angle), strict=True)), stratum, int(draw.integers(2**31))

    def case(self, state):
        """Return the Case of a state: normal turbulence, rotor-averaged, and a JONSWAP sea."""
        options = {"fidelity": self.fidelity}
        if self.site.shear_exponent is not None:
            options["shear_exponent"] = self.site.shear_exponent
        if self.site.current is not None and self.site.current.speed:
            current = self.site.current
            options["current"] = {"speed": current.speed, "heading": state["misalignment"],
                                  "exponent": current.exponent}  # fmt: skip
        wind = {"kind": "ntm", "speed": state["wind"], "class": self.site.wind.turbulence_class}
        sea = {"kind": "jonswap", "Hs": state["Hs"], "Tp": state["Tp"], "heading": state["misalignment"]}
        return Case("hour", wind, sea, self.platform, options, trip=TRIP, sensors=self.sensors)

    def settings(self):
        """Return what may not change within a folder, as plain values."""
        about = {
            "format": FORMAT, "platform": str(self.platform), "site": self.site.model_dump(mode="json"),
            "controller": self.controller, "fidelity": self.fidelity, "sensors": self.sensors,
            "seed": self.seed, "strata": [self.edges.tolist(), list(HEIGHTS)],
            "code": provenance.plant_code(Path(__file__)), "versions": provenance.versions(),
        }  # fmt: skip
        return json.loads(json.dumps(finite(about)))


@dataclass(frozen=True)
class Block:
    """Defines the hours of one task: numbers first to first + count - 1 of a stage."""

    century: Century
    stage: int
    share: tuple
    first: int
    count: int
    time_limit: float | None = TIME_LIMIT

    def path(self, folder):
        """Return the path of the file of the block."""
        return Path(folder) / "hours" / f"{self.stage}_{self.first // BLOCK:05d}.npz"


def simulated(block):
    """Return {name: array} of the hours of a Block: states, strata, status, and extremes (hours, columns).

    Extremes of an hour without result are NaN.
    """
    hours = [_hour(block, number) for number in range(block.first, block.first + block.count)]
    columns = next((row["columns"] for *_, row in hours if "columns" in row), [])
    missing = np.full(len(columns), nan)
    found = {key: np.array([state[key] for state, *_ in hours]) for key in STATE}
    return found | {
        "stratum": np.array([stratum for _, stratum, _ in hours]),
        "status": np.array([row["status"] for *_, row in hours]),
        "columns": np.array(columns),
        "low": np.array([row.get("low", missing) for *_, row in hours], dtype=np.float32),
        "high": np.array([row.get("high", missing) for *_, row in hours], dtype=np.float32),
    }


def _hour(block, number):
    """Return (state, stratum, row of `scored`) of one simulated hour of a Block."""
    century = block.century
    state, stratum, seed = century.state(np.array(block.share), block.stage, number)
    skip = century.site.design.transient
    case = century.case(state)
    case = replace(case, options={**case.options, "duration": skip + HOUR})
    run = Run(
        century.controller, century.controller, case, seed, skip + HOUR, skip, {}, None, block.time_limit
    )
    return state, stratum, scored(run, _extremes)[0]


def _extremes(frame, case, scene, skip):
    """Return {"columns", "low", "high"} of the loads of a run that may be asked for over many years."""
    values = {name.partition("_[")[0]: frame[name].to_numpy() for name in frame}
    counted = values["Time"] >= skip - 1e-9
    for name, (_, x, y) in RESULTANTS.items():
        if x in values and y in values:
            values[name] = np.hypot(values[x], values[y])
    kept = sorted(name for name in values if name in EXTRAPOLATED or name.startswith("FAIRTEN"))
    table = np.array([values[name][counted] for name in kept])
    return {"columns": kept, "low": table.min(axis=1), "high": table.max(axis=1)}


# --------------------------------------------------------------------------------------- the sample


@dataclass(frozen=True)
class Sample:
    """Holds the simulated hours of a Century: extremes (n, columns), weights and states (n,)."""

    columns: tuple
    low: np.ndarray
    high: np.ndarray
    weight: np.ndarray  # mean 1: probability of the state over that of its being drawn
    stratum: np.ndarray
    states: dict  # {key of STATE: (n,)}
    production: float  # fraction of time
    lost: int  # hours without result, which are left out
    tripped: int  # hours in which a trip stopped the turbine, left out: the extremes of the stop are others

    @property
    def sides(self):
        """Yield (column, side) of the extremes that can be asked for; of magnitudes the largest alone."""
        for column in self.columns:
            yield column, "max"
            if column not in RESULTANTS:
                yield column, "min"

    @property
    def hours(self):
        """Return the number of hours."""
        return len(self.weight)

    def values(self, column, side):
        """Return the extremes (n,) of a column and side, "max" or "min", signed so that more is worse."""
        index = self.columns.index(column)
        return self.high[:, index] if side == "max" else -self.low[:, index]


@dataclass(frozen=True)
class Level:
    """Holds the value of a return period of a load, its 95 % interval and what it rests on.

    NaN: the sample is too short for the value, or for this end of its interval. exceedances: effective number
    of hours at or above the value, 0 without one. state: mean (wind, Hs, Tp) of these hours.
    """

    value: float
    low: float
    high: float
    exceedances: float
    state: tuple


def return_level(sample, column, side, years):
    """Return the Level that the hourly extreme of a load exceeds once in some years on average.

    Raises: InputError for a return period that is not positive.
    """
    check_number("years", years, 0.0, low_open=True)
    values = sample.values(column, side)
    order = np.argsort(-values, kind="stable")
    values, weight = values[order].astype(np.float64), sample.weight[order]
    target = sample.hours / (years * YEAR * sample.production)  # weight of the hours beyond the value
    total, square = (np.concatenate([[0.0], np.cumsum(weight**k)]) for k in (1, 2))
    tail = 0.5 * (1.0 - CONFIDENCE)
    # limits of the weight beyond the k-th largest value, and of that beyond it alone
    share = total[1:] ** 2 / square[1:]
    surely = total[1:] / (2.0 * share) * chi2.ppf(tail, 2.0 * share)
    total, square = total + weight.mean(), square + np.mean(weight**2)
    perhaps = square / (2.0 * total) * chi2.ppf(1.0 - tail, 2.0 * total**2 / square)
    # the value is above each at which the rate is surely larger, and below each at which it is surely less
    above, below = np.flatnonzero(surely > target), np.count_nonzero(perhaps[:-1] < target)
    ends = (values[above[0]] if above.size else nan, values[below - 1] if below else nan)
    ends = ends if side == "max" else (-ends[1], -ends[0])
    reached = np.flatnonzero(np.cumsum(weight) >= target)
    if not reached.size or weight[0] > target * (1.0 + 1e-9):  # less than one hour is expected beyond it
        return Level(nan, *map(float, ends), 0.0, (nan,) * 3)
    at, sign = int(reached[0]), 1.0 if side == "max" else -1.0
    there = order[: at + 1]
    state = tuple(
        float(np.average(sample.states[key][there], weights=sample.weight[there])) for key in STATE[:3]
    )
    return Level(sign * float(values[at]), *map(float, ends), float(share[at]), state)


# ------------------------------------------------------------------------------- shares of a further stage


def tail_shares(sample, century, years):
    """Return the shares (strata,) of a stage that serves the values of some years of all loads alike.

    The largest value of an hour in a state is taken as a Gumbel variable whose mean and scale are quadratic
    in wind and Hs, fitted to the hours so far. Raises: InputError for fewer than LEAST_PILOT hours.
    """
    if sample.hours < LEAST_PILOT:
        raise InputError(
            f"importance sampling: {sample.hours} hours so far: at least {LEAST_PILOT} are needed"
        )
    p, middle = century.probabilities, _middles(century)
    target = 1.0 / (years * YEAR * sample.production)
    design, there = (_quadratic(*each) for each in ((sample.states["wind"], sample.states["Hs"]), middle))
    shares = []
    for column, side in sample.sides:
        values = sample.values(column, side).astype(np.float64)
        mean = np.linalg.lstsq(design, values, rcond=None)[0]
        spread = np.linalg.lstsq(design, np.abs(values - design @ mean), rcond=None)[0]
        least = 0.3 * np.mean(np.abs(values - design @ mean))
        # mean absolute deviation and mean of a Gumbel variable of scale 1: 0.9831, and Euler's constant
        scale = np.maximum(there @ spread, least) / 0.9831 + 1e-300
        mode = there @ mean - 0.5772 * scale
        low, high = float(mode.min()), float((mode + 40.0 * scale).max())
        for _ in range(60):
            level = 0.5 * (low + high)
            beyond = -np.expm1(-np.exp(np.minimum(-(level - mode) / scale, 50.0)))
            beyond = beyond.reshape(len(p), -1).mean(axis=1)
            low, high = (level, high) if p @ beyond > target else (low, level)
        share = p * np.sqrt(beyond)
        shares.append(share / share.sum())
    return DEFENCE * p + (1.0 - DEFENCE) * np.mean(shares, axis=0)


def _middles(century, count=5):
    """Return (wind, Hs) of count x count states in each stratum, (strata * count^2,) each."""
    inner = (np.arange(count) + 0.5) / count
    wind, Hs = [], []
    for low, high in zip(century.edges, century.edges[1:], strict=False):
        for first, last in zip(HEIGHTS, HEIGHTS[1:], strict=False):
            U, q = np.meshgrid(low + (high - low) * inner, first + (last - first) * inner)
            wind.append(U.ravel())
            Hs.append(century.climate.height_at(q.ravel(), U.ravel()))
    return np.concatenate(wind), np.concatenate(Hs)


def _quadratic(wind, Hs):
    """Return the terms (n, 6) of a quadratic polynomial in wind and Hs."""
    U, H = np.asarray(wind) / 10.0, np.asarray(Hs) / 5.0
    return np.stack([np.ones_like(U), U, H, U * U, U * H, H * H], axis=1)


# --------------------------------------------------------------------------------------- the folder


def _sampling(hours, years):
    """Return the text of a stage: its hours, and how they are drawn."""
    return f"{hours} hours of " + ("plain sampling" if years is None else f"sampling for {years:g} years")


def run_century(
    century, folder, stages, *, jobs=1, engine="processes", address=None, time_limit=TIME_LIMIT, progress=None
):
    """Simulate what is not finished of the stages of a Century in a folder; return (Sample, seconds, hours).

    stages: [(hours, years)]: years None for plain sampling, else importance sampling for the values of so
    many years, from the stages before. seconds of this call, in which so many hours were simulated.
    time_limit: s of wall clock of an hour, or None.
    Raises: InputError for a folder of other settings or in use.
    """
    folder = Path(folder).absolute()
    report = progress or (lambda done, total, left: None)
    began, simulated_hours = time.monotonic(), 0
    with locked(folder, f"century {str(folder)!r}", "another process is writing to it"):
        plan = _prepared(century, folder)
        for number, (hours, years) in enumerate(stages):
            check_whole_number("hours", hours, 1)
            if number == len(plan["stages"]):
                share = century.probabilities
                if years is not None:
                    share = tail_shares(read_sample(century, folder), century, years)
                plan["stages"].append({"hours": hours, "years": years, "share": share.tolist()})
            stage = plan["stages"][number]
            if stage["years"] != years or hours < stage["hours"]:
                raise InputError(
                    f"century {str(folder)!r}: its stage {number + 1} has"
                    f" {_sampling(stage['hours'], stage['years'])}, which cannot become"
                    f" {_sampling(hours, years)}: remove this folder, or choose another (--out)"
                )
            stage["hours"] = hours
            write_json(plan, folder / "century.json")
            share = tuple(stage["share"])
            blocks = [
                Block(century, number, share, first, min(BLOCK, hours - first), time_limit)
                for first in range(0, hours, BLOCK)
            ]
            left = [block for block in blocks if not _holds(block, folder)]
            done = len(blocks) - len(left)
            with closing(outcomes(simulated, left, jobs, engine, address, None, _lost)) as ended:
                for count, (index, result) in enumerate(ended, 1):
                    _write(result, left[index].path(folder))
                    simulated_hours += left[index].count
                    rest = (time.monotonic() - began) / count * (len(left) - count)
                    report(done + count, len(blocks), rest)
    return read_sample(century, folder), time.monotonic() - began, simulated_hours


def _lost(block, reason):
    """Return the hours of a block whose worker processes died, without results."""
    numbers, share = range(block.first, block.first + block.count), np.array(block.share)
    states = [block.century.state(share, block.stage, number) for number in numbers]
    found = {key: np.array([state[key] for state, *_ in states]) for key in STATE}
    empty = np.empty((block.count, 0), dtype=np.float32)
    return found | {
        "stratum": np.array([stratum for _, stratum, _ in states]), "low": empty, "high": empty,
        "status": np.full(block.count, FAILED), "columns": np.array([], dtype=str),
    }  # fmt: skip


def _write(result, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **result)


def _holds(block, folder):
    """Return whether the file of a block exists with all of its hours."""
    path = block.path(folder)
    return path.exists() and len(_read(path)["stratum"]) >= block.count


def _read(path):
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in ("stratum", "status", "columns", "low", "high", *STATE)}
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise InputError(f"{str(path)!r} has no hours of a century ({error}); remove it") from None


def _prepared(century, folder):
    """Return the plan of a folder, new or read. Raises: InputError for other settings."""
    path, settings = folder / "century.json", century.settings()
    remove_leftovers(folder / "hours")
    if not path.exists():
        if any(folder.glob("hours/*.npz")):
            raise InputError(f"century {str(folder)!r} has hours but no century.json")
        return {"settings": settings, "stages": []}
    plan = _plan(path)
    for key, value in settings.items():
        if plan["settings"].get(key) != value:
            raise InputError(
                f"century {str(folder)!r} was made with another {key}: choose another folder, or remove this"
            )
    return plan


def _plan(path):
    plan = parse_json(path.read_text(encoding="utf-8"))
    if not isinstance(plan, dict) or not isinstance(plan.get("settings"), dict):
        raise InputError(f"{str(path)!r} is not the plan of a century")
    return plan


def read_sample(century, folder):
    """Return the Sample of the finished hours of a folder. Raises: InputError for a folder without hours."""
    folder, parts = Path(folder), []
    stages = _plan(folder / "century.json")["stages"] if (folder / "century.json").exists() else []
    counts = np.zeros(len(stages))
    for number in range(len(stages)):
        for path in sorted(folder.glob(f"hours/{number}_*.npz")):
            parts.append(_read(path))
            counts[number] += len(parts[-1]["stratum"])
    if not any(part["columns"].size for part in parts):
        raise InputError(f"century {str(folder)!r} has no hours yet")
    columns = next(part["columns"] for part in parts if part["columns"].size)
    stratum = np.concatenate([part["stratum"] for part in parts])
    # what a stratum is drawn with, over its probability
    drawn = counts @ np.array([stage["share"] for stage in stages]) / counts.sum() / century.probabilities
    status = np.concatenate([part["status"] for part in parts])
    good = status == OK

    def stacked(name):
        blank = [np.full((len(part["stratum"]), len(columns)), nan, dtype=np.float32) for part in parts]
        return np.concatenate([
            part[name] if part[name].shape == empty.shape else empty
            for part, empty in zip(parts, blank, strict=True)
        ])[good]  # fmt: skip

    return Sample(
        tuple(columns.tolist()), stacked("low"), stacked("high"), 1.0 / drawn[stratum[good]], stratum[good],
        {key: np.concatenate([part[key] for part in parts])[good] for key in STATE},
        century.production, int((status == FAILED).sum()), int((~good & (status != FAILED)).sum()),
    )  # fmt: skip


def seconds_per_hour(century):
    """Return the s of wall clock that one hour takes in one process, measured on the second of two hours.

    Raises: InputError with the reason if both fail.
    """
    block = Block(century, 0, tuple(century.probabilities), 0, 2)
    *_, first = _hour(block, 0)  # compiles, or loads what is compiled
    began = time.perf_counter()
    *_, second = _hour(block, 1)
    if first["status"] == second["status"] == FAILED:
        raise InputError(f"century with {century.controller!r}: its first hours fail: {second['reason']}")
    return time.perf_counter() - began


# --------------------------------------------------------------------------------------- the table

FOLDER, FILE = "century", "century.csv"  # FOLDER/CONTROLLER/FILE in a folder of fowt loads
TABLE = (
    "load", "side", "years", "value", "low", "high", "exceedances", "wind", "Hs", "Tp", "extrapolated",
    "extrapolated_low", "extrapolated_high", "covered",
)  # fmt: skip


def century_table(sample, years, extrapolated=None):
    """Return the DataFrame of values of some years of all loads and sides, with the columns TABLE.

    extrapolated: {(load, side): extrapolation.Extrapolation} to compare with, of the same years. covered:
    whether the value is within the interval of the extrapolation; empty where one of them is missing.
    """
    rows = []
    for column, side in sample.sides:
        level = return_level(sample, column, side, years)
        row = [column, side, years, level.value, level.low, level.high, level.exceedances, *level.state]
        each = (extrapolated or {}).get((column, side))
        if each is None:
            rows.append([*row, nan, nan, nan, None])
            continue
        known = np.isfinite([level.value, each.low, each.high]).all()
        covered = bool(each.low <= level.value <= each.high) if known else None
        rows.append([*row, each.value, each.low, each.high, covered])
    return pd.DataFrame(rows, columns=list(TABLE))


def coverage_text(table):
    """Return which values of a century_table the interval of the extrapolation covers, "" without any.

    A sampled value has limits of its own, within which the true value may be covered: it is named twice then.
    """
    known = table[table["covered"].notna()]
    missed = known[~known["covered"].astype(bool)]
    if known.empty:
        return ""
    above = missed["extrapolated_low"] > missed["high"]  # False for a limit that the sample does not reach
    undecided = missed[~above & ~(missed["extrapolated_high"] < missed["low"])]
    text = (
        f"the interval of the extrapolation covers {len(known) - len(missed)} of {len(known)} sampled values;"
        f" not: {_names(missed) or 'none'}"
    )
    return f"{text} (within the limits of the sample: {_names(undecided)})" if len(undecided) else text


def _names(table):
    return ", ".join(f"{row.load} {row.side}" for row in table.itertuples())


def coverage_remarks(folder, labels):
    """Return coverage_text of each controller of a folder of fowt loads that has sampled hours."""
    remarks = []
    for label in labels:
        path = Path(folder) / FOLDER / label / FILE
        table = pd.read_csv(path) if path.is_file() else None
        if table is not None and (text := coverage_text(table)):
            remarks.append(f"{label}, once in {table['years'].iloc[0]:g} years: {text}")
    return tuple(remarks)


def extrapolations(runs, years, climate, progress=None):
    """Return {(load without unit, side): Extrapolation} of runs [(LoadCase, RunStatistics)] of DLC 1.1.

    climate: site.Climate of the runs; progress(done, total, text) before each load.
    """
    found, names = {}, list(runs[0][1].peaks)
    for done, name in enumerate(names):
        if progress:
            progress(done, len(names), f"extrapolating {name}")
        for side in ("max", "min"):
            conditions = conditions_of_runs(runs, name, side)
            found[name.partition("_[")[0], side] = extrapolate(conditions, side, years, climate)
    return found
