"""Evaluate two controllers, then make one HTML page of it: the page to send to somebody.

A results folder holds a row per run (results.csv), the time series and what was asked for; the report reads
nothing else, so it can be made later and elsewhere. On the command line the same is

    fowt evaluate --controllers pi,pi_land --cases ntm_14,ntm_18 --out results/examples/report
    fowt report results/examples/report

pi_land are the gains of the turbine on land: on the spar they drive the platform, which the page shows.
Needs pip install "fowt-env[report]".
"""

from pathlib import Path

from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.leaderboard_file import write_leaderboard
from fowt_env.training.reports.html_page import write_report

FOLDER = Path("results/examples/report")

table = evaluate("pi,pi_land", "ntm_14,ntm_18", duration=300.0, skip=60.0, seeds=range(1, 7), folder=FOLDER)
board = write_leaderboard(table, FOLDER, baseline="pi")
for entry in board["controllers"]:
    figure = entry["metrics"]["PtfmPitch_std_[deg]"]
    print(
        f"{entry['controller']:8} platform pitch std {figure['mean']:.2f} deg,"
        f" {100 * board['interval']['level']:.0f} % interval {figure['low']:.2f} to {figure['high']:.2f}"
    )

page = write_report(FOLDER)
print(f"wrote {page} ({page.stat().st_size / 1e6:.1f} MB): open it in a browser, it needs no network")
