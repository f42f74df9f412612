"""Going on after an interruption: an evaluation, and the training of an agent.

Long jobs get killed. An evaluation into a folder writes a row as each run ends and its series whole or not at
all; the same call then makes what is missing. A training writes checkpoints, and one more at Ctrl-C; --resume
goes on from the newest. Both end as they would have without the interruption; here the interruptions are
made on purpose. On the command line:

    fowt evaluate ... --out results/mine        Ctrl-C, and the same command again
    fowt train --out runs/mine                  Ctrl-C, then: fowt train --out runs/mine --resume

The part that trains needs pip install "fowt-env[train,plot]" and is left out where it is missing.
"""

import signal
from importlib.util import find_spec
from pathlib import Path

from fowt_env.training.evaluation.evaluate import evaluate

FOLDER = Path("results/examples/resume")
STEPS = 4_000  # decisions: enough to be interrupted, far too few to learn


def interrupted_evaluation():
    """Stop an evaluation after two of its four runs, and call it again."""

    def stop_after_two(done, total, row):
        if done == 2:
            raise KeyboardInterrupt

    made = []
    settings = {"duration": 30.0, "skip": 10.0, "seeds": (1, 2), "folder": FOLDER / "evaluation"}
    try:
        evaluate("pi,pi_land", "ntm_18", progress=stop_after_two, **settings)
    except KeyboardInterrupt:
        print("evaluation interrupted after 2 of 4 runs")
    table = evaluate("pi,pi_land", "ntm_18", progress=lambda done, total, row: made.append(row), **settings)
    print(f"called again: {sum(row is not None for row in made)} runs made, {len(table)} in the table")


def interrupted_training():
    """Send a training the signal of Ctrl-C, and resume it from its checkpoint."""
    from fowt_env.training.rl.train import Training, resolve

    changes = {"environment.num_envs": 8, "validation.winds": [18], "validation.every": STEPS}
    settings = resolve("ppo", "above_rated", 0, STEPS, changes)

    def interrupt(done, total, text):
        if done >= STEPS // 4 and not run.stop:  # a second Ctrl-C ends the program at once
            signal.raise_signal(signal.SIGINT)

    run = Training(settings, FOLDER / "training")
    finished = run.run(interrupt)
    print(
        f"training {'finished' if finished else 'interrupted'} at {run.model.num_timesteps} of {STEPS} steps"
    )
    again = Training(None, FOLDER / "training", resume=True)
    finished = again.run()
    print(f"resumed: {'finished' if finished else 'stopped'} at {again.model.num_timesteps} steps")


if __name__ == "__main__":
    interrupted_evaluation()
    if find_spec("stable_baselines3") is None:
        print('no training: stable-baselines3 is missing, pip install "fowt-env[train]"')
    else:
        interrupted_training()
