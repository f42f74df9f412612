"""Exported policies: stable-baselines3's own answers, the environment's own commands, and refusals."""

import subprocess
import sys
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import fowt_env
from fowt_env.controllers import information, make
from fowt_env.controllers.mpc.clone import FILE, MPCClone, is_clone
from fowt_env.controllers.policy.controller import policy_path, read_policy, shipped_agents
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs import TASKS, FowtEnv
from fowt_env.envs.observations import entries
from fowt_env.errors import InputError

QUICK = {"rotor": "table", "wave_components": 10, "wind": {"kind": "ntm", "speed": 18.0, "class": "B"}}
TURBINE = read_turbine("nrel5mw")


def write_random_policy(
    path, mode="residual", names=("rotor_speed", "previous_action"), preview=(), **changes
):
    """A policy file of a small random network, written without torch."""
    import json

    rng = np.random.default_rng(0)
    n = 3 * len(entries(names, TURBINE, preview))
    settings = {
        "format": 1, "activation": "tanh", "squash": "clip", "layers": 2, "clip_observation": 10.0,
        "control_dt": 0.1, "decisions": {"hold": 3, "smoothing": 0.4, "history": 2}, "action_mode": mode,
        "baseline": "gspi_oc3", "observation": list(names), "wind_preview": list(preview),
        "blade_pitch": [0.0, 30.0], "setpoint": [0.9, 1.1], "residual_torque": 0.1, "residual_pitch": 3.0,
        "about": {},
    } | changes  # fmt: skip
    arrays = {
        "settings": np.array(json.dumps(settings)),
        "mean": rng.normal(size=n), "scale": rng.uniform(1.0, 2.0, n),
        "weight_0": rng.normal(size=(5, n)), "bias_0": rng.normal(size=5),
        "weight_1": rng.normal(size=(2, 5)), "bias_1": rng.normal(size=2),
    }  # fmt: skip
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize("algo", ["ppo", "sac", "tqc"])
def test_the_exported_network_answers_as_stable_baselines3_does(algo, tmp_path):
    pytest.importorskip("sb3_contrib")
    from small_run import small

    from fowt_env.training.rl.train import Training

    run = Training(small(algo, steps=40), tmp_path / "run")
    run.run()
    network = read_policy(run.folder / "last.npz")[1]
    rng = np.random.default_rng(0)
    features = rng.normal(size=(200, run.env.observation_space.shape[0])).astype(np.float32) * 3.0
    expected, _ = run.model.predict(run.env.normalize_obs(features), deterministic=True)
    assert np.abs(network(features) - expected).max() < 1e-5


ESTIMATED = ("estimated_wind", "estimated_platform", "estimated_waves")


@pytest.mark.parametrize(
    ("mode", "baseline", "estimated", "shaping"),
    [
        ("residual", "lqr", ESTIMATED, {}),
        ("residual", "lqr", ESTIMATED, {"washout": 5.0, "authority": (0.05, 0.4), "authority_time": 2.0}),
        ("direct", "gspi_oc3", ESTIMATED, {}),
        ("setpoint", "gspi_oc3", (), {}),
    ],
)
def test_the_controller_commands_what_the_environment_would_do_with_its_decisions(
    mode, baseline, estimated, shaping, tmp_path
):
    from fowt_env.envs.actions import ACTION_MODES
    from fowt_env.envs.decisions import Decisions, DecisionSettings, authority_of, wind_entry

    chosen = {"hold": 3, "smoothing": 0.4, "history": 2} | shaping
    names = ("rotor_speed", "platform_pitch_rate", "previous_action", *estimated, "wind_preview")
    preview = (1.0, 2.5)
    path = write_random_policy(tmp_path / "a.npz", mode, names, preview, baseline=baseline, decisions=chosen)
    task = replace(TASKS["above_rated"], residual_pitch=3.0, setpoint=(0.9, 1.1))
    env = FowtEnv(
        task, action_mode=mode, baseline=baseline, observation=names, wind_preview=preview, duration=20.0,
        **QUICK,
    )  # fmt: skip
    network = read_policy(path)[1]
    observation, _ = env.reset(seed=1)
    settings = DecisionSettings(**chosen)
    wind = wind_entry(settings, ACTION_MODES[mode], env.observed)
    decisions = Decisions(len(observation), settings, 0.1, wind)
    agent = make(f"policy:{path}", TURBINE, 0.1)
    agent.prepare(env.scene)
    agent.reset(env.measurement(agent.preview_times))
    decisions.restart(observation, env.view().action)
    for period in range(120):
        if period % 3 == 0:
            if period:
                decisions.append(observation)
            decision = network(decisions.features())
        command = agent.act(env.measurement(agent.preview_times))
        action = decisions.smooth(decision)
        observation, _, terminated, _, _ = env.step(action)
        assert command == pytest.approx(tuple(env.view().command), rel=1e-9, abs=1e-9)
        assert not terminated
    assert np.any(action != 0.0)
    assert not shaping or 0.0 < authority_of(decisions.constants, decisions.data)


def test_a_policy_whose_authority_has_no_estimated_wind_is_refused(tmp_path):
    decisions = {"hold": 3, "smoothing": 0.4, "history": 2, "authority": [0.3, 0.9]}
    path = write_random_policy(tmp_path / "a.npz", decisions=decisions)
    with pytest.raises(InputError, match="policy file .*a.npz': decisions.authority = .*'estimated_wind'"):
        make(f"policy:{path}", TURBINE, 0.1)


def test_a_policy_runs_without_torch_or_stable_baselines3(tmp_path):
    path = write_random_policy(tmp_path / "a.npz")
    code = (
        "import sys, fowt_env\n"
        "scene = fowt_env.build_scene('oc3_hywind', wind=18.0, fidelity='standard')\n"
        f"frame = fowt_env.simulate(scene, controller='policy:{path}', duration=5.0)\n"
        "assert len(frame) >= 50\n"
        "assert not {'torch', 'stable_baselines3'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_information_is_what_agent_and_baseline_see(tmp_path):
    path = write_random_policy(tmp_path / "a.npz", names=("rotor_speed", "wind_preview"), preview=(2.0,))
    known = make(f"policy:{path}", TURBINE, 0.1).information
    assert known == ("generator_speed", "blade_pitch", "generator_torque", "rotor_speed", "wind_preview")
    assert make(f"policy:{path}", TURBINE, 0.1).name == f"policy:{path}"
    path = write_random_policy(tmp_path / "b.npz", names=("rotor_speed", "estimated_wind"))
    known = set(make(f"policy:{path}", TURBINE, 0.1).information)
    assert {"plant_model", "nacelle_acceleration", "platform_pitch_rate"} <= known
    assert not {"wind_speed", "wind_preview", "surge"} & known
    for name in shipped_agents():
        knows_wind = {"wind_speed", "wind_preview"} & set(information(f"policy:{name}"))
        assert bool(knows_wind) == ("preview" in name)


def test_a_simulation_with_a_policy_repeats_bit_for_bit(tmp_path):
    path = write_random_policy(tmp_path / "a.npz")
    scene = fowt_env.build_scene("oc3_hywind", wind=18.0, fidelity="standard")
    one, other = (fowt_env.simulate(scene, controller=f"policy:{path}", duration=10.0) for _ in range(2))
    assert one.equals(other)


def test_files_that_are_no_policies_are_refused(tmp_path):
    with pytest.raises(InputError, match="unknown policy 'nobody'"):
        make("policy:nobody", TURBINE, 0.1)
    with pytest.raises(InputError, match="no such file"):
        make(f"policy:{tmp_path}/none.npz", TURBINE, 0.1)
    with pytest.raises(InputError, match="runs code of its author"):
        make("policy:model.zip", TURBINE, 0.1)
    np.savez(tmp_path / "pickled.npz", settings=np.array([{"a": 1}], dtype=object))
    with pytest.raises(InputError, match="cannot be read"):
        make(f"policy:{tmp_path}/pickled.npz", TURBINE, 0.1)
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(InputError, match="cannot be read"):
        make(f"policy:{tmp_path}/text.npz", TURBINE, 0.1)
    path = write_random_policy(tmp_path / "future.npz", format=2)
    with pytest.raises(InputError, match="format = 2: must be one of 1"):
        make(f"policy:{path}", TURBINE, 0.1)
    path = write_random_policy(tmp_path / "wide.npz", observation=["rotor_speed"])
    with pytest.raises(InputError, match="9 inputs: its observation has 3"):
        make(f"policy:{path}", TURBINE, 0.1)
    path = write_random_policy(tmp_path / "good.npz")
    with pytest.raises(InputError, match="control_dt = 0.05: must be 0.1 s"):
        make(f"policy:{path}", TURBINE, 0.05)


def rewritten(path, **arrays):
    """The policy file with some arrays replaced, or left out where None."""
    with np.load(path) as file:
        kept = {name: file[name] for name in file.files} | arrays
    np.savez(path, **{name: array for name, array in kept.items() if array is not None})
    return path


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"decisions": {"envs": 8}}, "decisions.envs: unknown key. Allowed: hold, smoothing, history"),
        ({"decisions": {"hold": 0}}, "decisions.hold = 0: must be a whole number from 1 to 100"),
        ({"activation": "tan"}, "activation = 'tan': must be one of .*Did you mean 'tanh'"),
        ({"layers": 3}, "array 'weight_2 is not a file|array 'weight_2'"),
        ({"designed_on": {"platform": "oc3_hywind"}}, "designed_on: is called nominal_plant now, which is"),
        ({"clip_observatio": 3.0}, "clip_observatio: unknown key. Did you mean 'clip_observation'"),
    ],
)
def test_settings_that_no_policy_can_have_are_named(settings, message, tmp_path):
    path = write_random_policy(tmp_path / "a.npz", **settings)
    with pytest.raises(InputError, match=f"policy file .*a.npz.*{message}"):
        read_policy(path)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"settings": np.array("[1]")}, "its settings must be a JSON object"),
        ({"settings": np.array("{")}, "cannot be read"),
        ({"settings": None}, "cannot be read: 'settings'"),
        ({"weight_1": None}, "array 'weight_1'"),
        ({"mean": np.array(["a", "b"])}, "array of <U1: must hold numbers"),
        ({"bias_1": np.zeros(3)}, "do not form a network with two outputs"),
        ({"scale": np.zeros(27)}, "do not form a network with two outputs"),
        ({"bias_0": np.full(5, np.nan)}, "do not form a network with two outputs"),
    ],
)
def test_arrays_that_form_no_network_are_refused(arrays, message, tmp_path):
    path = rewritten(write_random_policy(tmp_path / "a.npz"), **arrays)
    with pytest.raises(InputError, match=f"policy file .*a.npz.*{message}"):
        read_policy(path)


def test_an_array_of_a_later_version_of_its_format_is_refused(tmp_path):
    path = write_random_policy(tmp_path / "a.npz")
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("more.npy", b"\x93NUMPY\x09\x00")
    with pytest.raises(InputError, match=r"array 'more.npy' has the version \(9, 0\)"):
        read_policy(path)


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_agents())
@pytest.mark.parametrize("speed", [14.0, 20.0])
def test_a_shipped_agent_comes_to_rest_in_steady_wind(name, speed):
    """From half a degree of platform pitch beyond rest, as the suite settling has it."""
    scene = fowt_env.build_scene("oc3_hywind", wind=speed, fidelity="standard")
    rest = fowt_env.trim(scene)["PtfmPitch"]
    run = fowt_env.simulate(
        scene, controller=f"policy:{name}", duration=600.0, initial={"PtfmPitch": rest + 0.5}
    )
    late = run[run["Time_[s]"] >= 300.0]
    assert late["RotSpeed_[rpm]"].to_numpy() == pytest.approx(12.1, rel=0.005)
    assert np.ptp(run[run["Time_[s]"] >= 500.0]["BldPitch1_[deg]"].to_numpy()) < 0.05


def test_a_file_with_another_network_for_mpc_clone_is_a_compiled_law(tmp_path):
    with np.load(FILE) as file:
        arrays = {name: file[name] for name in file}
    path = tmp_path / "own.npz"
    np.savez(path, **arrays | {"weight_2": 1.5 * arrays["weight_2"]})
    controller, shipped = (make(name, TURBINE, 0.1) for name in (f"policy:{path}", "mpc_clone"))
    assert isinstance(controller, MPCClone) and controller.name == f"policy:{path}" and is_clone(path)
    changed = np.flatnonzero(controller.network != shipped.network)
    assert 0 < len(changed) <= arrays["weight_2"].size
    assert controller.network[changed] == pytest.approx(1.5 * shipped.network[changed], rel=1e-6)
    assert not is_clone(policy_path(shipped_agents()[0]))
    path.write_bytes(b"no archive")
    assert not is_clone(path)
    with pytest.raises(InputError, match="cannot be read"):
        make(f"policy:{path}", TURBINE, 0.1)
