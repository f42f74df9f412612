"""Train a small agent and compare it with the unscheduled PI on validation episodes.

    python examples/10_train_small_agent.py            # some minutes on two cores
    python examples/10_train_small_agent.py --steps 20000   # a first look

Needs pip install "fowt-env[train,plot]". The agent sees what a turbine measures and what the estimator of
lqr makes of it, and adds to lqr; it never learned from the validation episodes. Its policy ends up
as runs/small_agent/best.npz, ready for

    fowt evaluate --controllers policy:runs/small_agent/best.npz,pi_unscheduled
"""

import argparse
import sys

from fowt_env.training.rl.train import Training, baseline_figures, resolve, validation_score

RATIOS = ("rotor_speed_std_ratio", "platform_pitch_std_ratio", "blade_pitch_travel_ratio", "failed")


def main(arguments=None):
    """Train, print the best validation of the agent and the PI's figures; returns whether it is ahead."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=600_000, help="decisions, each of five control periods")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="runs/small_agent")
    given = parser.parse_args(arguments)
    changes = {"validation.every": min(100_000, given.steps // 2)}
    settings = resolve("ppo", "above_rated", given.seed, given.steps, changes)
    run = Training(settings, given.out)
    if not run.run(lambda done, total, text: print(f"\r{done}/{total}: {text}  ", end="", file=sys.stderr)):
        sys.exit("stopped; a checkpoint is in " + given.out)
    baseline = validation_score(baseline_figures(settings, "pi_unscheduled"), run.reference)
    best = min(run.rows, key=lambda row: row["score"])
    print("\nratios to lqr, means over the validation episodes; lower is better")
    print(f"{'':28}{'agent':>10}{'pi_unscheduled':>18}")
    for name in (*RATIOS, "score"):
        print(f"{name:28}{best[name]:10.3f}{baseline[name]:18.3f}")
    ahead = best["score"] < baseline["score"]
    print("the agent is ahead" if ahead else "the agent is not ahead: train it for longer")
    return ahead


if __name__ == "__main__":
    main()
