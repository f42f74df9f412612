"""A training run of seconds, for the tests of training."""

from fowt_env.training.rl.train import resolve

SMALL = {
    "environment.num_envs": 2,
    "environment.rotor": "table",
    "environment.wave_components": 10,
    "environment.duration": 12.0,
    "environment.wind": {"kind": "ntm", "speed": 18.0, "class": "B"},
    "decisions.history": 2,
    "validation.winds": [18],
    "validation.seeds": 2,
    "validation.every": 64,
    "validation.skip": 2.0,
}
OFF_POLICY = {
    "buffer_size": 500, "learning_starts": 20, "batch_size": 16, "train_freq": 4, "gradient_steps": 1,
}  # fmt: skip
QUICK_ALGORITHM = {
    "ppo": {"n_steps": 16, "batch_size": 16, "n_epochs": 2},
    "sac": OFF_POLICY,
    "tqc": OFF_POLICY,
}


def small(algo, steps=160, **changes):
    """Resolved settings of a small run."""
    quick = {f"algorithm.{key}": value for key, value in QUICK_ALGORITHM[algo].items()}
    return resolve(algo, "above_rated", 3, steps, SMALL | quick | changes)
