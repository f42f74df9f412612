"""Implements fowt train, fowt connect export-policy and fowt dev benchmark training."""

import shlex
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from fowt_env.descriptions.checks import parse_whole_numbers
from fowt_env.errors import InputError
from fowt_env.training.cli.arguments import parse_pairs
from fowt_env.training.cli.benchmark import benchmarks
from fowt_env.training.cli.console import (
    EXIT_INTERRUPTED,
    command,
    connect,
    err,
    note,
    output,
    progress_bar,
    resumable,
    wrote,
)
from fowt_env.training.cli.options import WHOLE, AddressOption, CsvOption, EngineOption, JobsOption
from fowt_env.training.cli.tables import print_table, show

TrustOption = Annotated[bool, Option("--trust-zip", help="Load the checkpoint; this executes code from it.")]
CHANGE = "Change a setting; repeatable."
SWEEP = "Values of a setting, an agent for each combination; repeatable."
RATIOS = ("rotor_speed_std_ratio", "platform_pitch_std_ratio", "blade_pitch_travel_ratio", "failed")
LINE_EVERY = 10.0  # s between lines of progress without a terminal
WRITTEN = ("best.npz", "last.npz", "validation.csv", "learning_curve.png")


@command()
def train(
    algo: Annotated[str, Option(help="Algorithm: ppo, sac or tqc.")] = "ppo",
    task: Annotated[str, Option(help="Task in training/rl/ALGO.yml: above_rated, ...")] = "above_rated",
    seed: Annotated[int, Option(help="Random seed of networks and episodes.")] = 0,
    steps: Annotated[int | None, Option(help="Decisions; default: 2000000, resumed: unchanged.")] = None,
    out_folder: Annotated[str | None, Option("--out", help="Folder of the run.")] = None,
    resume: Annotated[bool, Option("--resume", help="Continue from the newest checkpoint.")] = False,
    trust_zip: TrustOption = False,
    change: Annotated[list[str] | None, Option("--set", metavar="KEY=VALUE", help=CHANGE)] = None,
    seeds: Annotated[str | None, Option(help=f"Several seeds, {WHOLE}, one agent each.")] = None,
    sweep: Annotated[list[str] | None, Option(metavar="KEY=[V1,V2]", help=SWEEP)] = None,
    jobs: JobsOption = 1,
    engine: EngineOption = "processes",
    address: AddressOption = None,
):
    """Train an agent with stable-baselines3 (PPO, SAC, TQC).

    The agent is validated during and after training; best.npz is the policy with the best score.

    Examples:
    fowt train --steps 20000 --out runs/first  # a first try
    fowt train --algo ppo --steps 4000000 --seed 0 --out runs/ppo_0
    fowt train --out runs/ppo_0 --resume  # continue after Ctrl-C, kill or a crash
    fowt train --set environment.observation=preview --set environment.reward.pitch_travel=20
    fowt train --seeds 0,1,2 --sweep algorithm.gamma=[0.98,0.99] --jobs 2 --out runs/six  # side by side

    [bold]Steps[/bold] are decisions of the agent, each over several control periods (decisions.hold).
    [bold]Files written[/bold]: best.npz, last.npz (policies), validation.csv, learning_curve.png,
    settings.yml, versions.json, checkpoints/, tensorboard/. To use a policy: policy:runs/ppo_0/best.npz.
    With --seeds or --sweep each run has a folder in --out, beside trainings.csv; the same command continues.
    """
    from fowt_env.training.rl.train import Training, resolve

    if seeds is not None or sweep:
        if resume or trust_zip:
            raise InputError("--seeds, --sweep: the same command continues, without --resume and --trust-zip")
        numbers = [seed] if seeds is None else parse_whole_numbers(seeds, "seeds")
        chosen = (algo, task, numbers, 2_000_000 if steps is None else steps, parse_pairs(change, "set"))
        folder = Path(out_folder or f"runs/{task}_{algo}")
        _train_several(chosen, parse_pairs(sweep, "sweep"), folder, jobs, engine, address)
        return
    folder = Path(out_folder or f"runs/{task}_{algo}_{seed}")
    if resume:
        if change:
            raise InputError("--set: a resumed run keeps its settings; only --steps may be increased")
        run = Training(None if steps is None else {"steps": steps}, folder, resume=True, trusted=trust_zip)
        if trust_zip:
            note(f"warning: executing code from the checkpoint in {folder}, as requested")
    else:
        output(folder, folder=True)
        decisions = 2_000_000 if steps is None else steps
        run = Training(resolve(algo, task, seed, decisions, parse_pairs(change, "set")), folder)
    with progress_bar("training", every=LINE_EVERY) as update:

        def report(done, total, text):
            update(done, total, text if err.is_terminal else f"{done:,} of {total:,}, {text}")

        finished = run.run(report)
    if run.rows:
        _print_validations(run)
    path = shlex.quote(str(folder))
    if not finished:
        note(f"stopped with a checkpoint: {folder}; next: fowt train --resume --out {path}")
        raise typer.Exit(EXIT_INTERRUPTED)
    steps, done = run.settings["steps"], run.rows[-1]["decisions"]
    if done > steps:
        note(f"{done:,} decisions for --steps {steps:,}: the algorithm runs complete rollouts")
    note(f"finished: {folder} ({', '.join(name for name in WRITTEN if (folder / name).exists())})")
    policy = folder / next(name for name in ("best.npz", "last.npz") if (folder / name).exists())
    platform = run.settings["environment"].get("platform")
    words = ["--controllers", f"policy:{policy},{run.reference_name}"]
    words += [] if platform is None else ["--suite", "above_rated", "--platform", str(platform)]
    words += ["--baseline", run.reference_name, "--out", f"results/{folder.name}"]
    note(f"next: fowt evaluate {shlex.join(words)}")


def _train_several(chosen, sweep, folder, jobs, engine, address):
    """Train agents side by side, print their best validations, and the command that compares them."""
    from fowt_env.training.rl.side_by_side import TABLE, members, train_all

    found = members(*chosen, sweep, folder)
    output(folder, folder=True)
    where = f"in {folder}; the same command continues"
    with resumable("training", lambda done: f"the {done} finished runs are {where}") as update:
        table = train_all(
            found, jobs, engine, address, lambda done, total: update(done, total, f"{done} of {total} done")
        )
    show(table[["folder", "decisions", "score", *RATIOS]].round(3))
    note(f"wrote {TABLE} and {len(table)} runs in {folder}; score: of the best validation, less is better")


def _print_validations(run):
    """Print the best and the last validation of a Training, and the reference of the score."""
    best, last = run.best(), run.rows[-1]
    chosen = {"best": best} | ({} if last is best else {"last": last})
    headings = ("validation", "decisions", "score", *RATIOS)
    rows = [
        (name, f"{row['decisions']:,}", *(row[key] for key in ("score", *RATIOS)))
        for name, row in chosen.items()
    ]
    print_table(headings, rows, f"relative to {run.reference_name} (score 1); less is better")


@command(connect)
def export_policy(
    folder: Annotated[str, Argument(help="Output folder of fowt train.")],
    out_path: Annotated[str, Option("--out", help="Output policy file, .npz.")],
    trust_zip: TrustOption = False,
):
    """Convert a training checkpoint to a policy file.

    Examples:
    fowt connect export-policy runs/ppo_0 --out mine.npz --trust-zip  # from your own run
    fowt evaluate --controllers policy:mine.npz,pi  # compare it

    Training already writes best.npz and last.npz: use this after an interrupted run.
    """
    from fowt_env.training.rl.export import export_run

    output(out_path, endings=(".npz",))
    if not trust_zip:
        raise InputError(
            f"{folder}: loading a stable-baselines3 checkpoint executes code from it; add --trust-zip if"
            " you created it or trust its author"
        )
    note(f"warning: executing code from the checkpoint in {folder}, as requested")
    wrote(export_run(folder, out_path))


@command(benchmarks)
def training(
    envs: Annotated[int, Option(help="Number of environments in a batch.")] = 64,
    steps: Annotated[int, Option(help="Number of timed PPO steps.")] = 50_000,
    out_path: CsvOption = "results/benchmark/training.csv",
):
    """Time PPO on each kind of vector environment.

    Times of physics, torch and Python are listed separately.

    Examples:
    fowt dev benchmark training --envs 16 --steps 20000  # a first look
    """
    from fowt_env.training.benchmarks.speed import write_csv
    from fowt_env.training.benchmarks.training import benchmark_training

    with progress_bar("training speed") as update:
        table = benchmark_training(envs, steps, progress=update)
    show(table.round(3))
    wrote(write_csv(table, out_path))
