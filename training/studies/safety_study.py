"""Runs agents with and without the safety layer on validation episodes, and two careless policies.

Careless policies command random torque and blade pitch every 5 s, or no torque and flat blades.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from fowt_env.controllers.policy.controller import policy_path, read_policy
from fowt_env.descriptions.checks import parse_names
from fowt_env.descriptions.units import RPM
from fowt_env.envs import TASKS, FowtEnv, SafetyLayer
from fowt_env.envs.actions import ACTION_MODES
from fowt_env.envs.decisions import Decisions, DecisionSettings, wind_entry
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.metrics import turbine_metrics
from fowt_env.training.rl.train import TASK_FIELDS, resolve, validation_episodes

CARELESS = ("random direct", "no torque, flat blades")


class Trained:
    """Runs the agent of a policy file on observations of its environment."""

    def __init__(self, name):
        self.settings, self.network = read_policy(policy_path(name))

    def env(self):
        """Return the training environment of the agent."""
        s = self.settings
        reach = {name: tuple(s[name]) if isinstance(s[name], list) else s[name] for name in TASK_FIELDS}
        return FowtEnv(
            replace(TASKS["above_rated"], **reach), action_mode=s["action_mode"], baseline=s["baseline"],
            observation=tuple(s["observation"]), wind_preview=tuple(s["wind_preview"]) or None,
        )  # fmt: skip

    def reset(self, env, observation):
        """Start an episode."""
        s = self.settings
        settings = DecisionSettings(**s["decisions"])
        wind = wind_entry(settings, ACTION_MODES[s["action_mode"]], env.unwrapped.observed)
        self.decisions = Decisions(len(observation), settings, s["control_dt"], wind)
        self.decisions.restart(observation, env.unwrapped.last_action)
        self.periods = 0

    def act(self, observation):
        """Return the action of the coming control period."""
        if self.periods % self.decisions.settings.hold == 0:
            if self.periods:
                self.decisions.append(observation)
            self.decision = self.network(self.decisions.features())
        self.periods += 1
        return self.decisions.smooth(self.decision)


class Careless:
    """Commands without observation: random values, or no torque and flat blades."""

    def __init__(self, kind):
        self.kind = kind

    def env(self):
        """Return an environment with direct commands."""
        return FowtEnv("above_rated", action_mode="direct")

    def reset(self, env, observation):
        """Start an episode, the same each time."""
        self.rng, self.periods, self.action = np.random.default_rng(0), 0, np.array([-1.0, -1.0])

    def act(self, observation):
        """Return the action of the coming control period."""
        if self.kind == CARELESS[0] and self.periods % 50 == 0:
            self.action = self.rng.uniform(-1.0, 1.0, 2)
        self.periods += 1
        return self.action


def episode_figures(agent, env, options):
    """Run one episode and return its metrics {name: value}."""
    observation, _ = env.reset(seed=0, options=options | {"offsets": {}})
    agent.reset(env, observation)
    scene = env.unwrapped.scene
    rows, over, info = [env.unwrapped.channels()], False, {}
    while not over:
        observation, _, terminated, truncated, info = env.step(agent.act(observation))
        rows.append(env.unwrapped.channels())
        over = terminated or truncated
    frame = pd.DataFrame(rows).set_axis([channel.column for channel in scene.channels], axis=1)
    metrics = turbine_metrics(frame, scene.turbine)
    return {
        "failed": float("termination" in info),
        "overspeed_[%]": metrics["overspeed_[%]"],
        "guarded_[%]": 100.0 * info.get("guarded_periods", 0) / (len(rows) - 1),
        "rotor_speed_std_[%]": 100.0 * metrics["RotSpeed_std_[rpm]"] * RPM / scene.turbine.rated_rotor_speed,
        "platform_pitch_std_[deg]": metrics["PtfmPitch_std_[deg]"],
    }


def safety_study(agents):
    """Return a DataFrame with a row per agent and layer: means over episodes, largest overspeed."""
    episodes, rows = validation_episodes(resolve("ppo", "above_rated", 0, 1))[0][::2], []
    judged = {name: Trained(name) for name in agents} | {kind: Careless(kind) for kind in CARELESS}
    for label, agent in judged.items():
        for layer in (False, True):
            env = SafetyLayer(agent.env()) if layer else agent.env()
            table = pd.DataFrame([episode_figures(agent, env, options) for options in episodes])
            row = {"agent": label, "safety_layer": layer, "episodes": len(table)} | table.mean().to_dict()
            row |= {"failed": int(table["failed"].sum()), "overspeed_[%]": table["overspeed_[%]"].max()}
            rows.append(row)
            print(f"{label}, {'with' if layer else 'without'} the layer: {row['failed']} failed")
    return pd.DataFrame(rows)


def main(
    agents: Annotated[str, typer.Option(help="Names or paths of policies, comma-separated.")] = "",
    out: Annotated[str, typer.Option(help="CSV to write.")] = "results/safety.csv",
):
    """Run agents with and without the safety layer on validation episodes; print and write the table."""
    table = safety_study(parse_names(agents))
    print(table.round(2).to_string(index=False))
    write_table(table, out)


if __name__ == "__main__":
    typer.run(main)
