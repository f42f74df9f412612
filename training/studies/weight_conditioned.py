"""Trains one policy whose inputs contain the weights of the cost, and compares fronts of swept laws.

    python -m fowt_env.training.studies.weight_conditioned imitate --out runs/imitated
    python -m fowt_env.training.studies.weight_conditioned search runs/imitated/clone.npz --out runs/found_0
    python -m fowt_env.training.studies.weight_conditioned train runs/imitated/clone.npz --out runs/ppo_0
    python -m fowt_env.training.studies.weight_conditioned sweep runs/found_0/clone.npz --out runs/all
    python -m fowt_env.training.studies.weight_conditioned sweep mpc --out runs/all
    python -m fowt_env.training.studies.weight_conditioned front found_0 lqr mpc --out runs/all

A point, TRADES numbers in [-1, 1], stands for the weights: settings_at and weights_at.

imitate: a network imitates mpc (DAgger as in clone_mpc.py) with the settings of a point that is drawn for
each episode and is an input. clone.npz is the network of clone_mpc at the middle point; its array
point_weight has the first layer's weights of the point, with which at_point writes the file of any other.

search: a population moves the last layer (search_clone.py) for the hypervolume of the front of FRONT.

train: PPO corrects the network of `imitate` by decisions of 0.5 s; every episode draws a point, which sets
the weights of REWARD_TERMS. policy.npz is a policy file with point_weight of its own; clone.npz beside it is
the baseline. On a GPU: --device cuda, with many environments and threads.

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
from copy import deepcopy
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Literal

import numpy as np
import pandas as pd
import typer

from fowt_env.controllers.lqr.design import LQGSettings
from fowt_env.controllers.lqr.law import LQR
from fowt_env.controllers.mpc.clone import BIAS_0, HIDDEN, N_INPUTS, read_clone
from fowt_env.controllers.mpc.law import MPC
from fowt_env.controllers.mpc.settings import MPCSettings
from fowt_env.controllers.policy.network_file import read_policy
from fowt_env.descriptions.array_files import read_arrays
from fowt_env.envs import FowtVectorEnv
from fowt_env.envs.rewards import REWARD_TERMS
from fowt_env.envs.tasks import JOINT, TASKS
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import read_table, write_table
from fowt_env.run.simulation import simulate
from fowt_env.training.design.linear_bound import efficient
from fowt_env.training.evaluation.bootstrap import interval, lifetime_means, resample_weights
from fowt_env.training.evaluation.case_environment import environment_settings as case_settings
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.leaderboard import decisions
from fowt_env.training.evaluation.limits import EXCEEDED, limit_texts
from fowt_env.training.evaluation.metrics import mean_exponent, metrics
from fowt_env.training.evaluation.results_table import WEIGHT, case_shares
from fowt_env.training.evaluation.run_case import OK, REFERENCE, TRIPPED
from fowt_env.training.evaluation.seeds import seeds_for, with_drawn_seeds
from fowt_env.training.rl.export import export_policy
from fowt_env.training.rl.settings import TASK_FIELDS
from fowt_env.training.rl.train import environment_settings, inner_env, make_algorithm, new_model, resolve
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
SHAFT, TRAVEL = (
    (0.1, 1.0 / 3.0),
    (0.9, 0.2),
)  # price and its factor per unit; limit and what is added per unit
# weight at the middle point, and exponents of BASES by the point: weight * prod(base ** (exponent * point))
BASES = np.array([4.0, 3.0, 3.0])
PRICED = {
    "rotor_speed": (6.0, (1, 0, 0)),
    "platform_motion": (14.0, (-1, 0, 0)),
    "pitch_travel": (85.0, (0, 0, -1)),
    "torque_travel": (20.0, (0, -1, 0)),
    "power_shortfall": (6.0, (0, 0, 0)),
}
# what mpc_clone misses of the best value of each term (rotor_speed, platform_motion: 1; the others: 0)
USUAL = np.array([0.167, 0.0354, 0.0142, 0.0208, 0.0413])
BEST = np.array([max(REWARD_TERMS[name].high, 0.0) for name in PRICED])
COLUMNS = np.array([list(REWARD_TERMS).index(name) for name in PRICED])
FAILURE_COST = 50.0  # usual costs of a decision
REWARD_SCALE = 0.1
WIND = tuple(  # as a lifetime, in which strong wind is rare
    (share, {"kind": "ntm", "speed": speed, "class": "B", "sigma": "drawn"}, JOINT)
    for share, speed in ((0.5, (11.5, 15.0)), (0.3, (15.0, 19.0)), (0.2, (19.0, 24.5)))
)
SETTINGS = {
    "environment.baseline": "mpc_clone",  # stands for the network that is corrected
    "environment.sensors": "standard",
    "algorithm.n_steps": 64,
    "algorithm.batch_size": 8192,
    "algorithm.learning_rate": [6.0e-4, 5.0e-5],
    "algorithm.policy_kwargs": {"net_arch": [128, 128], "activation": "tanh", "log_std_init": -3.5},
}
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


def weights_at(points):
    """Return the weights (n, terms of PRICED) at points (n, TRADES)."""
    middle = np.array([weight for weight, _ in PRICED.values()])
    exponents = np.array([exponent for _, exponent in PRICED.values()])
    return middle * np.exp((np.asarray(points) * np.log(BASES)) @ exponents.T)


def rewards_at(points, terms, failed):
    """Return the rewards (n,) of REWARD_TERMS (n, terms) at points: 0 if all costs are as usual.

    Costs are divided by those that are usual at the point, so that no point outweighs another in learning.
    """
    weights = weights_at(points)
    cost = (weights * (BEST - terms[:, COLUMNS])).sum(axis=1) / (weights @ USUAL)
    return REWARD_SCALE * (1.0 - cost - FAILURE_COST * failed)


def trained_environment(source, seed=0, steps=1):
    """Return (settings of a run that corrects the network of a file, settings of its FowtEnv)."""
    settings = resolve("ppo", "above_rated", seed, steps, SETTINGS)
    chosen = environment_settings(settings) | {"baseline": f"policy:{source}"}
    return settings, chosen | {"task": replace(chosen["task"], wind=WIND, sea=None)}


class Points:
    """Sets points of the network of a file of imitate or search that is the baseline of environments."""

    def __init__(self, source):
        self.bias = read_clone(source)[1]["bias_0"]
        self.by_point = read_arrays(source, 1 << 26)["point_weight"].astype(np.float64)

    def set(self, env, point):
        """Set the point of a FowtEnv from its next decision to the end of its episode."""
        env._baseline.parameters[BIAS_0 : BIAS_0 + HIDDEN] = self.bias + self.by_point @ point


def trading(env, seed, points):
    """Return a VecEnv that draws a point for each episode, pays by it and appends it to the observation.

    env: a FowtSB3VecEnv, or in VecNormalize without norm_reward; points: Points of its baselines.
    """
    from gymnasium.spaces import Box
    from stable_baselines3.common.vec_env import VecEnvWrapper

    n, size = env.num_envs, len(TRADES)
    space, batch = env.observation_space, inner_env(env).env

    class Trading(VecEnvWrapper):
        def __init__(self):
            low, high = (
                np.append(end, np.full(size, side)) for end, side in ((space.low, -1), (space.high, 1))
            )
            super().__init__(env, observation_space=Box(low.astype(np.float32), high.astype(np.float32)))
            self.rng = np.random.default_rng(seed)
            self.points, self.returns, self.lengths = np.zeros((n, size)), np.zeros(n), np.zeros(n, dtype=int)

        def with_points(self, observations):
            return np.hstack([observations, self.points]).astype(np.float32)

        def reset(self):
            observations = self.venv.reset()
            for i in range(n):
                self.draw(i)
            return self.with_points(observations)

        def draw(self, i):
            self.points[i] = self.rng.uniform(-1.0, 1.0, size)
            points.set(batch.envs[i], self.points[i])

        def step_wait(self):
            observations, _, dones, infos = self.venv.step_wait()
            truncated = np.array([info["TimeLimit.truncated"] for info in infos])
            rewards = rewards_at(self.points, batch.terms, dones & ~truncated)
            self.returns += rewards
            self.lengths += 1
            for i in np.flatnonzero(dones):
                infos[i]["terminal_observation"] = np.append(
                    infos[i]["terminal_observation"], self.points[i]
                ).astype(np.float32)
                infos[i]["episode"] = {"r": self.returns[i], "l": self.lengths[i], "failed": not truncated[i]}
                self.draw(i)
                self.returns[i] = self.lengths[i] = 0
            return self.with_points(observations), rewards.astype(np.float32), dones, infos

    return Trading()


def export(model, path, about):
    """Write the policy file of the middle point with the array point_weight; return the path."""
    env = model.get_env()
    n = len(TRADES)
    layers = deepcopy(model.policy.mlp_extractor.policy_net)
    of_point = layers[0].weight.data[:, -n:].cpu().numpy()
    layers[0].weight.data = layers[0].weight.data[:, :-n]
    actor = SimpleNamespace(
        mlp_extractor=SimpleNamespace(policy_net=layers), action_net=model.policy.action_net
    )
    export_policy(SimpleNamespace(policy=actor), inner_env(env).env.envs[0], path, about, env.venv)
    arrays = read_arrays(path, 1 << 26)
    settings = json.loads(str(arrays["settings"]))
    settings["baseline"] = (
        "mpc_clone"  # a policy file names a law: clone.npz beside it is a network for this one
    )
    return write_arrays(path, arrays | {"settings": np.array(json.dumps(settings)), "point_weight": of_point})


def at_point(source, point, path):
    """Write the file of `source`, of `imitated` or `export`, at a point; return the path."""
    arrays = read_arrays(source, 1 << 26)
    arrays["bias_0"] = (arrays["bias_0"] + arrays.pop("point_weight") @ np.asarray(point)).astype(np.float32)
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
        network = arrays | {"bias_0": arrays["bias_0"] + arrays["point_weight"] @ point}
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
        return [network | {"bias_0": network["bias_0"] + self.by_point @ point} for point in FRONT]

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


def recorder(folder, about, seconds=np.inf, every=60.0):
    """Return a callback that writes curve.csv, a row for each rollout, and policy.npz every `every` s.

    seconds: time after which it ends the training.
    """
    import time

    from stable_baselines3.common.callbacks import BaseCallback

    class Recorder(BaseCallback):
        def _on_training_start(self):
            self.rows, self.last, self.began = [], 0.0, time.monotonic()

        def _on_step(self):
            return time.monotonic() - self.began < seconds

        def _on_rollout_end(self):
            passed, episodes = time.monotonic() - self.began, self.model.ep_info_buffer
            row = {"decisions": self.num_timesteps, "seconds": passed}
            row["reward"] = float(self.model.rollout_buffer.rewards.mean())
            row["failed"] = np.mean([each["failed"] for each in episodes]) if episodes else np.nan
            self.rows.append(row)
            if passed - self.last > every:
                self.last = passed
                self.write()

        def write(self):
            write_table(pd.DataFrame(self.rows), folder / "curve.csv")
            export(self.model, folder / "policy.npz", about | {"steps": int(self.num_timesteps)})
            for row in self.rows[-1:]:
                print({name: round(float(value), 4) for name, value in row.items()}, flush=True)

    return Recorder()


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


@app.command()
def train(
    source: Source,
    out: Out,
    seed: Annotated[int, typer.Option(min=0, help="Training seed.")] = 0,
    steps: Annotated[int, typer.Option(min=1, help="Decisions.")] = 10_000_000,
    envs: Annotated[int, typer.Option(min=1, help="Environments.")] = 1024,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the environments.")] = 1,
    device: Annotated[str, typer.Option(help="Device of torch: cpu or cuda.")] = "cpu",
    seconds: Annotated[float, typer.Option(help="Time after which it ends, too.")] = np.inf,
):
    """Correct the network of a file by PPO, at all points."""
    import torch
    from stable_baselines3.common.utils import set_random_seed
    from stable_baselines3.common.vec_env import VecNormalize

    from fowt_env.training.rl.sb3_env import FowtSB3VecEnv

    if (out / "policy.npz").exists():
        raise InputError(f"{out}: already contains a policy: needs another folder")
    out.mkdir(parents=True, exist_ok=True)
    own = out / "clone.npz"
    shutil.copyfile(source, own)
    settings, chosen = trained_environment(own, seed, steps)
    base = FowtSB3VecEnv(envs, threads=threads, **chosen)
    normalised = VecNormalize(base, norm_reward=False, gamma=settings["algorithm"]["gamma"])
    env = trading(normalised, seed, Points(own))
    set_random_seed(seed)
    env.seed(seed)
    model = new_model(make_algorithm("ppo"), settings, env, device)
    torch.nn.init.zeros_(model.policy.action_net.weight)  # begins with what it corrects
    about = {"algo": "ppo", "name": "weight_conditioned", "seed": seed}
    record = recorder(out, about, seconds)
    model.learn(steps, callback=record)
    record.write()
    model.save(out / "model.zip")


def swept(law):
    """Return the list of changed settings {name: value} of a law; the first are the shipped ones."""
    if law == "lqr":
        pairs = itertools.product((0.6, 1.0), (0.35, 0.45, 0.577, 0.7, 0.85))
        return [{}, *({"share": share, "shaft": shaft, "travel": 1.02} for shaft, share in pairs)]
    pairs = itertools.product((0.2, 0.08), MPC_PRICES)
    found = [{}, *(prices | {"shaft": shaft, "travel": 1.0} for shaft, prices in pairs)]
    others = ({"travel": 1.0, "shaft_near_rated": 0.03}, {"travel": 0.7})
    return found + [prices | {"shaft": 0.08} | more for more in others for prices in MPC_PRICES[::2]]


def laws_of(law):
    """Return {label: controller} of the swept settings of a law."""
    kind, settings = LAWS[law]
    return {
        " ".join([law, *(f"{key}={value:g}" for key, value in changes.items())]): partial(
            kind, settings=settings().changed(**changes)
        )
        for changes in swept(law)
    }


def law_runs(laws, suite, seeds):
    """Return the table of the runs of {label: controller}, as evaluate without the reference."""
    labels, tables = list(laws), []
    for first in range(0, len(labels), DESIGNS):
        some = {label: laws[label] for label in labels[first : first + DESIGNS]}
        tables.append(evaluate(some, suite, seeds=seeds, reference=False))
    return pd.concat(tables)


def policy_runs(source, points, suite, seeds):
    """Return the table of the runs of a file at {label: point}, all runs at a point in one batch.

    source: file of imitate, search or train; that of train has its baseline beside it.
    """
    baseline = Path(source).with_name("clone.npz")
    correction = None if Path(source) == baseline else read_policy(source)[1]
    middle, by_point = (read_arrays(source, 1 << 26)[name] for name in ("bias_0", "point_weight"))
    chosen, at = trained_environment(baseline)[1], Points(baseline)
    pairs = list(itertools.product(suite.cases, seeds))
    decisions = {key: chosen[key] for key in ("action_mode", "baseline", "decisions", "observation")}
    reach = {name: getattr(chosen["task"], name) for name in TASK_FIELDS}
    cases = {case.name: case_settings(case, suite.duration) | decisions for case in suite.cases}
    for settings in cases.values():
        settings["task"] = replace(settings["task"], **reach)
    per_env = [cases[case.name] for case, _ in pairs]
    env = FowtVectorEnv(len(pairs), "Disabled", per_env=per_env, threads=1)
    env.reset(options=[{"weather_seed": seed} for _, seed in pairs])
    start, features, rows = env.get_state(), env.envs[0].features, []
    actions = np.zeros((len(pairs), 2))
    for label, point in points.items():
        if correction is not None:
            correction.biases[0] = (middle + by_point @ point).astype(np.float32)
        env.set_state(start)
        for single in env.envs:
            at.set(single, np.asarray(point))
        observations, ended = env.observations, np.zeros(len(pairs), dtype=bool)
        while not ended.all():
            if correction is not None:
                actions = correction(observations * features.scale + features.mean)
            observations, _, terminated, truncated, _ = env.step(actions)
            ended = terminated | truncated
        for (case, seed), single in zip(pairs, env.envs, strict=True):
            head = {"controller": label, "case": case.name, "seed": seed, WEIGHT: suite.weights[case.name]}
            head["status"] = TRIPPED if single.is_stopping else OK
            rows.append(head | metrics(single.frame(), skip=suite.skip))
    return pd.DataFrame(rows)


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
    source: Annotated[str, typer.Argument(help="lqr, mpc or a file of train.")],
    out: Out,
    draw_seeds: Annotated[str, typer.Option(help="Hash of test seeds; empty: validation.")] = "",
):
    """Run the settings of a law, or points of a policy: all on validation seeds, the chosen on test seeds."""
    law = source in LAWS
    name = source if law else Path(source).parent.name
    suite, seeds, stage = read_suite(SUITE), seeds_for("validation", *SEEDS), "validation"
    names = {f"{name} " + ",".join(f"{x:g}" for x in point): point for point in POINTS}
    subjects = laws_of(source) if law else names
    if draw_seeds:
        subjects = {label: subjects[label] for label in chosen(read_stage(out, stage, name))}
        suite, stage = with_drawn_seeds(suite, draw_seeds), "test"
        seeds = suite.seeds[:TEST_SEEDS]
    folder = out / stage
    folder.mkdir(parents=True, exist_ok=True)
    base = folder / f"{REFERENCE}.csv"
    if not base.exists():
        write_table(evaluate({suite.reference: suite.reference}, suite, seeds=seeds), base)
    runs = law_runs if law else partial(policy_runs, source)
    write_table(runs(subjects, suite, seeds), folder / f"{name}.csv")


def read_stage(out, stage, name):
    """Return the table of a sweep with the runs of the reference."""
    base = read_table(out / stage / f"{REFERENCE}.csv")
    return pd.concat([base[base["controller"] == REFERENCE], read_table(out / stage / f"{name}.csv")])


@app.command()
def front(
    names: Annotated[
        list[str], typer.Argument(help="Policy (its folder), then the laws to compare it with.")
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
