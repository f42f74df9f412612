"""Searches for a better last layer of a network of clone_mpc by a population (CMA-ES) on an aim of its own.

    python -m fowt_env.training.studies.search_clone lulls --out runs/lulls_0 --seed 0
    python -m fowt_env.training.studies.search_clone gusts --out runs/gusts_0 --seed 0
    python -m fowt_env.training.studies.search_clone above --out runs/oc4_0 --start runs/oc4/network_3.npz

The network is that of mpc_clone or of the file --start, platform and turbine are its own. A candidate adds a
linear function of the leading principal components of the second hidden layer to the two outputs, rates of
torque and blade pitch: UNKNOWNS numbers. All candidates of a generation run the same episodes, in weather of
training seeds; every RENEWED generations the weather is drawn anew. The cost of a candidate is that of the
runs as a suite measures them:

lulls   the score of the suite lulls.toml beside this file, turbulence of 11.5 to 14.5 m/s, whose limits
        have the aims for rotor speed and shaft
gusts   the mean of the mean and the largest overspeed in the suite `gusts` over those of the start, and half
        the score of the suite above_rated at NORMAL winds over that of the start, beyond 1; in each run the
        power below LEAST_POWER of that of the start costs PRICE
above   the score of the suite above_rated at NORMAL winds

What exceeds the limits of the suite (of runs, of their mean, and MARGIN of the relative ones) or falls below
the energy of --energy costs PRICE, a lost run LOST. The folder has clone.npz, the network at the mean of the
last distribution, and search.csv, a row for each generation. Method: Hansen, "The CMA evolution strategy: a
tutorial", 2016, by the library cma.
"""

import time
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pandas as pd
import typer

from fowt_env.controllers.mpc.clone import ESTIMATOR, FILE, NETWORK, CloneMemory, read_clone
from fowt_env.envs import FowtVectorEnv
from fowt_env.errors import InputError
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.case_environment import environment_settings
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.metrics import mean_exponent, metrics
from fowt_env.training.evaluation.seeds import seeds_for
from fowt_env.training.studies.clone_mpc import write_clone

COMPONENTS = 12
UNKNOWNS = 2 * (COMPONENTS + 1)
RENEWED = 5  # generations
# first standard deviation of a candidate, of the rates' standard deviation per unit of a component
STEP = 0.1
PRICE = 10.0  # per unit above a limit
LOST = 10.0  # times the share of lost runs
MARGIN = 0.96  # of a relative limit: other weather exceeds it by chance
LEAST_POWER = 0.995  # capped power of a run, of that of the start
NORMAL = slice(0, None, 2)  # every second wind of above_rated
HOLD = {"hold": 100, "smoothing": 0.0, "history": 0}  # zero actions: the baseline alone, few calls
LULLS = Path(__file__).with_name("lulls.toml")
REFERENCE = "gspi_oc3"
CAPPED = "GenPwr_capped_mean_[kW]"
NORMAL_TIME, GUST_TIME = (500.0, 150.0), (300.0, 150.0)  # s, duration and what is skipped of it
FIRST = 50_000  # number of the first training seed


class Episodes:
    """Runs candidates of a network in the same episodes of load cases, in one batch.

    cases: Cases; candidates: number of networks; duration, skip: s; threads: of the batch.
    """

    def __init__(self, cases, candidates, duration, skip, controller="mpc_clone", threads=1):
        self.cases, self.candidates, self.skip = cases, candidates, skip
        settings = [environment_settings(case, duration) for case in cases]
        common = {"action_mode": "residual", "baseline": controller, "decisions": HOLD, "threads": threads}
        self.env = FowtVectorEnv(len(cases) * candidates, "Disabled", per_env=settings * candidates, **common)
        self.start = None

    def weather(self, seeds):
        """Begin the episodes of each case in the weather of its seed, for a single candidate."""
        self.env.reset(options=[{"weather_seed": seed} for seed in seeds])
        self.start = self.env.get_state()

    def begin_as(self, other):
        """Begin the episodes of Episodes of the same cases for a single candidate."""
        self.start = other.start * self.candidates

    def run(self, networks=None):
        """Return [{metric: value} or None of a lost run] of each case for each candidate.

        networks: list of {name of SHAPES: array}; None: that of the file, or another controller.
        """
        self.env.set_state(self.start)
        for i, env in enumerate(self.env.envs if networks is not None else ()):
            network = networks[i // len(self.cases)]
            env._baseline.parameters[NETWORK:ESTIMATOR] = np.concatenate([*map(np.ravel, network.values())])
        zero, n = np.zeros((self.env.num_envs, 2)), len(self.cases)
        self.memories, ended = [], np.zeros(self.env.num_envs, dtype=bool)
        while not ended.all():
            *_, terminated, truncated, _ = self.env.step(zero)
            ended = terminated | truncated
            if terminated.any():
                raise RuntimeError("a protected turbine goes on until the end of its run")
            self.memories.append(np.array([env._episode.memory for env in self.env.envs]))
        lost = [env.is_stopping for env in self.env.envs]
        found = [
            None if gone else metrics(env.frame(), skip=self.skip)
            for gone, env in zip(lost, self.env.envs, strict=True)
        ]
        return [found[i * n : (i + 1) * n] for i in range(self.candidates)]


def mean_of(runs, metric):
    """Return the mean of a metric over runs, as that of a lifetime."""
    p = mean_exponent(metric)
    return float(np.mean([run[metric] ** p for run in runs]) ** (1.0 / p))


def score_of(runs, reference, suite, energy=0.0):
    """Return (score, excess over the limits) of runs by a suite, relative to those of a reference.

    energy: least one, of the reference's. None of the runs is lost.
    """
    limits, terms = suite.limits, {term.metric: term.weight for term in suite.score.term}
    names = {*terms, *limits.relative, suite.score.power}
    ratio = {name: mean_of(runs, name) / mean_of(reference, name) for name in names}
    score = np.average([ratio[name] for name in terms], weights=list(terms.values()))
    beyond = [ratio[name] - MARGIN * most for name, most in limits.relative.items()]
    beyond.append(energy - ratio[suite.score.power])
    beyond += [mean_of(runs, name) / most - 1.0 for name, most in limits.lifetime.items()]
    beyond += [max(run[name] for run in runs) / most - 1.0 for name, most in limits.run.items()]
    return score / ratio[suite.score.power], sum(max(0.0, each) for each in beyond)


class Aim:
    """Computes the costs of candidates on an aim.

    name: lulls, gusts or above; start: file of the network to begin with; energy: least one, of the
    reference's.
    """

    def __init__(self, name, candidates, start=FILE, energy=0.0):
        self.energy, of = energy, read_clone(start)[0]
        self.suite = read_suite(LULLS if name == "lulls" else "above_rated", of.platform)
        cases = self.suite.cases * 2 if name == "lulls" else self.suite.cases[NORMAL]
        self.parts = {"normal": (cases, NORMAL_TIME)}
        if name == "gusts":
            self.parts["gusts"] = (read_suite("gusts", of.platform).cases, GUST_TIME)
        law = {"controller": f"policy:{start}"}
        self.own, self.start = (
            {part: Episodes(cases, n, *time, **law) for part, (cases, time) in self.parts.items()}
            for n in (candidates, 1)
        )
        self.base = Episodes(*self.parts["normal"][:1], 1, *NORMAL_TIME, controller=REFERENCE)

    def weather(self, first):
        """Draw weather by training seeds from number `first` on; run the start and the reference in it."""
        for part, (cases, _) in self.parts.items():
            seeds = seeds_for("training", first, len(cases))
            for episodes in (self.start[part], *([self.base] if part == "normal" else [])):
                episodes.weather(seeds)
            self.own[part].begin_as(self.start[part])
        (self.reference,) = self.base.run()
        self.of_start = {part: episodes.run()[0] for part, episodes in self.start.items()}

    def costs(self, networks):
        """Return the costs (candidates,) of networks."""
        runs = {part: episodes.run(networks) for part, episodes in self.own.items()}
        return np.array(
            [self.cost({part: all_[i] for part, all_ in runs.items()}) for i in range(len(networks))]
        )

    def cost(self, runs):
        """Return the cost of {part: runs}; means are of the runs that neither side lost."""
        lost = [run is None for part in runs.values() for run in part]
        kept = [(run, base) for run, base in zip(runs["normal"], self.reference, strict=True) if run and base]
        if not kept:
            return LOST
        score, excess = score_of(*zip(*kept, strict=True), self.suite, self.energy)
        total = LOST * np.mean(lost) + PRICE * excess
        if "gusts" not in runs:
            return total + score
        pairs = {
            part: [pair for pair in zip(runs[part], self.of_start[part], strict=True) if all(pair)]
            for part in runs
        }
        if not pairs["gusts"]:
            return total + 1.0
        started = [pair for pair in zip(self.of_start["normal"], self.reference, strict=True) if all(pair)]
        total += 0.5 * max(0.0, score / score_of(*zip(*started, strict=True), self.suite)[0] - 1.0)
        shares = [run[CAPPED] / start[CAPPED] for run, start in pairs["normal"] + pairs["gusts"]]
        total += PRICE * sum(max(0.0, LEAST_POWER - share) for share in shares)
        speeds = np.array([[run["overspeed_[%]"] for run in pair] for pair in pairs["gusts"]])
        return total + 0.5 * sum(of(speeds[:, 0]) / of(speeds[:, 1]) for of in (np.mean, np.max))


def optimiser(n, candidates, seed):
    """Return a CMA-ES of the library cma over vectors (n,), from zero with steps of STEP.

    Raises: InputError naming the extra to install if cma is missing.
    """
    try:
        import cma
    except ImportError as error:
        raise InputError(
            f'search_clone: cma cannot be imported ({error}); pip install "fowt-env[search]"'
        ) from error
    options = {"popsize": candidates, "seed": seed + 1, "verbose": -9}  # seed 0 would be the clock
    return cma.CMAEvolutionStrategy(np.zeros(n), STEP, options)


def about_layer(episodes):
    """Return (components, mean (HIDDEN,), spread (2,)) of the last run of the start, one in Episodes.

    components (COMPONENTS, HIDDEN): of the second hidden layer, of unit variance; spread: standard deviations
    of the outputs.
    """
    memory = np.concatenate(episodes.memories)
    hidden = memory[:, CloneMemory.SECOND : CloneMemory.ESTIMATE]
    mean = hidden.mean(axis=0)
    _, sizes, axes = np.linalg.svd(hidden - mean, full_matrices=False)
    components = axes[:COMPONENTS] * (np.sqrt(len(hidden)) / sizes[:COMPONENTS, None])
    return components, mean, memory[:, CloneMemory.INPUTS : CloneMemory.INPUTS + 2].std(axis=0)


def changed(network, components, mean, spread, vector):
    """Return the network with a linear function of the components added to its outputs.

    spread: (2,) standard deviations of the outputs, by which the vector (UNKNOWNS,) is scaled.
    """
    added = spread[:, None] * vector.reshape(2, -1)
    weight = added[:, 1:] @ components
    return network | {
        "weight_2": network["weight_2"] + weight,
        "bias_2": network["bias_2"] + added[:, 0] - weight @ mean,
    }


def improve(judged, network, episodes, seed, generations, candidates, out, write):
    """Search; write search.csv in the folder `out` and the network at the mean of each distribution.

    judged: Aim, or has its methods; network: to begin with; episodes: those of the start; write: called with
    {name of SHAPES: array} and the number of generations.
    """
    first = FIRST + 10_000 * seed
    judged.weather(first)
    components, mean, spread = about_layer(episodes)
    search, rows = optimiser(UNKNOWNS, candidates - 1, seed), []
    began = time.process_time()
    for generation in range(generations):
        if generation % RENEWED == 0:
            judged.weather(first + 100 * (1 + generation // RENEWED))
        vectors = search.ask()
        tried = np.vstack([vectors, search.mean])  # the mean too, which is not among the ranked
        costs = judged.costs([changed(network, components, mean, spread, vector) for vector in tried])
        rows.append({
            "generation": generation, "cost_of_the_mean": costs[-1], "best": costs[:-1].min(),
            "start": judged.cost(judged.of_start), "sigma": search.sigma,
            "seconds": time.process_time() - began,
        })  # fmt: skip
        search.tell(vectors, costs[:-1])
        found = changed(network, components, mean, spread, search.mean)
        write({name: found[name].astype(np.float32) for name in network}, generation + 1)
        write_table(pd.DataFrame(rows), out / "search.csv")
        print({name: round(float(value), 4) for name, value in rows[-1].items()}, flush=True)


def main(
    aim: Annotated[Literal["lulls", "gusts", "above"], typer.Argument(help="Aim of the search.")],
    out: Annotated[Path, typer.Option(help="Folder of the results.")],
    seed: Annotated[int, typer.Option(help="Seed of the search and of its weather.")] = 0,
    generations: Annotated[int, typer.Option(min=1, help="Generations.")] = 30,
    candidates: Annotated[int, typer.Option(min=4, help="Candidates of a generation.")] = 12,
    start: Annotated[Path, typer.Option(help="Network to begin with, a file of clone_mpc.")] = FILE,
    energy: Annotated[float, typer.Option(help="Least energy, of that of gspi_oc3.")] = 0.0,
):
    """Search, and write the network at the mean of the last distribution."""
    if (out / "clone.npz").exists():
        raise InputError(f"{out}: already contains a search: needs another folder")
    out.mkdir(parents=True, exist_ok=True)
    settings, network = read_clone(start)
    judged = Aim(aim, candidates, start, energy)
    episodes = judged.start["gusts" if aim == "gusts" else "normal"]

    def write(found, generation):
        about = {
            "aim": aim, "seed": seed, "generations": generation, "candidates": candidates,
            "start": settings.about, "energy": energy,
        }  # fmt: skip
        write_clone(out / "clone.npz", found, settings.model_dump(exclude={"about"}), about)

    improve(judged, network, episodes, seed, generations, candidates, out, write)


if __name__ == "__main__":
    typer.run(main)
