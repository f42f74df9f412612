"""The same evaluation on Ray, which spreads runs over the machines of a cluster.

engine="ray" starts a local Ray with `jobs` workers; address="ray://head:10001" takes a running cluster
instead. Which worker makes a run does not matter: a run's weather follows from its seed alone, so the table
is that of one process, bit for bit. docs/results/speed.md has what handing the runs out costs.
Needs pip install "fowt-env[ray]"; without Ray this example says so and ends.
"""

from importlib.util import find_spec

from fowt_env.training.evaluation.engines import session
from fowt_env.training.evaluation.evaluate import evaluate


def main():
    """Score the PI on two cases in this process and on Ray, and compare the tables."""
    if find_spec("ray") is None:
        print('Ray is not installed: pip install "fowt-env[ray]"')
        return
    settings = {"controllers": "pi", "cases": "steady_16,ntm_18", "duration": 30.0, "skip": 10.0}
    here = evaluate(**settings)
    with session("ray", jobs=1):  # several evaluations inside share its warm workers
        away = evaluate(**settings, engine="ray")
    timing = [name for name in here.columns if "wall" in name or "time" in name.lower()]
    same = here.drop(columns=timing).equals(away.drop(columns=timing))
    print(away[["controller", "case", "status", "PtfmPitch_std_[deg]"]].to_string(index=False))
    print("the table of Ray is that of this process" if same else "the tables differ")


if __name__ == "__main__":  # workers import this file
    main()
