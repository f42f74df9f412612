"""Prepares the start of an episode: drawn values, options of reset, and initial state."""

from collections.abc import Mapping
from contextlib import contextmanager
from math import pi
from typing import NamedTuple

import numpy as np

from fowt_env.analysis.blade_coordinates import bending_states, turned_to
from fowt_env.descriptions.checks import short
from fowt_env.descriptions.sea_state import sea_of
from fowt_env.descriptions.wind import wind_of
from fowt_env.envs.rewards import Reference
from fowt_env.envs.tasks import Episode, draw_offsets, draw_weather, is_mixture, varies
from fowt_env.errors import InputError, unknown
from fowt_env.loop.protection import Guard
from fowt_env.plant.channels import DEG_PER_RAD
from fowt_env.plant.line_dynamics import rest_lines
from fowt_env.plant.state import Command, State
from fowt_env.run.initial_conditions import INITIAL
from fowt_env.scene.actuators import rest_actuators
from fowt_env.scene.scene import Scene


class Start(NamedTuple):
    """Holds a validated new episode, which can begin without further errors."""

    episode: Episode
    scene: Scene
    nominal: Scene | None
    state: np.ndarray  # (n_state,) operating point with the offsets
    command: np.ndarray  # (2,)
    reference: Reference
    guard: Guard | None


@contextmanager
def kept_if_refused(envs):
    """Restore the environments' random generators if the block of this context raises."""
    before = [
        (env._np_random, env._np_random_seed, env._np_random and env._np_random.bit_generator.state)
        for env in envs
    ]
    try:
        yield
    except BaseException:
        for env, (generator, seed, state) in zip(envs, before, strict=True):
            env._np_random, env._np_random_seed = generator, seed
            if generator is not None:
                generator.bit_generator.state = state
        raise


def moved_state(scene, state, command, offsets):
    """Return (state, command) plus {channel: offset in its unit}, with the pitch limited to its range.

    An offset of BldPitch1 applies to all blades, whose pitches are equal at an operating point.
    """
    x, u, drive = state.copy(), command.copy(), scene.turbine.pitch_drive
    for name, value in offsets.items():
        index, factor = INITIAL[name]
        if index == State.AZIMUTH:
            x = turned_to(x, x[index] + value * factor, bending_states(scene))
        else:
            x[index] += value * factor
    if abs(x[State.PLATFORM_PITCH]) >= 0.5 * pi:
        raise InputError(
            f"offsets['PtfmPitch'] = {offsets['PtfmPitch']:g}: leads to"
            f" {x[State.PLATFORM_PITCH] * DEG_PER_RAD:g} deg, must be inside (-90, 90) deg"
        )
    x[list(scene.pitch_states)] = min(max(x[State.BLADE_PITCH], drive.minimum), drive.maximum)
    u[Command.BLADE_PITCH :] = x[State.BLADE_PITCH]
    rest_actuators(scene.model, x, u)
    if offsets:
        rest_lines(scene, x)
    return x, u


def with_options(drawn, options, rng):
    """Return the drawn Episode with values replaced by the options of reset; ranges are drawn with rng."""
    if not isinstance(options, Mapping | None):
        raise InputError(f"options = {short(options)}: must be a mapping of reset's options, or None")
    changes = {}
    for key, value in (options or {}).items():
        if key not in Episode._fields:
            raise unknown("option of reset", key, Episode._fields)
        if key == "faults":
            continue  # drawn later, in FowtEnv._plan
        if key == "offsets":
            value = draw_offsets(value, rng)
        if key == "wind":
            value = wind_of(value)
            if value is None:
                raise InputError("options['wind'] = None: an episode needs a wind (0.0 for still air)")
        if key == "sea":
            value = sea_of(value)
        changes[key] = value
    if "wind" in changes:
        changes.setdefault("exact_start", not varies(changes["wind"]))
    if any(varies(changes.get(key)) for key in ("wind", "sea")):
        wind = changes.get("wind", drawn.wind)
        sea = changes.get("sea", None if is_mixture(wind) else drawn.sea)
        changes["wind"], changes["sea"] = draw_weather("options", wind, sea, rng)
    return drawn._replace(**changes)
