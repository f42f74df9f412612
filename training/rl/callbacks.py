"""While an agent learns: validation, the best policy kept, checkpoints, progress, an orderly stop."""

import time

import numpy as np
import pandas as pd
import torch
from stable_baselines3.common.callbacks import BaseCallback, EvalCallback

from fowt_env.files.tables import write_table
from fowt_env.training.rl.train import decision_env, seconds_text, validation_score

REPORT_EVERY = 1.0  # s


class Stopped(Exception):
    """The run was asked to end, and its checkpoint is written."""


class ValidationCallback(BaseCallback):
    """After each validation: physical figures against the baseline's, a row of the table, the best policy."""

    def __init__(self, training):
        super().__init__()
        self.training = training
        self.best = float("inf")

    def _on_step(self):
        training, evaluation = self.training, self.parent
        figures = decision_env(evaluation.eval_env).base.figures()
        row = {"decisions": self.num_timesteps, "seconds": training.checkpoint_callback.seconds()}
        row |= {"reward": evaluation.last_mean_reward} | validation_score(
            figures, training.reference, training.kinds
        )
        training.rows.append(row)
        for name, value in row.items():
            self.logger.record(f"validation/{name}", value)
        write_table(pd.DataFrame(training.rows), training.folder / "validation.csv")
        if row["score"] < self.best:
            self.best = row["score"]
            training.export("best.npz")
        return True


class Validation(EvalCallback):
    """EvalCallback that can also validate the policy as it stands, whatever its count of calls."""

    def now(self):
        """Validate the present policy; the rhythm of the validations stays as it is."""
        calls, self.n_calls = self.n_calls, 0
        try:
            self._on_step()
        finally:
            self.n_calls = calls


class CheckpointCallback(BaseCallback):
    """Checkpoints between an update and the next rollout, progress, and the stop that was asked for."""

    def __init__(self, training, report):
        super().__init__()
        self.training = training
        self.report = report
        self.before = 0.0  # s, of the sessions before this one
        self.torch_state = None  # to go on from in the first rollout
        self._begin = self._saved = self._reported = time.monotonic()
        self._first = None

    def seconds(self):
        """Return the wall time of the run so far, s, over all its sessions."""
        return self.before + time.monotonic() - self._begin

    def _on_training_start(self):
        self._begin = self._saved = time.monotonic()
        self._first = self.num_timesteps

    def _on_rollout_start(self):
        if self.torch_state is not None:
            # lasting noise was drawn once more before this point than in the run that was stopped
            torch.set_rng_state(self.torch_state)
            self.torch_state = None
        now = time.monotonic()
        if self.training.stop or now - self._saved > 60.0 * self.training.settings["checkpoint_minutes"]:
            self.training.save()
            self._saved = time.monotonic()
        if self.training.stop:
            raise Stopped

    def _on_step(self):
        now = time.monotonic()
        if self.report is not None and now - self._reported > REPORT_EVERY:
            self._reported = now
            total = self.training.settings["steps"]
            rate = (self.num_timesteps - self._first) / max(now - self._begin, 1e-9)
            left = seconds_text((total - self.num_timesteps) / max(rate, 1e-9))
            parts = [f"{rate:.0f} decisions/s"]
            returns = [episode["r"] for episode in self.model.ep_info_buffer]
            if returns:
                parts.append(f"return {np.mean(returns):.1f}")
            best = self.training.best()
            if best is not None:
                parts.append(f"best score {best['score']:.3f}")
            self.report(self.num_timesteps, total, ", ".join([*parts, f"{left} left"]))
        return True


def callbacks(training, validation_env, validation_callback, checkpoint_callback):
    """Return [Validation on its episodes, CheckpointCallback] of a training.rl.train.Training."""
    every = max(1, training.settings["validation"]["every"] // training.env.num_envs)
    evaluation = Validation(
        validation_env,
        callback_after_eval=validation_callback,
        n_eval_episodes=validation_env.num_envs,
        eval_freq=every,
        deterministic=True,
        verbose=0,
    )
    return [evaluation, checkpoint_callback]
