import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")

from fowt_env.errors import InputError  # noqa: E402
from fowt_env.visual import time_series  # noqa: E402

PNG = b"\x89PNG\r\n\x1a\n"


def run(shift=0.0, n=6001):
    """A run with waves of 10 s, platform pitch of 30 s and a rotor at 12 rpm."""
    t = 0.1 * np.arange(n)
    return pd.DataFrame(
        {
            "Time_[s]": t,
            "Wind1VelX_[m/s]": 18.0 + np.sin(0.05 * t),
            "Wave1Elev_[m]": 2.0 * np.cos(2.0 * np.pi * t / 10.0),
            "RotSpeed_[rpm]": 12.0 + 0.3 * np.sin(2.0 * np.pi * t / 30.0 + shift),
            "BldPitch1_[deg]": 15.0 + np.sin(0.2 * t + shift),
            "GenTq_[kN-m]": np.full(n, 43.09),
            "GenPwr_[kW]": 5000.0 + 50.0 * np.sin(0.2 * t + shift),
            "PtfmPitch_[deg]": 2.0 + np.sin(2.0 * np.pi * t / 30.0 + shift),
            "PtfmSurge_[m]": 12.0 + np.sin(0.05 * t + shift),
            "FAIRTEN1_[kN]": 900.0 + 10.0 * np.sin(0.05 * t),
            "OoPDefl1_[m]": 3.0 + np.sin(1.26 * t + shift),
            "RootMyb1_[kN-m]": 6000.0 + 900.0 * np.sin(1.26 * t + shift),
            "RootMxb1_[kN-m]": 600.0 + 3500.0 * np.cos(1.26 * t + shift),
        }
    )


def test_stacked_plot_has_a_labelled_panel_per_channel(tmp_path):
    path = tmp_path / "new" / "run.png"
    figure = time_series.plot_run(run(), path, title="a run")
    assert path.read_bytes().startswith(PNG) and path.stat().st_size > 20_000
    assert len(figure.axes) == len(time_series.PANELS)
    for axes, (label, channel) in zip(figure.axes, time_series.PANELS, strict=True):
        assert axes.get_ylabel() == label and "(" in label  # the unit
        assert axes.get_legend() is None
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), run()[channel])
    fewer = time_series.plot_run(run().drop(columns="FAIRTEN1_[kN]"))
    assert len(fewer.axes) == len(time_series.PANELS) - 1
    picture, size = fewer._repr_png_()  # what a notebook shows
    assert picture.startswith(PNG) and size["width"] == 864


def test_overlay_draws_each_run_and_the_common_weather_once(tmp_path):
    figure = time_series.plot_runs({"pi": run(), "pi_land": run(1.0)}, tmp_path / "both.svg")
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["pi", "pi_land"]
    lines = {axes.get_ylabel(): len(axes.lines) for axes in figure.axes}
    assert lines["wave\n(m)"] == 1 and lines["rotor speed\n(rpm)"] == 2
    assert (tmp_path / "both.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_rated_and_trip_are_lines_and_what_is_not_scored_is_shaded():
    ratings = {"rated_rotor_speed_[rpm]": 12.1, "overspeed_[rpm]": 15.73, "rated_power_[kW]": 5000.0}
    frame = run()
    plain = time_series.plot_run(frame)
    frame.attrs["ratings"] = ratings
    figure = time_series.plot_run(frame, skip=60.0)
    for axes, before in zip(figure.axes, plain.axes, strict=True):
        levels = [line.get_ydata()[0] for line in axes.lines[1:]]
        channel = next(channel for label, channel in time_series.PANELS if label == axes.get_ylabel())
        expected = {"RotSpeed_[rpm]": [12.1, 15.73], "GenPwr_[kW]": [5000.0]}.get(channel, [])
        assert levels == expected and len(before.lines) == 1
        assert axes.patches[-1].get_x() == 0.0 and axes.patches[-1].get_width() == 60.0
    assert time_series.plot_run(frame, ratings={}).axes[2].lines[1:] == []


def test_names_lose_what_does_not_tell_them_apart():
    from fowt_env.visual.style import LONGEST_NAME, short_names

    names = short_names(["lqr", "policy:ppo_lqr", "mypid:MyPID", "design:gains/mine.json", "x" * 60])
    assert list(names.values())[:4] == ["lqr", "ppo_lqr", "MyPID", "mine"]
    assert len(names["x" * 60]) <= LONGEST_NAME
    assert short_names(["a:Law", "b:Law"]) == {"a:Law": "a:Law", "b:Law": "b:Law"}


def test_a_constant_channel_is_a_flat_line_in_full_numbers():
    figure = time_series.plot_run(run().assign(**{"GenTq_[kN-m]": 43.09 + 7e-15 * np.arange(6001)}))
    axes = next(ax for ax in figure.axes if "torque" in ax.get_ylabel())
    low, high = axes.get_ylim()
    assert high - low > 1.0


def test_spectra_have_one_legend_above_and_no_panel_for_what_is_constant():
    frames = {"pi": run(), "lqr": run(1.0)}
    figure = time_series.plot_spectra(frames)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["pi", "lqr"]
    assert all(axes.get_legend() is None for axes in figure.axes)
    assert figure.axes[0].get_ylabel().startswith("wind")
    steady = {name: frame.assign(**{"Wind1VelX_[m/s]": 18.0}) for name, frame in frames.items()}
    assert len(time_series.plot_spectra(steady).axes) == len(figure.axes) - 1
    tower = {
        name: frame.assign(**{"TwrBsMyt_[kN-m]": frame["RotSpeed_[rpm]"]}) for name, frame in frames.items()
    }
    assert len(time_series.plot_spectra(tower).axes) == len(figure.axes) + 1


def test_spectrum_holds_the_variance_and_peaks_at_the_period():
    frame = run()
    frequency, density = time_series.spectrum(frame["Time_[s]"], frame["Wave1Elev_[m]"])
    assert frequency[np.argmax(density)] == pytest.approx(0.1, abs=0.005)
    assert np.trapezoid(density, frequency) == pytest.approx(2.0, rel=0.01)  # 2^2 / 2


def test_spectra_mark_platform_pitch_wave_and_1p(tmp_path):
    path = tmp_path / "spectra.png"
    figure = time_series.plot_spectra(run(), path, platform_pitch_period=29.9)
    assert path.read_bytes().startswith(PNG)
    marks = sorted(line.get_xdata()[0] for line in figure.axes[1].lines[1:])
    assert marks == pytest.approx([1.0 / 29.9, 0.1, 0.2], abs=0.005)
    texts = " ".join(text.get_text() for text in figure.axes[0].texts)
    assert "platform pitch" in texts and "wave peak" in texts and "1P" in texts
    still = time_series.plot_spectra(run().assign(**{"Wave1Elev_[m]": 0.0}))
    assert [text.get_text().split()[0] for text in still.axes[0].texts] == ["1P"]


def test_a_controller_has_the_same_colour_in_whatever_order_and_company():
    from fowt_env.visual.style import style_numbers

    assert style_numbers(["mine", "mpc", "gspi_oc3", "other"]) == [2, 1, 0, 3]
    assert style_numbers(["gspi_oc3", "mpc"]) == [0, 1] and style_numbers(["lqr", "mpc"]) == [2, 1]
    assert style_numbers(["a", "b", "c"]) == [0, 1, 2]
    figure = time_series.plot_runs({"mpc": run(), "gspi_oc3": run(1.0)})
    axes = next(each for each in figure.axes if len(each.lines) > 1)
    assert [line.get_color() for line in axes.lines[:2]] == ["#D55E00", "#0072B2"]


def test_wrong_input_is_named_and_leaves_no_file(tmp_path):
    with pytest.raises(InputError, match="unknown extension"):
        time_series.plot_run(run(), tmp_path / "run.docx")
    with pytest.raises(InputError, match="no runs"):
        time_series.plot_runs({})
    with pytest.raises(InputError, match=r"Time_\[s\]"):
        time_series.plot_run(run().drop(columns="Time_[s]"))
    with pytest.raises(InputError, match="platform_pitch_period = 0"):
        time_series.plot_spectra(run(), platform_pitch_period=0.0)
    with pytest.raises(InputError, match="evenly"):
        time_series.spectrum([0.0, 0.1, 0.5, 0.6], [0.0, 1.0, 0.0, 1.0])
    assert not list(tmp_path.iterdir())


def test_plotting_leaves_pyplot_alone():
    code = (
        "import sys, pandas as pd\nfrom fowt_env.visual import time_series\n"
        "time_series.plot_run(pd.DataFrame({'Time_[s]': [0.0, 1.0], 'RotSpeed_[rpm]': [12.0, 12.0]}))\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_plots_can_be_imported_from_the_folder_and_no_other_name():
    import fowt_env.visual

    assert fowt_env.visual.plot_run is time_series.plot_run
    assert all(callable(getattr(fowt_env.visual, name)) for name in fowt_env.visual.__all__)
    with pytest.raises(AttributeError, match="plot_rum"):
        _ = fowt_env.visual.plot_rum
