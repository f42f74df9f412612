"""Provides the Gymnasium environments of fowt_env with their tasks and Markdown tables."""

from fowt_env.envs.env import FowtEnv
from fowt_env.envs.jacobians import PeriodJacobian, PeriodJacobians
from fowt_env.envs.objectives import FowtObjectivesEnv
from fowt_env.envs.safety import SafetyCosts, SafetyLayer
from fowt_env.envs.settings import (
    ControlSettings,
    EpisodeSettings,
    InterfaceSettings,
    PlantSettings,
)
from fowt_env.envs.snapshot import Snapshot
from fowt_env.envs.tables import task_tables
from fowt_env.envs.tasks import TASKS, Task
from fowt_env.envs.vector_env import FowtVectorEnv

__all__ = [
    "TASKS",
    "ControlSettings",
    "EpisodeSettings",
    "FowtEnv",
    "FowtObjectivesEnv",
    "FowtVectorEnv",
    "InterfaceSettings",
    "PeriodJacobian",
    "PeriodJacobians",
    "PlantSettings",
    "SafetyCosts",
    "SafetyLayer",
    "Snapshot",
    "Task",
    "task_tables",
]
