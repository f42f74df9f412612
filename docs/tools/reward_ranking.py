"""Controllers ranked by the default reward and by their metrics: `python docs/tools/reward_ranking.py`.

Each runs in the same turbulence at 14, 18 and 22 m/s. The reward is that of the environment's step, from the
rows of the run; docs/reference/environment.md has the table.
"""

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.envs.rewards import REWARD_TERMS, build_scales, fill_terms, weight_array
from fowt_env.envs.tasks import TASKS
from fowt_env.files.markdown import markdown_table
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure
from fowt_env.plant.state import State
from fowt_env.training.evaluation.metrics import turbine_metrics

CONTROLLERS = ("lqr", "floating_feedback", "gspi_oc3", "pi_unscheduled", "pi_land", "gspi_land")
BASELINE = "gspi_oc3"
WEATHER = ((14.0, 2.5, 8.0), (18.0, 3.5, 8.6), (22.0, 4.7, 9.3))  # mean wind (m/s), Hs (m), Tp (s)
SEED = 100_001  # of the training range
DURATION, SKIP = 600.0, 100.0  # s
METRICS = {  # what the page calls them: name in training/evaluation/metrics.py
    "rotor speed std": "RotSpeed_std_[rpm]",
    "platform pitch std": "PtfmPitch_std_[deg]",
    "blade-pitch travel": "blade_pitch_travel_[deg/s]",
}
COLUMNS = {  # measurement: (channel, factor to SI)
    Measure.ROTOR_SPEED: ("RotSpeed_[rpm]", RPM),
    Measure.GENERATOR_TORQUE: ("GenTq_[kN-m]", 1e3),
    Measure.PLATFORM_PITCH: ("PtfmPitch_[deg]", DEGREE),
    Measure.PLATFORM_PITCH_RATE: ("PtfmRVyi_[deg/s]", DEGREE),
    Measure.BLADE_PITCH: ("BldPitch1_[deg]", DEGREE),
}


def reward_terms(frame, scene, control_dt=0.1):
    """(n - 1, N_TERMS) reward terms between the rows of a run that is written every control period."""
    point = fowt_env.trim(scene)
    reference = np.array([point.state[State.PLATFORM_PITCH], point.state[State.ROTOR_SPEED]])
    scales = build_scales(scene.turbine, control_dt)
    measured = np.zeros((len(frame), N_MEASUREMENTS))
    for measure, (column, factor) in COLUMNS.items():
        measured[:, measure] = factor * frame[column]
    # a row has the torque that its controller has just set, a measurement the one until then
    torque = measured[:, Measure.GENERATOR_TORQUE]
    torque[1:], torque[0] = torque[:-1].copy(), point.command[0]
    terms = np.zeros((len(frame) - 1, len(REWARD_TERMS)))
    for i in range(1, len(frame)):
        fill_terms(measured[i], measured[i - 1], reference, False, scales, terms[i - 1])
    return terms


def ranking(names=CONTROLLERS, weights=None):
    """DataFrame, a row per controller, best first: mean reward of a step, METRICS over those of BASELINE."""
    weights = weight_array(TASKS["above_rated"].weights if weights is None else weights)
    found = {name: [] for name in names}
    for speed, height, period in WEATHER:
        wind = {"kind": "ntm", "speed": speed, "class": "B"}
        sea = {"kind": "jonswap", "Hs": height, "Tp": period}
        scene = fowt_env.build_scene("oc3_hywind", wind, sea, seed=SEED, fidelity="standard")
        for name in names:
            frame = fowt_env.simulate(scene, controller=name, duration=DURATION)
            reward = reward_terms(frame, scene).mean(axis=0) @ weights
            run = turbine_metrics(frame, scene.turbine, SKIP)
            found[name].append([reward, *(run[metric] for metric in METRICS.values())])
    table = pd.DataFrame({name: np.mean(rows, axis=0) for name, rows in found.items()}).T
    table.columns = ["reward", *METRICS]
    table[list(METRICS)] /= table.loc[BASELINE, list(METRICS)]
    return table.sort_values("reward", ascending=False)


def markdown(table):
    """The ranking as the table of docs/reference/environment.md."""
    rows = [(f"`{name}`", *(f"{value:.2f}" for value in row)) for name, row in table.T.items()]
    return markdown_table(("baseline", "reward of a step", *METRICS), rows, aligned=True)


if __name__ == "__main__":
    print(markdown(ranking()))
