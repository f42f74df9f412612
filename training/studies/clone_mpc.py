"""Trains a network that imitates mpc (DAgger); --ship copies that of mpc_clone to controllers/mpc.

    python -m fowt_env.training.studies.clone_mpc --out runs/clone
    python -m fowt_env.training.studies.clone_mpc --out runs/volturnus --platform iea15_volturnus_s
    python -m fowt_env.training.studies.clone_mpc --out runs/shaft --set shaft=0.4

In the first round mpc operates the turbine (or, after a small change of mpc, the network given by --start),
in each later one the network of the round before, while mpc states what it would do. Episodes are those of
the task above_rated_mixture with mean winds of WINDS, scaled to the turbine, weather from the training seeds,
sensors `standard`. The folder has a file for each episode and each network: a second call continues. Another
mpc or platform needs another folder. A network is the law "policy:FILE".
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

from fowt_env.controllers.mpc.clone import FILE, FORMAT, HIDDEN, SHAPES, inputs_of, read_clone
from fowt_env.controllers.mpc.law import MPC, PERIOD, Entry, Memory
from fowt_env.controllers.mpc.settings import MPCSettings
from fowt_env.descriptions.platform import read_platform, turbine_of
from fowt_env.envs import FowtEnv
from fowt_env.envs.tasks import TASKS, scaled_task
from fowt_env.errors import InputError, SimulationStopped
from fowt_env.files.atomic import replacing
from fowt_env.run.simulation import simulate
from fowt_env.training.evaluation.seeds import TRAINING

PLATFORM, CONTROL_DT = "oc3_hywind", 0.1
OF_THE_LAW = ("schedule_time", "power_limit", "torque_low", "torque_high")  # not of the plan alone
# m/s, of the NREL 5 MW turbine, in turn: half of the episodes are near rated wind
WINDS = ((10.0, 15.0), (10.0, 25.0))
RATES = ((Memory.TORQUE_RATE, Entry.TORQUE_RATE_LIMIT), (Memory.PITCH_RATE, Entry.PITCH_RATE_LIMIT))
STEPS, BATCH, LARGEST_STEP = 12_000, 512, 3e-3  # of a fit, each from the network of the round before
BLOCK = 300  # successive decisions, of which neighbours are alike, that are left out of a fit together


class Records(list):
    """Collects pairs of inputs and rates; copies of a controller share it."""

    def __deepcopy__(self, memo):
        return self


class Teacher(MPC):
    """Records what mpc decides; with a network of a clone, that network decides."""

    def __init__(self, turbine, control_dt, records, network=None, settings=None):
        super().__init__(turbine, control_dt, settings)
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


def episode(seed, low, high, platform=PLATFORM):
    """Return (scene, initial values) of an episode; mean wind from low to high, m/s of the NREL 5 MW."""
    task = TASKS["above_rated_mixture"]
    wind = tuple((share, air | {"speed": (low, high)}, sea) for share, air, sea in task.wind)
    task = replace(task, wind=wind, weather_seeds=(TRAINING.start, TRAINING.stop))
    env = FowtEnv(scaled_task(task, turbine_of(platform)), platform, control_dt=CONTROL_DT)
    env.reset(seed=seed)
    shown = env.channels()
    return env.scene, {name: shown[name] for name in task.offsets}


def driver_of(round_, folder, start):
    """Return the file of the network that operates the turbine in a round; None: mpc does."""
    return folder / f"network_{round_ - 1}.npz" if round_ else start


def record(number, round_, folder, start, platform=PLATFORM, settings=None):
    """Run episode `number` of a round and write its inputs and rates; an existing file is kept."""
    path = folder / f"round_{round_}" / f"episode_{number}.npz"
    if path.exists():
        return
    driver = driver_of(round_, folder, start)
    network = None if driver is None else read_clone(driver)[1]
    records = Records()
    teacher = Teacher(turbine_of(platform), CONTROL_DT, records, network, settings)
    scene, initial = episode(1000 * round_ + number, *WINDS[number % len(WINDS)], platform)
    about = {"protection": "end_at_overspeed", "sensors": "standard"}
    failed, duration = False, TASKS["above_rated_mixture"].duration
    try:
        simulate(scene, teacher, duration, control_dt=CONTROL_DT, initial=initial, **about)
    except SimulationStopped:
        failed = True
    inputs, rates = (np.array(part) for part in zip(*records, strict=True))
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, inputs=inputs, rates=rates, failed=failed)


def fitted(inputs, rates, seed, start=None):
    """Fit a network from {name of SHAPES: array} `start`, or from random weights.

    inputs: (n, N_INPUTS), or with further columns; rates: (n, 2), over their limits.
    Return ({name of SHAPES: float32 array}, (R2 of torque rate, of pitch rate) on a tenth of the blocks of
    BLOCK decisions, left out).
    """
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0) + 1e-6
    if start is not None:
        mean, scale = start["mean"], start["scale"]
    centre, spread = rates.mean(axis=0), rates.std(axis=0)
    blocks = np.arange(len(inputs)) // BLOCK
    order = np.random.default_rng(seed).permutation(blocks[-1] + 1)
    apart = np.isin(blocks, order[: max(1, len(order) // 10)])
    left_out, used = np.flatnonzero(apart), np.flatnonzero(~apart)
    x, y = (
        torch.as_tensor(array, dtype=torch.float32)
        for array in ((inputs - mean) / scale, (rates - centre) / spread)
    )
    sizes = (inputs.shape[1], HIDDEN, HIDDEN, 2)
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


def settings_of(platform=PLATFORM):
    """Return the settings of the file of a clone of the present mpc on a platform."""
    turbine = turbine_of(platform)
    return {
        "format": FORMAT,
        "platform": read_platform(platform).name,
        "turbine": turbine.name,
        "period": PERIOD,
        "integral_limit": float(MPC(turbine, CONTROL_DT).parameters[Entry.INTEGRAL_LIMIT]),
    }


def write_clone(path, network, settings, about):
    """Write the file of a clone of mpc with settings of settings_of, as read_clone reads it."""
    settings = settings | {"about": about}
    with replacing(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, settings=np.array(json.dumps(settings)), **network)


def mpc_settings(changes):
    """Return MPCSettings with texts KEY=VALUE. Raises: InputError naming the key, value and allowed range."""
    values = {}
    for text in changes:
        key, _, value = text.partition("=")
        if key in OF_THE_LAW:
            raise InputError(f"--set {text}: is a limit of mpc_clone, too, and not learned: set another key")
        try:
            values[key] = float(value)
        except ValueError:
            raise InputError(f"--set {text}: must be KEY=NUMBER") from None
    return MPCSettings().changed(**values)


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
    platform: Annotated[str, typer.Option(help="Platform of the episodes.")] = PLATFORM,
    change: Annotated[
        list[str] | None, typer.Option("--set", help="Setting of mpc, e.g. shaft=0.4; may be repeated.")
    ] = None,
):
    """Record, fit and repeat."""
    settings = mpc_settings(change or ())
    if ship and platform != PLATFORM:
        raise InputError(f"--ship: needs platform {PLATFORM!r}")
    out.mkdir(parents=True, exist_ok=True)
    of = settings_of(platform)
    made_of = {"teacher": asdict(settings), "code": teacher_code(), "platform": platform}
    stamp = out / "teacher.json"
    if stamp.exists() and json.loads(stamp.read_text(encoding="utf-8")) != made_of:
        raise InputError(f"{out}: its episodes are of another mpc or platform: needs another folder")
    with replacing(stamp) as path:
        path.write_text(json.dumps(made_of), encoding="utf-8")
    data = []
    for round_ in range(rounds):
        same = {"folder": out, "start": start, "platform": platform, "settings": settings}
        run = partial(record, round_=round_, **same)
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
            about = {key: made_of[key] for key in ("teacher", "code")} | {
                "rounds": round_ + 1, "episodes": episodes, "decisions": len(inputs), "seed": seed,
                "R2_torque_rate": round(found[0], 4), "R2_pitch_rate": round(found[1], 4),
            }  # fmt: skip
            write_clone(path, network, of, about)
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
