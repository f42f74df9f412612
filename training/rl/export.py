"""Exports trained policies as plain array files, which controllers/policy/controller.py reads with numpy."""

import json
import pickle
from dataclasses import asdict

import numpy as np

from fowt_env.controllers.policy.network_file import FORMAT, MODES
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing

ACTIVATION_NAMES = {"Tanh": "tanh", "ReLU": "relu"}
UNCLIPPED = 1e9  # clip of features that are not clipped


def layers_of(model):
    """Return (torch Linear layers, activation name, squash name) of a model's deterministic policy.

    Raises: InputError for policies that are not multilayer perceptrons with one supported activation.
    """
    if hasattr(model.policy, "mlp_extractor"):
        modules, squash = [*model.policy.mlp_extractor.policy_net, model.policy.action_net], "clip"
    else:
        modules, squash = [*model.actor.latent_pi, model.actor.mu], "tanh"
    linear = [module for module in modules if type(module).__name__ == "Linear"]
    names = {type(module).__name__ for module in modules} - {"Linear"}
    if len(names) > 1 or not names <= set(ACTIVATION_NAMES):
        raise InputError(
            f"activations {', '.join(sorted(names))}: must be one of {', '.join(ACTIVATION_NAMES)}"
        )
    return linear, ACTIVATION_NAMES[names.pop()] if names else "tanh", squash


def export_policy(model, single, path, about, normalisation=None):
    """Write the deterministic policy of a model as a .npz without pickled objects; return the path.

    single: a FowtEnv of the training with decisions, in the mode residual, direct or setpoint; normalisation:
    VecNormalize of the training, None without; about: dict of text and numbers on the origin of the model.
    Raises: InputError for an environment or a network that a policy file cannot hold.
    """
    single = single.unwrapped
    if single.decisions is None or single.action_mode not in MODES:
        which = "no decisions" if single.decisions is None else f"action_mode {single.action_mode!r}"
        raise InputError(
            f"export_policy: the environment has {which}: must have decisions, and a mode of"
            f" {', '.join(MODES)}"
        )
    own, read = single.observation_space.shape, model.observation_space.shape
    if own != read:
        raise InputError(
            f"export_policy: the model reads observations of shape {read}, the environment has {own}: must be"
            " that of its training"
        )
    linear, activation, squash = layers_of(model)
    task, decisions, features = single.task, single.decisions, single.features
    mean, scale, clip = features.mean, features.scale, features.bound
    if normalisation is not None and normalisation.norm_obs:  # of what the environment has scaled
        statistics = normalisation.obs_rms
        mean = mean + scale * statistics.mean
        scale = scale * np.sqrt(statistics.var + normalisation.epsilon)
        clip = normalisation.clip_obs
    settings = {
        "format": FORMAT, "activation": activation, "squash": squash, "layers": len(linear),
        "clip_observation": float(min(clip, UNCLIPPED)), "control_dt": single.control_dt,
        "decisions": asdict(decisions), "action_mode": single.action_mode, "baseline": single.baseline,
        "observation": list(task.observation), "wind_preview": list(task.wind_preview),
        "blade_pitch": list(task.blade_pitch), "setpoint": list(task.setpoint),
        "residual_torque": task.residual_torque, "residual_pitch": task.residual_pitch, "about": about,
    }  # fmt: skip
    arrays = {"settings": np.array(json.dumps(settings)), "mean": mean, "scale": scale}
    for i, layer in enumerate(linear):
        arrays |= {f"{kind}_{i}": getattr(layer, kind).detach().cpu().numpy() for kind in ("weight", "bias")}
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)
    return path


def export_run(folder, path):
    """Write the policy of a run's newest checkpoint; return the path. Loading executes its code.

    Raises: InputError if the folder contains no checkpoint.
    """
    from fowt_env.envs import FowtEnv
    from fowt_env.training.rl.train import Training, environment_settings, make_algorithm

    run = Training(None, folder, resume=True, trusted=True)
    settings, checkpoint = run.settings, run.newest()
    if checkpoint is None:
        raise InputError(f"{folder}: contains no checkpoint of a run yet")
    model = make_algorithm(settings["algo"]).load(checkpoint / "model.zip", device="cpu")
    with (checkpoint / "normalisation.pkl").open("rb") as file:
        normalisation = pickle.load(file)
    about = {key: settings[key] for key in ("algo", "name", "seed")} | {"steps": int(model.num_timesteps)}
    return export_policy(model, FowtEnv(**environment_settings(settings)), path, about, normalisation)
