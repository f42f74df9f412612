"""Tables, files and plots of the linear study, and the sweep's guard of the scoring seeds."""

import json

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.errors import InputError
from fowt_env.training.design.plots import BODE, FREQUENCIES, plot_bode, plot_damping, plot_poles
from fowt_env.training.design.sweeps import (
    mode_table,
    models_over,
    save_models,
    save_study,
    sweep,
    transmission_zeros,
    zero_table,
    zeros_over,
)


@pytest.fixture(scope="module")
def models():
    return models_over(build_scene("oc3_hywind", wind=8.0, fidelity="reference"), (8.0, 13.0, 20.0))


def test_modes_are_those_of_the_system_matrix(models):
    table = mode_table(models)
    for wind, model in models.items():
        rows = table[table["wind_[m/s]"] == wind]
        values = np.linalg.eigvals(model.A)
        values = values[values.imag > 1e-6]
        assert sorted(rows["period_[s]"]) == pytest.approx(sorted(2.0 * np.pi / values.imag))
        assert {"surge", "heave", "platform_pitch", "yaw"} <= set(rows["mode"])


def test_the_response_vanishes_at_a_transmission_zero(models):
    """Just off the zero the transfer function is far smaller than a little further away."""
    model = models[20.0]
    row, column = model.output_index("rotor_speed"), model.inputs.index("blade_pitch_command")

    def transfer(s):
        x = np.linalg.solve(s * np.eye(len(model.states)) - model.A, model.B[:, column])
        return abs(model.C[row] @ x)

    zeros = [z for z in transmission_zeros(model) if 0.15 < abs(z.imag) < 0.3]
    assert zeros
    for zero in zeros:
        assert transfer(zero + 1e-7) < 1e-3 * transfer(zero + 0.01)


def test_pitch_to_speed_has_right_half_plane_zeros_near_rated_and_none_where_the_pitch_rests(models):
    assert [model.pitch_rests for model in models.values()] == [True, False, False]
    table = zero_table(models)
    assert set(table["wind_[m/s]"]) == {13.0}
    assert table["imag_[rad/s]"].max() == pytest.approx(0.2, abs=0.03)  # at the platform's own frequency


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_saved_models_read_back_as_they_were(models, tmp_path, suffix):
    path = save_models(models, tmp_path / f"m{suffix}")
    data = np.load(path) if suffix == ".npz" else json.loads(path.read_text())
    assert list(data["winds"]) == [8.0, 13.0, 20.0]
    assert tuple(data["states"]) == models[8.0].states
    np.testing.assert_array_equal(np.array(data["A"])[1], models[13.0].A)
    np.testing.assert_array_equal(np.array(data["D"])[2], models[20.0].D)
    place = models[20.0].index("blade_pitch")
    assert np.array(data["x"])[2, place] == pytest.approx(np.array(data["u"])[2, 1])
    with pytest.raises(InputError, match="must end with .json or .npz"):
        save_models(models, tmp_path / "m.mat")


def test_a_study_is_a_folder_of_tables_models_and_plots(models, tmp_path):
    pytest.importorskip("matplotlib")
    written = save_study(models, tmp_path / "study")
    assert {path.name for path in written} == {
        "modes.csv", "zeros.csv", "models.json", "models.npz", "poles.png", "damping.png", "bode.png",
    }  # fmt: skip
    assert all(path.stat().st_size > 50 for path in written)


def test_plots_show_every_mode_and_leave_out_a_pitch_that_rests(models):
    pytest.importorskip("matplotlib")
    poles = plot_poles(models).axes[0]
    assert len(poles.collections) >= sum(len(model.modes()) for model in models.values())
    bode = plot_bode(models).axes
    assert len(bode[0].lines) == 2  # blade pitch: above rated only
    assert len(bode[1].lines) == 3
    for axes, (source, output, _, factor, _) in zip(bode[:3], BODE, strict=True):
        response = models[20.0].response(FREQUENCIES, (source,))[:, models[20.0].output_index(output), 0]
        np.testing.assert_allclose(10.0 ** (axes.lines[-1].get_ydata() / 20.0), np.abs(factor * response))
    for axes in bode[3:6]:  # phases are continuous, and the winds begin beside each other
        angles = [line.get_ydata() for line in axes.lines]
        assert all(np.abs(np.diff(angle)).max() < 45.0 for angle in angles)
        assert max(abs(angle[0] - angles[0][0]) for angle in angles) < 180.0 and -90.0 <= angles[0][0] < 270.0
    values = np.concatenate([np.linalg.eigvals(model.A) for model in models.values()])
    slow = sorted(value.real for value in values if abs(value.imag) < 1e-9 and value.real > -2.0)
    places = [c.get_offsets()[0] for c in poles.collections if len(c.get_offsets())]
    drawn = sorted(x for x, y in places if y == 0.0)
    assert drawn == pytest.approx(slow) and len(slow) >= len(models)  # the rotor speed's own
    damping = plot_damping(models).axes[1]
    every = [mode for model in models.values() for mode in model.modes()]
    surge = [mode.damping_ratio for mode in every if mode.name == "surge"]
    np.testing.assert_allclose(damping.lines[0].get_ydata(), surge)
    for plot in (plot_poles, plot_damping, plot_bode):
        with pytest.raises(InputError, match="no linear models"):
            plot({})


def test_a_sweep_refuses_scoring_seeds_and_unknown_settings():
    with pytest.raises(InputError, match=r"seeds = \[1001, 7\]: must be 1000 or more"):
        sweep([{}], "ntm_18", [1001, 7])
    with pytest.raises(InputError, match="Did you mean 'torque_rate'"):
        sweep([{"torque_rat": 1.0}], "ntm_18", [1001])


@pytest.mark.nightly
def test_a_sweep_scores_each_variant_beside_the_baseline(tmp_path):
    out = tmp_path / "sweep.csv"
    variants = [{"travel": 1.0}, {"travel": 0.6}]
    table = sweep(variants, "ntm_18", [1001], out, duration=120.0, skip=20.0)
    assert list(table["variant"]) == ["gspi_oc3", "{'travel': 1.0}", "{'travel': 0.6}"]
    travel = table["blade_pitch_travel_[deg/s]"]
    assert travel[2] < 0.8 * travel[1]
    assert len(out.read_text().splitlines()) == 4


def test_the_table_of_zeros_is_that_of_the_models(models):
    """13 and 20 m/s on OC3-Hywind: a right-half-plane zero at the platform's pitch, and none."""
    scene = next(iter(models.values())).scene
    table = zeros_over(scene, (13.0, 20.0)).set_index("wind_[m/s]")
    zero = zero_table({13.0: models[13.0]}).iloc[0]
    assert table["zero_real_[rad/s]"][13.0] == pytest.approx(zero["real_[rad/s]"])
    assert table["zero_period_[s]"][13.0] == pytest.approx(table["platform_period_[s]"][13.0], rel=0.05)
    assert table["zero_real_[rad/s]"][20.0] == 0.0 and np.isnan(table["zero_period_[s]"][20.0])
    # the published gains leave the platform damped (theory.md, section 4)
    assert (table["pi_pitch_damping_[-]"] > 0.0).all()
    with pytest.raises(InputError, match="8: the blade pitch is at its limit"):
        zeros_over(scene, (8.0,))
