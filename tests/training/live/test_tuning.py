"""What the live page computes, without a browser."""

import json
import shlex
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from fowt_env.controllers import make
from fowt_env.controllers.design.saved_files import load_design
from fowt_env.controllers.registry import CONTROLLERS
from fowt_env.errors import InputError
from fowt_env.run.simulation import simulate
from fowt_env.training.cli import app as cli
from fowt_env.training.evaluation.metrics import turbine_metrics
from fowt_env.training.live import tuning
from fowt_env.training.live.tuning import Law, Weather, law_of

SHORT = Weather(duration=150.0)


def figures_of(**values):
    """Figures of one seed, in which every metric is 1 but those given."""
    return dict.fromkeys(tuning.METRICS, 1.0) | values


def test_a_law_is_read_back_from_its_text_and_holds_no_setting_at_its_start():
    law = law_of("pi[KP=1.25,gain_schedule_pitch=1]")
    assert law == Law("pi", (("KP", 1.25),)) and law_of(str(law)) == law
    assert law_of("mymodule:Mine") == Law("mymodule:Mine")
    assert tuning.changed(law, {"KP": 1.0, "KI": 1.0}) == Law("pi")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("pi[KP=9]", ("pi KP = 9", "0.3", "4")),
        ("pi[kp=1]", ("setting of pi", "'kp'", "KP")),
        ("pi[KP]", ("'KP'", "KEY=VALUE")),
        ("lqr[share=nan]", ("share",)),
        ("pi[KP=1", ("'pi[KP=1'", "NAME[KEY=VALUE,...]")),
        ("", ("''", "NAME")),
        ("rosco[kp=2]", ("rosco", "floating_feedback")),
    ],
)
def test_a_law_that_is_wrong_is_refused_with_key_value_and_range(text, words):
    with pytest.raises(InputError) as caught:
        law_of(text)
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"duration": 20.0}, ("duration = 20", "120")),
        ({"seed": -1}, ("seed = -1",)),
        ({"wind": "none"}, ("'none'", "wind")),
        ({"wind": "ntm:x"}, ("ntm:x",)),
        ({"platform": "oc3"}, ("oc3_hywind",)),
    ],
)
def test_conditions_that_are_wrong_are_refused_by_name(changes, words):
    with pytest.raises(InputError) as caught:
        replace(SHORT, **changes).scene()
    assert all(word in str(caught.value) for word in words)


def test_sliders_start_at_the_built_in_law():
    """The law of all settings at their start has the parameters of the name."""
    turbine = SHORT.scene().turbine
    for name in ("pi", "gspi_oc3", "pi_tuned", "floating_feedback"):
        space = tuning.tunable(name)
        moved = space.make(dict(space.start), turbine, tuning.CONTROL_DT)
        np.testing.assert_allclose(moved.parameters, make(name, turbine, 0.1).parameters, rtol=1e-12)
        for key, (low, high) in space.ranges.items():
            assert low <= space.start[key] <= high
    assert set(CONTROLLERS) < set(tuning.choices(("mine:Law",))) and "mine:Law" in tuning.choices(
        ("mine:Law",)
    )


def test_the_picture_is_the_run_in_means_of_half_a_second():
    shown = tuning.picture(SHORT, law_of("pi[KP=1.5]"))
    frame = simulate(SHORT.scene(), tuning.made(law_of("pi[KP=1.5]"), SHORT.scene()), 150.0)
    assert shown.note == "" and len(shown.series["time"]) == 300
    third = frame["RotSpeed_[rpm]"].to_numpy()[10:15]
    assert shown.series["RotSpeed_[rpm]"][2] == pytest.approx(third.mean(), rel=1e-6)
    assert shown.film["azimuth"][-1] > 360.0 * 20  # unwrapped: 12 rpm for 150 s are 30 turns
    assert not np.allclose(
        shown.series["RotSpeed_[rpm]"], tuning.picture(SHORT, Law("pi")).series["RotSpeed_[rpm]"]
    )
    expected = turbine_metrics(frame, SHORT.scene().turbine, 60.0)
    assert tuning.figures(SHORT, law_of("pi[KP=1.5]")) == pytest.approx(expected, nan_ok=True)


class Fails:
    """Commands constant torque and too little blade pitch, and no torque from 70 s on."""

    def reset(self, measurement):
        pass

    def act(self, measurement):
        return (0.0 if measurement.time > 70.0 else 40e3), 0.1


def test_a_run_that_ends_early_has_its_rows_a_note_and_no_figures(monkeypatch):
    monkeypatch.setattr(tuning, "made", lambda law, scene: Fails())
    weather = replace(SHORT, seed=1007)
    shown = tuning.picture(weather, Law("falls"))
    assert "overspeed" in shown.note and shown.series["time"][-1] < 60.0
    assert all(np.isnan(value) for value in tuning.figures(weather, Law("falls")).values())
    assert tuning.paired([tuning.figures(weather, Law("falls"))], [figures_of()]) == {}


def test_ratios_are_of_root_mean_squares_for_deviations_and_have_an_interval_from_four_seeds_on():
    name, mean = "RotSpeed_std_[rpm]", "GenPwr_capped_mean_[kW]"
    first = [figures_of(**{name: 3.0, mean: 10.0}), figures_of(**{name: 4.0, mean: 30.0})]
    second = [figures_of(**{name: 6.0, mean: 20.0}), figures_of(**{name: 8.0, mean: 30.0})]
    found = tuning.paired(first, second)
    assert found[name].first == pytest.approx(np.sqrt(12.5)) and found[name].ratio == pytest.approx(2.0)
    assert found[mean].ratio == pytest.approx(50.0 / 40.0)
    assert np.isnan(found[name].low) and not found[name].is_sure
    found = tuning.paired(2 * first, 2 * second)
    assert found[name].low == pytest.approx(2.0) and found[name].is_sure
    assert found[mean].low < 1.25 < found[mean].high
    assert all(not ratio.is_sure for ratio in tuning.paired(2 * first, 2 * first).values())


def test_the_verdict_names_what_is_sure_alone_and_in_which_direction():
    sure = tuning.Ratio(1.0, 0.8, 0.8, 0.7, 0.9)
    unsure, more = sure._replace(high=1.1), tuning.Ratio(1.0, 1.3, 1.3, 1.2, 1.4)
    ratios = {
        "RotSpeed_std_[rpm]": sure, "PtfmPitch_std_[deg]": unsure, "torque_travel_[kN-m/s]": more,
        "GenPwr_capped_mean_[kW]": more,
    }  # fmt: skip
    words = tuning.verdict(ratios, 6)
    better, worse = words.split("; ")
    assert better.startswith("better: rotor-speed std") and "power up to rated" in better
    assert worse.startswith("worse: torque travel") and "platform-pitch" not in words
    assert "platform-pitch" in tuning.verdict(ratios, 1)  # of one seed nothing is sure, and all is told
    assert tuning.verdict({}, 6) == "no difference"


def test_seeds_of_the_ratios_are_validation_seeds_and_the_shown_one_is_among_them():
    for seed in (3, 1002):
        weathers = tuning.further_seeds(replace(SHORT, seed=seed), 4)
        seeds = [each.seed for each in weathers]
        assert seeds[0] == seed and len(set(seeds)) == 4 and min(seeds[1:]) >= 1000


def test_responses_start_at_the_trim_and_end_at_rated_speed():
    found = tuning.responses(SHORT, Law("pi"))
    before = found["time"] < 0.0
    step, gust = found["step RotSpeed_[rpm]"], found["gust RotSpeed_[rpm]"]
    assert np.ptp(step[before]) < 0.01 and abs(step[-1] - 12.1) < 0.15
    assert step.max() > 12.3 and gust[found["time"] < 12.0].max() > 12.5
    assert found["step BldPitch1_[deg]"][-1] > found["step BldPitch1_[deg]"][0] + 1.0  # of 14 and 15 m/s


def test_the_linear_loop_says_why_there_is_none():
    assert "below rated" in tuning.linear(replace(SHORT, wind="8"), Law("pi")).note
    assert "no fixed compiled law" in tuning.linear(SHORT, Law("mpc_preview")).note
    with_one = tuning.linear(SHORT, Law("pi"))
    assert with_one.note == "" and with_one.margins.stable and len(with_one.poles) > 10


@pytest.mark.nightly
def test_blades_that_follow_at_once_have_margins_and_the_least_damped_motion_is_named():
    """VolturnUS-S has no drag in still water, so heave decays by radiation alone."""
    loop = tuning.linear(Weather("iea15_volturnus_s", "15", "none"), Law("lqr"))
    words = dict(tuning.loop_words(loop))
    assert words["stable"] == "yes" and "heave" in words["least damping"]
    assert 1.0 < loop.margins.loops["blade_pitch_command"].gain < 100.0


def test_a_loop_that_is_unstable_has_no_margins():
    """Land gains make platform and rotor speed oscillate."""
    words = dict(tuning.loop_words(tuning.linear(replace(SHORT, wind="14"), Law("pi_land"))))
    assert words["stable"] == "NO" and words["gain margin"] == words["sensitivity peak"] == "–"


@pytest.mark.parametrize(
    "text", ["pi[KP=1.3]", "gspi_oc3[KI=0.7]", "floating_feedback[pitch_gain=0.05]", "mpc[surge=0.5]"]
)
def test_a_saved_law_is_the_law_of_its_settings(text, tmp_path):
    law, scene = law_of(text), SHORT.scene()
    path = tuning.save(SHORT, law, tmp_path / "mine.json", "fowt tune")
    loaded, wanted = load_design(path)(scene.turbine, 0.1), tuning.made(law, scene)
    assert type(loaded) is type(wanted)
    np.testing.assert_array_equal(loaded.parameters, wanted.parameters)
    assert getattr(loaded, "settings", None) == getattr(wanted, "settings", None)
    assert json.loads(path.read_text())["command"] == "fowt tune"


def test_a_design_of_settings_is_checked_key_by_key(tmp_path):
    path = tuning.save(
        SHORT, law_of("floating_feedback[pitch_gain=0.05]"), tmp_path / "mine.json", "fowt tune"
    )
    good = json.loads(path.read_text())
    for key, value, words in (
        ("low_pass", "fast", "settings.low_pass"), ("scheduled", 1, "must be a bool"),
        ("signal", "x", "signal"), ("pitch_gain", float("inf"), "not a JSON number"),
        ("high_pass", -1.0, "high_pass"),
    ):  # fmt: skip
        path.write_text(json.dumps(good | {"settings": good["settings"] | {key: value}}))
        with pytest.raises(InputError, match=words):
            load_design(path)
    with pytest.raises(InputError, match="'ipc'.*cannot be saved"):
        tuning.save(SHORT, Law("ipc"), tmp_path / "ipc.json", "")


def test_the_command_opens_the_page_with_the_same_laws_and_conditions():
    first, second = Law("pi"), law_of("lqr[share=0.4]")
    weather = Weather("oc3_hywind", "eog:18", "none", 7, 300.0)
    words = shlex.split(tuning.command_of(weather, first, second))
    given = dict(zip(words[2::2], words[3::2], strict=True))
    assert words[:2] == ["fowt", "tune"]
    assert law_of(given.pop("--controller")) == second and law_of(given.pop("--against")) == first
    assert given == {"--wind": "eog:18", "--sea": "none", "--seed": "7", "--duration": "300"}


@pytest.mark.parametrize("option", ["--controller", "--against", "--further"])
def test_an_unknown_controller_is_refused_before_a_page_is_served(option, monkeypatch):
    server = pytest.importorskip("fowt_env.training.live.server", reason="the extra `live` is missing")
    monkeypatch.setattr(server, "tune", lambda *_, **__: pytest.fail("served"))
    done = CliRunner().invoke(cli.app, ["tune", option, "lqq", "--no-browser"])
    assert done.exit_code == 2 and "unknown controller 'lqq'. Did you mean 'lqr'?" in done.stderr
