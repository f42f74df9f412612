"""Torque laws of turbine files that leave out what follows from the rest."""

import numpy as np
import pytest

from fowt_env.descriptions.turbine import read_turbine, turbine_file
from fowt_env.errors import InputError
from fowt_env.plant.drivetrain import build_torque_curve, generator_torque

# the IEA 15 MW turbine's figures in the names of ROSCO: VS_RtTq, PC_RefSpd, VS_MinOMSpd, VS_Rgn2K
DIRECT_DRIVE = """
rated_torque = 1.97868e7
minimum_speed = 0.5236
region2_constant = 3.28052e7
"""


def written(tmp_path, law, changes=()):
    """Path of the NREL 5 MW file with another torque law, and lines replaced."""
    text = turbine_file("nrel5mw").read_text()
    start, end = text.index("[torque_law]"), text.index("[gains.oc3]")
    text = f"{text[:start]}[torque_law]\n{law}\n{text[end:]}"
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return path


GEARLESS = (
    ("gear_ratio = 97.0", "gear_ratio = 1.0"),
    ("rated_rotor_speed_rpm = 12.1 ", "rated_rotor_speed_rpm = 7.56 "),
    ('"blade.csv"', '"nrel5mw/blade.csv"'),
    ('"blade_structure.csv"', '"nrel5mw/blade_structure.csv"'),
    ('"polars"', '"nrel5mw/polars"'),
)


def test_a_direct_drive_law_of_roscos_figures_is_complete(tmp_path):
    law = read_turbine(written(tmp_path, DIRECT_DRIVE, GEARLESS)).torque_law
    assert law.rated_speed == pytest.approx(0.79168, rel=1e-4)
    assert law.rated_power == pytest.approx(15e6 / 0.95756, rel=1e-4)  # of the turbine's definition
    assert law.cut_in_speed == 0.5236 < law.region2_start_speed < 0.55
    assert law.speed_filter_corner == pytest.approx(1.0081, rel=0.03)  # of the turbine's DISCON.IN
    assert law.max_torque == pytest.approx(2.17654e7, rel=1e-3)
    curve = build_torque_curve(law)
    speeds = [0.5, 0.53, 0.6, 0.7, 0.77, 0.7917, 0.9]
    torques = [generator_torque(speed, 0.0, curve) for speed in speeds]
    assert torques == sorted(torques) and torques[0] == 0.0
    assert torques[2:4] == pytest.approx([3.28052e7 * speed**2 for speed in speeds[2:4]])
    assert torques[-2:] == [1.97868e7] * 2


def test_region_3_starts_at_rated_speed_where_region_2_stays_below_rated_torque(tmp_path):
    law = read_turbine(written(tmp_path, DIRECT_DRIVE.replace("3.28", "2.28"), GEARLESS)).torque_law
    assert law.transition_speed == pytest.approx(0.99 * law.rated_speed)


def test_what_a_file_gives_is_kept():
    law = read_turbine("nrel5mw").torque_law
    assert (law.transition_speed, law.slip_percent, law.max_torque) == (121.6805, 10.0, 47402.91)


@pytest.mark.parametrize(
    ("law", "part"),
    [
        (DIRECT_DRIVE + "cut_in_speed = 0.5\n", "torque_law.cut_in_speed: conflicts with minimum_speed"),
        (DIRECT_DRIVE.replace("0.5236", "-1.0"), "torque_law.minimum_speed = -1.0: must be a number > 0"),
        (DIRECT_DRIVE.replace("rated_torque = 1.97868e7", ""), "torque_law.rated_torque is missing"),
        (DIRECT_DRIVE.replace("0.5236", "0.9"), "must be cut_in_speed < region2_start_speed"),
    ],
)
def test_a_law_that_is_not_complete_names_what_is_wrong(tmp_path, law, part):
    with pytest.raises(InputError) as caught:
        read_turbine(written(tmp_path, law, GEARLESS))
    assert part in str(caught.value)


def test_a_discon_in_that_is_not_there_is_named(tmp_path):
    text = turbine_file("nrel5mw").read_text().replace('"blade', '"nrel5mw/blade')
    path = tmp_path / "mine.toml"
    path.write_text(
        text.replace('"polars"', '"nrel5mw/polars"').replace("[rotor]", 'discon = "no.IN"\n[rotor]')
    )
    with pytest.raises(InputError, match=r"discon = 'no.IN': must be a file"):
        read_turbine(path)


@pytest.mark.parametrize(
    "name, hub",
    [
        ("nrel5mw", 115926.0),
        ("nrel5mw_openfast", 115926.0),
        ("nrel5mw_tilted", 115926.0),
        ("iea15", 969952.0),
    ],
)
def test_blades_and_hub_make_the_inertia_about_the_shaft(name, hub):
    """Second moment about the shaft by Steiner's rule; hub: HubIner of the decks, kg m2."""
    rotor = read_turbine(name).rotor
    reach = rotor.blade_second_moment + 2.0 * rotor.hub_radius * rotor.blade_first_moment
    reach += rotor.hub_radius**2 * rotor.blade_mass
    assert rotor.inertia == pytest.approx(3.0 * np.cos(rotor.cone) ** 2 * reach + hub, rel=1e-5)
    assert rotor.blade_first_moment / rotor.blade_mass == pytest.approx(
        {"iea15": 27.601, "nrel5mw": 20.475}.get(name, 20.650), abs=5e-4
    )


@pytest.mark.parametrize(
    "change, part",
    [
        ("blade_mass = 40000.0", "rotor: blade_mass = 40000: must be <= mass/blades = 36666.7"),
        (
            "blade_mass = 4000.0",
            "rotor: blade_first_moment = 363231: must be <= 246000, blade_mass at the tip",
        ),
        (
            "blade_first_moment = 5e5",
            "rotor: blade_second_moment = 1.1776e+07: must be >= blade_first_moment",
        ),
        ("blade_first_moment = 1e200", "rotor: blade_first_moment = 1e+200: must be <= "),  # square: inf
        ("blade_second_moment = 12905655.0", "together have 4.2105"),  # about the rotor centre, not the root
        ("", "rotor: blade_first_moment: is missing; blade_mass, blade_first_moment"),
    ],
)
def test_impossible_masses_of_a_blade_are_named(tmp_path, change, part):
    lines = turbine_file("nrel5mw").read_text().replace('"blade', '"nrel5mw/blade').split("\n")
    key = change.split(" ")[0] or "blade_first_moment"
    text = "\n".join(change if line.startswith(f"{key} =") else line for line in lines)
    (tmp_path / "mine.toml").write_text(text.replace('"polars"', '"nrel5mw/polars"'))
    with pytest.raises(InputError) as caught:
        read_turbine(tmp_path / "mine.toml")
    assert part in str(caught.value)
