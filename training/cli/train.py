"""The commands of learning: train, export-policy, benchmark training."""

from pathlib import Path
from typing import Annotated

import typer

from fowt_env.errors import InputError
from fowt_env.training.cli.arguments import parse_pairs
from fowt_env.training.cli.benchmark import benchmarks
from fowt_env.training.cli.console import EXIT_INTERRUPTED, app, note, out, progress_bar, reported

TRAIN_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt train --algo ppo --steps 4000000 --seed 0 --out runs/ppo_0[/cyan]

[cyan]fowt train --out runs/ppo_0 --resume[/cyan]  go on after Ctrl-C, kill or a crash

[cyan]fowt train --set environment.observation=preview --set environment.reward.pitch_travel=20[/cyan]

[bold]Steps[/bold] are decisions of the agent, each several control periods (decisions.hold).
[bold]Files written[/bold]: settings.yml, versions.json, checkpoints/, validation.csv, best.npz, last.npz,
learning_curve.png, tensorboard/. A policy runs as  fowt evaluate --controllers policy:runs/ppo_0/best.npz"""


@app.command(epilog=TRAIN_EXAMPLES)
@reported
def train(
    algo: Annotated[str, typer.Option(help="ppo, sac or tqc.")] = "ppo",
    task: Annotated[str, typer.Option(help="Task of training/rl/ALGO.yml.")] = "above_rated",
    seed: Annotated[int, typer.Option(help="Random seed of networks and episodes.")] = 0,
    steps: Annotated[int | None, typer.Option(help="Decisions; default 2000000, or as before.")] = None,
    out_folder: Annotated[str | None, typer.Option("--out", help="Folder of the run.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue from the newest checkpoint.")] = False,
    trust_zip: Annotated[
        bool,
        typer.Option("--trust-zip", help="With --resume: load a checkpoint of others, executing its code."),
    ] = False,
    change: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a setting; repeatable.")
    ] = None,
):
    """Train an agent with stable-baselines3 (PPO, SAC, TQC).

    It is validated as it learns and at the end; best.npz is the policy that scored best.
    """
    from fowt_env.training.rl.train import Training, resolve

    folder = Path(out_folder or f"runs/{task}_{algo}_{seed}")
    if resume:
        if change:
            raise InputError("--set: a resumed run keeps its settings; only --steps may grow")
        run = Training(None if steps is None else {"steps": steps}, folder, resume=True, trusted=trust_zip)
        if trust_zip:
            note(f"warning: executing code from the checkpoint in {folder}, as requested")
    else:
        settings = resolve(
            algo, task, seed, 2_000_000 if steps is None else steps, parse_pairs(change, "set")
        )
        run = Training(settings, folder)
    with progress_bar("training", None) as update:
        finished = run.run(lambda done, total, text: update(done, text, total))
    if run.rows:
        last = run.rows[-1]
        shown = ", ".join(f"{key} {value:.4g}" for key, value in last.items())
        note(f"last validation: {shown}")
    note(f"{'finished' if finished else 'stopped with a checkpoint'}: {folder}")
    if not finished:
        raise typer.Exit(EXIT_INTERRUPTED)


@app.command()
@reported
def export_policy(
    folder: Annotated[str, typer.Argument(help="Folder of a run of fowt train.")],
    out_path: Annotated[str, typer.Option("--out", help="The policy file, .npz.")],
    trust_zip: Annotated[
        bool, typer.Option("--trust-zip", help="Load the checkpoint, which executes code from it.")
    ] = False,
):
    """Turn a training run's checkpoint into a policy file."""
    from fowt_env.training.rl.export import export_run

    if Path(out_path).suffix != ".npz":
        raise InputError(f"--out {out_path!r}: must end with .npz")
    if not trust_zip:
        raise InputError(
            f"{folder}: loading a stable-baselines3 checkpoint executes code from it; if it is yours, or you"
            " trust whoever made it, add --trust-zip"
        )
    note(f"warning: executing code from the checkpoint in {folder}, as requested")
    note(f"wrote {export_run(folder, out_path)}")


@benchmarks.command()
@reported
def training(
    envs: Annotated[int, typer.Option(help="Environments in a batch.")] = 64,
    steps: Annotated[int, typer.Option(help="Steps of PPO that are timed.")] = 50_000,
    out_path: Annotated[str, typer.Option("--out", help="CSV to write.")] = "results/benchmark/training.csv",
):
    """Time PPO on each kind of vector environment, and print the time of physics, torch and Python."""
    from fowt_env.training.benchmarks.speed import write_csv
    from fowt_env.training.benchmarks.training import benchmark_training

    with progress_bar("training speed", None) as update:
        table = benchmark_training(envs, steps, progress=lambda done, total, kind: update(done, kind, total))
    out.print(table.round(3).to_string(index=False), highlight=False)
    note(f"wrote {write_csv(table, out_path)}")
