"""How agents compare with rivals on the same runs: interquartile mean of ratios, with 95 % intervals.

    fowt evaluate --controllers policy:ppo_measured,gspi_oc3,rosco_float --seeds 1:6:1 --out results/rl
    python -m training.agent_scores results/rl/results.csv --rivals gspi_oc3,rosco_float

Each ratio is of one metric of an agent over that of a rival in the same wind and waves. Intervals are
percentile bootstraps over these runs; they say nothing about other training seeds.
"""

import argparse

import numpy as np
import pandas as pd
from scipy.stats import trim_mean

from fowt_env.errors import InputError, unknown

FIGURES = (
    "RotSpeed_std_[rpm]",
    "PtfmPitch_std_[deg]",
    "blade_pitch_travel_[deg/s]",
    "GenPwr_mean_[kW]",
    "GenPwr_std_[kW]",
    "TwrBsMyt_std_[kN-m]",
    "FAIRTEN_std_[kN]",
)
RESAMPLES = 2000


def interquartile_mean(values):
    """Mean of the middle half of values (..., n), along the last axis."""
    return trim_mean(values, 0.25, axis=-1)


def interval(values, rng):
    """(low, high): 95 % percentile bootstrap of the interquartile mean of values (n,)."""
    picks = rng.integers(len(values), size=(RESAMPLES, len(values)))
    low, high = np.percentile(interquartile_mean(np.asarray(values)[picks]), (2.5, 97.5))
    return float(low), float(high)


def agent_scores(table, rivals, agents=None):
    """DataFrame: per agent, rival and figure the ratio's interquartile mean, its interval, runs, failures.

    table: what training.evaluate.evaluate returns. agents: labels; None: all that are no rivals.
    Raises: InputError for labels that were not run, or where no run of both went well.
    """
    known = list(dict.fromkeys(table["controller"]))
    agents = [name for name in known if name not in rivals] if agents is None else agents
    for name in (*rivals, *agents):
        if name not in known:
            raise unknown("controller of the evaluation", name, known)
    runs = table.set_index(["controller", "case", "seed"]).sort_index()
    rows = []
    for agent in agents:
        failed = int((runs.loc[agent]["status"] != "ok").sum())
        for rival in rivals:
            ratio = (runs.loc[agent][list(FIGURES)] / runs.loc[rival][list(FIGURES)]).dropna()
            if ratio.empty:
                raise InputError(f"{agent} and {rival}: no run of both went well")
            for figure in FIGURES:
                low, high = interval(ratio[figure].to_numpy(), np.random.default_rng(0))
                rows.append(
                    {
                        "agent": agent,
                        "rival": rival,
                        "figure": figure,
                        "ratio": float(interquartile_mean(ratio[figure].to_numpy())),
                        "low": low,
                        "high": high,
                        "runs": len(ratio),
                        "failed": failed,
                    }
                )
    return pd.DataFrame(rows)


def main(arguments=None):
    """Print the table of one or several results.csv."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tables", nargs="+", help="results.csv of fowt evaluate; several are put together")
    parser.add_argument("--rivals", default="gspi_oc3,rosco_float")
    given = parser.parse_args(arguments)
    table = pd.concat([pd.read_csv(path) for path in given.tables]).drop_duplicates(
        ["controller", "case", "seed"]
    )
    scores = agent_scores(table, given.rivals.split(","))
    shown = [
        f"{r:.3f} [{low:.3f}, {high:.3f}]" for r, low, high in scores[["ratio", "low", "high"]].to_numpy()
    ]
    scores["shown"] = shown
    wide = scores.pivot_table(
        index=["agent", "rival", "runs", "failed"],
        columns="figure",
        values="shown",
        aggfunc="first",
        sort=False,
    )
    print(wide.T.to_string())


if __name__ == "__main__":
    main()
