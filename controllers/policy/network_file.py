"""Reads policy files: arrays and one JSON text in a .npz, read without pickle, every value checked.

Loading runs no code of the file's author: names in the file must be known names, the baseline one of
CONTROLLERS; descriptions/array_files.py reads the arrays, at most MAX_BYTES. training/rl/export.py writes
these files.
"""

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from fowt_env.controllers.registry import CONTROLLERS
from fowt_env.descriptions.array_files import read_arrays
from fowt_env.descriptions.files import parse_json, raise_problems
from fowt_env.descriptions.records import Finite, NonNegative, Positive, Record, unknown_key, validate
from fowt_env.envs.actions import ACTION_MODES, n_actions
from fowt_env.envs.decisions import DecisionSettings
from fowt_env.envs.observations import KNOWN, N_ACTIONS
from fowt_env.errors import InputError

FORMAT = 1
MODES = tuple(name for name, mode in ACTION_MODES.items() if n_actions(mode) == N_ACTIONS)  # one pitch
ACTIVATIONS = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0.0)}
SQUASHES = {"clip": lambda x: np.clip(x, -1.0, 1.0), "tanh": np.tanh}
MAX_BYTES = 100_000_000  # of all arrays; typical policies have 200 kB
MAX_LAYERS = 100
PAIR = Annotated[list[Finite], Field(min_length=2, max_length=2)]


class PolicySettings(Record):
    """Defines the JSON text of a policy file."""

    format: Literal[FORMAT]
    activation: Literal[tuple(ACTIVATIONS)]
    squash: Literal[tuple(SQUASHES)]
    layers: Annotated[int, Field(ge=1, le=MAX_LAYERS, strict=True)]
    clip_observation: Positive
    control_dt: Positive
    decisions: dict[str, Any]  # of DecisionSettings
    action_mode: Literal[MODES]
    baseline: Literal[tuple(CONTROLLERS)]  # an import path would run code
    observation: Annotated[list[Literal[KNOWN]], Field(min_length=1, max_length=200)]
    wind_preview: Annotated[list[NonNegative], Field(max_length=200)]  # s
    blade_pitch: PAIR  # deg
    setpoint: PAIR
    residual_torque: Finite
    residual_pitch: Finite  # deg
    about: dict[str, Any]


class Network:
    """Evaluates a multilayer perceptron on normalised features, float32.

    weights, biases: lists of (out, in) and (out,) arrays; mean, scale: of the features; clip: of the
    normalised features. Calling it with features (..., size) returns actions (..., 2) in [-1, 1].
    """

    def __init__(self, weights, biases, activation, squash, mean, scale, clip):
        self.weights = [np.ascontiguousarray(w, dtype=np.float32) for w in weights]
        self.biases = [np.ascontiguousarray(b, dtype=np.float32) for b in biases]
        self.activation, self.squash = ACTIVATIONS[activation], SQUASHES[squash]
        self.mean = np.asarray(mean, dtype=np.float64)
        self.scale = np.asarray(scale, dtype=np.float64)
        self.clip = float(clip)

    def __call__(self, features):
        normal = np.clip((features - self.mean) / self.scale, -self.clip, self.clip)
        x = normal.astype(np.float32)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = self.activation(x @ weight.T + bias)
        return self.squash(x @ self.weights[-1].T + self.biases[-1])


def read_policy(path):
    """Return (settings dict, Network) of a policy file.

    Raises: InputError naming the file and the problem.
    """
    path = Path(path)
    where = f"policy file {str(path)!r}"
    try:
        arrays = read_arrays(path, MAX_BYTES)
        settings = parse_json(str(arrays["settings"]))
    except Exception as error:  # zipfile, zlib, numpy and json raise various errors for broken files
        raise InputError(f"{where}: cannot be read: {error!s:.300}") from error
    _check_settings(where, settings)
    try:
        weights = [_numbers(arrays[f"weight_{i}"]) for i in range(settings["layers"])]
        biases = [_numbers(arrays[f"bias_{i}"]) for i in range(settings["layers"])]
        mean, scale = _numbers(arrays["mean"]), _numbers(arrays["scale"])
    except (KeyError, ValueError) as error:
        raise InputError(f"{where}: array {error}") from None
    _check_shapes(where, weights, biases, mean, scale)
    kinds = settings["activation"], settings["squash"]
    return settings, Network(weights, biases, *kinds, mean, scale, settings["clip_observation"])


def _numbers(array):
    """Return the array if it is numeric. Raises: ValueError."""
    if array.dtype.kind not in "fiu":
        raise ValueError(f"of {array.dtype}: must hold numbers")
    return array


def _check_settings(where, settings):
    """Raise InputError unless settings are valid for a policy of this format."""
    if not isinstance(settings, dict):
        raise InputError(f"{where}: its settings must be a JSON object")
    record, problems = validate(PolicySettings, settings)
    raise_problems(where, problems)
    known = [field.name for field in fields(DecisionSettings)]
    problems = [unknown_key(f"decisions.{key}", key, known) for key in record.decisions if key not in known]
    raise_problems(where, problems)
    try:
        DecisionSettings(**record.decisions)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _check_shapes(where, weights, biases, mean, scale):
    """Raise InputError unless the arrays form a network of finite numbers with two outputs."""
    size = mean.shape
    good = len(size) == 1 and scale.shape == size and bool(np.all(scale > 0.0))
    for weight, bias in zip(weights, biases, strict=True):
        good = good and weight.ndim == 2 and (weight.shape[1],) == size and weight.shape[:1] == bias.shape
        size = bias.shape
    finite = all(bool(np.all(np.isfinite(array))) for array in (*weights, *biases, mean, scale))
    if not (good and finite and size == (N_ACTIONS,)):
        raise InputError(f"{where}: its arrays do not form a network with two outputs")
