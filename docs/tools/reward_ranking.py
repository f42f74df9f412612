"""Controllers ranked by the rewards and by their metrics and scores: `python docs/tools/reward_ranking.py`.

The reward of weighted terms: in the same turbulence at 14, 18 and 22 m/s. The reward "score": in the cases
of the suite above_rated, with validation seeds. Rewards are those of the environment's step, from the rows
of the run; docs/results/rewards.md has the tables.
"""

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.envs.goals import N_ENTRIES, build_goals, fill_goals, goal_weights, usual_deviations
from fowt_env.envs.rewards import REWARD_TERMS, build_scales, fill_terms, weight_array
from fowt_env.envs.tasks import TASKS
from fowt_env.files.markdown import markdown_table
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure
from fowt_env.plant.state import State
from fowt_env.training.evaluation.cases import mean_speed, read_suite
from fowt_env.training.evaluation.metrics import turbine_metrics
from fowt_env.training.evaluation.run_case import run_metrics
from fowt_env.training.evaluation.seeds import seeds_for

CONTROLLERS = ("lqr", "floating_feedback", "gspi_oc3", "pi_unscheduled", "pi_land", "gspi_land")
BASELINE = "gspi_oc3"
LAWS = (  # ranked by the reward "score"
    "gspi_oc3", "pi", "pi_unscheduled", "pi_tuned", "floating_feedback", "lqr", "rosco", "rosco_float",
    "openfast_oc3", "mpc",
)  # fmt: skip
VALIDATION = seeds_for("validation", 1, 2)
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
    Measure.NACELLE_ACCELERATION: ("NcIMUTAxs_[m/s^2]", 1.0),
}


def reward_terms(frame, scene, control_dt=0.1):
    """(n - 1, N_TERMS) reward terms between the rows of a run that is written every control period."""
    point = fowt_env.trim(scene)
    reference = np.array([point.state[State.PLATFORM_PITCH], point.state[State.ROTOR_SPEED]])
    scales = build_scales(scene.turbine, control_dt)
    measured = measurements(frame, point)
    terms = np.zeros((len(frame) - 1, len(REWARD_TERMS)))
    for i in range(1, len(frame)):
        fill_terms(measured[i], measured[i - 1], reference, False, scales, terms[i - 1])
    return terms


def measurements(frame, point):
    """(n, N_MEASUREMENTS) of the fields of COLUMNS, from the rows of a run from its operating point."""
    measured = np.zeros((len(frame), N_MEASUREMENTS))
    for measure, (column, factor) in COLUMNS.items():
        measured[:, measure] = factor * frame[column]
    # a row has the torque that its controller has just set, a measurement the one until then
    torque = measured[:, Measure.GENERATOR_TORQUE]
    torque[1:], torque[0] = torque[:-1].copy(), point.command[0]
    return measured


def goal_rewards(frame, scene, control_dt=0.1):
    """(n - 1,) rewards "score" between the rows of a run that is written every control period."""
    point, turbine = fowt_env.trim(scene), scene.turbine
    speed, torque = point.state[State.ROTOR_SPEED], point.command[0]
    power = torque * speed * turbine.drivetrain.gear_ratio
    reference = (point.state[State.PLATFORM_PITCH], speed, np.inf, torque, power)
    reference = np.array([*reference, *usual_deviations(turbine, scene.wind_speed)])
    goals, entries = build_goals(turbine, control_dt), np.zeros((len(frame) - 1, N_ENTRIES))
    measured = measurements(frame, point)
    for i in range(1, len(frame)):
        fill_goals(measured[i], measured[i - 1], reference, False, goals, entries[i - 1])
    return entries @ goal_weights()


def by_wind(names=LAWS, seeds=VALIDATION):
    """DataFrame, a row per wind and controller: score of the case, and reward "score" of a step."""
    suite = read_suite("above_rated")
    terms = [term.metric for term in suite.score.term]
    rows = []
    for case in suite.cases:
        figures = {name: [] for name in names}
        for seed in seeds:
            weather = {"wind": case.wind, "sea": case.sea, "seed": seed, "duration": suite.duration}
            scene = fowt_env.build_scene(case.platform, **weather, **case.options)
            for name in names:
                frame = fowt_env.simulate(
                    scene, controller=name, duration=suite.duration, sensors=case.sensors
                )
                found = run_metrics(frame, case, scene, suite.skip)
                reward = goal_rewards(frame, scene)[round(suite.skip / 0.1) :].mean()
                figures[name].append([*(found[term] for term in terms), found[suite.score.power], reward])
        base = np.array(figures[BASELINE])
        for name, values in figures.items():
            ratio = np.mean(np.array(values)[:, :-1] / base[:, :-1], axis=0)
            row = {"wind": mean_speed(case), "controller": name, "score": ratio[:-1].mean() / ratio[-1]}
            rows.append(row | {"reward": np.mean(values, axis=0)[-1]})
    return pd.DataFrame(rows)


def wind_table(table):
    """Score and reward of each controller in each wind, as the table of docs/results/rewards.md."""
    winds = sorted(table["wind"].unique())
    rows = [
        (f"`{name}`", *(f"{row.score:.2f}, {row.reward:.3f}" for row in group.itertuples()))
        for name, group in table.groupby("controller", sort=False)
    ]
    return markdown_table(("controller", *(f"{wind:g} m/s" for wind in winds)), rows, aligned=True)


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
    """The ranking as the table of docs/results/rewards.md."""
    rows = [(f"`{name}`", *(f"{value:.2f}" for value in row)) for name, row in table.T.items()]
    return markdown_table(("baseline", "reward of a step", *METRICS), rows, aligned=True)


if __name__ == "__main__":
    print(markdown(ranking()))
    print(wind_table(by_wind()))
