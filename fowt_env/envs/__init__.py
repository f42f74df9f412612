"""Gymnasium environments of fowt_env, their tasks, and their tables."""

from fowt_env.envs.env import FowtEnv
from fowt_env.envs.tables import task_tables
from fowt_env.envs.tasks import TASKS, Task
from fowt_env_registration import register_envs

__all__ = ["TASKS", "FowtEnv", "Task", "task_tables"]

register_envs()
