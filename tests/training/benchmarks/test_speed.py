"""The benchmarks on tiny settings: what they compute and write, never how fast this machine is."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.envs import FowtEnv
from fowt_env.errors import InputError
from fowt_env.scene.build import build_scene
from fowt_env.training.benchmarks import accuracy as benchmark_accuracy
from fowt_env.training.benchmarks import envs as benchmark_envs
from fowt_env.training.benchmarks import evaluation as benchmark_evaluation
from fowt_env.training.benchmarks import speed as benchmark

STILL = "still water, no wind"
TINY = {"seconds": 2.0, "repeats": 1, "calls": 20}


def test_a_kind_of_scene_has_a_time_for_every_load_and_none_for_absent_ones():
    row = benchmark.speed([STILL], **TINY).iloc[0]
    assert row["kind"] == STILL
    assert row["wave_components"] == 0
    for load in benchmark.LOADS:
        assert row[f"{load} (us)"] >= 0.0
    for figure in ("step_us", "step_x", "loop_x", "simulate_x", "calibration_ms"):
        assert row[figure] > 0.0
    scene = benchmark.TIMED_SCENES[STILL].scene()
    assert scene.model.aero is None and scene.model.hydro.waves is None
    with pytest.raises(InputError, match="full, standart"):
        benchmark.speed(["full, standart"], **TINY)


def test_the_table_is_headed_by_machine_versions_and_commit(tmp_path):
    table = pd.DataFrame({"kind": ["a"], "step_us": [1.5]})
    path = benchmark.write_csv(table, tmp_path / "speed.csv", ["start: 2"])
    comments = [line for line in path.read_text().splitlines() if line.startswith("#")]
    for key in ("machine:", "versions:", "commit:", "calibration:", "start: 2"):
        assert any(key in line for line in comments)
    pd.testing.assert_frame_equal(pd.read_csv(path, comment="#"), table)


def test_the_front_keeps_what_nothing_beats():
    error = [1.0, 0.1, 0.1, 0.5, np.nan]
    speed = [100.0, 10.0, 20.0, 5.0, 1000.0]
    assert benchmark_accuracy.pareto(error, speed).tolist() == [True, False, True, False, False]


def test_a_study_goes_on_where_it_was_interrupted_and_errs_by_nothing_against_itself(tmp_path):
    out = tmp_path / "accuracy.csv"
    base = benchmark_accuracy.Variant("integrator and step", "rk4", 0.05, "bem", "exact")
    sea = {"kind": "regular", "H": 3.0, "T": 8.0}
    arguments = {"duration": 5.0, "finest": 0.05, "wind": 18.0, "sea": sea, "out": out}
    first = benchmark_accuracy.accuracy((1,), chosen=[base], **arguments)
    # the check at twice the step differs from the reference, the reference's own step does not
    assert first["worst"][0] > 0.0
    assert first["worst"][1] == 0.0
    said = []
    coarse = replace(base, dt=0.1)
    second = benchmark_accuracy.accuracy(
        (1,), chosen=[base, coarse], progress=lambda text, done, total: said.append(text), **arguments
    )
    assert [text.split(": ")[1] for text in said] == ["reference", coarse.name]
    assert second["variant"].tolist() == pd.read_csv(out, comment="#")["variant"].tolist()
    assert second["worst"][2] == pytest.approx(first["worst"][0], rel=1e-6)  # the check's step


@pytest.mark.parametrize("level", ["standard", "fast"])
def test_the_variant_named_a_level_has_the_parts_and_the_step_of_that_level(level):
    found = {benchmark_accuracy.LEVELS[v.name]: v for v in benchmark_accuracy.select(["levels"])}[level]
    scene = build_scene(wind=18.0, fidelity=level)
    parts = (scene.rotor, *(scene.options[part] for part in ("wave_loads", "integrator")))
    assert (found.rotor, found.wave_loads, found.integrator) == parts
    assert found.dt == scene.dt
    assert dict(found.options).get("mooring", "catenary") == scene.options["mooring"]


def summarised(variants, axes):
    """Table of made-up rows of an accuracy study."""
    rows = {"variant": variants, "axis": axes, "worst_of": "yaw", "kernel_factor": 110.0, "worst": 0.1}
    return pd.DataFrame(rows | {"real_time_factor": 100.0} | dict.fromkeys(benchmark_accuracy.CHANNELS, 0.1))


def test_a_thinned_sea_keeps_the_strongest_components_with_their_phases():
    sea = {"kind": "jonswap", "Hs": 6.0, "Tp": 11.0, "heading": 30.0}
    waves = build_scene(sea=sea, seed=4, fidelity="reference").model.hydro.waves
    few = build_scene(sea=benchmark_accuracy._thinned(waves, 7), fidelity="reference").model.hydro.waves
    kept = np.isin(waves.omega, few.omega)
    assert kept.sum() == 7
    assert waves.amplitude[kept].min() > waves.amplitude[~kept].max()
    for name in ("amplitude", "phase", "cos_heading", "sin_heading"):
        np.testing.assert_allclose(getattr(few, name), getattr(waves, name)[kept], rtol=1e-12, atol=1e-12)


def test_memory_of_an_environment_is_what_no_other_one_holds():
    envs = [FowtEnv(fidelity="fast", duration=10.0)]
    envs.append(envs[0].twin())
    own = benchmark_envs.own_bytes(envs)
    shared = max(a.nbytes for a in benchmark_envs.arrays_of(envs[0]._config))
    assert 100.0 < own < shared


def test_the_cost_of_an_evaluation_has_a_row_per_stage_and_the_size_of_a_run(tmp_path):
    suite = tmp_path / "tiny.toml"
    suite.write_text(
        'version = 1\ndescription = "d"\nsource = "s"\nwind = "rotor-averaged"\nduration = 15.0\nskip = 5.0\n'
        '[[case]]\nname = "a"\nwind = 16.0\n'
    )
    table = benchmark_evaluation.evaluation_cost(2, suite, "pi").set_index("stage")
    assert tuple(table.index) == benchmark_evaluation.STAGES
    assert (table["ms per run"] > 0.0).all()
    assert table.loc["reading its row", "ms per run"] < table.loc["whole run", "ms per run"]
    assert 0.01 < table.loc["whole run", "MB per run"] < 1.0
    with pytest.raises(InputError, match="count = 0"):
        benchmark_evaluation.evaluation_cost(0, suite)


def test_levels_over_steps_include_the_levels_themselves_and_stay_out_of_the_sweep():
    axis = "steps of the levels"
    steps = benchmark_accuracy.select([axis])
    assert {v.axis for v in steps} == {axis}
    assert set(benchmark_accuracy.LEVELS) <= {v.name for v in steps}
    assert axis not in {v.axis for v in benchmark_accuracy.variants()}
    # what a variant leaves open is that of a level with the same waves
    assert {(v.wave_loads, v.fidelity) for v in steps} == {("exact", "reference"), ("fast", "standard")}


def test_points_of_another_platform_are_those_of_the_same_variants(tmp_path):
    table, path = summarised(["a", "b"], "x"), tmp_path / "accuracy.png"
    figure = benchmark_accuracy.plot_accuracy(table.iloc[:1], path, beside=("other", table))
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    assert len(lines["other, the same variants"].get_xdata()) == 1 and path.stat().st_size > 1000
    with pytest.raises(InputError, match="does not exist"):
        benchmark_accuracy.read_accuracy(tmp_path / "none.csv")


def test_a_made_box_covers_the_rotor_with_the_wind_that_was_asked_for():
    rotor = read_turbine(read_platform("iea15_volturnus_s").turbine).rotor
    box = benchmark.made_box(rotor, seconds=60.0)
    assert box["u"].shape == (240, box["z"].size, box["y"].size)
    assert box["y"][-1] >= rotor.tip_radius and box["z"][-1] >= rotor.hub_height + rotor.tip_radius
    assert np.allclose(np.diff(box["z"]), np.diff(box["z"])[0])
    assert box["u"].mean() == pytest.approx(18.0, abs=2.0)
