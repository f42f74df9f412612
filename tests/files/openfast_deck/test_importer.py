"""A deck becomes a platform and turbine: masses in closed form, HydroDyn's tables, moorings, refusals.

Expected values are worked out here from what the manuals of OpenFAST's modules say of their keys."""

import math

import numpy as np
import pytest
from small_deck import HYDRODYN, NAMES, ROTOR_TABLE, write_deck

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.conversion import mass_properties
from fowt_env.files.openfast_deck.deck import read_deck
from fowt_env.files.openfast_deck.hydrodyn import read_hydrodyn
from fowt_env.files.openfast_deck.importer import import_deck
from fowt_env.files.openfast_deck.mooring import read_mooring
from fowt_env.plant.drivetrain import build_drivetrain


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    """(platform, turbine, report, folder) of the small deck."""
    folder = tmp_path_factory.mktemp("deck")
    report = import_deck(write_deck(folder), folder / "out", name="small")
    platform = read_platform(folder / "out" / "platform.toml")
    return platform, read_turbine(platform.turbine), report, folder / "out"


def platform_of(folder, **changes):
    """Platform of a changed deck."""
    import_deck(write_deck(folder, **changes), folder / "out")
    return read_platform(folder / "out" / "platform.toml")


def turbine_of(folder, **changes):
    """Turbine of a changed deck."""
    return read_turbine(platform_of(folder, **changes).turbine)


def refused(folder, **changes):
    """Text of the InputError that a changed deck is refused with; nothing may be written."""
    with pytest.raises(InputError) as caught:
        import_deck(write_deck(folder, **changes), folder / "out")
    assert not (folder / "out").exists()
    return str(caught.value)


# --------------------------------------------------------------------------- masses and geometry


def of_blade(power, about):
    """Moment of the mass of a blade, kg m^power: 260 to 140 kg/m over 50 m, 150 kg at its tip."""
    places = np.polynomial.Polynomial([-about, 1.0]) ** power
    along = (places * np.polynomial.Polynomial([260.0, -120.0 / 50.0])).integ()
    return along(50.0) - along(0.0) + 150.0 * places(50.0)


def test_rotor_has_the_mass_properties_of_its_tapered_blades_with_their_tips_and_hub(imported):
    rotor, cone = imported[1].rotor, math.radians(3.0)
    blade, first, second = (of_blade(power, about=-2.0) for power in range(3))  # about the rotor centre
    mass = 3e4 + 3 * blade
    assert (blade, mass) == pytest.approx((10150.0, 60450.0))
    assert rotor.mass == pytest.approx(mass)
    assert rotor.cm_offset == pytest.approx((-3e4 - 3 * first * math.sin(cone)) / mass, rel=1e-6)
    assert rotor.inertia == pytest.approx(2e5 + 3 * second * math.cos(cone) ** 2, rel=1e-5)
    across = 1.5 * second * math.cos(cone) ** 2 + 3 * second * math.sin(cone) ** 2 + 3e4
    assert rotor.inertia_diameter == pytest.approx(across - mass * rotor.cm_offset**2, rel=1e-5)
    assert rotor.blade_mass == pytest.approx(blade)
    assert rotor.blade_first_moment == pytest.approx(of_blade(1, about=0.0), rel=1e-5)  # BldNodes lumps
    assert rotor.blade_second_moment == pytest.approx(of_blade(2, about=0.0), rel=1e-5)
    assert rotor.cone == pytest.approx(cone)
    assert rotor.shaft_tilt == pytest.approx(math.radians(5.0))


@pytest.mark.parametrize(
    ("potential", "shadow", "intensity", "expected"),
    [
        ("0", "False", "0.0 0.1 0.2", {}),
        ("1", "0", "0.0 0.1 0.2", {"tower_potential": "potential"}),
        ("2", "True", "0.0 0.1 0.2", {"tower_potential": "bak", "tower_shadow": "powles"}),
        ("0", "2", "0.06 0.1 0.2", {"tower_shadow": "eames"}),
    ],
)
def test_the_tower_s_influence_on_the_wind_is_taken_with_its_table(
    tmp_path, potential, shadow, intensity, expected
):
    first, second, third = intensity.split()
    rows = [
        ("0        TwrPotent", f"{potential} TwrPotent"),
        ("0        TwrShadow", f"{shadow} TwrShadow"),
        ("TwrElev TwrDiam TwrCd\n(m) (m) (-)", "TwrElev TwrDiam TwrCd TwrTI\n(m) (m) (-) (-)"),
        ("10.0 6.0 0.7", f"10.0 6.0 0.7 {first}"),
        ("45.0 5.6 0.4", f"45.0 5.6 0.4 {second}"),
        ("80.0 4.0 0.6", f"80.0 4.0 0.6 {third}"),
    ]
    report = import_deck(write_deck(tmp_path, AeroDyn=rows), tmp_path / "out")
    platform = read_platform(tmp_path / "out" / "platform.toml")
    assert platform.options == expected
    assert any("influence of the tower" in row[0] for row in report.figures) == bool(expected)
    sections = platform.tower.sections
    assert sections.diameter.tolist() == [6.0, 5.6, 4.0] and sections.height[-1] == 80.0
    assert sections.drag_coefficient.tolist() == [0.7, 0.4, 0.6]
    # the default where AeroDyn does not read it
    assert sections.turbulence_intensity.tolist() == [0.1 if first == "0.0" else 0.06, 0.1, 0.2]


def test_a_tower_influence_that_aerodyn_does_not_have_is_refused(tmp_path):
    rows = [("0        TwrPotent", "3        TwrPotent")]
    with pytest.raises(InputError, match="TwrPotent = 3: must be a whole number from 0 to 2"):
        import_deck(write_deck(tmp_path, AeroDyn=rows), tmp_path / "out")


def test_rotor_centre_lies_along_the_tilted_shaft(imported):
    rotor = imported[1].rotor
    assert rotor.overhang == pytest.approx(4.0 * math.cos(math.radians(5.0)))
    assert rotor.hub_height == pytest.approx(82.0 + 4.0 * math.sin(math.radians(5.0)))


def test_nacelle_inertia_is_about_its_own_centre_of_mass(imported):
    nacelle = imported[1].nacelle
    assert nacelle.inertia == pytest.approx((0.0, 0.0, 1.0e6 - 1e5 * (2.0**2 + 0.5**2)))
    assert (nacelle.cm_downwind, nacelle.cm_left, nacelle.cm_height) == (2.0, 0.5, 81.5)


def test_the_generator_s_inertia_is_of_its_own_shaft_and_counts_with_the_square_of_the_gear_ratio(imported):
    turbine = imported[1]
    assert turbine.drivetrain.generator_inertia == 500.0
    shaft = build_drivetrain(turbine)
    assert shaft.inertia_row == pytest.approx(turbine.rotor.inertia + 90.0**2 * 500.0)


def test_tower_has_the_mass_of_its_taper_with_the_yaw_bearing_at_its_top(imported):
    tower = imported[0].tower
    # 3300 to 1100 kg/m (AdjTwMa 1.1) over 70 m: moments about the base, and 5000 kg at the top
    mass = 2200.0 * 70.0 + 5000.0
    first = 3300.0 * 70.0**2 / 2 - 2200.0 * 70.0**2 / 3 + 5000.0 * 70.0
    second = 3300.0 * 70.0**3 / 3 - 2200.0 * 70.0**3 / 4 + 5000.0 * 70.0**2
    assert tower.mass == pytest.approx(mass)
    assert tower.cm_height == pytest.approx(10.0 + first / mass, rel=1e-5)
    assert tower.inertia[0] == pytest.approx(second - first**2 / mass, rel=1e-5)
    assert (tower.base_diameter, tower.top_diameter) == (6.0, 4.0)
    # in even wind the load of the deck's tower: Simpson's rule is exact for two straight lines' product
    load = sum(35.0 / 6.0 * (d0 * c0 + (d0 + d1) * (c0 + c1) + d1 * c1)
               for (d0, c0), (d1, c1) in (((6.0, 0.7), (5.6, 0.4)), ((5.6, 0.4), (4.0, 0.6))))  # fmt: skip
    assert tower.drag_coefficient == pytest.approx(load / (5.0 * 70.0), rel=1e-5)


def test_tower_bends_with_the_shapes_damping_and_factors_of_its_file(imported):
    platform, _, report, folder = imported
    modes = platform.tower.modes
    assert modes.height_fraction == (0.0, 1.0) and modes.mass_density == pytest.approx((3300.0, 1100.0))
    assert modes.fore_aft_stiffness == (2e12, 1e12)  # AdjFASt 2
    assert modes.side_side_stiffness == pytest.approx((2.7e12, 0.9e12))  # AdjSSSt 0.9
    assert modes.fore_aft == ((0.8, 0.4, -0.1, -0.2, 0.1), (20.0, -10.0, -5.0, -3.0, -1.0))
    assert modes.side_side == ((0.7, 0.3, 0.0, 0.0, 0.0), (-9.0, 4.0, 3.0, 2.0, 1.0))
    assert modes.fore_aft_damping == (0.01, 0.02) and modes.side_side_damping == (0.03, 0.04)
    assert modes.fore_aft_tuner == (1.0, 1.1) and modes.side_side_tuner == (0.95, 1.05)
    assert (modes.top_mass, modes.elements) == (5000.0, 300)
    assert "TwrFADmp" in (folder / "platform.toml").read_text()
    assert not any("tower mode" in what for what, _ in report.differences)  # the deck has them off


def test_blades_bend_with_the_shapes_damping_and_factors_of_their_file(imported):
    _, turbine, report, folder = imported
    blade = turbine.blade_structure
    assert blade.span_fraction.tolist() == [0.0, 1.0] and blade.mass_density.tolist() == [260.0, 140.0]
    assert blade.structural_twist == pytest.approx(np.radians([12.0, -3.0]), rel=1e-9)
    assert blade.flapwise_stiffness.tolist() == [1.5e9, 4.5e8]  # AdjFlSt 1.5
    assert blade.edgewise_stiffness.tolist() == [1.6e9, 3.2e8]  # AdjEdSt 0.8
    assert blade.flap_1 == (0.9, 0.5, -0.3, -0.2, 0.1) and blade.flap_2 == (-2.0, -3.0, 1.0, 6.0, -1.0)
    assert blade.edge_1 == (0.6, 0.7, -0.4, 0.3, -0.2)
    assert blade.damping_ratio == pytest.approx((0.005, 0.006, 0.007)) and blade.flap_tuner == (1.2, 1.3)
    assert (blade.tip_mass, blade.elements) == (150.0, 400)
    assert (turbine.shaft_torsion.stiffness, turbine.shaft_torsion.damping) == (3e8, 4e6)
    text = (folder / "turbine" / "turbine.toml").read_text()
    assert "BldFlDmp" in text and "DTTorSpr" in text
    said = dict(report.differences)
    assert said["first blade flap mode"] == 'rigid; with the option blades = "modes" as in the deck'
    assert "drivetrain torsion" not in said  # the deck has none


@pytest.mark.parametrize(
    "changes",
    [
        {"blade": [("BldFl1Sh(2)", "BldOtherSh(2)")]},
        {"blade": [("70.0 3e8", "70.0 0.0")]},
        {"ElastoDyn": [("3.0E8  DTTorSpr", "0.0  DTTorSpr"), ("True   FlapDOF1", "True  DrTrDOF")]},
    ],
)
def test_a_deck_without_shapes_or_stiffness_gives_a_rigid_part(tmp_path, changes):
    report = import_deck(write_deck(tmp_path, **changes), tmp_path / "out")
    turbine = read_turbine(tmp_path / "out" / "turbine" / "turbine.toml")
    assert (turbine.blade_structure is None) == ("blade" in changes)
    assert (turbine.shaft_torsion is None) == ("ElastoDyn" in changes)
    what = "first blade flap mode" if "blade" in changes else "drivetrain torsion"
    assert dict(report.differences)[what] == "rigid"


def test_a_blade_shape_that_is_not_1_at_the_tip_is_refused_with_its_file(tmp_path):
    text = refused(tmp_path, blade=[("0.6     BldEdgSh(2)", "0.5     BldEdgSh(2)")])
    assert "blade.dat" in text and "edge_1: adds up to 0.9" in text


def test_a_deck_whose_tower_bends_says_which_option_has_it(tmp_path):
    path = write_deck(tmp_path, ElastoDyn=[("False  TwFADOF1", "True   TwFADOF1")])
    said = dict(import_deck(path, tmp_path / "out").differences)["first fore-aft tower mode"]
    assert said.startswith('rigid; with the option tower = "modes"')


@pytest.mark.parametrize("old, new", [("TwFAM1Sh(2)", "TwOtherSh(2)"), ("0.0 3000.0 1e12", "0.0 3000.0 0.0")])
def test_a_tower_file_without_shapes_or_stiffness_gives_a_rigid_tower(tmp_path, old, new):
    assert platform_of(tmp_path, tower=[(old, new)]).tower.modes is None


def test_a_shape_that_is_not_1_at_the_top_is_refused_with_its_file(tmp_path):
    text = refused(tmp_path, tower=[("0.8     TwFAM1Sh(2)", "0.9     TwFAM1Sh(2)")])
    assert "tower.dat" in text and "fore_aft.1: adds up to 1.1" in text


def tank(density, radius, bottom, level, x=0.0, y=0.0):
    """(mass, centre, inertia about it along x, y and z) of water in an upright cone; radius (m) over z."""

    def total(density_over_z):
        along = (density * math.pi * density_over_z).integ()
        return along(level) - along(bottom)

    z = np.polynomial.Polynomial([0.0, 1.0])
    mass = total(radius**2)
    centre = total(radius**2 * z) / mass
    across = total(radius**4 / 4.0 + radius**2 * (z - centre) ** 2)
    return mass, (x, y, centre), (across, across, total(radius**4 / 2.0))


PLATFORM = 6.0e6, (0.4, -0.3, -30.0), (2.0e9, 2.1e9, 1.5e8)
# inside of the steel: the column has 4.5 m, the one beside it 2.5 m at its foot and 2.75 m 20 m above
COLUMN = np.polynomial.Polynomial([4.5])
BESIDE = np.polynomial.Polynomial([2.5 + 0.25 * 16.0 / 20.0, 0.25 / 20.0])
WATER = tank(1100.0, COLUMN, -20.0, -5.0), tank(1300.0, BESIDE, -16.0, -7.0, 8.0, -6.0)


def test_water_in_members_is_ballast_with_its_own_inertia(imported):
    ballast, bodies = imported[0].ballast, (PLATFORM, *WATER)
    mass = sum(body[0] for body in bodies)
    centre = [sum(body[0] * body[1][axis] for body in bodies) / mass for axis in range(3)]
    assert ballast.mass == pytest.approx(mass)
    assert (ballast.cm_downwind, ballast.cm_left, -ballast.cm_depth) == pytest.approx(centre)
    for axis, inertia in enumerate(ballast.inertia):
        about = sum(
            own[axis] + part * sum((at[k] - centre[k]) ** 2 for k in range(3) if k != axis)
            for part, at, own in bodies
        )
        assert inertia == pytest.approx(about, rel=1e-8)


def test_old_hydrodyn_has_water_on_the_axis_and_its_moment_in_the_additional_stiffness(tmp_path):
    """The deck gives what the weight of water restores, of which the coupling with yaw is of its offset."""
    old = HYDRODYN.replace("1    NBody\n", "")
    weights = [(9.81 * mass, *centre) for mass, centre, _ in WATER]
    roll = -sum(weight * z for weight, _, _, z in weights)
    yaw_roll = sum(weight * x for weight, x, _, _ in weights)
    yaw_pitch = sum(weight * y for weight, _, y, _ in weights)
    old = old.replace("0 0 0 7.0e5 0 0\n", f"0 0 0 {7e5 + roll} 0 {yaw_roll}\n")
    old = old.replace("2.0e4 0 0 0 8.0e5 0\n", f"2.0e4 0 0 0 {8e5 + roll} {yaw_pitch}\n")
    platform = platform_of(tmp_path, HydroDyn=old)
    assert np.array(platform.additional.stiffness) == pytest.approx(STIFFNESS, rel=1e-6, abs=1e-3)
    mass = 6.0e6 + sum(water[0] for water in WATER)
    assert platform.ballast.mass == pytest.approx(mass)
    # on their axes: about them the water has no inertia of its own
    centre = [
        (6.0e6 * PLATFORM[1][k] + sum(water[0] * water[1][k] for water in WATER)) / mass for k in (0, 1)
    ]
    apart = sum(body[0] * sum((body[1][k] - centre[k]) ** 2 for k in (0, 1)) for body in (PLATFORM, *WATER))
    assert platform.ballast.inertia[2] == pytest.approx(1.5e8 + apart, rel=1e-8)


def test_the_report_s_masses_are_those_of_the_files(imported):
    platform, turbine, report, folder = imported
    figures = dict(report.figures)
    total = platform.ballast.mass + platform.tower.mass + turbine.nacelle.mass + turbine.rotor.mass
    assert figures["mass, total"] == f"{total:,.1f} kg".replace(",", " ")
    assert figures["mass, total"] in (folder / "report.md").read_text()
    lift = f"{(1027.0 * 7000.0 - total) / 1e3:,.1f} t".replace(",", " ")
    assert figures["buoyancy less weight, balanced by lines and members"] == lift


# --------------------------------------------------------------------------- aerodynamics


def test_blade_has_the_nodes_of_aerodyn_with_the_outermost_just_inside(imported):
    blade = imported[1].blade
    assert blade.radius == pytest.approx([2.05, 12.0, 32.0, 51.95])
    assert blade.prebend == pytest.approx([0.0, -0.1, -0.5, -1.5])
    assert blade.sweep == pytest.approx([0.0, 0.2, 0.1, 0.0])
    assert np.degrees(blade.twist) == pytest.approx([12.0, 8.0, 3.0, 0.0])
    assert blade.polars["one"][:, 1] == pytest.approx([0.0, 0.4, 0.0])  # the first of two tables


@pytest.mark.parametrize(("flag", "moment"), [("True", (0.03, -0.05, 0.03)), ("False", (0.0, 0.0, 0.0))])
def test_the_pitching_moment_of_polars_is_used_where_aerodyn_does(tmp_path, flag, moment):
    turbine = turbine_of(tmp_path, AeroDyn=[("True     UseBlCm", f"{flag} UseBlCm")])
    assert turbine.blade.polars["one"][:, 3] == pytest.approx(moment)


def test_the_middle_table_of_a_polar_is_taken_where_aerodyn_interpolates(tmp_path):
    turbine = turbine_of(tmp_path, AeroDyn=[("1        InCol_Alfa", "2 AFTabMod\n1 InCol_Alfa")])
    assert turbine.blade.polars["one"][1, 1] == 0.5
    assert "number 2 (Reynolds number 5.0 million)" in (tmp_path / "out" / "report.md").read_text()


def test_a_polar_of_any_file_name_has_a_plain_name_here(tmp_path):
    path = write_deck(tmp_path, AeroDyn=[('"foils/One.dat"', '"1, thick.dat"')])
    (tmp_path / NAMES["polar"]).rename(tmp_path / "1, thick.dat")
    import_deck(path, tmp_path / "out")
    turbine = read_turbine(tmp_path / "out" / "turbine" / "turbine.toml")
    assert set(turbine.blade.polars) == {"1__thick"}


PERFORMANCE = """# a rotor, and words that are nobody's business
# Pitch angle vector (deg)
0.0 5.0
# TSR vector (-)
7.0 8.0 9.0
# Wind speed vector (m/s)
10.0

# Power coefficient
0.40 0.30
0.42 0.31
0.41 0.29

# Thrust coefficient
0.8 0.6
0.8 0.6
0.8 0.6

# Torque coefficient
0.05 0.04
0.05 0.04
0.05 0.04
"""
NAMED = [("45.0      ! VS_MinOMSpd", '"../table.txt" ! PerfFileName - table')]


def test_the_rotor_table_goes_along_under_a_name_of_ours_and_discon_names_it(tmp_path):
    (tmp_path / "deck").mkdir()
    path = write_deck(tmp_path / "deck", DISCON=NAMED)
    (tmp_path / "table.txt").write_text(PERFORMANCE)  # outside of the deck's folder
    import_deck(path, tmp_path / "out")
    folder = tmp_path / "out" / "turbine"
    assert '"rotor_performance.txt"      ! PerfFileName - table' in (folder / "DISCON.IN").read_text()
    written = (folder / "rotor_performance.txt").read_text()
    assert [line.split() for line in written.split("\n") if line and line[0] != "#"] == [
        line.split() for line in PERFORMANCE.split("\n") if line and line[0] != "#"
    ]
    assert len(written.split("\n")) == len(PERFORMANCE.split("\n"))  # ROSCO counts them
    assert "business" not in written
    # without the least speed it starts at 30 % of the rated one
    turbine = read_turbine(folder / "turbine.toml")
    assert turbine.torque_law.cut_in_speed == pytest.approx(0.3 * 130.0)


@pytest.mark.parametrize(
    "text",
    ["PRIVATE KEY abc", "# Power coefficient\nPRIVATE KEY abc\n", PERFORMANCE.replace("0.29", ""),
     "0.1 0.2\n", "# Power coefficient\n", "# PRIVATE KEY abc\n"],
)  # fmt: skip
def test_a_file_that_is_no_rotor_table_is_refused_without_a_word_of_it(tmp_path, text):
    (tmp_path / "deck").mkdir()
    path = write_deck(tmp_path / "deck", DISCON=NAMED)
    (tmp_path / "table.txt").write_text(text)
    with pytest.raises(InputError, match="table.txt") as caught:
        import_deck(path, tmp_path / "out")
    assert "PRIVATE" not in str(caught.value) and not (tmp_path / "out").exists()


def test_of_discon_only_entries_and_comments_go_along_under_a_name_of_ours(tmp_path):
    path = write_deck(
        tmp_path,
        ServoDyn=[('"DISCON.IN"     DLL_InFile', '"../turbine.toml" DLL_InFile')],
        DISCON=[("! Controller parameter input file", "PRIVATE KEY abc\n! a comment")],
    )
    (tmp_path / NAMES["DISCON"]).rename(tmp_path.parent / "turbine.toml")
    import_deck(path, tmp_path / "out")
    folder = tmp_path / "out" / "turbine"
    text = (folder / "DISCON.IN").read_text()
    assert text.startswith("!\n! a comment\n") and "30000.0   ! VS_RtTq" in text
    assert read_turbine(folder / "turbine.toml").name == "out"


# --------------------------------------------------------------------------- hydrodynamics


def test_coefficients_have_their_dimension_by_wamitulen_density_and_gravity(imported):
    """Added mass with rho L^k, damping with rho L^k omega, forces with rho g L^m, as WAMIT's manual says."""
    body, density, weight, length = imported[0].potential_flow, 1027.0, 1027.0 * 9.81, 2.0
    assert body.volume == 7000.0
    assert body.centre_of_buoyancy == (0.1, -0.2)
    omega = np.array([0.2, 0.6, 1.0, 1.6])
    assert body.omega == pytest.approx(omega)
    for i, j in [(k, k) for k in range(1, 7)] + [(1, 5), (5, 1)]:
        scale = density * length ** (3 + (i > 3) + (j > 3))
        place = i - 1, j - 1
        assert body.added_mass_infinite[place] == pytest.approx(0.1 * i * j * scale)
        assert body.added_mass_zero[place] == pytest.approx(0.12 * i * j * scale)
        assert body.added_mass[:, *place] == pytest.approx((0.1 * i * j + 0.1 * omega) * scale)
        damping = 0.05 * i * j * omega * np.exp(-omega) * scale * omega
        assert body.damping[:, *place] == pytest.approx(damping, rel=1e-6)
    for i in range(1, 7):
        scale = weight * length ** (2 + (i > 3))
        assert body.excitation[:, 2, i - 1] == pytest.approx((i * omega + 0.5j) * scale, rel=1e-6)
    assert body.stiffness[2, 2] == pytest.approx(20.0 * weight * length**2)
    assert body.stiffness[2, 4] == body.stiffness[4, 2] == pytest.approx(1.5 * weight * length**3)
    assert body.stiffness[3, 3] == pytest.approx(-1250.0 * weight * length**4)


STIFFNESS = np.diag([4e3, 5e3, 6e3, 7e5, 8e5, 9e7])
STIFFNESS[0, 4] = STIFFNESS[4, 0] = 2e4


def test_additional_matrices_are_hydrodyn_s(imported):
    extra = imported[0].additional
    assert extra.preload == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert np.array_equal(extra.stiffness, STIFFNESS)
    assert np.array_equal(extra.linear_damping, np.diag([1e5, 2e5, 3e5, 4e6, 5e6, 6e6]))
    quadratic = np.diag([4e4, 3e4, 2e4, 7e6, 6e6, 5e6])
    quadratic[0, 4], quadratic[4, 0] = -5e4, -7e4
    assert np.array_equal(extra.quadratic_damping, quadratic)


def test_coefficients_over_depth_split_a_member_where_they_bend(imported):
    beside, *column = (member for member in imported[0].members if member.potential_flow)
    assert beside.drag_coefficient == (0.6, 0.6)  # SimplCd
    assert [member.start[2] for member in column] == pytest.approx([10.0, 0.0, -10.0], abs=1e-12)
    assert [member.drag_coefficient for member in column] == [(0.5, 0.5), (0.5, 1.5), (1.5, 1.5)]


def test_axial_drag_of_a_joint_goes_by_the_sum_of_its_areas_and_half_of_its_coefficient(imported):
    disc = imported[0].members[-1]
    assert not disc.potential_flow
    assert disc.drag_coefficient == (2.0, 3.0)
    assert disc.added_mass_coefficient == (0.5, 0.7)
    assert disc.pressure_coefficient == (0.6, 0.8)
    # rho A v^2 / 4 in HydroDyn: the ring of 20 m less the column of 10 m above, the full disc below
    assert disc.axial_drag_coefficient == pytest.approx((0.5 * 8.0 * (1.0 - 0.25), 0.5 * 8.0))
    # the column is in the potential-flow body: it takes no added mass from the disc
    assert disc.axial_added_mass_coefficient == pytest.approx((0.9, 0.9))
    assert disc.axial_pressure_coefficient == pytest.approx((0.8, 0.8))


def test_members_without_a_potential_flow_body_have_all_their_loads(tmp_path):
    platform = platform_of(tmp_path, HydroDyn=[("1    PotMod ", "0    PotMod ")])
    assert platform.potential_flow is None
    assert platform.additional is None  # which HydroDyn has with potential flow alone
    assert not any(member.potential_flow for member in platform.members)
    disc = platform.members[-1]
    assert disc.axial_added_mass_coefficient == pytest.approx((0.9 * (1.0 - 0.5**3), 0.9))
    assert disc.axial_pressure_coefficient == pytest.approx((0.8 * 0.75, 0.8))
    beside, column = platform.members[0], platform.members[1:-1]
    assert beside.added_mass_coefficient == pytest.approx((1.1, 1.1))  # SimplCa, SimplCp
    assert beside.pressure_coefficient == pytest.approx((0.9, 0.9))
    assert [member.added_mass_coefficient for member in column] == [(1.2, 1.2), (1.2, 1.3), (1.3, 1.3)]
    assert [member.pressure_coefficient for member in column] == [(0.85, 0.85), (0.85, 0.75), (0.75, 0.75)]


# --------------------------------------------------------------------------- moorings, wind, sea


def test_lines_of_map_are_repeated_and_weigh_what_they_do_in_water(imported):
    lines = imported[0].lines
    assert len(lines) == 3
    for line, azimuth in zip(lines, (0.0, 120.0, 240.0), strict=True):
        assert math.hypot(*line.anchor[:2]) == pytest.approx(400.0)
        assert math.degrees(math.atan2(line.anchor[1], line.anchor[0])) % 360.0 == pytest.approx(azimuth)
        assert line.anchor[2] == -200.0
        assert line.wet_weight == pytest.approx((100.0 - 1027.0 * math.pi * 0.05**2) * 9.81)
        assert line.seabed_friction == 0.7


def test_moordyn_gives_the_lines_of_map(tmp_path):
    write_deck(tmp_path)
    site = (200.0, 1025.0, 9.81)
    ours, other = (read_mooring(None, tmp_path / NAMES[name], *site)[0] for name in ("MAP", "MoorDyn"))
    for a, b in zip(ours, other, strict=True):
        assert a.anchor == pytest.approx(b.anchor, abs=1e-6)
        assert a.fairlead == pytest.approx(b.fairlead, abs=1e-6)
        assert (a.length, a.wet_weight, a.EA) == (b.length, b.wet_weight, b.EA)
        assert a.dynamics is None and b.dynamics == MOVING


MOVING = {
    "segments": 20, "diameter": 0.1, "drag_coefficient": 2.0, "axial_drag_coefficient": 0.4,
    "added_mass_coefficient": 0.8, "axial_added_mass_coefficient": 0.3, "damping_ratio": 1.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("edits", "changed"),
    [
        ([("-1.0 0", "2.0E6 0")], {"damping_ratio": 2e6 * 20 / 450.0 / math.sqrt(4e8 * 100.0)}),
        ([("0.001 dtM - step", "1.0e5 kbot\n2.0e4 cbot")], {"seabed_stiffness": 1e5, "seabed_damping": 2e4}),
    ],
)
def test_dynamics_of_moordyn_are_those_of_moving_lines(tmp_path, edits, changed):
    """BA > 0 in N s, as the damping ratio of a segment; the bed of the options."""
    write_deck(tmp_path, MoorDyn=edits)
    lines, _ = read_mooring(None, tmp_path / NAMES["MoorDyn"], 200.0, 1025.0, 9.81)
    assert lines[0].dynamics == pytest.approx(MOVING | changed)


def test_lines_of_several_types_keep_their_own_dynamics(tmp_path):
    """Alike, in one table; else with each line, and a scene is built of both."""
    more = ("chain 0.1", "rope 0.2 150.0 4.0E8 -0.5 0 1.2 1.0 0.1 0.0\nchain 0.1")
    switch = {"OpenFAST": [("1    CompMooring", "3    CompMooring"), ("map.dat", "moor.dat")]}
    for number, edits in enumerate(([], [more, ("3 chain 5 6", "3 rope 5 6")])):
        folder = tmp_path / str(number)
        folder.mkdir()
        import_deck(write_deck(folder, MoorDyn=edits, **switch), folder=folder / "out")
        platform = read_platform(folder / "out" / "platform.toml")
        own = [line.dynamics or platform.line_dynamics for line in platform.lines]
        assert [part.diameter for part in own] == [0.1, 0.1, 0.2 if edits else 0.1]
        assert (platform.line_dynamics is None) == bool(edits)


def test_a_repetition_by_zero_doubles_the_lines(tmp_path):
    """As the tension-leg platform of OpenFAST/r-test has it: two tendons at each corner."""
    path = write_deck(tmp_path, MAP=[("repeat 240 120", "repeat 270 180 90 0 270 180 90")])
    lines = read_deck(path).lines
    assert len(lines) == 8
    assert lines[0].anchor == pytest.approx(lines[4].anchor)


def test_site_wind_and_sea_are_those_of_the_deck(imported):
    platform, _, report, _ = imported
    site = platform.environment
    assert (site.gravity, site.water_density, site.air_density) == (9.81, 1027.0, 1.2)
    assert (site.water_depth, site.shear_exponent) == (200.0, 0.11)
    assert "Hs 6 m, Tp 10 s, gamma 2.5, heading 15 deg" in report.suggestions[0]
    assert "12 m/s at 80 m" in report.suggestions[1]


@pytest.mark.parametrize(
    ("part", "old", "new", "said"),
    [
        ("OpenFAST", '"wind.dat"', '"gone.dat"', "Wind of the deck: none"),
        ("InflowWind", "1     WindType", '2 WindType\n"gone.wnd" Filename_Uni', "no such file"),
        ("InflowWind", "1     WindType", "3 WindType", "TurbSim"),
    ],
)
def test_a_deck_is_imported_without_its_wind(tmp_path, part, old, new, said):
    report = import_deck(write_deck(tmp_path, **{part: [(old, new)]}), tmp_path / "out")
    assert said in report.suggestions[1]
    assert read_platform(tmp_path / "out" / "platform.toml").environment.shear_exponent == 0.14


@pytest.mark.parametrize(
    ("part", "key", "value", "figure"),
    [
        ("SeaState", "WtrDens", 1030.0, "water_density"),
        ("SeaState", "WtrDpth", 190.0, "water_depth"),
        ("AeroDyn", "AirDens", 1.3, "air_density"),
    ],
)
def test_a_module_s_own_figure_of_the_site_counts_before_that_of_the_fst(tmp_path, part, key, value, figure):
    deck = read_deck(write_deck(tmp_path, **{part: [(f'"default"  {key}', f"{value}  {key}")]}))
    assert getattr(deck.site, figure) == value


def test_fast_8_has_its_site_in_its_modules(tmp_path):
    """Gravity in ElastoDyn, air in AeroDyn, water and waves in HydroDyn; no SeaState, few switches."""
    waves = "1000 WtrDens\n150 WtrDpth\n0 MSL2SWL\n2 WaveMod\n5 WaveHs\n9 WaveTp\n0 CurrMod\n1    PotMod "
    path = write_deck(
        tmp_path,
        OpenFAST='head\n1 CompMooring\n"ed.dat" EDFile\n"ad.dat" AeroFile\n"servo.dat" ServoFile\n'
        '"hd.dat" HydroFile\n"map.dat" MooringFile\n"unused" InflowFile\n',
        ElastoDyn=[("3      NumBl", "9.80665 Gravity\n3 NumBl")],
        AeroDyn=[('"default"  AirDens', "1.225 AirDens")],
        HydroDyn=[("1    PotMod ", waves)],
        MAP=[("400 0 depth", "400 0 -150")],
    )
    deck = read_deck(path)
    assert (deck.site.gravity, deck.site.air_density) == (9.80665, 1.225)
    assert (deck.site.water_density, deck.site.water_depth) == (1000.0, 150.0)
    assert deck.sea.suggestion == {"kind": "jonswap", "Hs": 5.0, "Tp": 9.0}


def test_a_deck_may_be_given_by_its_parts(tmp_path):
    write_deck(tmp_path, SeaState=[('"default"  WtrDpth', "200  WtrDpth")])
    names = ("elastodyn", "aerodyn", "hydrodyn", "seastate", "mooring", "servodyn")
    kinds = ("ElastoDyn", "AeroDyn", "HydroDyn", "SeaState", "MoorDyn", "ServoDyn")
    parts = {name: tmp_path / NAMES[kind] for name, kind in zip(names, kinds, strict=True)}
    deck = read_deck(parts=parts)
    assert mass_properties(deck)["rotor"] == pytest.approx(60450.0)
    assert len(deck.lines) == 3
    assert deck.site.gravity == 9.80665
    with pytest.raises(InputError, match="hydrodyn \\(HydroFile\\)"):
        read_deck(parts={"elastodyn": parts["elastodyn"], "aerodyn": parts["aerodyn"]})


# --------------------------------------------------------------------------- controller


def test_torque_law_and_pitch_drive_are_rosco_s(imported):
    _, turbine, _, folder = imported
    law, drive = turbine.torque_law, turbine.pitch_drive
    assert (law.rated_torque, law.rated_speed, law.max_torque) == (3e4, 130.0, 3.3e4)
    assert law.rated_power == pytest.approx(3e4 * 130.0)
    assert law.region2_constant == 1.7
    assert law.cut_in_speed == 45.0
    assert turbine.rated_rotor_speed == pytest.approx(130.0 / 90.0)
    assert (turbine.rated_wind_speed, turbine.cut_out_wind_speed) == (11.0, 24.0)
    assert (drive.minimum, drive.maximum, drive.rate_limit) == pytest.approx((0.0, 1.5, 0.1))
    assert turbine.drivetrain.generator_efficiency == 0.95
    assert turbine.drivetrain.mesh_loss == pytest.approx(0.02)
    assert (folder / "turbine" / "DISCON.IN").is_file()
    assert turbine.discon == str(folder / "turbine" / "DISCON.IN")


def test_servodyn_s_own_torque_law_is_on_the_high_speed_shaft_in_si(tmp_path):
    """VSContrl 1: speeds in rpm, the constant of region 2 in N m/rpm^2, the slip in percent."""
    turbine = turbine_of(tmp_path, ServoDyn=[("5     VSContrl", "1     VSContrl")])
    law, speed = turbine.torque_law, 1200.0 * 2.0 * math.pi / 60.0
    assert (law.rated_torque, law.slip_percent) == (31000.0, 8.5)
    assert law.rated_speed == pytest.approx(speed)
    assert law.region2_constant * speed**2 == pytest.approx(0.02 * 1200.0**2)
    assert law.rated_power == pytest.approx(31000.0 * speed)
    assert math.degrees(turbine.pitch_drive.rate_limit) == pytest.approx(7.0)
    assert turbine.drivetrain.generator_efficiency == 0.93


@pytest.mark.parametrize(("table", "best"), [(ROTOR_TABLE, 0.47), (None, 0.45)])
def test_the_rated_wind_has_rated_power_at_the_best_power_coefficient(tmp_path, table, best):
    """Where DISCON.IN says none: P = rho / 2 pi R^2 Cp v^3, with a usual coefficient if there is no table.

    The table has one of 0.99 too, which no rotor can have."""
    if table is not None:
        (tmp_path / "Cp.txt").write_text(table)
    named = [("8.8 11.0  ! IPC_Vramp", '"Cp.txt" ! PerfFileName')]
    wind = turbine_of(tmp_path, DISCON=named).rated_wind_speed
    assert 0.5 * 1.2 * math.pi * 52.0**2 * best * wind**3 == pytest.approx(3e4 * 130.0, rel=1e-6)


def test_the_pitch_actuator_of_rosco_is_the_second_drive_of_the_turbine(tmp_path):
    text = "2 ! PA_Mode - actuator\n1.5 ! PA_CornerFreq - rad/s\n0.7 ! PA_Damping - of it"
    drive = turbine_of(tmp_path, DISCON=[("0         ! PA_Mode - actuator", text)]).pitch_drive
    assert (drive.time_constant, drive.natural_frequency) == (0.0, None)
    assert (drive.second_order.natural_frequency, drive.second_order.damping) == (1.5, 0.7)
    written = (tmp_path / "out" / "turbine" / "turbine.toml").read_text()
    assert "PA_CornerFreq" in written and "PA_Damping" in written


def test_the_legacy_controller_of_the_5_mw_turbine_is_known_by_its_library(tmp_path):
    library = [('"libdiscon.so"', '"ServoData/DISCON_OC3Hywind_win32.dll"')]
    turbine = turbine_of(tmp_path, ServoDyn=library, ElastoDyn=[("90     GBRatio", "97 GBRatio")])
    known, power = read_turbine("nrel5mw"), turbine.torque_law.rated_power
    assert turbine.torque_law == known.torque_law.model_copy(update={"rated_power": power})
    assert power == pytest.approx(known.torque_law.rated_power, rel=1e-6)
    assert turbine.gains == known.gains


# --------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("part", "old", "new", "expected"),
    [
        ("HydroDyn", "1    NBody\n", "2    NBody\n", ("hd.dat", "NBody = 2", "must be 1")),
        ("HydroDyn", "1    PotMod ", "2    PotMod ", ("PotMod = 2", "fluid impulse")),
        ("HydroDyn", "0  NMGDepths", "1  NMGDepths\nMGDpth MGThck\n(m) (m)\n0 0.1", ("marine growth",)),
        ("HydroDyn", "0    PtfmRefxt", "1.0 PtfmRefxt", ("PtfmRefxt = 1",)),
        ("SeaState", "0     CurrMod", "2 CurrMod", ("sea.dat", "CurrMod = 2", "user's current")),
        ("ElastoDyn", "-4.0   OverHang", "4.0 OverHang", ("OverHang = 4.0", "downwind")),
        ("ElastoDyn", "False  Furling", "True Furling", ("Furling = True",)),
        ("ElastoDyn", "-3     PreCone(2)", "-2 PreCone(2)", ("PreCone(2) = -2", "blades must be identical")),
        ("ElastoDyn", "1.0E6  NacYIner", "1.0E5 NacYIner", ("NacYIner",)),
        ("ElastoDyn", "3.D4   HubMass", "-3.D4 HubMass", ("ed.dat", "line", "HubMass = -3.D4", ">= 0")),
        ("OpenFAST", "0    MHK", "2    MHK", ("MHK = 2",)),
        ("OpenFAST", "0    CompSub", "1    CompSub", ("CompSub = 1", "SubDyn")),
        ("OpenFAST", "1    CompMooring", "4    CompMooring", ("CompMooring = 4", "--mooring")),
        ("OpenFAST", '"hd.dat"', '"gone.dat"', ("HydroFile = 'gone.dat'", "no such file")),
        ("MAP", "1 fix    400", "1 Connect 400", ("connect", "points between lines")),
        ("MAP", "chain  0.1  100.0", "chain  0.5  100.0", ("chain", "must be > 0")),
        ("AeroDyn", "1        NumAFfiles", "1        StallMod", ("AeroDyn 14",)),
        ("polar", "-180.0 0.0 0.02 0.03\n   0.0 0.4", "-90.0 0.0 0.02 0.03\n   0.0 0.4", ("-180 to 180",)),
        ("blade", "1.0 0.5 -3.0 70.0", "0.0 0.5 -3.0 70.0", ("blade.dat", "increase")),
    ],
)  # fmt: skip
def test_what_cannot_be_represented_is_refused_by_file_line_and_key(tmp_path, part, old, new, expected):
    found = refused(tmp_path, **{part: [(old, new)]})
    for text in expected:
        assert text in found


def test_figures_that_no_platform_can_have_are_refused_before_anything_is_written(tmp_path):
    found = refused(tmp_path, HydroDyn=[("1.0e5 0 0 0 0 0 AddBLin", "-1.0e5 0 0 0 0 0 AddBLin")])
    assert "platform.toml" in found
    assert "linear_damping.1.1" in found


def test_a_folder_with_a_platform_is_replaced_only_when_asked(imported, tmp_path):
    path = write_deck(tmp_path)
    import_deck(path, tmp_path / "out")
    with pytest.raises(InputError, match="already has a platform.toml"):
        import_deck(path, tmp_path / "out")
    import_deck(path, tmp_path / "out", replace_files=True)


def test_no_file_of_a_folder_is_replaced_by_an_import_that_is_not_asked_to(tmp_path):
    path, notes = write_deck(tmp_path), tmp_path / "out" / "report.md"
    notes.parent.mkdir()
    notes.write_text("my own")
    with pytest.raises(InputError, match="already has a report.md"):
        import_deck(path, tmp_path / "out")
    assert notes.read_text() == "my own" and [*notes.parent.iterdir()] == [notes]


def test_members_need_joints_and_sections_that_are_there(tmp_path):
    write_deck(tmp_path, HydroDyn=[("1 1 2 1 1 1.0 2 1 TRUE", "1 1 9 1 1 1.0 2 1 TRUE")])
    with pytest.raises(InputError, match="joint 9 is not defined"):
        read_hydrodyn(tmp_path / NAMES["HydroDyn"], 1025.0)
