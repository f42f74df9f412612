"""The PI baseline at its best: gains searched on training seeds, so that nobody beats a straw man.

    python -m fowt_env.training.design.tune_pi --seeds 1001,1002,1003 --out controllers/pi_tuned.toml

The cases are those of a suite, the seeds others than it is scored on (1000 and above). Searched are
factors on the published OC3 gains: proportional, integral, and the blade pitch at which the schedule halves
them. The cost is the mean of rotor-speed and platform-pitch deviation, each over that of `pi`; more
blade-pitch travel than `pi` is not allowed.
"""

from math import exp
from typing import Annotated

import numpy as np
import typer
from scipy.optimize import minimize

from fowt_env.controllers.pi import PI, PISettings
from fowt_env.descriptions.checks import parse_whole_numbers
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.scene.build import build_scene
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.engines import session
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.run_case import CONTROL_DT
from fowt_env.training.evaluation.seeds import VALIDATION

FACTORS = ("KP", "KI", "gain_schedule_pitch")
WEIGHED = ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]")
TRAVEL = "blade_pitch_travel_[deg/s]"
PENALTY = 20.0  # on travel beyond that of pi: 1 % more has to be worth 20 % of the deviations
FAILED = 10.0  # cost of gains with which a run fails


def candidate(turbine, factors, control_dt=CONTROL_DT):
    """PI with the published OC3 gains times {name of FACTORS: factor}."""
    published = PISettings.published(turbine)
    changes = {name: getattr(published, name) * factors[name] for name in FACTORS}
    return PI(PISettings.published(turbine, **changes), control_dt, "pi_tuned")


def relative_means(controller, reference, suite, seeds, **engine):
    """{metric: mean over cases and seeds, over that of the reference}, or None where a run failed."""
    table = evaluate({"candidate": controller}, suite, seeds=seeds, **engine)
    if (table["status"] != "ok").any():
        return None
    return {name: float(table[name].mean() / reference[name]) for name in (*WEIGHED, TRAVEL)}


def cost(relative):
    """Cost of relative means: the mean deviation, and a penalty on travel beyond the reference's."""
    if relative is None:
        return FAILED
    excess = max(0.0, relative[TRAVEL] - 1.0)
    return float(np.mean([relative[name] for name in WEIGHED]) + PENALTY * excess)


def search(seeds, suite="above_rated", evaluations=60, report=None, **engine):
    """(best factors, its relative means, [(factors, relative means)] of all tried) by Nelder and Mead.

    engine: jobs, engine and address of evaluate.
    Raises: InputError for seeds below 1000, which are those of the suites.
    """
    if any(seed < VALIDATION.start for seed in seeds):
        raise InputError(f"seeds = {list(seeds)}: tuning seeds must be {VALIDATION.start} or more")
    chosen = read_suite(suite)
    turbine = build_scene(chosen.cases[0].platform).turbine
    table = evaluate("pi", chosen, seeds=seeds, **engine)
    reference = {name: float(table[name].mean()) for name in (*WEIGHED, TRAVEL)}
    tried = []

    def value(logarithms):
        factors = {name: exp(x) for name, x in zip(FACTORS, logarithms, strict=True)}
        relative = relative_means(candidate(turbine, factors), reference, chosen, seeds, **engine)
        tried.append((factors, relative))
        if report is not None:
            report(factors, relative, cost(relative))
        return cost(relative)

    start = np.zeros(len(FACTORS))
    simplex = np.vstack([start, *(start + 0.3 * direction for direction in np.eye(len(FACTORS)))])
    options = {"maxfev": evaluations, "initial_simplex": simplex, "xatol": 0.01, "fatol": 1e-4}
    minimize(value, start, method="Nelder-Mead", options=options)
    factors, relative = min(tried, key=lambda pair: cost(pair[1]))
    return factors, relative, tried


TEXT = """# Factors on the published OC3 gains of `pi`, found by
#   python -m fowt_env.training.design.tune_pi --suite {suite} --seeds {seeds} --evaluations {evaluations}
# on training seeds, which no suite is scored on. Relative to `pi` there: rotor-speed deviation {speed:.3f},
# platform-pitch deviation {pitch:.3f}, blade-pitch travel {travel:.3f}.
KP = {KP:.4f}
KI = {KI:.4f}
gain_schedule_pitch = {gain_schedule_pitch:.4f}
"""


def main(
    seeds: Annotated[str, typer.Option(help="Training seeds, 1000 or more.")] = "1001,1002",
    suite: Annotated[str, typer.Option(help="Suite whose cases are run.")] = "above_rated",
    evaluations: Annotated[int, typer.Option(help="Sets of gains tried.")] = 60,
    jobs: Annotated[int, typer.Option(help="Worker processes.")] = 1,
    engine: Annotated[str, typer.Option(help="Where the runs go: processes or ray.")] = "processes",
    address: Annotated[str | None, typer.Option(help="Of a Ray cluster that is running.")] = None,
    out: Annotated[str, typer.Option(help="File to write.")] = "controllers/pi_tuned.toml",
):
    """Search the gains of pi_tuned and write them."""
    numbers = parse_whole_numbers(seeds, "seeds")

    def report(factors, relative, value):
        shown = "failed" if relative is None else "  ".join(f"{k} {v:.3f}" for k, v in relative.items())
        print(
            "  ".join(f"{k} {v:.3f}" for k, v in factors.items()), f"  cost {value:.4f}  {shown}", flush=True
        )

    with session(engine, jobs, address):
        factors, relative, _ = search(
            numbers, suite, evaluations, report, jobs=jobs, engine=engine, address=address
        )
    speed, pitch, travel = (relative[name] for name in (*WEIGHED, TRAVEL))
    text = TEXT.format(
        suite=suite, seeds=seeds, evaluations=evaluations, speed=speed, pitch=pitch, travel=travel, **factors
    )
    with replacing(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(f"wrote {out}")


if __name__ == "__main__":
    typer.run(main)
