"""Training: what a run leaves behind, how it stops and goes on, and what it refuses."""

import json
import random
import shlex
import tomllib

import gymnasium
import numpy as np
import pandas as pd
import pytest
import yaml

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")

import torch
from small_run import small

from fowt_env.controllers import information
from fowt_env.controllers.policy.controller import AGENTS, shipped_agents
from fowt_env.controllers.policy.network_file import read_policy
from fowt_env.errors import InputError
from fowt_env.registration import LADDER
from fowt_env.training.cli.arguments import parse_pairs
from fowt_env.training.rl import callbacks, train
from fowt_env.training.rl.settings import check_algorithm
from fowt_env.training.rl.train import (
    Training,
    baseline_figures,
    environment_settings,
    inner_env,
    make_algorithm,
    make_envs,
    resolve,
    validation_episodes,
    validation_score,
)
from fowt_env.training.studies import publish_agent


def parameters(run):
    return {name: value.clone() for name, value in run.model.policy.state_dict().items()}


def stopped_run(settings, folder, monkeypatch, after):
    """A run that was asked to stop after some decisions."""
    monkeypatch.setattr(callbacks, "REPORT_EVERY", 0.0)
    run = Training(settings, folder)

    def report(done, total, text):
        run.stop = run.stop or done >= after

    assert not run.run(report)
    return run


@pytest.mark.parametrize("algo", ["ppo", "sac", pytest.param("tqc", marks=pytest.mark.nightly)])
def test_a_stopped_and_resumed_run_ends_with_the_bits_of_one_that_went_through(algo, tmp_path, monkeypatch):
    through = Training(small(algo), tmp_path / "through")
    assert through.run()
    stopped_run(small(algo), tmp_path / "parts", monkeypatch, after=80)
    resumed = Training(None, tmp_path / "parts", resume=True)
    assert resumed.run()
    assert resumed.model.num_timesteps == through.model.num_timesteps
    for name, value in parameters(through).items():
        assert torch.equal(value, parameters(resumed)[name]), name
    assert np.array_equal(through.env.obs_rms.mean, resumed.env.obs_rms.mean)
    if algo != "ppo":
        buffers = (through.model.replay_buffer, resumed.model.replay_buffer)
        assert buffers[0].pos == buffers[1].pos > 20
        assert np.array_equal(buffers[0].observations, buffers[1].observations)
    for a, b in zip(through.rows, resumed.rows, strict=True):
        assert {k: v for k, v in a.items() if k != "seconds"} == {
            k: v for k, v in b.items() if k != "seconds"
        }


def test_a_run_leaves_settings_versions_checkpoint_policies_table_and_plot(tmp_path):
    run = Training(small("ppo"), tmp_path / "run")
    assert run.run()
    folder = tmp_path / "run"
    with (folder / "settings.yml").open() as file:
        assert yaml.safe_load(file) == run.settings
    assert json.loads((folder / "versions.json").read_text())["stable-baselines3"]
    checkpoint = folder / "checkpoints" / f"step_{run.model.num_timesteps}"
    assert [p.name for p in (folder / "checkpoints").iterdir()] == [checkpoint.name]
    for name in ("best.npz", "last.npz", "validation.csv", "learning_curve.png", "curve.csv"):
        assert (folder / name).stat().st_size > 100
    assert [row["decisions"] for row in run.rows] == [0, 40, 80, 120, 160]
    curve = pd.read_csv(folder / "curve.csv")
    assert curve["decisions"].tolist() == [32, 64, 96, 128, 160] and curve["length"].iloc[-1] == 24.0
    assert np.isnan(curve["return"].iloc[0])  # no episode has ended yet
    paid = curve["reward/rotor_speed"]
    assert np.all((paid > 0.0) & (paid <= 1.0)) and np.isfinite(curve["return"].iloc[-1])
    assert all(np.isfinite(row["score"]) for row in run.rows) and run.best() in run.rows
    assert any((folder / "tensorboard").iterdir())


def test_a_run_that_was_killed_before_its_first_checkpoint_starts_anew(tmp_path):
    whole = Training(small("ppo"), tmp_path / "whole")
    assert whole.run()
    killed = Training(small("ppo"), tmp_path / "killed")
    killed._write_settings()
    half = killed.checkpoints / ".writing_999999999"
    half.mkdir(parents=True)
    resumed = Training(None, tmp_path / "killed", resume=True)
    assert resumed.run()
    assert not half.exists()
    for name, value in parameters(whole).items():
        assert torch.equal(value, parameters(resumed)[name]), name


def test_a_second_training_in_a_folder_is_refused_before_anything_is_built(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    first, second = Training(small("ppo"), folder), Training(small("ppo"), folder)

    def building(settings):
        third = Training(None, folder, resume=True)  # settings.yml is there from the start
        for other in (second, third):
            with pytest.raises(InputError, match=f"run folder '{folder}': another training is writing to it"):
                other.run()
        with pytest.raises(InputError, match="already contains a run"):
            Training(small("ppo"), folder)
        raise KeyboardInterrupt

    monkeypatch.setattr(train, "make_envs", building)
    with pytest.raises(KeyboardInterrupt):
        first.run()
    assert not folder.exists()  # nothing was trained, so that settings that work may have it


def test_a_run_that_came_into_the_folder_meanwhile_is_not_written_over(tmp_path):
    late = Training(small("ppo", steps=32), tmp_path / "run")
    first = Training(small("ppo", steps=64), late.folder)
    first._write_settings()
    with pytest.raises(InputError, match="already contains a run"):
        late.run()
    assert Training(None, late.folder, resume=True).settings == first.settings


def test_a_resumed_run_that_cannot_be_built_keeps_its_settings(tmp_path, monkeypatch):
    def broken(settings):
        raise ZeroDivisionError

    Training(small("ppo"), tmp_path)._write_settings()
    monkeypatch.setattr(train, "make_envs", broken)
    with pytest.raises(ZeroDivisionError):
        Training(None, tmp_path, resume=True).run()
    assert (tmp_path / "settings.yml").exists()


def test_the_policy_that_is_kept_is_that_of_the_best_validation_also_in_a_resumed_run(tmp_path, monkeypatch):
    scores, networks, runs = [2.5, 2.0, 1.0, 3.0, 2.7], [], []
    real = callbacks.validation_score

    def scored_otherwise(figures, reference, kinds):
        networks.append(parameters(runs[-1]))
        return real(figures, reference, kinds) | {"score": scores[len(networks) - 1]}

    monkeypatch.setattr(callbacks, "validation_score", scored_otherwise)
    monkeypatch.setattr(callbacks, "REPORT_EVERY", 0.0)
    runs.append(Training(small("ppo", steps=192), tmp_path / "run"))

    def report(done, total, text):
        runs[0].stop = len(networks) == 3

    assert not runs[0].run(report)
    runs.append(Training(None, tmp_path / "run", resume=True))
    assert runs[1].run()
    table = pd.read_csv(tmp_path / "run" / "validation.csv")
    assert list(table["score"]) == scores
    settings, network = read_policy(tmp_path / "run" / "best.npz")
    assert settings["about"]["steps"] == table["decisions"][table["score"].idxmin()]
    kept = [torch.tensor(array) for array in (*network.weights, *network.biases)]

    def same(stored):
        layers = [f"mlp_extractor.policy_net.{i}" for i in (0, 2)] + ["action_net"]
        there = [stored[f"{layer}.{kind}"] for kind in ("weight", "bias") for layer in layers]
        return all(torch.equal(a, b) for a, b in zip(kept, there, strict=True))

    assert [same(stored) for stored in networks] == [False, False, True, False, False]


def test_a_checkpoint_of_others_or_a_changed_one_is_resumed_only_where_it_is_trusted(tmp_path, monkeypatch):
    run = Training(small("ppo", steps=32), tmp_path / "run")
    assert run.run()
    Training(None, run.folder, resume=True)
    (run.newest() / "state.pkl").touch()
    Training(None, run.folder, resume=True)  # the contents count
    monkeypatch.setenv("FOWT_CONFIG_DIR", str(tmp_path / "another user"))
    with pytest.raises(InputError, match="executes code.*--trust-zip"):
        Training(None, run.folder, resume=True)
    assert Training({"steps": 64}, run.folder, resume=True, trusted=True).run()
    early = Training(None, run.folder, resume=True)  # its newest checkpoint is this user's own
    with (run.newest() / "state.pkl").open("ab") as file:
        file.write(b".")
    with pytest.raises(InputError, match="executes code"):
        Training(None, run.folder, resume=True)
    with pytest.raises(InputError, match="executes code"):
        early.run()


def test_without_a_place_for_its_key_a_run_goes_on_but_its_checkpoint_has_no_seal(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("FOWT_CONFIG_DIR", str(tmp_path / "file" / "below"))
    run = Training(small("ppo", steps=32), tmp_path / "run")
    assert run.run() and not (run.newest() / "seal.txt").exists()
    with pytest.raises(InputError, match="--trust-zip"):
        Training(None, run.folder, resume=True)


def test_validation_repeats_the_same_episodes_bit_for_bit():
    _, validation = make_envs(small("ppo"))
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (24, 2, 2))
    found = []
    for _ in range(2):
        validation.reset()
        for action in actions:
            validation.step(action)
        found.append(inner_env(validation).figures())
    assert found[0].keys() == found[1].keys()
    for name, values in found[0].items():
        assert np.array_equal(values, found[1][name], equal_nan=True)
        assert name in ("rotor_speed_offset_[%]", "blade_pitch_swing_[deg]") or np.all(np.isfinite(values))
    assert found[0]["rotor_speed_std_[rpm]"][0] != found[0]["rotor_speed_std_[rpm]"][1]


@pytest.fixture(scope="module")
def reference():
    """Figures of the reference on two turbulent episodes, one of steady wind and one of each gust; kinds."""
    changes = {"validation.steady": [18], "validation.gusts": [18], "environment.sea": {"kind": "joint"}}
    settings = small("ppo", **changes)
    kinds = validation_episodes(settings)[1]
    assert kinds == ["turbulent", "turbulent", "steady", "gust", "gust"]
    figures = baseline_figures(settings)
    # such short episodes end before the time from which on steady wind is judged
    assert np.all(np.isnan(figures["blade_pitch_swing_[deg]"]))
    figures["blade_pitch_swing_[deg]"] = np.full(5, 0.01)
    figures["rotor_speed_offset_[%]"] = np.full(5, 0.1)
    return figures, kinds


@pytest.mark.parametrize(
    ("metric", "factor", "score"),
    [
        ("blade_pitch_travel_[deg/s]", 1.5, 2.0),
        ("blade_pitch_travel_[deg/s]", 0.5, 1.0),
        ("torque_travel_[kN-m/s]", 1.5, 1.5),
        ("shaft_torque_DEL_[kN-m]", 1.2, 1.2),
        ("capped_power_mean_[kW]", 0.989, 1.2),
        ("capped_power_mean_[kW]", 1.2, 1.0),
        ("shaft_power_mean_[kW]", 1.2, 1.0),  # what is made beyond rated power is not paid
        ("blade_pitch_swing_[deg]", 4.9, 1.0),
        ("blade_pitch_swing_[deg]", 5.1, 1.5),
        ("rotor_speed_offset_[%]", 5.1, 1.5),
    ],
)
def test_what_a_validation_score_charges_for(reference, metric, factor, score):
    figures, kinds = reference
    row = validation_score(figures, figures, kinds)
    assert row["score"] == pytest.approx(1.0) and row["failed"] == row["unrest"] == 0.0
    changed = figures | {metric: factor * figures[metric]}
    assert validation_score(changed, figures, kinds)["score"] == pytest.approx(score)


def test_larger_motions_in_gusts_cost_and_those_of_steady_wind_are_no_ratio(reference):
    figures, kinds = reference
    name = "platform_pitch_std_[deg]"
    worse = figures | {name: figures[name] * np.where(np.array(kinds) == "gust", 1.1, 1.0)}
    row = validation_score(worse, figures, kinds)
    assert row["score"] == pytest.approx(1.2) and row["gust_ratio"] == pytest.approx(1.1)
    moved = figures | {name: figures[name] * np.where(np.array(kinds) == "steady", 9.0, 1.0)}
    assert validation_score(moved, figures, kinds)["score"] == pytest.approx(1.0)


def test_an_agent_that_always_fails_scores_infinity(reference):
    figures, kinds = reference
    nothing = {name: np.full_like(values, np.nan) for name, values in figures.items()}
    assert validation_score(nothing | {"failed": np.ones(5)}, figures, kinds)["score"] == np.inf


@pytest.mark.parametrize(
    ("words", "changes", "message"),
    [
        (("pop", "above_rated", 0, 10), {}, "unknown algorithm 'pop'. Did you mean 'ppo'"),
        (("ppo", "above_ratted", 0, 10), {}, "unknown task of training/rl/ppo.yml"),
        (("ppo", "above_rated", 0, 0), {}, "steps = 0"),
        (("ppo", "above_rated", 0, 10), {"algoritm.gamma": 1.0}, "unknown setting 'algoritm.gamma'"),
    ],
)
def test_what_no_file_of_settings_has_is_named(words, changes, message):
    with pytest.raises(InputError, match=message):
        resolve(*words, changes)


def test_a_folder_without_usable_settings_is_not_resumed(tmp_path):
    with pytest.raises(InputError, match="contains no run"):
        Training(None, tmp_path, resume=True)
    (tmp_path / "settings.yml").write_text("algo: [ppo\n")
    with pytest.raises(InputError, match="settings.yml.*not valid YAML"):
        Training(None, tmp_path, resume=True)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"decisions.envs": 8}, "decisions.envs: unknown key. Allowed: hold, smoothing, history"),
        ({"decisions.hold": 0}, "decisions.hold = 0: must be a whole number from 1 to 100"),
        ({"environment.num_env": 8}, "environment.num_env: unknown key. Did you mean 'num_envs'"),
        ({"environment.windd": 8}, "environment.windd: unknown key. Did you mean 'wind'"),
        ({"environment.designed_on": {}}, "environment.designed_on: is called nominal_plant now"),
        ({"environment.threads": 8}, "environment.threads: unknown key"),  # training's own
        ({"environment.baseline": "mine:Law"}, "environment.baseline = 'mine:Law': must be one of const"),
        ({"environment.num_envs": 0}, "environment.num_envs = 0: must be a whole number >= 1"),
        ({"environment.baseline": None}, "environment.baseline = None: must be one of constant, "),
        ({"environment.reward": 3}, "environment.reward = 3: must be a table of weights"),
        ({"environment.observation": 3}, "environment.observation = 3: must be the name"),
        ({"environment.randomise": 3}, "environment.randomise = 3: must be a table"),
        ({"normalise.training": True}, "normalise.training: unknown key"),
        ({"normalise.clip_obs": "x"}, "normalise.clip_obs = 'x': must be a number > 0"),
        ({"validation.winds": [-3]}, "validation.winds.*-3"),
        ({"checkpoint_minutes": "often"}, "checkpoint_minutes = 'often'"),
        ({"validation.winds": "[a]"}, r"validation.winds = '\[a\]': must be a list of numbers"),
    ],
)
def test_a_setting_that_no_run_can_have_is_named_before_anything_is_built(change, message):
    with pytest.raises(InputError, match=message):
        small("ppo", **change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"algorithm.n_stepps": 3}, "algorithm.n_stepps: unknown key. Did you mean 'n_steps'"),
        ({"algorithm.seed": 3}, "algorithm.seed: unknown key"),  # training's own
        ({"algorithm.gamma": 1.5}, "algorithm.gamma = 1.5: must be a number > 0 and <= 1"),
        ({"algorithm.n_steps": 0.5}, "algorithm.n_steps = 0.5: must be a whole number"),
        ({"algorithm.ent_coef": "x"}, "algorithm.ent_coef = 'x': must be a number"),
        ({"algorithm.use_sde": 1}, "algorithm.use_sde = 1: must be true or false"),
        ({"algorithm.learning_rate": [1.0, "b"]}, "algorithm.learning_rate = .*a pair"),
        ({"algorithm.policy_kwargs": 3}, "algorithm.policy_kwargs = 3: must be a table"),
        ({"algorithm.policy_kwargs.activation": "tan"}, "policy_kwargs.activation = 'tan': .* tanh, relu"),
        ({"algorithm.policy_kwargs.optimizer_class": "x"}, "kwargs.optimizer_class = 'x': must be numbers"),
        ({"algorithm.policy_kwargs.net_arch": {"pi": ["x"]}}, "policy_kwargs.net_arch = .*: must be numbers"),
        ({"algorithm.rollout_buffer_class": "os:abort"}, "algorithm.rollout_buffer_class: unknown key"),
        ({"algorithm.target_kl": "os:abort"}, "algorithm.target_kl = 'os:abort': must be a number"),
        ({"algorithm.policy_kwargs.net": 3}, "ppo does not accept these settings.*'net'"),
        ({"algorithm.n_steps": -1}, "ppo does not accept these settings.*n_steps=-1"),
        (
            {"environment.observation": "mesured"},
            "set 'mesured'. Did you mean 'measured'",
        ),
        ({"validation.skip": 12.0}, "validation.skip = 12.0: must be less than the 12 s of an episode"),
    ],
)
def test_a_run_that_cannot_start_says_why_and_leaves_nothing_behind(change, message, tmp_path):
    with pytest.raises(InputError, match=message):
        Training(small("ppo", **change), tmp_path / "run").run()
    assert not (tmp_path / "run").exists()


def test_judging_the_baseline_draws_nothing_from_the_generators_of_training():
    settings = small("ppo")
    before = (random.getstate(), repr(np.random.get_state()), torch.get_rng_state().tolist())
    baseline_figures(settings)
    assert before == (random.getstate(), repr(np.random.get_state()), torch.get_rng_state().tolist())


def test_a_published_agent_has_a_card_whose_command_makes_the_same_settings(tmp_path, monkeypatch):
    settings = small("ppo")
    run = Training(settings, tmp_path / "run")
    run.run()
    monkeypatch.setattr(publish_agent, "AGENTS", tmp_path)
    policy, card = publish_agent.publish(run.folder, "small", "a test")
    assert policy.read_bytes() == (run.folder / "best.npz").read_bytes()
    with card.open("rb") as file:
        found = tomllib.load(file)
    words = shlex.split(found["command"])
    changes = parse_pairs([words[i + 1] for i, word in enumerate(words) if word == "--set"], "set")
    given = {key: words[words.index(f"--{key}") + 1] for key in ("algo", "task", "seed", "steps")}
    again = resolve(given["algo"], given["task"], int(given["seed"]), int(given["steps"]), changes)
    assert again == settings
    assert found["information"][:2] == ["generator_speed", "blade_pitch"]
    assert found["validation"]["score"] == pytest.approx(min(row["score"] for row in run.rows), abs=1e-4)


def test_every_shipped_agent_has_a_card_and_is_small():
    for name in shipped_agents():
        assert (AGENTS / f"{name}.npz").stat().st_size < publish_agent.LARGEST_FILE
        with (AGENTS / f"{name}.toml").open("rb") as file:
            card = tomllib.load(file)
        assert {"command", "seed", "wall_time", "machine", "information", "validation", "versions"} <= set(
            card
        )
        assert tuple(card["information"]) == information(f"policy:{name}")


@pytest.mark.parametrize("algo", ["ppo", "sac", "tqc"])
@pytest.mark.parametrize("name", LADDER)
def test_the_ladder_is_trained_in_its_environments_with_settings_of_the_zoo_s_file(algo, name):
    settings = resolve(algo, name.removeprefix("fowt_env/"), 0, 1000)
    check_algorithm(make_algorithm(algo), algo, settings["algorithm"])
    made, spec = environment_settings(settings), gymnasium.spec(name).kwargs
    assert made["task"].residual_pitch == spec.get("residual_pitch", 2.0)
    for key in ("action_mode", "reward", "duration", "decisions"):
        assert made[key] == spec[key]
    assert list(made["observation"]) == list(spec["observation"])
    assert {key: tuple(value) for key, value in made["normalise"].items()} == spec["normalise"]
    assert settings["environment"]["num_envs"] > 1 and not settings["normalise"]["norm_obs"]
