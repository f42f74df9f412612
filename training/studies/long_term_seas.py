"""Compares the 50-year load of the classes of Hs of a load table with that of all seas, where it is known.

    python -m fowt_env.training.studies.long_term_seas --seeds 20 --first 100

A load has the standard deviation sqrt((0.5 + 0.02 U)^2 + (w Hs)^2) about zero in a wind U and a sea Hs of a
site; its peaks above 1.4 deviations, 150 an hour, are those of a Gaussian process or exponential. Six runs of
an hour in each wind and class of Hs, as of DLC 1.2, are extrapolated from the classes alone and by the
distribution of Hs. Printed are mean and rms error of value over known value, and how often the 95 % interval
contains it.
"""

from math import log
from typing import Annotated

import numpy as np
import typer
from scipy.optimize import brentq

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.files.markdown import markdown_table
from fowt_env.training.loads.extrapolation import Condition, extrapolate
from fowt_env.training.loads.site import YEAR, climate_of, read_site

SITE, TURBINE = "northern_north_sea", "nrel5mw"
EDGES = np.arange(3.0, 26.0, 2.0)  # m/s
WINDS = 0.5 * (EDGES[1:] + EDGES[:-1])
AVAILABLE = 0.97
RATE = 150.0  # peaks per hour above LEVEL deviations
LEVEL, EXPONENTIAL = 1.4, 0.6  # deviations: threshold, and scale of exponential peaks
CLASSES, FINE, RUNS, STORED = 3, 200, 6, 60
STREAM = 11  # of the random generator
LOADS = {"wind": 0.0, "both": 0.35 / 3.0, "waves": 0.5}  # weight of Hs, 1/m
KINDS = ("gauss", "exponential")
PERIODS = {"1 day": 1.0 / 365.25, "50 years": 50.0}


def climate():
    """Return the Climate of the study."""
    return climate_of(read_site(SITE), read_turbine(TURBINE))


def deviation(weight, wind, Hs):
    """Return the standard deviation of a load of turbulence and waves."""
    return np.sqrt((0.5 + 0.02 * wind) ** 2 + (weight * Hs) ** 2)


def known_value(kind, weight, years, site):
    """Return the load exceeded in an hour once in some years, integrated over winds and seas of a Climate."""
    exceeded = np.append(np.logspace(0.0, -10.0, 401), 0.0)
    middle = 1.0 - np.sqrt(exceeded[:-1] * np.append(exceeded[1:-1], 0.5 * exceeded[-2]))
    scale = deviation(weight, WINDS[:, None], site.height_at(middle, WINDS[:, None]))
    likely = shares(site)[:, None] * -np.diff(exceeded)

    def excess(load):
        height = np.maximum(load / scale, LEVEL)
        power = 0.5 * (height**2 - LEVEL**2) if kind == "gauss" else (height - LEVEL) / EXPONENTIAL
        hours = float(np.sum(likely * -np.expm1(-RATE * np.exp(-power))))
        return log(max(hours, 1e-300) * years * YEAR)

    return brentq(excess, 1.0, 200.0)


def shares(site):
    """Return the fractions of the time (winds,)."""
    return AVAILABLE * np.diff(site.below(EDGES))


def sampled(kind, weight, seed, site):
    """Return the Conditions of one realisation of RUNS hours in each wind and class of Hs."""
    random, found = np.random.default_rng([STREAM, seed]), []
    for wind, share in zip(WINDS, shares(site), strict=True):
        fine = site.height_at((np.arange(CLASSES * FINE) + 0.5) / (CLASSES * FINE), wind)
        for Hs in fine.reshape(CLASSES, FINE).mean(axis=1):
            scale, runs = float(deviation(weight, wind, Hs)), []
            for _ in range(RUNS):
                excess = random.exponential(size=random.poisson(RATE))
                gauss = kind == "gauss"
                runs.append(
                    scale * (np.sqrt(LEVEL**2 + 2.0 * excess) if gauss else LEVEL + EXPONENTIAL * excess)
                )
            found.append(
                Condition(
                    f"u{wind:g}_h{Hs:.2f}", share / CLASSES, tuple(np.sort(run)[-STORED:] for run in runs),
                    tuple(map(len, runs)), np.array([run.max() for run in runs]), np.ones(RUNS), 0.0,
                    float(wind), float(Hs), (float(wind),),
                )
            )  # fmt: skip
    return found


def compared(kind, weight, years, seeds, site):
    """Return {estimator: (ratios to the known value (seeds,), how many intervals contain it)}."""
    known, found = known_value(kind, weight, years, site), {}
    samples = [sampled(kind, weight, seed, site) for seed in seeds]
    for name, seas in (("classes", None), ("all seas", site)):
        values = [extrapolate(sample, years=years, climate=seas) for sample in samples]
        ratios = np.array([each.value / known for each in values])
        found[name] = ratios, sum(each.low <= known <= each.high for each in values)
    return found


def main(
    seeds: Annotated[int, typer.Option(min=1, help="Realisations of each kind of load.")] = 20,
    first: Annotated[int, typer.Option(min=0, help="First seed.")] = 100,
):
    """Print the comparison."""
    rows, site, numbers = [], climate(), range(first, first + seeds)
    for load, weight in LOADS.items():
        for kind in KINDS:
            for period, years in PERIODS.items():
                row = [load, kind, period]
                for ratios, inside in compared(kind, weight, years, numbers, site).values():
                    error = np.sqrt(np.mean((ratios - 1.0) ** 2))
                    row += [f"{ratios.mean():.3f}", f"{error:.3f}", f"{inside} of {seeds}"]
                rows.append(row)
    heads = [f"{name}, {figure}" for name in ("classes", "all seas") for figure in ("mean", "rms", "covered")]
    print(markdown_table(["load of", "peaks", "value of", *heads], rows))


if __name__ == "__main__":
    typer.run(main)
