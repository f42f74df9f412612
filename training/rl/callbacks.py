"""Defines the training callbacks: validation, export of the best policy, checkpoints, progress, stop."""

import time

import numpy as np
import pandas as pd
import torch
from stable_baselines3.common.callbacks import BaseCallback, EvalCallback

from fowt_env.files.tables import write_table
from fowt_env.training.rl.train import inner_env, validation_score

REPORT_EVERY = 1.0  # s
POINTS = 200  # rows of the curve over a run
PARTS = 4  # validations of a run at least, beside that before its first decision


EPISODE = (("return", "r"), ("length", "l"))  # of the curve: name, key in stable-baselines3's buffer


class Stopped(Exception):
    """Signals that the run was stopped after writing a checkpoint."""


class Validation(EvalCallback):
    """Validates a train.Training: ratios to the reference, a row of the table, the best policy."""

    def __init__(self, training, env):
        steps, given = training.settings["steps"], training.settings["validation"].get("every")
        quarter = -(-steps // PARTS)
        every = max(1, min(given or quarter, quarter) // training.env.num_envs)
        super().__init__(env, n_eval_episodes=env.num_envs, eval_freq=every, deterministic=True, verbose=0)
        self.training = training
        self.best = float("inf")

    def _on_training_start(self):
        super()._on_training_start()
        if not self.training.rows:
            self.now()

    def now(self):
        """Validate the current policy, leaving the interval of validations unchanged."""
        calls, self.n_calls = self.n_calls, 0
        try:
            self._on_step()
        finally:
            self.n_calls = calls

    def _on_step(self):
        training, due = self.training, self.n_calls % self.eval_freq == 0
        going = super()._on_step()
        if not due:
            return going
        metrics = inner_env(self.eval_env).figures()
        row = {"decisions": self.num_timesteps, "seconds": training.checkpointing.seconds()}
        row |= {"reward": self.last_mean_reward}
        row |= validation_score(metrics, training.reference, training.kinds)
        training.rows.append(row)
        for name, value in row.items():
            self.logger.record(f"validation/{name}", value)
        write_table(pd.DataFrame(training.rows), training.folder / "validation.csv")
        if row["score"] < self.best:
            self.best = row["score"]
            training.export("best.npz")
        return going


class Curve(BaseCallback):
    """Records returns and reward terms of the training episodes over a run, also for TensorBoard."""

    def __init__(self, training):
        super().__init__()
        self.training = training
        self.sums, self.count = {}, 0

    def _on_step(self):
        for name, value in inner_env(self.training_env).terms.items():
            self.sums[name] = self.sums.get(name, 0.0) + value
        self.count += 1
        return True

    def _on_rollout_end(self):
        training, rows = self.training, self.training.curve
        last = rows[-1]["decisions"] if rows else 0
        if self.num_timesteps - last < training.settings["steps"] / POINTS:
            return
        terms = {name: value / self.count for name, value in self.sums.items()}
        self.sums, self.count = {}, 0
        episodes = self.model.ep_info_buffer
        means = {name: np.mean([e[key] for e in episodes]) if episodes else np.nan for name, key in EPISODE}
        rows.append({"decisions": self.num_timesteps, **means, **terms})
        for name, value in terms.items():
            self.logger.record(name, value)
        write_table(pd.DataFrame(rows), training.folder / "curve.csv")


class CheckpointCallback(BaseCallback):
    """Writes checkpoints between an update and the next rollout, reports progress and stops a run."""

    def __init__(self, training, report):
        super().__init__()
        self.training = training
        self.report = report
        self.before = 0.0  # s, wall time of earlier sessions
        self.torch_state = None  # random state at the first rollout of a resumed run
        self._begin = self._saved = self._reported = time.monotonic()
        self._first = None

    def seconds(self):
        """Return the wall time of the run so far over all sessions, s."""
        return self.before + time.monotonic() - self._begin

    def _on_training_start(self):
        self._begin = self._saved = time.monotonic()
        self._first = self.num_timesteps

    def _on_rollout_start(self):
        if self.torch_state is not None:
            # exploration noise was drawn once more up to here than in the run that was stopped
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
            seconds = max(0.0, total - self.num_timesteps) / max(rate, 1e-9)
            left = time.strftime("%H:%M:%S", time.gmtime(seconds))
            parts = [f"{rate:.0f} decisions/s"]
            returns = [episode["r"] for episode in self.model.ep_info_buffer]
            if returns:
                parts.append(f"return {np.mean(returns):.1f}")
            best = self.training.best()
            if best is not None:
                parts.append(f"best score {best['score']:.3f}")
            self.report(self.num_timesteps, total, ", ".join([*parts, f"{left} left"]))
        return True
