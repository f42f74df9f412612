import numpy as np
import pandas as pd
import pytest

pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")

from fowt_env.analysis.campbell import Campbell  # noqa: E402
from fowt_env.errors import InputError  # noqa: E402
from fowt_env.visual.response import (  # noqa: E402
    plot_boxes,
    plot_campbell,
    plot_raos,
    plot_schedule,
    response_operator,
)

PNG = b"\x89PNG\r\n\x1a\n"


def run(gain=2.0, noise=0.0, n=24000):
    """Waves around 0.1 Hz, a surge that follows them `gain` times, and a noisy platform pitch."""
    rng = np.random.default_rng(1)
    t = 0.1 * np.arange(n)
    wave = sum(
        0.05 * np.cos(2.0 * np.pi * f * t + p)
        for f, p in zip(np.linspace(0.06, 0.16, 80), rng.uniform(0, 7, 80), strict=True)
    )
    return pd.DataFrame(
        {
            "Time_[s]": t,
            "Wave1Elev_[m]": wave,
            "PtfmSurge_[m]": 15.0 + gain * wave,
            "PtfmPitch_[deg]": 3.0 + 0.5 * wave + noise * rng.standard_normal(n),
            "RotSpeed_[rpm]": 12.0 + 0.1 * gain * wave,
        }
    )


def schedule(shift=0.0):
    wind = np.arange(4.0, 25.0, 1.0)
    return pd.DataFrame(
        {"Wind_[m/s]": wind, "RotSpeed_[rpm]": np.minimum(wind + shift, 12.1), "BldPitch1_[deg]": wind}
    )


def test_the_response_operator_of_a_linear_system_is_its_gain():
    frequency, amplitude, coherence = response_operator(run(gain=2.0), "PtfmSurge_[m]")
    assert frequency.min() < 0.07 and frequency.max() > 0.15
    np.testing.assert_allclose(amplitude, 2.0, rtol=1e-6)
    np.testing.assert_allclose(coherence, 1.0, rtol=1e-6)


def test_noise_lowers_the_coherence_and_hardly_the_gain():
    _, amplitude, coherence = response_operator(run(noise=1.0), "PtfmPitch_[deg]")
    assert np.median(coherence) < 0.9
    assert np.median(amplitude) == pytest.approx(0.5, rel=0.05)


def test_boxes_are_the_quartiles_of_the_samples_that_are_kept():
    frames = {"a": run(1.0), "b": run(3.0)}
    figure = plot_boxes({"calm": frames, "rough": {"b": run(6.0)}}, skip=100.0)
    axes = next(ax for ax in figure.axes if "rotor speed" in ax.get_ylabel())
    assert len(axes.patches) == 3
    kept = frames["b"][frames["b"]["Time_[s]"] >= 100.0]["RotSpeed_[rpm]"]
    box = axes.patches[1].get_path().vertices[:, 1]
    np.testing.assert_allclose((box.min(), box.max()), np.percentile(kept, [25, 75]), rtol=1e-12)


def test_a_schedule_has_a_line_per_table_and_only_panels_with_data():
    figure = plot_schedule({"one": schedule(), "two": schedule(1.0)})
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title(loc="left") for axes in shown] == ["rotor speed (rpm)", "blade pitch (deg)"]
    np.testing.assert_array_equal(shown[0].lines[1].get_ydata(), schedule(1.0)["RotSpeed_[rpm]"])


def test_the_schedule_marks_rated_wind():
    figure = plot_schedule(schedule(), rated_wind=11.4)
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert all(axes.lines[-1].get_xdata()[0] == 11.4 for axes in shown)
    assert any("11.4" in text.get_text() for axes in shown for text in axes.texts)


def test_raos_have_phase_within_half_a_turn_and_coherence_from_below_the_platform_s_resonance():
    late = run()
    late["PtfmSurge_[m]"] = np.roll(late["PtfmSurge_[m]"], 120)  # 12 s: more than a turn at 0.1 Hz
    figure = plot_raos(late, platform_pitch_period=30.0)
    amplitude, phase, coherence = (figure.axes[row * 2] for row in range(3))
    angles = np.concatenate([line.get_ydata() for line in phase.lines if len(line.get_ydata()) > 2])
    angles = angles[np.isfinite(angles)]
    assert np.abs(angles).max() <= 180.0 and np.ptp(angles) > 270.0  # it does pass the ends
    for line in phase.lines:  # and no line is drawn from one end to the other
        assert not (np.abs(np.diff(line.get_ydata())) > 180.0).any()
    assert amplitude.get_xlim()[0] < 1.0 / 30.0
    assert coherence.get_ylim() == (0.0, 1.0) and figure.get_suptitle()


def test_every_plot_is_written_where_it_is_asked_for(tmp_path):
    plot_raos({"a": run(), "b": run(noise=1.0)}, tmp_path / "rao.png", "RAO")
    plot_boxes({"calm": {"": run()}}, tmp_path / "boxes.png")
    plot_schedule(schedule(), tmp_path / "steady.svg")
    assert (tmp_path / "rao.png").read_bytes().startswith(PNG)
    assert (tmp_path / "boxes.png").read_bytes().startswith(PNG)
    assert b"<svg" in (tmp_path / "steady.svg").read_bytes()[:600]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot_boxes({}), "no cases"),
        (lambda: plot_boxes({"a": {}}), "no runs"),
        (lambda: plot_boxes({"a": {"x": run()[["Time_[s]", "Wave1Elev_[m]"]]}}), "no run has"),
        (lambda: plot_schedule(pd.DataFrame({"a": [1.0]})), "Wind_"),
        (lambda: plot_raos(run().assign(**{"Wave1Elev_[m]": 0.0})), "no waves"),
        (lambda: plot_raos(run().drop(columns="Wave1Elev_[m]")), "no column 'Wave1Elev"),
        (lambda: plot_raos(run().drop(index=5)), "evenly"),
        (lambda: plot_raos(run(), skip=2399.0), "rows remain"),
    ],
)
def test_what_cannot_be_plotted_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_a_campbell_diagram_has_a_line_per_mode_and_per_harmonic():
    speed = np.array([0.0, 0.5, 1.0])
    found = Campbell(speed, {"low": np.array([0.3, 0.3, 0.31]), "shaft": np.full(3, 9.0)}, {})
    axes = plot_campbell(found, harmonics=(1, 3), rated_speed=0.8).axes[0]
    assert [line.get_label() for line in axes.lines if line.get_label()[0] != "_"] == ["low"]
    lines = [line.get_xydata() for line in axes.lines]
    assert np.allclose(lines[1][-1], [30.0 / np.pi, 3.0 / (2.0 * np.pi)])
    assert any(np.allclose(line[:, 0], 0.8 * 30.0 / np.pi) for line in lines)
    assert axes.get_ylim()[1] < 0.4
    assert {text.get_text() for text in axes.texts} == {"1P", "3P", "rated 7.639 rpm"}
    with pytest.raises(InputError, match="at least two rotor speeds"):
        plot_campbell(Campbell(speed[:1], {"low": np.array([0.3])}, {}))
