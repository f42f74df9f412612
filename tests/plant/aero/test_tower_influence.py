"""The tower's influence on the wind at the blades, against plain vectors and OpenFAST v5."""

import numpy as np
import pytest
from naive import curved_rotor, tower_wind
from naive.rigid_body import rotation
from numba import config
from rotor_helpers import by, curved, looked_up, moving, series_of, solved

from fowt_env.analysis.rotor_loads import rotor_loads
from fowt_env.descriptions.files import DATA
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.errors import InputError
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.section_inflow import build_dynamic_sections
from fowt_env.plant.aero.section_table import build_section_table
from fowt_env.plant.aero.tower_influence import POTENTIAL, SHADOW, build_tower_influence, disturbance
from fowt_env.plant.aero.wake import build_dynamic_inflow
from fowt_env.plant.aero.wind import wind_at, wind_now
from fowt_env.plant.blade_pitches import BladePitches
from fowt_env.plant.state import N_RIGID, State
from fowt_env.scene.build import build_scene

TILT, RPM = 0.11, np.pi / 30.0
STRAIGHT = read_turbine("nrel5mw")
CURVED = curved(STRAIGHT, TILT)
# thick and with more drag than a tower has, and no higher than the roots of the blades that point up
SECTIONS = [[20.0, 60.0, 91.0], [9.0, 8.0, 7.0], [0.9, 0.6, 1.1], [0.3, 0.4, 0.2]]
compiled = pytest.mark.skipif(config.DISABLE_JIT, reason="tables take minutes without the compiler")


def with_tower(turbine, potential, shadow):
    """BladeElements of a turbine behind or in front of the tower."""
    tower = build_tower_influence(SECTIONS, potential, shadow, turbine.rotor)
    return build_blade_elements(turbine, 1.225)._replace(tower=tower)


def part_of(potential, shadow):
    return build_tower_influence(SECTIONS, potential, shadow, STRAIGHT.rotor)


@pytest.mark.parametrize("potential", POTENTIAL)
@pytest.mark.parametrize("shadow", SHADOW)
def test_the_disturbance_around_a_cylinder_is_that_of_complex_velocities(potential, shadow):
    part = part_of(potential, shadow)
    if part is None:
        assert not (potential or shadow)
        return
    rng = np.random.default_rng(2)
    for x, y in [*rng.uniform(-4.0, 4.0, (40, 2)), (1.2, 0.0), (2.0, 0.3), (0.5, 1.4), (-1.5, 0.0)]:
        expected = tower_wind.around_cylinder(x, y, 0.7, 0.3, potential, shadow)
        assert disturbance(x, y, 0.7, 0.3, part) == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_the_flow_stagnates_in_front_and_doubles_beside_and_the_shadow_is_half_the_wind_at_most():
    assert disturbance(-1.0, 0.0, 0.5, 0.1, part_of("potential", False)) == pytest.approx((-1.0, 0.0))
    assert disturbance(0.0, 1.0, 0.5, 0.1, part_of("potential", False)) == pytest.approx((1.0, 0.0))
    for shadow in ("powles", "eames"):
        assert disturbance(1.0, 0.0, 3.0, 0.1, part_of(False, shadow)) == (-0.5, 0.0)
        assert disturbance(-3.0, 0.1, 3.0, 0.1, part_of(False, shadow)) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("potential", "shadow"),
    [pytest.param("bak", "eames", marks=pytest.mark.nightly), ("potential", "powles")],
)
def test_loads_are_those_of_the_wind_with_the_tower_by_plain_vectors(potential, shadow):
    """Also with wind from behind, in which the rotor is in the shadow, and at the ends of the tower."""
    states, winds = moving(6)
    winds[3:, 0] *= -0.6
    for i, x in enumerate(states):
        x[State.AZIMUTH] = np.pi - 0.15 * i  # the first blade points down
    elements = with_tower(CURVED, potential, shadow)
    for pitches in (None, BladePitches(N_RIGID)):
        found, _ = by(solved, states, winds, elements, TILT, pitches=pitches)
        plain, _ = by(solved, states, winds, elements._replace(tower=None), TILT, pitches=pitches)
        assert (np.abs(found - plain).max(axis=1) > 3e-4 * np.abs(plain).max(axis=1)).all()
        for load, x, row in zip(found, states, winds, strict=True):
            series = series_of(row)

            def wind(point, series=series):
                return np.array(wind_at(0.0, *point, wind_now(0.0, series), series, None))

            body = rotation(*x[3:6])
            disturbed = tower_wind.with_tower(
                wind, SECTIONS, potential, shadow, x[:3], body, x[7:10], x[10:13]
            )
            own = None if pitches is None else x[[State.BLADE_PITCH, N_RIGID, N_RIGID + 1]]
            expected = curved_rotor.loads(CURVED, elements, x, disturbed, 1.225, own)
            assert load[:6] == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())


@compiled
@pytest.mark.parametrize(
    "turbine",
    [
        pytest.param(STRAIGHT, id="straight"),
        pytest.param(CURVED, id="curved"),
    ],
)
@pytest.mark.nightly
def test_the_look_up_has_the_same_influence(turbine):
    states, winds = moving(60)
    elements, tilt = with_tower(turbine, "bak", "powles"), turbine.rotor.shaft_tilt
    exact = by(solved, states, winds, elements, tilt)[0]
    found = by(looked_up, states, winds, build_section_table(elements), tilt)[0]
    plain = by(solved, states, winds, elements._replace(tower=None), tilt)[0]
    moved = (exact - plain).std(axis=0)
    assert (np.abs(found - exact).max(axis=0) < 0.1 * moved + 1e-9 * np.abs(exact).max()).all()


@compiled
def test_tables_of_a_blade_are_shared_whatever_the_tower_is():
    plain = with_tower(STRAIGHT, "bak", False)
    assert build_section_table(plain).load is build_section_table(plain._replace(tower=None)).load
    wake = build_dynamic_inflow()
    both = [build_dynamic_sections(part, wake) for part in (plain, plain._replace(tower=None))]
    assert both[0].load is both[1].load and both[0].elements.tower is not None


# OpenFAST v5.0.0 (git 2895884d): IEA 15 MW, rigid, on a fixed platform, 12 m/s uniform, 7.56 rpm, 6.3 deg,
# TwrShadow 1. Change against TwrPotent 0 and TwrShadow 0: mean, 3P amplitude of thrust (N) and torque (N m)
OPENFAST = {
    "potential": ((-3883.0, 1.984e4), (-6.225e4, 3.813e5)),
    "bak": ((-1.111e4, 2.541e4), (-1.992e5, 4.859e5)),
}


@pytest.mark.parametrize("potential", OPENFAST)
def test_thrust_and_torque_dip_three_times_a_revolution_as_in_openfast(potential):
    azimuths = np.arange(48) * np.pi / 72.0  # a third of a revolution
    values = []
    for options in ({}, {"tower_potential": potential, "tower_shadow": "powles"}):
        scene = build_scene(
            "iea15_volturnus_s", wind=12.0, rotor="bem", skewed_wake=True, blade_stations=None,
            shear_exponent=0.0, **options,
        )  # fmt: skip
        loads = [rotor_loads(scene, 7.56 * RPM, np.radians(6.3), azimuth) for azimuth in azimuths]
        values.append([(load.force[0], load.moment[0]) for load in loads])
    change = np.subtract(values[1], values[0])
    waves = np.abs(2.0 / 48.0 * np.exp(-3j * azimuths) @ change)
    for i, (mean, amplitude) in enumerate(OPENFAST[potential]):
        # measured: mean 0.05 %, amplitude 0.02 %, at azimuths that are not those of OpenFAST
        assert change[:, i].mean() == pytest.approx(mean, rel=2e-3)
        assert waves[i] == pytest.approx(amplitude, rel=2e-3)


def test_the_table_of_the_whole_rotor_refuses_it_and_fidelity_fast_takes_the_look_up():
    with pytest.raises(InputError, match="rotor = 'table': does not support tower_shadow, which needs rotor"):
        build_scene(wind=8.0, rotor="table", tower_shadow="powles")
    scene = build_scene(wind=8.0, fidelity="fast", tower_potential="bak")
    assert scene.rotor == "lookup" and scene.model.aero.rotor.elements.tower.potential == 2
    assert build_scene(wind=8.0).model.aero.rotor.elements.tower is None
    with pytest.raises(InputError, match="tower_potential = 'baak': allowed False, 'potential', 'bak'"):
        build_scene(wind=8.0, tower_potential="baak")


def test_sections_of_a_platform_file_replace_the_taper():
    tower = build_scene("iea15_volturnus_s", wind=8.0, rotor="bem", tower_potential="potential").model
    tower = tower.aero.rotor.elements.tower
    assert np.interp(100.0, tower.height, tower.diameter) == 10.0 and tower.diameter[-1] == 6.5
    taper = build_scene(wind=8.0, rotor="bem", tower_potential="potential").model.aero.rotor.elements.tower
    assert taper.diameter.tolist() == [6.5, 3.87] and taper.intensity.tolist() == [0.1, 0.1]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("132.0, 144.386]", "132.0, 131.0]", "height = "),
        ("10.0, 10.0, 6.5]", "10.0, 6.5]", "diameter: has 10 values; must be one for each height, 11"),
        ("0.5, 0.5]", "0.5, -0.5]", "drag_coefficient = .*each must be in .0, 10"),
        ("0.1, 0.1]", "0.1, 0.01]", "turbulence_intensity = .*each must be in .0.05, 1"),
    ],
)
def test_wrong_sections_name_key_and_range(tmp_path, old, new, message):
    path = DATA / "platforms" / "iea15_volturnus_s.toml"
    text = path.read_text()
    start = text.index("[tower.sections]")
    text = text[:start] + text[start:].replace(old, new, 1)
    (tmp_path / "platform.toml").write_text(text)
    for file in path.parent.glob("iea15_volturnus_s*"):
        if file.suffix != ".toml":
            (tmp_path / file.name).symlink_to(file)
    with pytest.raises(InputError, match=message):
        read_platform(tmp_path / "platform.toml")
