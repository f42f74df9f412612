"""One policy for all weights of the reward: rewards, points, files, and hypervolumes of fronts."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.controllers.mpc.clone import HIDDEN, N_INPUTS, SHAPES, read_clone
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.studies import weight_conditioned as study
from fowt_env.training.studies.clone_mpc import outputs, settings_of, write_clone


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
