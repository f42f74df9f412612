"""Trains one policy whose inputs contain the weights of the cost, and compares fronts of swept laws.

    python -m fowt_env.training.studies.weight_conditioned imitate --out runs/imitated
    python -m fowt_env.training.studies.weight_conditioned search runs/imitated/clone.npz --out runs/found_0
    python -m fowt_env.training.studies.weight_conditioned sweep runs/found_0/clone.npz --out runs/all
    python -m fowt_env.training.studies.weight_conditioned sweep mpc --out runs/all
    python -m fowt_env.training.studies.weight_conditioned front found_0 lqr mpc --out runs/all

A point, TRADES numbers in [-1, 1], stands for the weights: settings_at and weights_at.

imitate: a network imitates mpc (DAgger as in clone_mpc.py) with the settings of a point that is drawn for
each episode and is an input. clone.npz is the network of clone_mpc at the middle point; its array
point_weight has the first layer's weights of the point, with which at_point writes the file of any other.

search: a population moves the last layer (search_clone.py) for the hypervolume of the front of FRONT.

sweep: runs a network at POINTS, or a law at its settings in `swept`, on the suite above_rated and validation
seeds; with --draw-seeds at most MOST of them, chosen by the hypervolumes on the validation seeds, on seeds
drawn from a hash.

front: hypervolumes in the plane of plot_pareto and fowt design front, deviations of rotor speed and platform
pitch over those of gspi_oc3, from gspi_oc3 itself (1, 1); and with pitch travel as third axis, from its limit
in the suite. Settings that exceed a limit of the suite, lose a run or have less than LEAST_ENERGY of the
energy are left out.
"""

import itertools
import json
import shutil
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pandas as pd
import typer

from fowt_env.controllers.lqr.design import LQGSettings
from fowt_env.controllers.lqr.law import LQR
from fowt_env.controllers.mpc.clone import N_INPUTS, read_clone
from fowt_env.controllers.mpc.law import MPC
from fowt_env.controllers.mpc.settings import MPCSettings
from fowt_env.descriptions.array_files import read_arrays
from fowt_env.envs.tasks import TASKS
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import read_table, write_table
from fowt_env.run.simulation import simulate
from fowt_env.training.design.linear_bound import efficient
from fowt_env.training.evaluation.bootstrap import interval, lifetime_means, resample_weights
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.leaderboard import decisions
from fowt_env.training.evaluation.limits import EXCEEDED, limit_texts
from fowt_env.training.evaluation.metrics import mean_exponent
from fowt_env.training.evaluation.results_table import case_shares
from fowt_env.training.evaluation.run_case import OK, REFERENCE
from fowt_env.training.evaluation.seeds import seeds_for, with_drawn_seeds
from fowt_env.training.studies.clone_mpc import (
    CONTROL_DT,
    WINDS,
    Records,
    Teacher,
    episode,
    fitted,
    settings_of,
    write_clone,
)
from fowt_env.training.studies.search_clone import LOST, MARGIN, NORMAL_TIME, Episodes, improve

TRADES = ("rotor speed against platform pitch", "load of the shaft", "pitch travel")
MPC_PRICES = tuple(
    {"speed": speed, "platform_pitch": pitch}
    for speed, pitch in ((0.3, 1.5), (0.6, 1.4), (1.0, 1.2), (1.6, 0.9), (2.4, 0.4))
)
SHAFT = (0.1, 1.0 / 3.0)  # price at the middle point, factor per unit
TRAVEL = (0.9, 0.2)  # limit at the middle point, change per unit
POINTS = tuple(itertools.product((-0.5, 0.0, 0.4, 0.8), (0.0, 0.4, 0.8), (0.3, 0.8)))
LAWS = {"lqr": (LQR, LQGSettings), "mpc": (MPC, MPCSettings)}
SUITE = "above_rated"
# of search: its points, the cases that it runs, cost of the excess over a limit, margin of the energy
FRONT = ((-0.5, 0.6, 0.6), (0.1, 0.5, 0.6), (0.6, 0.3, 0.6))
SEARCHED, EXCESS, SEARCHED_ENERGY = ("ntm_12", "ntm_14", "ntm_18"), 3.0, 0.991
LEAST_ENERGY = 0.99
AXES = ("RotSpeed_std_[rpm]", "PtfmPitch_std_[deg]", "blade_pitch_travel_[deg/s]")
SEEDS = (1, 2)  # number of the first validation seed, and of seeds
TEST_SEEDS = 4
FRONT_RESAMPLES = 2000
MOST = 6  # settings of a front that are judged
DESIGNS = 14  # in one evaluation: the laws keep so many in memory


def settings_at(point):
    """Return the MPCSettings of a point."""
    prices = {
        key: np.interp(point[0], np.linspace(-1.0, 1.0, len(MPC_PRICES)), [each[key] for each in MPC_PRICES])
        for key in MPC_PRICES[0]
    }
    shaft, travel = SHAFT[0] * SHAFT[1] ** point[1], TRAVEL[0] + TRAVEL[1] * point[2]
    return MPCSettings().changed(**{key: float(x) for key, x in prices.items()}, shaft=shaft, travel=travel)


def moved(network, by_point, point):
    """Return a network with the bias of the first layer at a point; by_point: weights (hidden, TRADES)."""
    return network | {"bias_0": network["bias_0"] + by_point @ np.asarray(point)}


def at_point(source, point, path):
    """Write the file of `source`, of imitate or search, at a point; return the path."""
    arrays = read_arrays(source, 1 << 26)
    arrays = moved(arrays, arrays.pop("point_weight"), point)
    arrays["bias_0"] = arrays["bias_0"].astype(np.float32)
    settings = json.loads(str(arrays["settings"]))
    settings["about"]["point"] = [float(x) for x in point]
    arrays["settings"] = np.array(json.dumps(settings))
    return write_arrays(path, arrays)


def write_arrays(path, arrays):
    """Write {name: array}; return the path."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)
    return path


def parted(network):
    """Return the arrays of a file of imitate of a network that has points as further inputs."""
    mean, scale, weight = network["mean"], network["scale"], network["weight_0"]
    by_point = weight[:, N_INPUTS:] / scale[N_INPUTS:]
    return network | {
        "mean": mean[:N_INPUTS], "scale": scale[:N_INPUTS], "weight_0": weight[:, :N_INPUTS],
        "bias_0": network["bias_0"] - by_point @ mean[N_INPUTS:], "point_weight": by_point,
    }  # fmt: skip


def record(number, round_, folder):
    """Run episode `number` of a round; write its inputs, with the point, and rates; keep an existing file."""
    path = folder / f"round_{round_}" / f"episode_{number}.npz"
    if path.exists():
        return
    seed = 1000 * round_ + number
    point = np.random.default_rng([seed, len(TRADES)]).uniform(-1.0, 1.0, len(TRADES))
    network = None
    if round_:
        arrays = read_arrays(folder / f"network_{round_ - 1}.npz", 1 << 26)
        network = moved(arrays, arrays["point_weight"], point)
    records = Records()
    scene, initial = episode(seed, *WINDS[number % len(WINDS)])
    teacher = Teacher(scene.turbine, CONTROL_DT, records, network, settings_at(point))
    about = {"protection": "end_at_overspeed", "sensors": "standard"}
    failed, duration = False, TASKS["above_rated_mixture"].duration
    try:
        simulate(scene, teacher, duration, control_dt=CONTROL_DT, initial=initial, **about)
    except SimulationStopped:
        failed = True
    inputs, rates = (np.array(part) for part in zip(*records, strict=True))
    inputs = np.hstack([inputs, np.tile(point, (len(inputs), 1))])
    path.parent.mkdir(parents=True, exist_ok=True)
    write_arrays(path, {"inputs": inputs, "rates": rates, "failed": np.array(failed)})


class Front:
    """Computes the costs of networks for search_clone.improve: minus the area of their front of FRONT.

    source: file of imitate; candidates: number of networks; threads: of their runs.
    """

    def __init__(self, source, candidates, threads=1):
        self.by_point = read_arrays(source, 1 << 26)["point_weight"].astype(np.float64)
        self.network, self.suite = read_clone(source)[1], read_suite(SUITE)
        cases = [case for case in self.suite.cases if case.name in SEARCHED]
        shares = np.array([self.suite.weights[case.name] for case in cases])
        shares[-1] = 1.0 - shares[:-1].sum()  # stands for all stronger winds
        self.shares, own = shares, (*NORMAL_TIME, f"policy:{source}")
        self.own = Episodes(cases, candidates * len(FRONT), *own, threads=threads)
        self.start = Episodes(cases, len(FRONT), *own)
        self.base = Episodes(cases, 1, *NORMAL_TIME, controller=self.suite.reference)

    def weather(self, first):
        """Draw weather by training seeds from number `first` on; run the start and the reference in it."""
        seeds = seeds_for("training", first, len(self.shares))
        self.base.weather(seeds)
        self.start.weather(seeds * len(FRONT))
        self.own.start = self.start.start * (self.own.candidates // len(FRONT))
        (self.reference,) = self.base.run()
        self.of_start = self.start.run(self.at_points(self.network))

    def at_points(self, network):
        """Return the networks of FRONT."""
        return [moved(network, self.by_point, point) for point in FRONT]

    def costs(self, networks):
        """Return the costs (candidates,) of networks."""
        runs = self.own.run([one for network in networks for one in self.at_points(network)])
        n = len(FRONT)
        return np.array([self.cost(runs[i * n : (i + 1) * n]) for i in range(len(networks))])

    def cost(self, runs):
        """Return the cost of the runs of FRONT; what exceeds a limit worsens both axes of its point."""
        lost = [run is None for part in runs for run in part]
        points = [self.point(part) for part in runs if all(part)]
        return LOST * float(np.mean(lost)) - area(points, (1.0, 1.0))

    def point(self, runs):
        """Return (rotor speed, platform pitch) of a setting over those of the reference, with its excess."""

        def mean(of, name):
            p = mean_exponent(name)
            return float(self.shares @ [run[name] ** p for run in of]) ** (1.0 / p)

        def over(name):
            return mean(runs, name) / mean(self.reference, name)

        limits = self.suite.limits
        beyond = [over(name) / (MARGIN * most) - 1.0 for name, most in limits.relative.items()]
        beyond += [mean(runs, name) / (MARGIN * most) - 1.0 for name, most in limits.lifetime.items()]
        beyond += [max(run[name] for run in runs) / most - 1.0 for name, most in limits.run.items()]
        beyond.append(SEARCHED_ENERGY / over(self.suite.score.power) - 1.0)
        excess = sum(max(0.0, each) for each in beyond)
        return [over(name) + EXCESS * excess for name in AXES[:2]]


app = typer.Typer(add_completion=False)
Out = Annotated[Path, typer.Option(help="Folder of the results.")]
Source = Annotated[Path, typer.Argument(help="File of imitate or search.")]


@app.command()
def imitate(
    out: Out,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds, the first of them with mpc.")] = 2,
    episodes: Annotated[int, typer.Option(min=1, help="Episodes of a round.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the fits.")] = 0,
    jobs: Annotated[int, typer.Option(min=1, help="Processes side by side.")] = 1,
):
    """Imitate mpc at all points."""
    out.mkdir(parents=True, exist_ok=True)
    data = []
    for round_ in range(rounds):
        run = partial(record, round_=round_, folder=out)
        if jobs == 1:
            list(map(run, range(episodes)))
        else:
            with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
                list(pool.map(run, range(episodes)))
        data += [
            read_arrays(out / f"round_{round_}" / f"episode_{number}.npz", 1 << 26)
            for number in range(episodes)
        ]
        inputs, rates = (np.concatenate([part[name] for part in data]) for name in ("inputs", "rates"))
        network, found = fitted(inputs, rates, seed)
        about = {
            "rounds": round_ + 1, "episodes": episodes, "decisions": len(inputs), "seed": seed,
            "R2_torque_rate": round(found[0], 4), "R2_pitch_rate": round(found[1], 4),
        }  # fmt: skip
        path = out / f"network_{round_}.npz"
        write_clone(path, parted(network), settings_of(), about)
        failed = sum(bool(part["failed"]) for part in data[-episodes:])
        print(f"round {round_}: {failed} of {episodes} episodes failed, {about}", flush=True)
    shutil.copyfile(path, out / "clone.npz")


@app.command()
def search(
    source: Source,
    out: Out,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search and of its weather.")] = 0,
    generations: Annotated[int, typer.Option(min=1, help="Generations.")] = 40,
    candidates: Annotated[int, typer.Option(min=4, help="Candidates of a generation.")] = 12,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the runs.")] = 1,
):
    """Move the last layer of the network of imitate for a better front."""
    if (out / "clone.npz").exists():
        raise InputError(f"{out}: already contains a search: needs another folder")
    out.mkdir(parents=True, exist_ok=True)
    judged, settings = Front(source, candidates, threads), read_clone(source)[0]

    def write(found, generation):
        about = {"seed": seed, "generations": generation, "candidates": candidates, "start": settings.about}
        kept = settings.model_dump(exclude={"about"})
        write_clone(out / "clone.npz", found | {"point_weight": judged.by_point}, kept, about)

    improve(judged, judged.network, judged.start, seed, generations, candidates, out, write)


def swept(law):
    """Return the list of changed settings {name: value} of a law; the first are the shipped ones."""
    if law == "lqr":
        pairs = itertools.product((0.6, 1.0), (0.35, 0.45, 0.577, 0.7, 0.85))
        return [{}, *({"share": share, "shaft": shaft, "travel": 1.02} for shaft, share in pairs)]
    pairs = itertools.product((0.2, 0.08), MPC_PRICES)
    found = [{}, *(prices | {"shaft": shaft, "travel": 1.0} for shaft, prices in pairs)]
    others = ({"travel": 1.0, "shaft_near_rated": 0.03}, {"travel": 0.7})
    return found + [prices | {"shaft": 0.08} | more for more in others for prices in MPC_PRICES[::2]]


def networks_of(source, out):
    """Return {label: controller} of a file of imitate or search at POINTS, as files in the folder `out`."""
    name, found = Path(source).parent.name, {}
    for point in POINTS:
        label = f"{name} " + ",".join(f"{x:g}" for x in point)
        found[label] = f"policy:{at_point(source, point, out / f'{label}.npz'.replace(' ', '_'))}"
    return found


def laws_of(law):
    """Return {label: controller} of the swept settings of a law."""
    kind, settings = LAWS[law]
    return {
        " ".join([law, *(f"{key}={value:g}" for key, value in changes.items())]): partial(
            kind, settings=settings().changed(**changes)
        )
        for changes in swept(law)
    }


def runs_of(controllers, suite, seeds):
    """Return the table of the runs of {label: controller}, as evaluate without the reference."""
    labels, tables = list(controllers), []
    for first in range(0, len(labels), DESIGNS):
        some = {label: controllers[label] for label in labels[first : first + DESIGNS]}
        tables.append(evaluate(some, suite, seeds=seeds, reference=False))
    return pd.concat(tables)


def area(points, corner):
    """Return the area between points (n, 2) and a corner that all dominated points are below."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    front = efficient(points[(points < corner).all(axis=1)])
    widths = np.diff(np.append(front[:, 0], corner[0]))
    return float(widths @ (corner[1] - front[:, 1]))


def volume(points, corner):
    """Return the hypervolume between points (n, 3) and a corner: areas over slices of the third axis."""
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    levels = np.sort(points[points[:, 2] < corner[2], 2])
    heights = np.diff(np.append(levels, corner[2]))
    areas = [area(points[points[:, 2] <= level, :2], corner[:2]) for level in levels]
    return float(heights @ areas) if len(levels) else 0.0


def measured(table, weights=None):
    """Return ({label: ratios (resamples, axes) to the reference}, {label: why it is left out}) of a table.

    weights: of the seeds, (resamples, seeds); None: one row, all seeds once.
    """
    suite = read_suite(SUITE)
    names = [*AXES, suite.score.power]
    exponents = np.array([mean_exponent(name) for name in names])
    cases, seeds = (list(dict.fromkeys(table[key])) for key in ("case", "seed"))
    shares = case_shares(table, cases)
    keyed = table.set_index(["controller", "case", "seed"])
    weights = np.ones((1, len(seeds))) if weights is None else weights

    def means(label, of):
        keys = pd.MultiIndex.from_product([[label], cases, seeds])
        values = keyed[names].reindex(keys).to_numpy(dtype=float).reshape(len(cases), len(seeds), -1)
        return lifetime_means(values, of, shares, exponents)

    ratios, left_out, one = {}, {}, np.ones((1, len(seeds)))
    for label in dict.fromkeys(table["controller"][table["controller"] != REFERENCE]):
        ratio = means(label, weights) / means(REFERENCE, weights)
        energy = (means(label, one) / means(REFERENCE, one))[0, -1]
        rows = table[table["controller"] == label]
        why = limit_texts(decisions(table, label, suite.limits), EXCEEDED)
        why += [f"energy {energy:.3f}"] if energy < LEAST_ENERGY else []
        why += [f"{(rows['status'] != OK).sum()} lost"] if (rows["status"] != OK).any() else []
        ratios[label] = ratio[:, :-1]
        if why:
            left_out[label] = "; ".join(why)
    return ratios, left_out


def hypervolumes(ratios, labels):
    """Return (resamples, 2): hypervolumes of the settings `labels` in the plane of AXES and in all three."""
    corner = np.array([1.0, 1.0, read_suite(SUITE).limits.relative[AXES[2]]])
    stacked = np.stack([ratios[label] for label in labels], axis=1) if labels else np.ones((1, 1, 3))
    return np.array([[area(each[:, :2], corner[:2]), volume(each, corner)] for each in stacked])


def chosen(table):
    """Return at most MOST labels of a table, one after the other with the greatest gain of hypervolumes."""
    ratios, left_out = measured(table)
    rest, kept = [label for label in ratios if label not in left_out], []
    whole = hypervolumes(ratios, rest)[0]
    reached = 0.0
    while rest and len(kept) < MOST:
        gains = [float((hypervolumes(ratios, [*kept, label])[0] / whole).sum()) for label in rest]
        if max(gains) <= reached:
            break
        reached = max(gains)
        kept.append(rest.pop(int(np.argmax(gains))))
    return kept


@app.command()
def sweep(
    source: Annotated[str, typer.Argument(help="lqr, mpc or a file of imitate or search.")],
    out: Out,
    draw_seeds: Annotated[str, typer.Option(help="Hash of test seeds; empty: validation.")] = "",
):
    """Run the settings of a law, or points of a policy: all on validation seeds, the chosen on test seeds."""
    law = source in LAWS
    name = source if law else Path(source).parent.name
    suite, seeds, stage = read_suite(SUITE), seeds_for("validation", *SEEDS), "validation"
    (out / "networks").mkdir(parents=True, exist_ok=True)
    subjects = laws_of(source) if law else networks_of(source, out / "networks")
    if draw_seeds:
        subjects = {label: subjects[label] for label in chosen(read_stage(out, stage, name))}
        suite, stage = with_drawn_seeds(suite, draw_seeds), "test"
        seeds = suite.seeds[:TEST_SEEDS]
    folder = out / stage
    folder.mkdir(parents=True, exist_ok=True)
    base = folder / f"{REFERENCE}.csv"
    if not base.exists():
        write_table(evaluate({suite.reference: suite.reference}, suite, seeds=seeds), base)
    write_table(runs_of(subjects, suite, seeds), folder / f"{name}.csv")


def read_stage(out, stage, name):
    """Return the table of a sweep with the runs of the reference."""
    base = read_table(out / stage / f"{REFERENCE}.csv")
    return pd.concat([base[base["controller"] == REFERENCE], read_table(out / stage / f"{name}.csv")])


@app.command()
def front(
    names: Annotated[
        list[str], typer.Argument(help="Network (its folder), then the laws to compare it with.")
    ],
    out: Out,
    stage: Annotated[Literal["validation", "test"], typer.Option(help="Seeds.")] = "test",
):
    """Print the settings, and the hypervolumes of each sweep and of all laws together."""
    tables = {name: read_stage(out, stage, name) for name in names}
    seeds = tables[names[0]]["seed"].nunique()
    weights = resample_weights(seeds, FRONT_RESAMPLES)
    found, resampled = {}, {}
    for name, table in tables.items():
        ratios, left_out = measured(table)
        for label, ratio in ratios.items():
            print(label, *(f"{x:.3f}" for x in ratio[0]), left_out.get(label, ""))
        found[name] = {label: ratio for label, ratio in ratios.items() if label not in left_out}
        many = measured(table, weights)[0]
        resampled[name] = {label: many[label] for label in found[name]}
    sets = {name: [name] for name in names} | {"laws": names[1:]}
    estimates, draws = (
        {key: hypervolumes(*_joined([of[name] for name in members])) for key, members in sets.items()}
        for of in (found, resampled)
    )
    for key in sets:
        rows = {key: (estimates[key], draws[key])}
        if key != names[0]:
            rows[f"{names[0]} over {key}"] = (
                estimates[names[0]] / estimates[key], draws[names[0]] / draws[key]
            )  # fmt: skip
        for text, (one, many) in rows.items():
            low, high = interval(one[0], many, seeds, positive=True)
            print(text, *(f"{x:.4f} [{a:.4f}, {b:.4f}]" for x, a, b in zip(one[0], low, high, strict=True)))


def _joined(parts):
    """Return (ratios, labels) of several sweeps together."""
    ratios = {label: ratio for part in parts for label, ratio in part.items()}
    return ratios, list(ratios)


if __name__ == "__main__":
    app()
