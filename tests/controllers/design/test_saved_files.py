"""Designs as files: what is read back is what was saved, and whatever is wrong is named."""

import json

import numpy as np
import pytest

from fowt_env import build_scene
from fowt_env.controllers import make
from fowt_env.controllers.design.closed_loop import closed_loop_matrix
from fowt_env.controllers.design.pi import design_pi
from fowt_env.controllers.design.saved_files import load_design, lqr_settings, save_design
from fowt_env.controllers.lqr.design import LQGSettings, design_model, design_models
from fowt_env.controllers.lqr.law import LQR
from fowt_env.controllers.pi import PI, PISettings
from fowt_env.errors import InputError
from fowt_env.training.design.sweeps import models_over
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.provenance import controller_code

GOOD = {"KP": 0.006, "KI": 0.0009, "gain_schedule_pitch": 0.11}


@pytest.fixture(scope="module")
def windy():
    return build_scene("oc3_hywind", wind=18.0, fidelity="reference")


@pytest.fixture(scope="module")
def models(windy):
    return models_over(windy, (11.0, 13.0, 16.0, 19.0, 22.0, 25.0))


@pytest.fixture
def pi_file(tmp_path, windy):
    return save_design(tmp_path / "mine.json", "pi", windy, GOOD, "by hand")


@pytest.fixture(scope="module")
def lqr_file(tmp_path_factory, windy):
    settings = lqr_settings(LQGSettings(share=0.6), [design_model(windy, wind) for wind in (12, 13)])
    return save_design(tmp_path_factory.mktemp("designs") / "lq.json", "lqr", windy, settings, "by hand")


def test_a_saved_pi_is_the_pi_of_its_settings(pi_file, turbine):
    loaded = make(f"design:{pi_file}", turbine, 0.1)
    settings = PISettings.published(turbine, KP=0.006, KI=0.0009, gain_schedule_pitch=0.11)
    np.testing.assert_array_equal(loaded.parameters, PI(settings, 0.1).parameters)
    assert loaded.name == "mine"


@pytest.mark.parametrize("control_dt", [0.05, 0.1])
def test_a_saved_lqr_has_the_same_bits_as_the_one_designed(lqr_file, windy, turbine, control_dt):
    loaded = make(f"design:{lqr_file}", turbine, control_dt)
    models = [design_model(windy, wind) for wind in (12, 13)]
    np.testing.assert_array_equal(
        loaded.parameters, LQR(turbine, control_dt, LQGSettings(share=0.6), models=models).parameters
    )


def test_a_saved_lqr_does_not_follow_a_changed_plant(lqr_file, turbine):
    loaded = make(f"design:{lqr_file}", turbine, 0.1)
    before = loaded.parameters.copy()
    loaded.prepare(build_scene("oc3_hywind", wind=18.0, mooring=False, fidelity="reference"))
    np.testing.assert_array_equal(loaded.parameters, before)


def test_a_saved_default_lqr_gives_the_blocks_of_the_named_one(tmp_path, windy, turbine):
    settings = lqr_settings(LQGSettings(), design_models(windy))
    path = save_design(tmp_path / "d.json", "lqr", windy, settings, "fowt design lqr")
    named = make("lqr", turbine, 0.1)
    named.prepare(windy)
    np.testing.assert_array_equal(make(f"design:{path}", turbine, 0.1).parameters, named.parameters)


def test_evaluate_scores_a_design_by_its_file_and_notices_its_edit(pi_file):
    name = f"design:{pi_file}"
    table = evaluate([name, "pi"], "ntm_18", duration=20.0, skip=5.0)
    assert list(table["status"]) == ["ok", "ok"]
    assert table["RotSpeed_std_[rpm]"].iloc[0] != table["RotSpeed_std_[rpm]"].iloc[1]
    before = controller_code(name)
    pi_file.write_text(pi_file.read_text().replace("0.006", "0.005"))
    assert controller_code(name) != before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 1}, "version = 1: must be 2"),
        ({"format": "other"}, "is not a controller design"),
        ({"kind": "pid"}, "unknown kind 'pid'. Did you mean 'pi'"),
        ({"turbine": "iea15mw"}, "cannot control 'nrel5mw'; it was designed for the platform 'oc3_hywind'"),
        ({"settings": GOOD | {"KP": "x"}}, "settings.KP = x: must be a finite number"),
        ({"settings": GOOD | {"KP": -1.0}}, "KP = -1.0: must be non-negative"),
        ({"settings": {"KP": 1.0, "KI": 1.0}}, "settings.gain_schedule_pitch is missing"),
        ({"settings": GOOD | {"gain_schedule_pich": 1.0}}, "Did you mean 'gain_schedule_pitch'"),
        ({"settings": []}, "settings: must be an object"),
    ],
)
def test_a_wrong_entry_is_named_with_file_key_and_value(pi_file, turbine, change, message):
    pi_file.write_text(json.dumps(json.loads(pi_file.read_text()) | change))
    with pytest.raises(InputError) as error:
        load_design(pi_file)(turbine, 0.1)
    assert message in str(error.value) and "mine.json" in str(error.value)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda s: s["lqg"].update(torque_rate=0.0), "torque_rate = 0.0: must be finite and positive"),
        (lambda s: s["lqg"].pop("power"), "settings.lqg.power is missing"),
        (lambda s: s["models"][1].update(wind=15.0), "models[1].wind = 15: must be 1 m/s above"),
        (lambda s: s["models"][0]["A"].pop(), "models[0].A: must be 11 x 11 finite numbers"),
        (lambda s: s["models"][0].update(trim=None), "models[0].trim: must be 6 finite numbers"),
        (lambda s: s.update(models=[]), "must list models of at least two winds"),
    ],
)
def test_a_wrong_entry_of_an_lqr_is_named(lqr_file, tmp_path, edit, message):
    content = json.loads(lqr_file.read_text())
    edit(content["settings"])
    path = tmp_path / "lq.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError) as error:
        load_design(path)
    assert message in str(error.value) and "lq.json" in str(error.value)


def test_files_that_are_no_designs_are_refused(tmp_path, windy, turbine):
    with pytest.raises(InputError, match="does not exist"):
        make(f"design:{tmp_path / 'none.json'}", turbine, 0.1)
    broken = tmp_path / "broken.json"
    broken.write_text('{"format": "fowt-design", "version": NaN}')
    with pytest.raises(InputError, match="not valid JSON: NaN"):
        make(f"design:{broken}", turbine, 0.1)
    with pytest.raises(InputError, match="must end with .json"):
        save_design(tmp_path / "d.toml", "pi", windy, {}, "")
    with pytest.raises(InputError, match="KP is missing"):
        save_design(tmp_path / "d.json", "pi", windy, {}, "")


def test_the_rotor_loop_has_the_wanted_frequency_and_damping_at_every_wind(models, turbine):
    found = design_pi(models, turbine, 0.15, 0.8)
    assert [row["wind_[m/s]"] for row in found.table] == [13.0, 16.0, 19.0, 22.0, 25.0]  # 11: pitch at rest
    for row in found.table:
        assert row["omega_[rad/s]"] == pytest.approx(0.15, rel=0.03)
        assert row["zeta_[-]"] == pytest.approx(0.8, rel=0.03)


def test_the_rotor_loop_is_that_of_the_assembled_closed_loop_of_a_bare_rotor(models, turbine):
    """Platform and aerodynamic damping taken out and the lag and filter made fast, the whole plant agrees."""
    found = design_pi(models, turbine, 0.2, 0.7)
    settings = PISettings.published(
        turbine, KP=found.KP, KI=found.KI, gain_schedule_pitch=found.gain_schedule_pitch,
        speed_filter_corner=1e4,
    )  # fmt: skip
    model = models[19.0]
    a, names = closed_loop_matrix(model, settings)
    speed, blade = names.index("rotor_speed"), names.index("blade_pitch")
    keep = [speed, blade, names.index("filtered_speed"), names.index("speed_integral")]
    a = a[np.ix_(keep, keep)]
    a[0, 0] = 0.0  # the design leaves the rotor's own aerodynamic damping out
    a[1] *= 1e3  # actuator lag of 0.2 ms
    root = max(np.linalg.eigvals(a), key=lambda value: value.imag)
    row = next(row for row in found.table if row["wind_[m/s]"] == 19.0)
    assert abs(root) == pytest.approx(row["omega_[rad/s]"], rel=1e-3)
    assert -root.real / abs(root) == pytest.approx(row["zeta_[-]"], rel=3e-3)


def test_a_faster_rotor_loop_takes_damping_from_the_platform(models, turbine):
    slow, fast = (design_pi(models, turbine, omega, 0.7) for omega in (0.1, 0.4))
    for a, b in zip(slow.table, fast.table, strict=True):
        assert a["platform_zeta_[-]"] > b["platform_zeta_[-]"]
    assert fast.table[0]["platform_zeta_[-]"] < 0.0 < slow.table[-1]["platform_zeta_[-]"]


def test_the_published_schedule_makes_a_slower_loop(models, turbine):
    published, loop = (design_pi(models, turbine, 0.2, 0.7, s) for s in ("published", "loop"))
    assert published.gain_schedule_pitch == pytest.approx(0.5 * loop.gain_schedule_pitch)
    for a, b in zip(published.table, loop.table, strict=True):
        assert a["omega_[rad/s]"] < 0.85 * b["omega_[rad/s]"]


def test_bad_wishes_are_named(models, turbine):
    with pytest.raises(InputError, match="omega = -0.2"):
        design_pi(models, turbine, -0.2, 0.7)
    with pytest.raises(InputError, match="zeta = nan"):
        design_pi(models, turbine, 0.2, float("nan"))
    with pytest.raises(InputError, match="Did you mean 'published'"):
        design_pi(models, turbine, 0.2, 0.7, "publised")
    with pytest.raises(InputError, match="winds: must include at least two"):
        design_pi({11.0: models[11.0]}, turbine, 0.2, 0.7)
