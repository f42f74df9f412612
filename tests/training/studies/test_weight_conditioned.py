"""One policy for all weights of the reward: rewards, points, files, and hypervolumes of fronts."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from fowt_env.controllers.mpc.clone import BIAS_0, ESTIMATOR, HIDDEN, N_INPUTS, SHAPES, read_clone
from fowt_env.controllers.policy.network_file import read_policy
from fowt_env.descriptions.array_files import read_arrays
from fowt_env.envs.rewards import N_TERMS
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.studies import weight_conditioned as study
from fowt_env.training.studies.clone_mpc import outputs, settings_of, write_clone

ROTOR, PLATFORM, TRAVEL = (
    list(study.PRICED).index(n) for n in ("rotor_speed", "platform_motion", "pitch_travel")
)


def terms_of(costs):
    terms = np.zeros((1, N_TERMS))
    terms[0, study.COLUMNS] = study.BEST - costs
    return terms


def test_the_reward_is_zero_for_usual_costs_at_every_point_and_a_failure_costs_many_decisions():
    for point in ([0.0, 0.0, 0.0], [1.0, -1.0, 0.5]):
        assert study.rewards_at([point], terms_of(study.USUAL), np.zeros(1)) == pytest.approx(0.0, abs=1e-12)
        better = study.rewards_at([point], terms_of(0.5 * study.USUAL), np.zeros(1))
        assert better == pytest.approx(0.5 * study.REWARD_SCALE)
    lost = study.rewards_at([[0.0, 0.0, 0.0]], terms_of(study.USUAL), np.ones(1))
    assert lost == pytest.approx(-study.REWARD_SCALE * study.FAILURE_COST)


def test_a_point_trades_rotor_speed_against_platform_pitch_and_prices_travel():
    middle, moved = study.weights_at([[0.0, 0.0, 0.0], [1.0, 0.0, -0.5]])
    assert moved[ROTOR] / middle[ROTOR] == pytest.approx(4.0)
    assert moved[PLATFORM] / middle[PLATFORM] == pytest.approx(0.25)
    assert moved[TRAVEL] / middle[TRAVEL] == pytest.approx(3.0**0.5)


def test_a_point_has_the_settings_of_mpc_between_those_that_are_swept():
    found = [study.settings_at((trade, 0.0, 0.0)) for trade in (-1.0, 0.25, 1.0)]
    assert [each.speed for each in found] == pytest.approx([0.3, 1.3, 2.4])
    assert [each.platform_pitch for each in found] == pytest.approx([1.5, 1.05, 0.4])
    cheap = study.settings_at((0.0, 1.0, 0.5))
    assert (cheap.shaft, cheap.travel) == pytest.approx((0.1 / 3.0, 1.0))
    assert cheap.shaft < study.settings_at((0.0, -1.0, 0.5)).shaft


def test_a_network_with_points_among_its_inputs_is_a_clone_at_each_point(tmp_path):
    rng, n, size = np.random.default_rng(0), N_INPUTS, len(study.TRADES)
    shapes = SHAPES | {"mean": (n + size,), "scale": (n + size,), "weight_0": (HIDDEN, n + size)}
    network = {name: rng.normal(size=shape) for name, shape in shapes.items()}
    network["scale"] = 1.0 + network["scale"] ** 2
    inputs, point = rng.normal(size=n), np.array([0.5, -1.0, 0.2])
    source, moved = tmp_path / "clone.npz", tmp_path / "moved.npz"
    write_clone(source, study.parted(network), settings_of(), {"rounds": 2})
    whole = outputs(network, np.append(inputs, point))
    settings, at = read_clone(study.at_point(source, point, moved))
    assert settings.about == {"rounds": 2, "point": list(point)}
    assert outputs(at, inputs) == pytest.approx(whole, abs=1e-5)
    assert outputs(read_clone(source)[1], inputs) != pytest.approx(whole, abs=1e-3)
    law = SimpleNamespace(parameters=np.zeros(ESTIMATOR))
    study.Points(source).set(SimpleNamespace(_baseline=law), point)
    assert law.parameters[BIAS_0 : BIAS_0 + HIDDEN] == pytest.approx(at["bias_0"], abs=1e-5)
    assert not law.parameters[:BIAS_0].any() and not law.parameters[BIAS_0 + HIDDEN :].any()


def runs_of(**metrics):
    """Return a run of all metrics 1 with those given."""
    return dict.fromkeys(METRICS, 1.0) | {"torque_travel_[kN-m/s]": 0.1} | metrics


def test_the_cost_of_a_front_is_its_area_less_what_limits_take_and_lost_runs_cost_most():
    front = object.__new__(study.Front)
    front.suite, front.shares = read_suite(study.SUITE), np.array([0.5, 0.3, 0.2])
    front.reference = [runs_of()] * 3
    power, travel = front.suite.score.power, study.AXES[2]
    good = [runs_of(**values(0.5, 0.8, 0.9))] * 3
    assert front.point(good) == pytest.approx([0.5, 0.8])
    assert front.cost([good]) == pytest.approx(-0.5 * 0.2)
    mixed = [runs_of(**values(speed, 0.8, 0.9)) for speed in (0.5, 0.6, 0.7)]
    expected = np.sqrt(0.5 * 0.5**2 + 0.3 * 0.6**2 + 0.2 * 0.7**2)
    assert front.point(mixed)[0] == pytest.approx(expected)
    far = [runs_of(**values(0.5, 0.8, 1.02 * 0.96 * 1.01))] * 3
    assert front.point(far) == pytest.approx([0.53, 0.83])
    weak = [runs_of(**values(0.5, 0.8), **{power: study.SEARCHED_ENERGY / 1.01})] * 3
    assert front.point(weak) == pytest.approx([0.53, 0.83])
    assert travel in front.suite.limits.relative
    assert front.cost([good, [None, good[0], good[0]]]) == pytest.approx(study.LOST / 6.0 - 0.1)


def test_an_episode_keeps_its_point_until_its_last_observation():
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    from gymnasium.spaces import Box

    class Two(vec_env.VecEnv):
        env = SimpleNamespace(terms=np.vstack([terms_of(study.USUAL)] * 2), envs=["first", "second"])

        def __init__(self):
            super().__init__(2, Box(-5.0, 5.0, (1,)), Box(-1.0, 1.0, (2,)))

        def reset(self):
            return np.zeros((2, 1), dtype=np.float32)

        def step_async(self, actions):
            pass

        def step_wait(self):
            infos = [{"TimeLimit.truncated": False}, {"TimeLimit.truncated": False}]
            infos[1]["terminal_observation"] = np.array([7.0], dtype=np.float32)
            return np.ones((2, 1), dtype=np.float32), np.zeros(2), np.array([False, True]), infos

        def close(self):
            pass

        def get_attr(self, name, indices=None):
            return [None, None]

        set_attr = env_method = env_is_wrapped = None

    set_ = []
    points = SimpleNamespace(set=lambda env, point: set_.append((env, point.copy())))
    env = study.trading(Two(), 0, points)
    first = env.reset()
    assert first.shape == (2, 4) and env.observation_space.shape == (4,)
    assert not np.array_equal(first[0, 1:], first[1, 1:])
    later, rewards, _, infos = env.step(np.zeros((2, 2)))
    assert later[:, 0].tolist() == [1.0, 1.0]
    assert np.array_equal(later[0, 1:], first[0, 1:]) and not np.array_equal(later[1, 1:], first[1, 1:])
    assert np.array_equal(infos[1]["terminal_observation"], np.append([7.0], first[1, 1:]).astype(np.float32))
    assert rewards == pytest.approx([0.0, -study.REWARD_SCALE * study.FAILURE_COST])
    assert infos[1]["episode"]["failed"] and infos[1]["episode"]["l"] == 1
    assert [env for env, _ in set_] == ["first", "second", "second"]
    assert set_[2][1] == pytest.approx(later[1, 1:], abs=1e-6)


def test_a_policy_file_at_a_point_has_the_weights_of_the_point_in_its_first_layer(tmp_path):
    from fowt_env.controllers.policy.controller import policy_path

    rng = np.random.default_rng(0)
    arrays = read_arrays(policy_path("ppo_lqr"), 1 << 26)
    width = arrays["bias_0"].size
    source = tmp_path / "policy.npz"
    np.savez(source, **arrays, point_weight=rng.normal(size=(width, 3)).astype(np.float32))
    settings, network = read_policy(source)
    point = (0.5, -1.0, 0.0)
    moved_settings, moved = read_policy(study.at_point(source, point, tmp_path / "moved.npz"))
    trade = read_arrays(source, 1 << 26)["point_weight"]
    assert moved.biases[0] == pytest.approx(network.biases[0] + trade @ np.array(point), abs=1e-6)
    assert all(np.array_equal(a, b) for a, b in zip(moved.weights, network.weights, strict=True))
    assert moved_settings["about"]["point"] == list(point)
    assert moved_settings["baseline"] == settings["baseline"]


def test_areas_and_volumes_are_those_of_unions_of_boxes():
    points = np.array([[0.5, 0.8], [0.8, 0.5], [0.9, 0.9], [1.2, 0.1]])
    assert study.area(points, (1.0, 1.0)) == pytest.approx(0.5 * 0.2 + 0.2 * 0.5 - 0.2 * 0.2)
    assert study.area(points[3:], (1.0, 1.0)) == 0.0
    rng = np.random.default_rng(1)
    boxes, corner = rng.uniform(0.2, 1.2, (6, 3)), np.array([1.0, 1.0, 1.1])
    boxes[0] = 0.1, 0.1, 1.15  # beyond the corner in one axis
    drawn = rng.uniform(size=(200_000, 3)) * corner
    inside = (drawn[:, None, :] >= boxes).all(axis=2).any(axis=1)
    assert study.volume(boxes, corner) == pytest.approx(inside.mean() * corner.prod(), abs=0.004)
    assert study.volume(boxes + 2.0, corner) == 0.0


def table_of(**controllers):
    """Return a table of all cases and four seeds with metrics of 1 or {controller: {metric: value}}."""
    suite = read_suite(study.SUITE)
    rows = []
    for name, metrics in {study.REFERENCE: {}, **controllers}.items():
        for case in suite.cases:
            for seed in (1, 2, 3, 4):
                row = dict.fromkeys(METRICS, 1.0) | {"torque_travel_[kN-m/s]": 0.1} | metrics
                head = {"controller": name, "case": case.name, "seed": seed, "status": study.OK}
                rows.append(head | {"weight_[-]": suite.weights[case.name]} | row)
    return pd.DataFrame(rows)


def values(speed, pitch, travel=0.9, **others):
    return dict(zip(study.AXES, (speed, pitch, travel), strict=True)) | others


def test_settings_beyond_a_limit_without_energy_or_with_lost_runs_are_left_out():
    power = read_suite(study.SUITE).score.power
    table = table_of(
        good=values(0.5, 0.8),
        far=values(0.4, 0.4, 1.1),
        weak=values(0.4, 0.4, **{power: 0.98}),
        lost=values(0.3, 0.3),
    )
    table.loc[(table["controller"] == "lost") & (table["seed"] == 2), "status"] = "tripped"
    ratios, left_out = study.measured(table)
    assert ratios["good"][0] == pytest.approx([0.5, 0.8, 0.9])
    assert set(left_out) == {"far", "weak", "lost"}
    assert "travel" in left_out["far"] and "energy" in left_out["weak"] and "lost" in left_out["lost"]


def test_settings_are_chosen_by_what_they_add_to_the_hypervolumes():
    table = table_of(
        a=values(0.5, 0.8),
        b=values(0.8, 0.5),
        worse=values(0.9, 0.9),
        best=values(0.6, 0.6),
        c=values(0.6, 0.6, 0.95),
    )
    assert study.chosen(table)[0] == "best"
    assert set(study.chosen(table)) == {"best", "a", "b"}


@pytest.mark.slow
def test_the_exported_policy_decides_as_the_trained_one_at_each_point(tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO

    monkeypatch.setitem(study.SETTINGS, "algorithm.batch_size", 64)
    source = tmp_path / "clone.npz"
    zeros = np.zeros((HIDDEN, len(study.TRADES)))
    write_clone(source, read_clone()[1] | {"point_weight": zeros}, settings_of(), {})
    out = tmp_path / "out"
    study.train(source, out, seed=0, steps=128, envs=2, threads=1, device="cpu", seconds=np.inf)
    model = PPO.load(out / "model.zip", device="cpu")
    settings, _ = read_policy(out / "policy.npz")
    assert settings["about"]["steps"] == 128
    curve = pd.read_csv(out / "curve.csv")
    assert curve["decisions"].tolist() == [128]
    rng, point = np.random.default_rng(0), (0.7, -0.3, 1.0)
    network = read_policy(study.at_point(out / "policy.npz", point, tmp_path / "at.npz"))[1]
    normal = rng.normal(size=(8, network.mean.size)).astype(np.float32)  # as the model sees them
    trained = model.predict(
        np.hstack([normal, np.tile(point, (8, 1))]).astype(np.float32), deterministic=True
    )[0]
    assert network(network.mean + network.scale * normal) == pytest.approx(trained, abs=1e-5)
    assert np.ptp(trained, axis=0).min() > 1e-3
