"""Trains the network of mpc_clone by imitation of mpc (DAgger) and copies it to controllers/mpc.

    python -m fowt_env.training.studies.clone_mpc --out runs/clone

In the first round mpc operates the turbine (or, after a small change of mpc, the network given by --start),
in each later one the network of the round before, while mpc states what it would do. Episodes are those of
the task above_rated_mixture with mean winds of WINDS, weather from the training seeds, sensors `standard`.
The folder has a file for each episode and each network: a second call continues, one with --ship copies the
last network. A changed mpc needs another folder.
"""

import hashlib
import json
import shutil
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from fowt_env.controllers.mpc.clone import FILE, FORMAT, HIDDEN, N_INPUTS, SHAPES, inputs_of, read_clone
from fowt_env.controllers.mpc.law import MPC, PERIOD, Entry, Memory
from fowt_env.controllers.mpc.settings import MPCSettings
from fowt_env.descriptions.platform import read_platform, turbine_of
from fowt_env.envs import FowtEnv
from fowt_env.envs.tasks import TASKS
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.training.evaluation.seeds import TRAINING

PLATFORM, CONTROL_DT = "oc3_hywind", 0.1
WINDS = ((10.0, 15.0), (10.0, 25.0))  # m/s, in turn: half of the episodes are near rated wind
RATES = ((Memory.TORQUE_RATE, Entry.TORQUE_RATE_LIMIT), (Memory.PITCH_RATE, Entry.PITCH_RATE_LIMIT))
STEPS, BATCH, LARGEST_STEP = 12_000, 512, 3e-3  # of a fit, each from the network of the round before


class Records(list):
    """Collects pairs of inputs and rates; copies of a controller share it."""

    def __deepcopy__(self, memo):
        return self


class Teacher(MPC):
    """Records what mpc decides; with a network of a clone, that network decides."""

    def __init__(self, turbine, control_dt, records, network=None):
        super().__init__(turbine, control_dt)
        self.records, self.network = records, network

    def _replan(self, ahead):
        estimator = self.estimator
        inputs = inputs_of(
            self.parameters,
            estimator.parameters,
            self.estimated,
            self.memory,
            self.low_torque,
            self.command,
        )
        super()._replan(ahead)
        limits = [self.parameters[limit] for _, limit in RATES]
        self.records.append((inputs, [self.memory[rate] for rate, _ in RATES] / np.array(limits)))
        if self.network is not None:
            for (rate, _), share, limit in zip(RATES, outputs(self.network, inputs), limits, strict=True):
                self.memory[rate] = limit * share


def outputs(network, inputs):
    """Return the rates (..., 2) over their limits of a network {name of SHAPES: array}."""
    x = (inputs - network["mean"]) / network["scale"]
    for i in range(2):
        x = np.tanh(x @ network[f"weight_{i}"].T + network[f"bias_{i}"])
    return np.clip(x @ network["weight_2"].T + network["bias_2"], -1.0, 1.0)


def teacher_code():
    """Return a hash of the files of mpc without those of its clone."""
    files = sorted(path for path in FILE.parent.glob("*.py") if path.stem != FILE.stem)
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:16]


def environment(low, high, controller):
    """Return the environment of the episodes with mean winds from low to high, m/s."""
    task = TASKS["above_rated_mixture"]
    wind = tuple((share, air | {"speed": (low, high)}, sea) for share, air, sea in task.wind)
    return FowtEnv(
        replace(task, wind=wind, weather_seeds=(TRAINING.start, TRAINING.stop)),
        PLATFORM,
        action_mode="residual",
        baseline=controller,
        sensors="standard",
        observation=("rotor_speed",),
        control_dt=CONTROL_DT,
    )


def driver_of(round_, folder, start):
    """Return the file of the network that operates the turbine in a round; None: mpc does."""
    return folder / f"network_{round_ - 1}.npz" if round_ else start


def record(number, round_, folder, start):
    """Run episode `number` of a round and write its inputs and rates; an existing file is kept."""
    path = folder / f"round_{round_}" / f"episode_{number}.npz"
    if path.exists():
        return
    driver = driver_of(round_, folder, start)
    network = None if driver is None else read_clone(driver)[1]
    records = Records()
    teacher = Teacher(turbine_of(PLATFORM), CONTROL_DT, records, network)
    env = environment(*WINDS[number % len(WINDS)], teacher)
    env.reset(seed=1000 * round_ + number)
    ended = False
    while not ended:
        *_, terminated, truncated, _ = env.step((0.0, 0.0))
        ended = terminated or truncated
    env.close()
    inputs, rates = (np.array(part) for part in zip(*records, strict=True))
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, inputs=inputs, rates=rates, failed=terminated)


def fitted(inputs, rates, seed, start=None):
    """Fit a network from {name of SHAPES: array} `start`, or from random weights.

    Return ({name of SHAPES: float32 array}, (R2 of torque rate, of pitch rate) on a tenth left out).
    """
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0) + 1e-6
    if start is not None:
        mean, scale = start["mean"], start["scale"]
    centre, spread = rates.mean(axis=0), rates.std(axis=0)
    order = np.random.default_rng(seed).permutation(len(inputs))
    left_out, used = order[: len(order) // 10], order[len(order) // 10 :]
    x, y = (
        torch.as_tensor(array, dtype=torch.float32)
        for array in ((inputs - mean) / scale, (rates - centre) / spread)
    )
    sizes = (N_INPUTS, HIDDEN, HIDDEN, 2)
    linear = [torch.nn.Linear(*pair) for pair in zip(sizes[:-1], sizes[1:], strict=True)]
    net = torch.nn.Sequential(linear[0], torch.nn.Tanh(), linear[1], torch.nn.Tanh(), linear[2])
    if start is not None:
        last = {
            "weight_2": start["weight_2"] / spread[:, None], "bias_2": (start["bias_2"] - centre) / spread
        }  # fmt: skip
        for i, part in enumerate(linear):
            for kind in ("weight", "bias"):
                name = f"{kind}_{i}"
                getattr(part, kind).data = torch.as_tensor((start | last)[name], dtype=torch.float32)
    optimiser = torch.optim.Adam(net.parameters(), lr=LARGEST_STEP)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, STEPS)
    rng = np.random.default_rng(seed + 1)
    for _ in range(STEPS):
        chosen = rng.choice(used, BATCH)
        loss = ((net(x[chosen]) - y[chosen]) ** 2).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    with torch.no_grad():
        missed = ((net(x[left_out]) - y[left_out]) ** 2).mean(dim=0) / y[left_out].var(dim=0)
    network = {"mean": mean, "scale": scale}
    for i, part in enumerate(linear):
        network |= {
            f"weight_{i}": part.weight.detach().numpy().astype(np.float64),
            f"bias_{i}": part.bias.detach().numpy().astype(np.float64),
        }
    network["weight_2"] *= spread[:, None]  # the output is over the limits of the rates
    network["bias_2"] = spread * network["bias_2"] + centre
    return {name: network[name].astype(np.float32) for name in SHAPES}, tuple((1.0 - missed).tolist())


def write_clone(path, network, about):
    """Write the file of a clone of mpc on PLATFORM, as read_clone reads it."""
    platform = read_platform(PLATFORM)
    settings = {
        "format": FORMAT,
        "platform": platform.name,
        "turbine": turbine_of(PLATFORM).name,
        "period": PERIOD,
        "integral_limit": float(MPC(turbine_of(PLATFORM), CONTROL_DT).parameters[Entry.INTEGRAL_LIMIT]),
        "about": about,
    }
    with replacing(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, settings=np.array(json.dumps(settings)), **network)


def main(
    out: Annotated[Path, typer.Option(help="Folder of the episodes and networks.")],
    rounds: Annotated[int, typer.Option(help="Rounds, the first of them with mpc.")] = 4,
    episodes: Annotated[int, typer.Option(help="Episodes of a round.")] = 32,
    seed: Annotated[int, typer.Option(help="Seed of the fits.")] = 0,
    jobs: Annotated[int, typer.Option(help="Processes side by side.")] = 1,
    start: Annotated[
        Path | None, typer.Option(help="Network to begin with, a file of an earlier one.")
    ] = None,
    ship: Annotated[bool, typer.Option(help="Copy the last network to controllers/mpc.")] = False,
):
    """Record, fit and repeat."""
    out.mkdir(parents=True, exist_ok=True)
    made_of = {"teacher": asdict(MPCSettings()), "code": teacher_code()}
    stamp = out / "teacher.json"
    if stamp.exists() and json.loads(stamp.read_text(encoding="utf-8")) != made_of:
        raise InputError(f"{out}: its episodes are of another mpc: needs another folder")
    with replacing(stamp) as path:
        path.write_text(json.dumps(made_of), encoding="utf-8")
    data = []
    for round_ in range(rounds):
        run = partial(record, round_=round_, folder=out, start=start)
        if jobs == 1:
            list(map(run, range(episodes)))
        else:
            with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
                list(pool.map(run, range(episodes)))
        for number in range(episodes):
            with np.load(out / f"round_{round_}" / f"episode_{number}.npz") as file:
                data.append({name: file[name] for name in file})
        failed = sum(bool(part["failed"]) for part in data[-episodes:])
        path = out / f"network_{round_}.npz"
        if not path.exists():
            inputs, rates = (np.concatenate([part[name] for part in data]) for name in ("inputs", "rates"))
            driver = driver_of(round_, out, start)
            before = None if driver is None else read_clone(driver)[1]
            network, found = fitted(inputs, rates, seed, before)
            about = made_of | {
                "rounds": round_ + 1, "episodes": episodes, "decisions": len(inputs), "seed": seed,
                "R2_torque_rate": round(found[0], 4), "R2_pitch_rate": round(found[1], 4),
            }  # fmt: skip
            write_clone(path, network, about)
        about = read_clone(path)[0].about
        print(
            f"round {round_}: {failed} of {episodes} episodes failed, {about['decisions']} decisions,"
            f" R2 {about['R2_torque_rate']:.4f} of the torque rate, {about['R2_pitch_rate']:.4f} of the pitch"
            " rate",
            flush=True,
        )
    if ship:
        with replacing(FILE) as temporary:
            shutil.copyfile(path, temporary)
        print(FILE)


if __name__ == "__main__":
    typer.run(main)
