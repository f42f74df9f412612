"""Members against a plain twin, the spar's own strips, HydroDyn's convention by hand, and closed forms."""

from collections import namedtuple
from math import cos, pi, radians, sin

import numpy as np
import pytest
from naive import members as naive
from plant_helpers import make_pose
from spar_in_waves import STILL, SWITCHES, motion, waves_of

from fowt_env.descriptions.platform import Environment, Member
from fowt_env.plant.hydro.member_buoyancy import add_member_buoyancy, displaced
from fowt_env.plant.hydro.member_series import N_WATER, VELOCITIES, build_water_series, interpolate, no_series
from fowt_env.plant.hydro.members import (
    N_NODE,
    add_member_loads,
    add_node_mass,
    axis_of,
    build_members,
    fill_water,
    lay_nodes,
    node_loads,
)
from fowt_env.plant.hydro.morison import Current
from fowt_env.plant.hydro.waves import wave_kinematics
from fowt_env.plant.state import NO_LOAD

SITE = Environment(water_depth=200.0)
SEA = [(0.35, 1.0, 1.0, 0.7), (0.8, 1.2, -2.0, -2.5), (1.2566, 0.4, 0.5, 3.0)]
# a leaning taper through the surface, a level pontoon below it, a dry brace and a deep stub of a base
HULL = (
    Member(
        start=(12.0, 5.0, -14.0), end=(18.0, 3.0, 9.0), diameter=(9.0, 6.0), drag_coefficient=(0.6, 0.8),
        added_mass_coefficient=(0.9, 0.7), axial_drag_coefficient=(4.8, 1.0),
        axial_added_mass_coefficient=(1.1, 0.4),
    ),
    Member(
        start=(12.0, 5.0, -12.0), end=(-20.0, -6.0, -13.0), diameter=(2.0, 3.0),
        drag_coefficient=(0.63, 0.63), added_mass_coefficient=(1.0, 1.0), pressure_coefficient=(0.9, 1.0),
        axial_pressure_coefficient=(0.0, 1.0),
    ),
    Member(start=(-20.0, 0.0, 8.0), end=(15.0, 0.0, 9.0), diameter=(1.6, 1.6), drag_coefficient=(0.6, 0.6)),
    Member(
        start=(-20.0, -6.0, -10.0), end=(-20.0, -6.0, -20.0), diameter=(14.0, 14.0),
        drag_coefficient=(0.68, 0.68), added_mass_coefficient=(0.5, 0.5),
        axial_drag_coefficient=(0.0, 9.6), potential_flow=True,
    ),
)  # fmt: skip


def build(members=HULL, position="fixed", surface="swl", stretching="none", site=SITE, cell=0.5, **options):
    return build_members(
        members, density=site.water_density, gravity=site.gravity, depth=site.water_depth,
        position=position, surface=surface, stretching=stretching, cell=cell, **options,
    )  # fmt: skip


def load_of(t, motion, members, waves, current=None):
    """(wrench (6,), added mass (6, 6)) as the plant makes them."""
    pose, nodes = make_pose(*motion), members.nodes
    if members.scratch_nodes:
        nodes = np.zeros((members.scratch_nodes, N_NODE))
        lay_nodes(t, pose, members, waves, nodes)
    water, added = np.zeros(N_WATER * len(nodes)), np.zeros((6, 6))
    for node in nodes:
        add_node_mass(node, *axis_of(pose, node, members), added)
    fill_water(t, pose, nodes, members, waves, water)
    return np.array(node_loads(pose, nodes, members, waves, current, water)), added


@pytest.mark.parametrize("axis", ["displaced", "undisplaced"])
@pytest.mark.parametrize("switches", SWITCHES, ids="-".join)
def test_loads_match_the_plain_twin(switches, axis):
    rng = np.random.default_rng(4)
    members, waves = build(HULL, *switches, axis=axis), waves_of(SEA, SITE)
    for t in (0.0, 31.7):
        where = motion(rng)
        current = Current(0.6, -0.2, 1.0 / 7.0)
        found, added = load_of(t, where, members, waves, current)

        def stream(z):
            return np.array([0.6, -0.2]) * np.clip(1.0 + z / SITE.water_depth, 0.0, 1.0) ** (1.0 / 7.0)

        wanted, mass = naive.load(t, *where, HULL, SEA, SITE, switches, stream, axis=axis)
        scale = np.repeat([np.abs(wanted[:3]).max(), np.abs(wanted[3:]).max()], 3)
        assert np.abs(found - wanted) == pytest.approx(np.zeros(6), abs=2e-5 * scale.max())
        assert np.abs((found - wanted) / scale).max() < 2e-5
        assert np.abs(added - mass).max() < 1e-6 * np.abs(mass).max()


def test_still_members_keep_the_added_mass_of_their_nodes():
    members = build()
    _, added = load_of(0.0, motion(np.random.default_rng(1)), members, None)
    assert members.added_mass == pytest.approx(added, rel=1e-12)
    assert np.linalg.eigvalsh(added)[0] > 0.0


@pytest.mark.parametrize("axis", ["displaced", "undisplaced"])
def test_the_added_mass_of_a_tilted_platform_is_that_of_the_plain_twin(axis):
    Scratch = namedtuple("Scratch", "added_mass, member_nodes, member_water")
    members, where = build(axis=axis), motion(np.random.default_rng(6))
    data = Scratch(np.zeros((6, 6)), np.zeros((0, N_NODE)), np.zeros(N_WATER * len(members.nodes)))
    add_member_loads(0.0, make_pose(*where), NO_LOAD, members, None, None, data)
    mass = naive.load(0.0, *where, HULL, None, SITE, ("fixed", "swl", "none"), axis=axis)[1]
    assert np.abs(data.added_mass - mass).max() < 1e-6 * np.abs(mass).max()


def test_one_inclined_cylinder_has_the_drag_of_hydrodyn():
    """Cd rho R |v| v across the axis, and rho AxCd A / 4 on each joint, which is half of 1/2 rho A AxCd."""
    lean, speed = radians(30.0), 2.0
    end = (20.0 * sin(lean), 0.0, -40.0 + 20.0 * cos(lean))
    rho, radius, cd, ax_cd = SITE.water_density, 2.5, 0.8, 9.6
    member = Member(
        start=(0.0, 0.0, -40.0), end=end, diameter=(5.0, 5.0), drag_coefficient=(cd, cd),
        axial_drag_coefficient=(0.5 * ax_cd, 0.0), potential_flow=True,
    )  # fmt: skip
    found, added = load_of(0.0, STILL, build((member,)), None, Current(speed, 0.0, 0.0))
    across, along = speed * cos(lean), speed * sin(lean)
    side = cd * rho * radius * across**2 * 20.0
    plate = 0.25 * ax_cd * rho * pi * radius**2 * along**2
    force = np.array([side * cos(lean) + plate * sin(lean), 0.0, -side * sin(lean) + plate * cos(lean)])
    middle = 0.5 * (np.array([0.0, 0.0, -40.0]) + end)
    moment = np.cross(middle, side * np.array([cos(lean), 0.0, -sin(lean)]))
    moment += np.cross([0.0, 0.0, -40.0], plate * np.array([sin(lean), 0.0, cos(lean)]))
    assert found == pytest.approx(np.concatenate([force, moment]), rel=1e-12, abs=1e-6)
    assert not added.any()


def test_the_heave_plates_of_oc4_damp_as_published():
    """Three plates of 24 m with AxCd = 9.6 on one joint: 4.8 in 1/2 rho A each (Robertson et al., 2014)."""
    plates = tuple(
        Member(
            start=(x, y, -20.0), end=(x, y, -14.0), diameter=(24.0, 24.0), drag_coefficient=(0.0, 0.0),
            axial_drag_coefficient=(4.8, 0.0), potential_flow=True,
        )
        for x, y in ((14.43, 25.0), (-28.87, 0.0), (14.43, -25.0))
    )  # fmt: skip
    heaving = (np.zeros(3), np.eye(3), np.array([0.0, 0.0, 0.5]), np.zeros(3))
    found, _ = load_of(0.0, heaving, build(plates), None)
    assert found[2] == pytest.approx(-0.5 * 1025.0 * 3.0 * pi * 144.0 * 4.8 * 0.25, rel=1e-12)


# buoyancy


def test_buoyancy_is_the_volume_below_the_water():
    rng = np.random.default_rng(2)
    bodies = build().bodies
    for _ in range(3):
        r, R, v, w = motion(rng, tilt=0.5, heave=3.0)
        volume, qx, qy, qz = displaced(make_pose(r, R, v, w), bodies)
        counted, moment = naive.displaced(r, R, HULL[:3])
        assert volume == pytest.approx(counted, rel=2e-4)
        # the counting's own error: a share of the volume times the size of the whole
        assert np.array([qx, qy, qz]) == pytest.approx(moment, abs=2e-4 * counted * 20.0)


def test_a_sunken_cone_displaces_its_volume_and_a_dry_one_nothing():
    cone = Member(
        start=(3.0, 1.0, -30.0), end=(5.0, 2.0, -22.0), diameter=(6.0, 2.0), drag_coefficient=(0, 0)
    )
    length = float(np.linalg.norm([2.0, 1.0, 8.0]))
    bodies = build((cone,)).bodies
    volume, qx, qy, qz = displaced(make_pose(*STILL), bodies)
    assert volume == pytest.approx(pi * length * (9.0 + 3.0 + 1.0) / 3.0, rel=1e-14)
    share = (9.0 + 2.0 * 3.0 + 3.0) / (4.0 * 13.0)
    centre = np.array([3.0, 1.0, -30.0]) + share * np.array([2.0, 1.0, 8.0])
    assert np.array([qx, qy, qz]) / volume == pytest.approx(centre, rel=1e-14)
    up = make_pose(np.array([0.0, 0.0, 40.0]), np.eye(3), np.zeros(3), np.zeros(3))
    assert displaced(up, bodies) == (0.0, 0.0, 0.0, 0.0)


def test_force_is_the_slope_of_the_potential_energy():
    """Buoyancy in heave: dV/dz is the area that the water cuts, here of a column that leans by 30 degrees."""
    lean = radians(30.0)
    member = Member(
        start=(-20.0 * sin(lean), 0.0, -20.0 * cos(lean)), end=(20.0 * sin(lean), 0.0, 20.0 * cos(lean)),
        diameter=(8.0, 8.0), drag_coefficient=(0, 0),
    )  # fmt: skip
    members = build((member,))
    fz = [
        add_member_buoyancy(
            make_pose(np.array([0.0, 0.0, z]), np.eye(3), np.zeros(3), np.zeros(3)), NO_LOAD, members
        ).fz
        for z in (-0.5, 0.5)
    ]
    stiffness = SITE.water_density * SITE.gravity * pi * 16.0 / cos(lean)
    assert fz[0] - fz[1] == pytest.approx(stiffness, rel=1e-12)


def test_no_members_change_nothing():
    pose = make_pose(*motion(np.random.default_rng(0)))
    assert build(()) is None
    assert add_member_buoyancy(pose, NO_LOAD, None) == NO_LOAD


# the table over the record


@pytest.mark.parametrize(
    "sea, error",
    [
        # 12 rows per shortest wave: the cubic's error is largest in accelerations near the surface
        ({"kind": "jonswap", "Hs": 6.0, "Tp": 10.0, "gamma": 3.3}, 4e-4),
        ({"kind": "regular", "H": 4.0, "T": 7.0}, 1e-6),
    ],
    ids=["jonswap", "regular"],
)
@pytest.mark.parametrize("channels", [VELOCITIES, N_WATER])
def test_the_table_gives_the_motion_of_the_sum_of_waves(sea, error, channels):
    waves = waves_of(sea, SITE, seed=3, duration=200.0)
    place = np.array([[3.0, 1.0, -5.0], [-20.0, 25.0, -0.4], [10.0, -7.0, -19.0]])
    series = build_water_series(waves, place, channels, 200.0)
    times = np.random.default_rng(5).uniform(0.0, 200.0, 300)
    water, found, wanted = np.zeros(channels * len(place)), [], []
    for t in (0.0, *times, 200.0):
        interpolate(t, waves.ramp, series, water)
        found.append(water.copy())
        wanted.append(np.concatenate([np.array(wave_kinematics(t, *p, waves))[:channels] for p in place]))
    rms = np.sqrt(np.mean((np.array(found) - wanted) ** 2, axis=0))
    assert (rms <= error * np.std(wanted, axis=0)).all()


def test_a_regular_wave_goes_on_beyond_its_table():
    waves = waves_of({"kind": "regular", "H": 4.0, "T": 7.0}, SITE)
    series = build_water_series(waves, np.array([[3.0, 1.0, -5.0]]), VELOCITIES, 200.0)
    water = np.zeros(VELOCITIES)
    interpolate(12345.6, waves.ramp, series, water)
    wanted = np.array(wave_kinematics(12345.6, 3.0, 1.0, -5.0, waves))[:VELOCITIES]
    assert water == pytest.approx(wanted, abs=1e-6 * np.abs(wanted).max())


def test_components_off_any_lattice_have_no_table():
    omega = [0.5, 0.5 + 1e-5 * pi, 1.0]
    waves = waves_of([(w, 1.0, 0.0, 0.0) for w in omega], SITE)
    place = np.array([[3.0, 1.0, -5.0]])
    assert build_water_series(waves, place, VELOCITIES, 1e5).values.size == 0
    assert no_series().values.size == 0
