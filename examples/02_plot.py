"""Two controllers in the same wind and waves: time series over each other, and their spectra.

The land-based gains are too fast for a floating platform: its pitch motion loses its damping.
"""

import fowt_env
from fowt_env.visual.time_series import plot_run, plot_runs, plot_spectra

scene = fowt_env.build_scene(
    wind={"kind": "ntm", "speed": 16.0, "class": "B"},
    sea={"kind": "jonswap", "Hs": 5.0, "Tp": 10.0},
    fidelity="standard",
)
runs = {name: fowt_env.simulate(scene, controller=name, duration=600.0) for name in ("pi", "pi_land")}
period = fowt_env.natural_periods(scene)["platform_pitch"]

folder = "results/examples"
plot_run(runs["pi"], f"{folder}/run.png", title="PI at 16 m/s")
plot_runs(runs, f"{folder}/runs.png", title="the same wind and waves")
plot_spectra(runs, f"{folder}/spectra.png", skip=60.0, platform_pitch_period=period)
print(f"wrote run.png, runs.png and spectra.png in {folder}")
for name, run in runs.items():
    print(f"{name:8} platform pitch std {run['PtfmPitch_[deg]'].std():.2f} deg")
