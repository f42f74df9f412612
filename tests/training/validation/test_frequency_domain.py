"""The frequency domain against closed forms, MoorPy and published periods; nothing of the plant is used."""

from dataclasses import replace

import numpy as np
import pytest

from fowt_env.errors import InputError
from fowt_env.training.validation.frequency_domain import (
    DENSITY,
    GRAVITY,
    CatenaryLine,
    FloatingBody,
    catenary,
    interpolated,
    line_stiffness,
    point_mass,
    read_arrays,
    tower_mass,
    weight,
    weight_stiffness,
)
from fowt_env.training.validation.responses import body_of

LINE = CatenaryLine((-837.6, 0.0, -200.0), (-40.868, 0.0, -14.0), 835.35, 1065.7, 7.536e8)


def box(damping=0.0, added=0.0, **changes):
    """Body of one frequency-independent coefficient: a box 20 m wide, 10 m deep, on weak springs."""
    omega = np.linspace(0.05, 4.0, 80)
    mass = point_mass(DENSITY * 4000.0, (0.0, 0.0, -6.0), (5e8, 5e8, 6e8))
    ones = np.ones((omega.size, 1, 1))
    stiffness = np.zeros((6, 6))
    stiffness[2, 2] = DENSITY * GRAVITY * 400.0
    stiffness[3, 3] = stiffness[4, 4] = DENSITY * GRAVITY * (20.0**4 / 12.0 - 4000.0 * 5.0)
    coefficients = {
        "omega": omega, "added_mass": added * np.eye(6) * ones, "damping": damping * np.eye(6) * ones,
        "added_mass_infinite": added * np.eye(6), "stiffness": stiffness, "excitation_omega": omega,
        "heading": np.zeros(1), "excitation": np.ones((omega.size, 1, 6), complex),
    }  # fmt: skip
    springs = np.diag([1e4, 1e4, 0.0, 0.0, 0.0, 1e7])
    return FloatingBody(coefficients, mass, (), 4000.0, added_stiffness=springs, **changes)


def test_catenary_matches_moorpy_on_the_seabed_and_hanging_free():
    moorpy = pytest.importorskip("moorpy.Catenary")
    for span, rise, friction in ((796.7, 186, 1.0), (780.0, 186, 1.0), (812.0, 186, 0.0), (814.0, 180, 1.0)):
        line = replace(LINE, friction=friction)
        known = line.length, line.stiffness, line.weight
        _, _, h, v, _ = moorpy.catenary(span, rise, *known, CB=friction, Tol=1e-10)
        assert catenary(span, rise, line) == pytest.approx((abs(h), abs(v)), rel=1e-5)


def test_a_line_that_no_tension_fits_is_refused():
    with pytest.raises(InputError, match="no solution"):
        catenary(np.nan, 186.0, LINE)


def test_masses_off_the_origin_have_steiners_terms_and_a_tower_those_of_a_rod():
    matrix = point_mass(10.0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert np.diag(matrix) == pytest.approx([10, 10, 10, 4 + 10 * 13, 5 + 10 * 10, 6 + 10 * 5])
    assert matrix[0, 4] == pytest.approx(30.0) and matrix[1, 5] == pytest.approx(10.0)
    rod = tower_mass((0.0, 1.0), (100.0, 100.0), 10.0, 90.0)
    assert rod[0, 0] == pytest.approx(8000.0)
    assert rod[0, 4] == pytest.approx(8000.0 * 50.0)
    assert rod[4, 4] == pytest.approx(100.0 / 3.0 * (90.0**3 - 10.0**3), rel=1e-5)


def test_the_weight_turns_a_displaced_body_as_its_moment_about_the_origin_changes():
    mass = point_mass(7.0, (1.5, -0.5, 4.0))
    turn = 1e-6
    for axis in range(3):
        rotation = np.eye(3)
        a, b = [i for i in range(3) if i != axis]
        sign = -1.0 if axis == 1 else 1.0
        rotation[a, b], rotation[b, a] = -sign * turn, sign * turn
        moved = np.cross(rotation @ np.array([1.5, -0.5, 4.0]), [0.0, 0.0, -7.0 * GRAVITY])
        change = (moved - weight(mass)[3:]) / turn
        assert -weight_stiffness(mass)[3:, 3 + axis] == pytest.approx(change, abs=1e-4 * 7.0 * GRAVITY)


def test_coefficients_are_linear_between_frequencies_and_go_to_their_limits():
    grid, values = np.array([1.0, 2.0]), np.array([10.0, 30.0])
    assert interpolated(1.5, grid, values) == 20.0
    assert interpolated(0.5, grid, values, low=0.0) == 5.0
    assert interpolated(4.0, grid, values, high=0.0) == 15.0


def test_modes_of_a_box_are_those_of_mass_and_stiffness():
    body = box(added=1e6)
    modes = body.natural_modes()
    heave = np.sqrt(body.stiffness[2, 2] / (DENSITY * 4000.0 + 1e6))
    assert modes["heave"][0] == pytest.approx(heave, rel=1e-9)
    assert modes["yaw"][0] == pytest.approx(np.sqrt(1e7 / 6.01e8), rel=1e-9)


def test_responses_of_a_box_are_force_over_impedance():
    body, omega = box(damping=2e5), 0.7
    found = body.responses(np.array([omega]))[0, 2]
    impedance = body.stiffness[2, 2] - omega**2 * DENSITY * 4000.0 + 2e5j * omega
    assert found == pytest.approx(1.0 / impedance, rel=1e-9)


def test_a_box_let_go_swings_at_its_period_and_by_its_damping():
    body = box(added_damping=np.diag([0.0, 0.0, 4e5, 0.0, 0.0, 0.0]))
    time, motion = body.free_decay([0, 0, 1.0, 0, 0, 0], 60.0, step=0.02)
    mass = DENSITY * 4000.0
    natural, rate = np.sqrt(body.stiffness[2, 2] / mass), 0.5 * 4e5 / mass
    damped = np.sqrt(natural**2 - rate**2)
    exact = np.exp(-rate * time) * (np.cos(damped * time) + rate / damped * np.sin(damped * time))
    assert np.abs(motion[:, 2] - exact).max() < 5e-3


def test_retardation_of_a_band_of_damping_is_its_cosine_transform():
    body = box(damping=3.0)
    time = np.array([0.0, 0.5, 2.0])
    found = body.retardation(time)[:, 2, 2]
    top = body.coefficients["omega"][-1]
    exact = 2.0 / np.pi * 3.0 * top * np.sinc(top * time / np.pi)
    assert found == pytest.approx(exact, abs=0.06)  # the damping rises from zero below 0.05 rad/s


@pytest.mark.parametrize(
    ("name", "published"),
    # Robertson et al., NREL/TP-5000-60601 (2014), of the flexible turbine; Jonkman, NREL/TP-500-41958 (2007)
    [
        ("nrel5mw_oc4_semi", {"surge": 113.0, "heave": 17.5, "pitch": 26.8}),
        ("nrel5mw_iti_barge", {"pitch": 11.9}),
    ],
)
def test_periods_of_the_public_platforms_are_those_published_within_6_percent(name, published):
    modes = body_of(name).natural_modes()
    for motion, period in published.items():
        assert 2.0 * np.pi / modes[motion][0] == pytest.approx(period, rel=0.06)


def test_stiffness_of_three_lines_is_alike_in_surge_and_sway():
    body = body_of("nrel5mw_oc4_semi")
    stiffness = line_stiffness(body.lines, np.zeros(6))
    assert stiffness[0, 0] == pytest.approx(stiffness[1, 1], rel=1e-3)
    assert stiffness[0, 0] == pytest.approx(70.8e3, rel=0.01)  # Robertson et al. (2014), table 4-1


def test_missing_arrays_and_headings_are_named(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_arrays(tmp_path / "none.npz")
    with pytest.raises(InputError, match="heading"):
        box().excitation(1.0, heading=0.5)
