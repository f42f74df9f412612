import numpy as np
import pytest
from naive import curved_rotor
from numba import config
from rotor_helpers import averaged, by, curved, looked_up, moving, rough_field, series_of, solved

from fowt_env.analysis.rotor_loads import rotor_loads
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.aero.blade_elements import blade_section, build_blade_elements
from fowt_env.plant.aero.blade_shape import BladeLoad, blade_motion, with_blade
from fowt_env.plant.aero.coefficient_table import build_coefficient_table
from fowt_env.plant.aero.section_table import build_section_table
from fowt_env.plant.aero.station_choice import build_fewer_elements
from fowt_env.plant.aero.wind import wind_at, wind_now
from fowt_env.plant.blade_pitches import BladePitches
from fowt_env.plant.state import BLADES, N_RIGID, NO_LOAD, State, pose_of
from fowt_env.plant.tilt import build_tilt, to_body_axes
from fowt_env.scene.build import build_scene
from fowt_env.scene.options import ROTORS, chosen_stations
from fowt_env.training.validation.openfast_cases import table

TILT = 0.11
STRAIGHT = read_turbine("nrel5mw")
CURVED = curved(STRAIGHT, TILT)
ELEMENTS = build_blade_elements(CURVED, 1.225)
PITCHES = BladePitches(N_RIGID)
compiled = pytest.mark.skipif(config.DISABLE_JIT, reason="tables take minutes without the compiler")


def loads(load_of, states, winds, rotor, turbine=CURVED, field=None, shear=0.14):
    """(n, 8): wrench about the body origin, thrust, torque of each state."""
    return by(load_of, states, winds, rotor, turbine.rotor.shaft_tilt, field, shear=shear)[0]


@pytest.mark.parametrize("pitches", [None, PITCHES])
def test_loads_are_those_of_stations_placed_and_turned_by_matrices(pitches):
    states, winds = moving(4)
    found, _ = by(solved, states, winds, ELEMENTS, TILT, pitches=pitches)
    for load, x, row in zip(found, states, winds, strict=True):
        series = series_of(row)

        def wind(point, series=series):
            return np.array(wind_at(0.0, *point, wind_now(0.0, series), series, None))

        own = None if pitches is None else x[[State.BLADE_PITCH, N_RIGID, N_RIGID + 1]]
        expected = curved_rotor.loads(CURVED, ELEMENTS, x, wind, 1.225, own)
        assert load[:6] == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())
        shaft = curved_rotor.about_y(TILT)[:, 0]
        hub = np.array([-CURVED.rotor.overhang, 0.0, CURVED.rotor.hub_height])
        assert load[6] == pytest.approx(expected[:3] @ shaft, rel=1e-9)
        assert load[7] == pytest.approx((expected[3:] - np.cross(hub, expected[:3])) @ shaft, rel=1e-9)


def without_moment(turbine):
    """The turbine with cm = 0 in its polars, and two blades where asked."""
    polars = {name: polar * [1.0, 1.0, 1.0, 0.0] for name, polar in turbine.blade.polars.items()}
    return turbine.model_copy(update={"blade": turbine.blade.model_copy(update={"polars": polars})})


def test_losses_and_solidity_take_lengths_along_the_blade_and_distances_from_the_shaft():
    points = curved_rotor.axis_points(CURVED)
    along = 1.5 + np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    assert along[-1] > 63.05
    assert ELEMENTS.tip_exponent == pytest.approx(1.5 * (along[-1] - along[1:-1]) / along[1:-1], rel=1e-12)
    assert ELEMENTS.hub_exponent == pytest.approx(along[1:-1] - 1.5, rel=1e-12)
    coned = points[1:-1] @ curved_rotor.about_y(-0.07).T
    assert ELEMENTS.radius == pytest.approx(np.hypot(coned[:, 1], coned[:, 2]), rel=1e-12)
    assert ELEMENTS.solidity == pytest.approx(
        3 * CURVED.blade.chord / (2 * np.pi * ELEMENTS.radius), rel=1e-12
    )


def test_straight_blades_in_the_rotor_plane_have_the_same_loads_either_way():
    turbine = without_moment(STRAIGHT)
    states, winds = moving(5)
    plain = build_blade_elements(turbine, 1.225)
    shaped = build_blade_elements(turbine, 1.225, shaped=True)
    assert plain.shape is None and shaped.shape is not None
    a = loads(solved, states, winds, plain, turbine)
    assert loads(solved, states, winds, shaped, turbine) == pytest.approx(a, rel=1e-9, abs=1.0)


def test_a_tilted_shaft_is_a_pitched_platform():
    upright, tilted = curved(STRAIGHT, tilt=0.0), CURVED
    states, winds = moving(3)
    states[:, [State.ROLL, State.YAW]] = 0.0
    load = loads(solved, states, winds, build_blade_elements(tilted, 1.225), tilted)
    # the same hub, seen from a platform that is pitched further by the tilt
    turn = curved_rotor.about_y(TILT)
    hub = turn.T @ [-tilted.rotor.overhang, 0.0, tilted.rotor.hub_height]
    rotor = upright.rotor.model_copy(update={"overhang": -hub[0], "hub_height": hub[2]})
    upright = upright.model_copy(update={"rotor": rotor})
    states[:, State.PLATFORM_PITCH] += TILT
    states[:, 7:10], states[:, 10:13] = states[:, 7:10] @ turn, states[:, 10:13] @ turn
    other = loads(solved, states, winds, build_blade_elements(upright, 1.225), upright)
    assert load[:, :3] @ turn == pytest.approx(other[:, :3], rel=1e-9)
    assert load[:, 3:6] @ turn == pytest.approx(other[:, 3:6], rel=1e-9)
    assert load[:, 6:] == pytest.approx(other[:, 6:], rel=1e-9)


@compiled
@pytest.mark.parametrize(
    ("kind", "blades"),
    # three blades in a sheared wind are taken together, two one by one
    [
        pytest.param("sheared", 3, marks=pytest.mark.nightly),
        ("sheared", 2),
        pytest.param("box", 3, marks=pytest.mark.nightly),
        ("still lower edge", 3),
    ],
)
def test_the_table_of_stations_gives_what_is_solved(kind, blades):
    turbine = curved(STRAIGHT, blades=blades)
    elements = build_blade_elements(turbine, 1.225)
    states, winds = moving(200)
    if kind == "still lower edge":  # a blade's tip below the lowest height: sampled station by station
        states[:, State.HEAVE] -= 45.0
    field = rough_field() if kind == "box" else None
    exact = loads(solved, states, winds, elements, turbine, field)
    quick = loads(looked_up, states, winds, build_section_table(elements), turbine, field)
    error = np.sqrt(np.mean((quick - exact) ** 2, axis=0)) / exact.std(axis=0)
    assert error[6:].max() < 3e-4  # thrust and torque
    assert error.max() < 1.2e-3


@compiled
def test_states_outside_the_table_of_stations_are_solved():
    states, winds = moving(3)
    table = build_section_table(ELEMENTS)
    parked, reversed_wind = states.copy(), winds * [-1.0, 1.0, 1.0, 1.0, 1.0]
    parked[:, State.ROTOR_SPEED] = 0.1
    for x, row in ((parked, winds), (states, reversed_wind)):
        assert loads(looked_up, x, row, table) == pytest.approx(
            loads(solved, x, row, ELEMENTS), rel=1e-9, abs=1e-3
        )


@pytest.mark.nightly
@compiled
def test_the_table_of_the_rotor_gives_the_mean_over_a_turn():
    states, winds = moving(60, pitch=(6.0, 18.0), spread=0.0)
    turns = np.linspace(0.0, 2.0 * np.pi / 3.0, 8, endpoint=False)
    exact = np.zeros((len(states), 8))
    for turn in turns:
        states[:, State.AZIMUTH] = turn
        exact += loads(solved, states, winds, ELEMENTS) / len(turns)
    quick = loads(averaged, states, winds, build_coefficient_table(ELEMENTS))
    error = np.sqrt(np.mean((quick - exact) ** 2, axis=0)) / exact.std(axis=0)
    assert error[[0, 4, 6, 7]].max() < ROTORS["table"].error  # surge, pitch, thrust, torque
    assert error.max() < 0.03


def smooth(turbine):
    """The turbine with polars that are smooth: those between points of a table have no second derivative."""
    angle = np.radians(np.linspace(-180.0, 180.0, 1441))
    lift = 3.2 * np.sin(angle + 0.07) * np.cos(angle) ** 2 + 0.4 * np.sin(2.0 * angle)
    moment = -0.1 * np.cos(angle) - 0.15 * np.sin(angle)
    polar = np.column_stack([angle, lift, 0.01 + 1.2 * np.sin(angle) ** 2, moment])
    blade = turbine.blade.model_copy(update={"polars": dict.fromkeys(turbine.blade.polars, polar)})
    return turbine.model_copy(update={"blade": blade})


STEPS = {"v": 0.6, "w": 0.6, "up": 3.0, "aside": 3.0, "power": 0.2, "pitch": 0.1}  # m/s, of a shear in 126 m


def derivative(load_at, about):
    """(4, 6) loads about the hub at four winds, derived by each of the named disturbances, times STEPS."""
    rows = []
    for wind, speed, blade_pitch in ((12, 1.27, 0.07), (15, 1.27, 0.18), (18, 1.27, 0.26), (24, 1.27, 0.39)):
        total = 0.0
        for signs in np.ndindex((2,) * len(about)):
            signs = 1.0 - 2.0 * np.array(signs)
            changed = dict.fromkeys(STEPS, 0.0)
            for name, sign in zip(about, signs, strict=True):
                changed[name] += sign * STEPS[name]
            x = np.zeros(N_RIGID)
            x[State.PLATFORM_PITCH] = changed["pitch"]
            x[State.ROTOR_SPEED], x[State.BLADE_PITCH] = speed, blade_pitch
            row = np.array([wind, *(changed[name] for name in ("v", "w", "up", "aside"))])
            total = total + signs.prod() * load_at(x, row, changed["power"]) / 2.0 ** len(about)
        hub = np.array([-CURVED.rotor.overhang, 0.0, CURVED.rotor.hub_height])
        rows.append(np.r_[total[:3], total[3:] - np.cross(hub, total[:3])])
    return np.array(rows)


@compiled
@pytest.mark.parametrize(
    ("about", "found", "within"),
    [
        (("v",), (1, 2, 4, 5), 0.004),
        (("up",), (1, 2, 4, 5), 0.004),
        (("power",), range(6), 0.02),
        (("v", "v"), (0, 3), 0.01),
        (("up", "up"), (0, 3), 0.01),
        (("v", "up"), (0, 3), 0.01),
        (("v", "aside"), (0, 3), 0.01),
        (("pitch", "up"), (0, 3), 0.01),
    ],
)
def test_the_table_of_the_rotor_has_the_derivatives_of_the_mean_load(about, found, within):
    """By cross wind and shear, linear and of a power law; twice for thrust and torque.

    On a rotor that is pitched in shear the cross wind diverges. The twin is at azimuths that leave no third
    harmonic, with its stations brought to the plane of the hub along the shaft: that the wind differs there
    is left out of the table.
    """
    turbine = smooth(curved(STRAIGHT, tilt=0.0))
    elements = build_blade_elements(turbine, 1.225)
    table = build_coefficient_table(elements)

    def exact(x, row, power):
        body = curved_rotor.rotation(*x[3:6])
        hub = body @ [-turbine.rotor.overhang, 0.0, turbine.rotor.hub_height]

        def wind(point):
            point = point - body[:, 0] * ((point - hub) @ body[:, 0])
            linear = (row[3] * (point[2] - 90.0) + row[4] * point[1]) / 126.0
            return np.array([row[0] * (point[2] / 90.0) ** power + linear, row[1], row[2]])

        turned = (np.r_[x[:6], azimuth, x[7:]] for azimuth in (0.0, np.pi / 3.0))
        return sum(curved_rotor.loads(turbine, elements, y, wind, 1.225) for y in turned) / 2.0

    def tabulated(x, row, power):
        return loads(averaged, [x], [row], table, turbine, shear=power)[0, :6]

    wanted, got = (derivative(load_at, about)[:, found] for load_at in (exact, tabulated))
    assert np.all(np.abs(got - wanted).max(axis=0) < within * np.abs(wanted).max(axis=0))


@compiled
def test_twelve_chosen_stations_stand_for_all_where_evenly_spaced_ones_do_not():
    few = build_fewer_elements(CURVED, 1.225, 12)
    even = build_blade_elements(CURVED, 1.225, chosen_stations(12, CURVED))
    assert len(few.radius) == 12 and set(few.radius) <= set(ELEMENTS.radius)
    states = np.zeros((4, N_RIGID))
    states[:, State.ROTOR_SPEED] = 0.96, 1.267, 1.267, 1.267
    states[:, State.BLADE_PITCH] = np.radians([0.0, 4.0, 15.0, 22.5])
    winds = np.outer([8.0, 12.0, 18.0, 24.0], [1.0, 0.0, 0.0, 0.0, 0.0])
    exact, chosen, spaced = (loads(solved, states, winds, e, shear=0.0)[:, 6:] for e in (ELEMENTS, few, even))
    assert chosen == pytest.approx(exact, rel=5e-3)
    assert np.abs(spaced / exact - 1.0).max() > 0.02


def test_rotor_loads_about_hub_and_roots_are_sums_over_stations():
    scene = build_scene(wind=14.0, shear_exponent=0.0, turbine=without_moment(STRAIGHT), fidelity="reference")
    elements = build_blade_elements(STRAIGHT, 1.225)
    fn, ft = np.array(
        [blade_section(14.0, 1.267 * r, 0.15, j, 1.0, elements)[5:7] for j, r in enumerate(elements.radius)]
    ).T
    arm = elements.moment_weight - 1.5 * elements.weight
    found = rotor_loads(scene, 1.267, 0.15, azimuth=0.3)
    assert found.force == pytest.approx([3 * elements.weight @ fn, 0.0, 0.0], rel=1e-9, abs=1.0)
    assert found.moment == pytest.approx([3 * elements.moment_weight @ ft, 0.0, 0.0], rel=1e-9, abs=100.0)
    assert found.root_out_of_plane == pytest.approx(np.full(3, arm @ fn), rel=1e-9)
    assert found.root_in_plane == pytest.approx(np.full(3, arm @ ft), rel=1e-9)


def test_rotor_loads_of_a_curved_rotor_are_those_of_its_plant():
    scene = build_scene(wind=14.0, turbine=CURVED, fidelity="reference")
    found = rotor_loads(scene, 1.267, 0.15, azimuth=0.3)
    x = np.zeros(N_RIGID)
    x[State.ROTOR_SPEED], x[State.BLADE_PITCH], x[State.AZIMUTH] = 1.267, 0.15, 0.3
    load = loads(solved, [x], [[14.0, 0.0, 0.0, 0.0, 0.0]], ELEMENTS)[0]
    hub = np.array([-CURVED.rotor.overhang, 0.0, CURVED.rotor.hub_height])
    turn = curved_rotor.about_y(TILT)
    assert found.force == pytest.approx(load[:3] @ turn, rel=1e-9)
    assert found.moment == pytest.approx((load[3:6] - np.cross(hub, load[:3])) @ turn, rel=1e-9)


@compiled
@pytest.mark.parametrize("stations", [50, 18])
def test_thrust_and_torque_of_a_tilted_coned_and_prebent_rotor_are_those_of_aerodyn(stations):
    """BEM_Mod 1, skewed wake, rigid IEA 15 MW on a fixed platform, uniform steady wind of 6 to 24 m/s."""
    points = table("iea15_volturnus_s/steady.csv.gz")
    points = points[points["case"].str.fullmatch(r"\d+mps")]
    assert len(points) == 6
    for point in points.to_dict("records"):
        scene = build_scene(
            "iea15_volturnus_s", wind=point["wind_mps"], shear_exponent=0.0, blade_stations=stations,
            hydrodynamics=False, mooring=False,
            fidelity="reference",
        )  # fmt: skip
        turns = np.linspace(0.0, 2.0 * np.pi / 3.0, 4, endpoint=False)
        state = point["rotor_speed_rpm"] * np.pi / 30.0, np.radians(point["blade_pitch1_deg"])
        found = [rotor_loads(scene, *state, turn) for turn in turns]
        assert np.mean([f.force[0] for f in found]) == pytest.approx(point["aero_thrust_N"], rel=1e-3)
        assert np.mean([f.moment[0] for f in found]) == pytest.approx(point["aero_torque_Nm"], rel=1e-3)


@compiled
def test_loads_in_shear_are_those_of_aerodyn_at_each_azimuth():
    scene = build_scene(
        "iea15_volturnus_s", wind=12.0, shear_exponent=0.14, skewed_wake=True, blade_stations=50,
        hydrodynamics=False, mooring=False,
        fidelity="reference",
    )  # fmt: skip
    rows = table("iea15_volturnus_s/rotor_in_shear.csv.gz").drop(columns="time_s")
    assert len(rows) == 13
    for degrees, thrust, torque, my, mz in rows.to_numpy():
        azimuth = np.radians(degrees)
        found = rotor_loads(scene, 7.56 * np.pi / 30.0, np.radians(6.3), azimuth)
        turned = curved_rotor.rotation(azimuth, 0.0, 0.0).T @ found.moment
        assert found.force[0] == pytest.approx(thrust, rel=5e-4)
        assert turned == pytest.approx([torque, my, mz], rel=5e-4, abs=4e3)


# Blades with a pitch each


@pytest.fixture(scope="module", params=["straight", "curved"])
def rotors(request):
    """(turbine, [(way, rotor)]) of what is solved and of the table of stations."""
    turbine = STRAIGHT if request.param == "straight" else CURVED
    elements = build_blade_elements(turbine, 1.225)
    return turbine, [(solved, elements), (looked_up, build_section_table(elements))]


fields = pytest.mark.parametrize(
    "field",
    [pytest.param(None, id="series"), pytest.param(rough_field(), id="box", marks=pytest.mark.nightly)],
)


@pytest.mark.nightly
@compiled
@fields
def test_equal_pitches_have_the_loads_of_one_pitch_for_all(rotors, field):
    turbine, ways = rotors
    states, winds = moving(20, spread=0.0)
    states[0, State.BLADE_PITCH :] = np.radians(-6.0)  # outside the table
    states[1, State.ROTOR_SPEED] = 0.3  # too slow for it
    for way, rotor in ways:
        each, _ = by(way, states, winds, rotor, turbine.rotor.shaft_tilt, field, PITCHES)
        collective, untouched = by(way, states, winds, rotor, turbine.rotor.shaft_tilt, field)
        assert each == pytest.approx(collective, rel=1e-12, abs=1e-12 * np.abs(collective).max())
        assert not untouched.any()


@compiled
@fields
def test_the_table_has_the_exact_loads_of_every_blade(rotors, field):
    """To the table's own accuracy, and exactly where one of the blades is pitched beyond it."""
    turbine, ways = rotors
    states, winds = moving(60)
    states[0, State.BLADE_PITCH], states[1, N_RIGID], states[2, N_RIGID + 1] = np.radians([-6.0, 91.0, -7.0])
    (exact, each_exact), (quick, each_quick) = (
        by(way, states, winds, rotor, turbine.rotor.shaft_tilt, field, PITCHES) for way, rotor in ways
    )
    assert np.array_equal(quick[:3], exact[:3]) and np.array_equal(each_quick[:3], each_exact[:3])
    assert not np.array_equal(quick[3:], exact[3:])
    assert np.all(np.abs(quick - exact).max(axis=0) < 3e-3 * np.abs(exact).max(axis=0))
    largest = np.abs(each_exact).max(axis=(0, 1))
    assert np.all(np.abs(each_quick - each_exact).max(axis=(0, 1)) <= 3e-3 * largest)


@compiled
@fields
def test_loads_of_the_blades_add_up_to_those_of_the_rotor(rotors, field):
    turbine, ways = rotors
    tilt, states_of_wind = turbine.rotor.shaft_tilt, moving(10)
    hub = curved_rotor.about_y(-tilt) @ [-turbine.rotor.overhang, 0.0, turbine.rotor.hub_height]
    for way, rotor in ways:
        totals, parts = by(way, *states_of_wind, rotor, tilt, field, PITCHES)
        for x, load, blades in zip(states_of_wind[0], totals, parts, strict=True):
            about_centre = NO_LOAD
            for number, part in enumerate(blades):
                psi = x[State.AZIMUTH] + 2.0 * np.pi * number / BLADES
                at = blade_motion(psi, 0.0, pose_of(x), pose_of(x))
                about_centre = with_blade(about_centre, BladeLoad(*part), at)
            force, moment = np.array(about_centre[:3]), np.array(about_centre[3:])
            wrench = to_body_axes(NO_LOAD._make([*force, *(moment + np.cross(hub, force))]), build_tilt(tilt))
            expected = np.array([*wrench, force[0], moment[0]])
            assert load == pytest.approx(expected, rel=1e-11, abs=1e-11 * np.abs(load).max())


@compiled
def test_a_blade_feels_its_own_pitch_alone(rotors):
    turbine, ways = rotors
    states, winds = moving(5)
    for way, rotor in ways:
        _, before = by(way, states, winds, rotor, turbine.rotor.shaft_tilt, pitches=PITCHES)
        for number, index in enumerate((State.BLADE_PITCH, N_RIGID, N_RIGID + 1)):
            changed = states.copy()
            changed[:, index] += 0.02
            _, after = by(way, changed, winds, rotor, turbine.rotor.shaft_tilt, pitches=PITCHES)
            others = [other for other in range(BLADES) if other != number]
            assert np.array_equal(after[:, others], before[:, others])
            assert np.all(after[:, number, 0] < 0.99 * before[:, number, 0])  # towards feather: less thrust
