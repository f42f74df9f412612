"""Makes and checks data sets of Minari for offline learning, episode by episode.

Environment, actions and rewards are those of fowt_env/OC3Hywind-v2: torque and blade pitch every 0.1 s, a
reward in [0, 1]. The weather of episode i is that of the training seed FIRST_SEED + i, so that each kind of
behaviour meets the same weather, and none that a suite or a validation has.
"""

import json
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import fowt_env
from fowt_env.control import known_scene, make, preview_leads
from fowt_env.descriptions.checks import check_number
from fowt_env.envs.actions import ActionMode, build_action_map, scale
from fowt_env.errors import InputError, unknown
from fowt_env.files.atomic import replacing
from fowt_env.registration import SENSOR_FAULTS
from fowt_env.training.evaluation.seeds import TRAINING

NAME = "fowt_env/OC3Hywind-v2"
OBSERVATION = ("default", "nacelle_acceleration", "nacelle_velocity", "wind_speed")
FIRST_SEED = TRAINING.start + 500_000
HOLD = 50  # control periods of an addition at random
REACH = np.array([0.2, 0.2])  # of these additions, in units of the action
CARD = "README.md"
FORMAT = "arrow"


@dataclass(frozen=True)
class Behaviour:
    """Defines who acts in the episodes of a data set."""

    summary: str
    controller: str
    random: bool = False  # whether held random additions change the commands
    settings: dict[str, Any] = field(default_factory=dict)  # of the environment


BEHAVIOURS = {
    "expert": Behaviour("model predictive control", "mpc"),
    "medium": Behaviour("the gain-scheduled PI law", "pi"),
    "random": Behaviour("the PI law with random additions, each held for 5 s", "pi", random=True),
    "faulty": Behaviour(
        "the PI law with a biased and a frozen sensor, and trips",
        "pi",
        settings={"faults": SENSOR_FAULTS, "protection": "turbine"},
    ),
}


def minari():
    """Return the module minari. Raises: InputError if it is not installed."""
    try:
        import minari.dataset.minari_storage  # noqa: F401

        return minari
    except ImportError as error:
        raise InputError(f"data sets need Minari: pip install 'fowt-env[minari]' ({error})") from error


def environment(behaviour, duration=None):
    """Return the environment of a behaviour; duration: s of an episode, None: that of the task."""
    more = {} if duration is None else {"duration": duration}
    return gymnasium.make(NAME, observation=OBSERVATION, **BEHAVIOURS[behaviour].settings, **more)


def make_dataset(behaviour, hours, dataset_id=None, duration=None, progress=None):
    """Write the episodes of a behaviour as a data set of Minari; return it.

    hours: of operation, rounded up to whole episodes. dataset_id: with namespace and version; None:
    oc3hywind/BEHAVIOUR-v0. Its folder is that of Minari (MINARI_DATASETS_PATH). After an
    interruption a second call continues with the next episode; more hours extend a set. progress: function
    (episodes done, episodes).

    Raises: InputError for unknown behaviours, hours out of range and a set of another behaviour.
    """
    library = minari()
    if behaviour not in BEHAVIOURS:
        raise unknown("behaviour", behaviour, BEHAVIOURS)
    check_number("hours", hours, 0.0, 1e5, low_open=True)
    chosen = BEHAVIOURS[behaviour]
    env = environment(behaviour, duration)
    count = ceil(round(hours * 3600.0 / env.unwrapped.task.duration, 9))
    dataset_id = dataset_id or f"oc3hywind/{behaviour}-v0"
    storage = _storage(library, dataset_id, env, behaviour)
    while storage.total_episodes < count:
        number = int(storage.total_episodes)
        storage.update_episodes([_episode(env, chosen, number)])
        if progress is not None:
            progress(number + 1, count)
    env.close()
    dataset = library.load_dataset(dataset_id)
    with replacing(Path(storage.data_path).parent / CARD) as path:
        path.write_text(card(dataset, behaviour), encoding="utf-8")
    return dataset


def _storage(library, dataset_id, env, behaviour):
    """Return the storage of a data set, made if there is none."""
    from minari import namespace as namespaces
    from minari.dataset.minari_dataset import parse_dataset_id
    from minari.dataset.minari_storage import MinariStorage
    from minari.storage import get_dataset_path

    try:
        namespace = parse_dataset_id(dataset_id)[0]
    except ValueError as error:
        raise InputError(f"id = {dataset_id!r}: must be NAMESPACE/NAME-vVERSION ({error})") from None
    path = Path(get_dataset_path(dataset_id)) / "data"
    wanted = {"algorithm_name": BEHAVIOURS[behaviour].controller, "env_spec": env.spec.to_json()}
    if (path / "metadata.json").exists():
        raw = MinariStorage.read_raw_metadata(path)
        if {key: raw.get(key) for key in wanted} != wanted or raw.get("behaviour") != behaviour:
            raise InputError(f"id = {dataset_id!r}: holds other episodes; needs another id")
        return MinariStorage.read(path)
    if namespace is not None and namespace not in namespaces.list_local_namespaces():
        namespaces.create_namespace(namespace)
    path.mkdir(parents=True, exist_ok=True)
    storage = MinariStorage.new(path, env.observation_space, env.action_space, env.spec, data_format=FORMAT)
    storage.update_metadata(
        {
            "dataset_id": dataset_id,
            "minari_version": library.__version__,
            "algorithm_name": BEHAVIOURS[behaviour].controller,
            "behaviour": behaviour,
            "author": {"fowt_env"},
            "description": BEHAVIOURS[behaviour].summary,
            "requirements": [f"fowt-env=={fowt_env.__version__}"],
        }
    )
    return storage


def _episode(env, behaviour, number):
    """Return the EpisodeBuffer of one episode."""
    from minari.data_collector import EpisodeBuffer

    seed = FIRST_SEED + number
    options = {"weather_seed": seed}
    observation, _ = env.reset(seed=seed, options=options)
    act = _acting(env.unwrapped, behaviour, seed)
    observations, actions, rewards, terminations, truncations = [observation], [], [], [], []
    ended = False
    while not ended:
        action = act()
        observation, reward, terminated, truncated, _ = env.step(action)
        observations.append(observation)
        actions.append(action)
        rewards.append(reward)
        terminations.append(terminated)
        truncations.append(truncated)
        ended = terminated or truncated
    arrays = [np.array(values) for values in (observations, actions, rewards, terminations, truncations)]
    return EpisodeBuffer(None, seed, options, *arrays)


def _acting(env, behaviour, seed):
    """Return a function that returns the action (2,) float32 of the present instant."""
    turbine, control_dt = env.design_scene.turbine, env.control_dt
    controller = make(behaviour.controller, turbine, control_dt)
    leads = preview_leads(controller)
    controller.prepare(known_scene(env.design_scene, controller))
    controller.reset(env.measurement(leads))
    reach = build_action_map(ActionMode.DIRECT, env.task, turbine, control_dt)
    rng, held = np.random.default_rng(seed), np.zeros(2)
    calls = 0

    def act():
        nonlocal held, calls
        torque, pitch = controller.act(env.measurement(leads))
        if behaviour.random and calls % HOLD == 0:
            held = REACH * rng.uniform(-1.0, 1.0, 2)
        calls += 1
        action = (scale(torque, reach.low, reach.high), scale(pitch, reach.pitch_low, reach.pitch_high))
        return np.clip(np.array(action) + held, -1.0, 1.0).astype(np.float32)

    return act


def figures(dataset):
    """Return {name: value} of a data set: hours, episodes, failures, rewards of a step."""
    env = dataset.recover_environment().unwrapped
    step = env.physics_steps * env.dt
    returns = [(float(e.rewards.mean()), bool(e.terminations[-1])) for e in dataset.iterate_episodes()]
    rewards, failed = map(np.array, zip(*returns, strict=True))
    return {
        "episodes": len(rewards),
        "hours": dataset.total_steps * step / 3600.0,
        "failed": int(failed.sum()),
        "reward": float(rewards.mean()),
        "lowest": float(rewards.min()),
        "highest": float(rewards.max()),
    }


def card(dataset, behaviour):
    """Return the text of the card of a data set."""
    env, values, chosen = dataset.recover_environment().unwrapped, figures(dataset), BEHAVIOURS[behaviour]
    last = FIRST_SEED + values["episodes"] - 1
    channels = "\n".join(f"| {i} | {e.name} | {e.unit} |" for i, e in enumerate(env.observed))
    name = dataset.spec.dataset_id
    return f"""# {name}

Behaviour `{behaviour}`: {chosen.summary}. OC3-Hywind with the NREL 5 MW turbine, {values["hours"]:.1f} h in
{values["episodes"]} episodes of {env.task.duration:g} s, simulated by fowt_env {fowt_env.__version__}.

- Environment `{NAME}`, task `{env.task.name}`, a step of {env.control_dt:g} s.
- Weather: training seeds {FIRST_SEED} to {last}; no suite, validation or leaderboard has them.
- Mean reward of a step {values["reward"]:.3f}; of an episode {values["lowest"]:.3f} to
  {values["highest"]:.3f}. {values["failed"]} episodes ended in failure.
- Every episode replays bit for bit from its seed and options: `fowt dataset check {name}`.

```python
import minari

dataset = minari.load_dataset("{name}")
env = dataset.recover_environment()
```

Settings of the environment: `{json.dumps(chosen.settings)}`. Actions: torque and blade pitch in [-1, 1].
Observations, each scaled as in the environment reference:

| entry | channel | unit |
|---|---|---|
{channels}
"""


def check_dataset(dataset_id, replays=1, progress=None):
    """Check a data set of make_dataset and return its figures.

    Every episode: shapes, ranges, one end, seeds of training that are all different. The first `replays`
    episodes are replayed in the environment of the set and must agree bit for bit.

    Raises: InputError naming the episode and what is wrong.
    """
    library = minari()
    try:
        dataset = library.load_dataset(dataset_id)
    except FileNotFoundError:
        known = ", ".join(library.list_local_datasets()) or "none"
        raise InputError(
            f"id = {dataset_id!r}: is not among the datasets on this machine ({known}): fowt dataset make"
        ) from None
    except ValueError as error:
        raise InputError(f"id = {dataset_id!r}: cannot be loaded: {error}") from None
    env = dataset.recover_environment()
    told = list(dataset.storage.get_episode_metadata(range(dataset.total_episodes)))
    seeds, steps = [one.get("seed") for one in told], 0
    if len(set(seeds)) < len(seeds) or not all(type(s) is int and s in TRAINING for s in seeds):
        raise InputError(f"id = {dataset_id!r}: its seeds must be different seeds of training")
    for number, episode in enumerate(dataset.iterate_episodes()):
        fault = _fault(episode, env)
        if fault is None and number < replays:
            fault = _difference(episode, env, told[number])
        if fault is not None:
            raise InputError(f"id = {dataset_id!r}: episode {number}: {fault}")
        steps += len(episode.rewards)
        if progress is not None:
            progress(number + 1, len(seeds))
    if steps != dataset.total_steps or not seeds:
        raise InputError(f"id = {dataset_id!r}: holds {steps} steps: its metadata says {dataset.total_steps}")
    return figures(dataset)


def _fault(episode, env):
    """Return what is wrong with the arrays of an episode; None: nothing."""
    n = len(episode.rewards)
    shapes = (episode.observations.shape, episode.actions.shape)
    wanted = ((n + 1, *env.observation_space.shape), (n, *env.action_space.shape))
    if shapes != wanted:
        return f"observations and actions of shapes {shapes}: must be {wanted}"
    ends = episode.terminations | episode.truncations
    if not ends[-1] or ends[:-1].any():
        return "must end in its last step alone"
    rewards = episode.rewards
    if not (np.isfinite(rewards).all() and rewards.min() >= 0.0 and rewards.max() <= 1.0):
        return "rewards must be in [0, 1]"
    low, high = env.observation_space.low, env.observation_space.high
    if not np.all((episode.observations >= low) & (episode.observations <= high)):
        return "observations must be in the space of the environment"
    return None if np.abs(episode.actions).max() <= 1.0 else "actions must be in [-1, 1]"


def _difference(episode, env, told):
    """Return how a replay of an episode differs from it; None: not at all."""
    observation, _ = env.reset(seed=told["seed"], options=told["options"])
    if not np.array_equal(observation, episode.observations[0]):
        return "its start differs from that of its seed"
    for k, action in enumerate(episode.actions):
        observation, reward, *_ = env.step(action)
        if not np.array_equal(observation, episode.observations[k + 1]) or reward != episode.rewards[k]:
            return f"step {k} differs from that of its replay"
    return None
