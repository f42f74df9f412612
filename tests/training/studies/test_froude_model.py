"""The Froude-scaled 10 MW platform and turbine: labelled, and similar to their original in all they do."""

from math import sqrt

import numpy as np
import pytest

from fowt_env import build_scene, simulate, trim
from fowt_env.descriptions.platform import DATA, Line, read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.training.studies.froude_model.scale import (
    EXPONENTS,
    platform_text,
    scale_of_power,
    turbine_text,
    write,
)

NAME = "oc3_froude_10mw"
SCALE = 2.0 ** (1.0 / 3.5)


@pytest.fixture(scope="module")
def pair():
    """(original, scaled) in steady wind above rated and a regular wave, each of its own size."""
    scenes = []
    for platform, scale in (("oc3_hywind", 1.0), (NAME, SCALE)):
        sea = {"kind": "regular", "H": 3.0 * scale, "T": 10.0 * sqrt(scale)}
        scenes.append(build_scene(platform, wind=18.0 * sqrt(scale), sea=sea, fidelity="standard"))
    return scenes


def test_the_built_in_files_are_those_that_the_script_writes():
    scale = scale_of_power(10e6)
    assert scale == pytest.approx(SCALE, rel=1e-6)  # the 5 MW are 5 296 610 W times 0.944
    text = (DATA / "platforms" / f"{NAME}.toml").read_text()
    assert text == platform_text(read_platform("oc3_hywind"), NAME, NAME, scale)
    text = (DATA / "turbines" / NAME / "turbine.toml").read_text()
    assert text == turbine_text(read_turbine("nrel5mw"), NAME, scale, "nrel5mw/polars")


def test_every_figure_of_a_description_has_its_power_of_the_scale():
    platform, turbine = read_platform("oc3_hywind"), read_turbine("nrel5mw")
    records = {name: getattr(platform, name) for name in ("environment", "ballast", "hull", "hydro", "tower")}
    records |= {name: getattr(turbine, name) for name in ("rotor", "nacelle", "drivetrain", "pitch_drive")}
    records |= {"torque_law": turbine.torque_law, "gains": turbine.gains["oc3"]}
    records |= {"protection": turbine.protection, "trip": turbine.protection.overspeed}
    for name, record in records.items():
        # scaled platforms do without the tower's modes, a file of their own, and sections: straight taper
        assert set(EXPONENTS[name]) == set(type(record).model_fields) - {"modes", "sections"}, name
    assert set(EXPONENTS["lines"]) == set(Line.model_fields) - {"dynamics"}  # lines hang as catenaries
    # a scaled turbine is rigid
    apart = {"name", "source", "gains", "blade", "blade_structure", "shaft_torsion", "discon", *records}
    assert set(EXPONENTS["turbine"]) == set(type(turbine).model_fields) - apart


def test_the_operating_point_is_that_of_the_original_times_powers_of_the_scale(pair):
    small, large = (trim(scene) for scene in pair)
    for channel, power in (
        ("BldPitch1", 0.0), ("PtfmPitch", 0.0), ("PtfmSurge", 1.0), ("RotSpeed", -0.5), ("RotThrust", 3.0),
        ("GenPwr", 3.5), ("FAIRTEN1", 3.0),
    ):  # fmt: skip
        assert large[channel] == pytest.approx(small[channel] * SCALE**power, rel=1e-5), channel
    assert large["GenPwr"] == pytest.approx(10_000.0, rel=1e-4)


def test_a_closed_loop_in_waves_is_the_original_in_slower_time(pair):
    """Plant, waves, moorings, actuator and controller all scale: rows agree one by one."""
    frames = []
    for scene, scale in zip(pair, (1.0, SCALE), strict=True):
        t = sqrt(scale)
        times = {"dt": 0.1 * t, "control_dt": 0.1 * t, "output_dt": 0.5 * t, "duration": 60.0 * t}
        frames.append(simulate(scene, "pi", initial="zero", **times))
    small, large = frames
    for column, power in (
        ("PtfmSurge_[m]", 1.0), ("PtfmHeave_[m]", 1.0), ("PtfmPitch_[deg]", 0.0), ("RotSpeed_[rpm]", -0.5),
        ("BldPitch1_[deg]", 0.0), ("GenPwr_[kW]", 3.5), ("FAIRTEN2_[kN]", 3.0), ("Wave1Elev_[m]", 1.0),
    ):  # fmt: skip
        expected = small[column].to_numpy() * SCALE**power
        error = np.abs(large[column].to_numpy() - expected).max() / np.abs(expected).max()
        assert error < 1e-5, (column, error)


def test_a_scaled_model_of_a_user_stands_in_a_folder_of_its_own(tmp_path):
    path = write(0.5, tmp_path, "half")
    platform = read_platform(path)
    assert platform.environment.water_depth == 160.0
    assert build_scene(path, wind=8.0, fidelity="reference").turbine.rotor.tip_radius == 31.5


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), 1e9])
def test_a_scale_that_means_nothing_is_refused(scale, tmp_path):
    with pytest.raises(InputError, match="scale"):
        write(scale, tmp_path, "nothing")
    assert not list(tmp_path.iterdir())
