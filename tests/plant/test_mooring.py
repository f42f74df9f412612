"""Mooring lines against an independent twin, MoorPy and published figures."""

import contextlib
import io

import naive.mooring as naive
import numpy as np
import pytest
from floaters import TENDON, tendons

from fowt_env.descriptions.platform import Line
from fowt_env.plant.events import N_COUNTERS, Counter
from fowt_env.plant.mooring import (
    N_LINE,
    SLACK,
    SUSPENDED,
    TOUCHDOWN,
    build_mooring,
    catenary,
    line_shape,
    mooring_load,
    suspended_residual,
    touchdown_residual,
)
from fowt_env.plant.state import N_RIGID, NO_LOAD, State, pose_of

pytestmark = pytest.mark.installation

# OC3-Hywind line: Jonkman (2010), NREL/TP-500-47535, table 6-1; wet weight as MAP++ has it
L, W, EA = 902.2, 698.094, 384.243e6
Z_REST, X_REST = 250.0, 848.67
LINE = (L, W, EA)


def oc3_lines(friction=0.0, turned=0.0):
    """Line records of OC3-Hywind, the anchors turned about the vertical by an angle."""
    records = []
    for azimuth in np.radians([0.0, 120.0, 240.0]):
        far, near = azimuth + turned, azimuth
        records.append(
            Line(
                anchor=(853.87 * np.cos(far), 853.87 * np.sin(far), -320.0),
                fairlead=(5.2 * np.cos(near), 5.2 * np.sin(near), -70.0),
                length=L,
                wet_weight=W,
                EA=EA,
                seabed_friction=friction,
            )
        )
    return tuple(records)


def wrench(motion, mooring, lines=None, counters=None):
    """(6,) wrench in body axes at a (6,) position and orientation; cold start unless lines are given."""
    x = np.zeros(N_RIGID)
    x[:6] = motion
    lines = np.zeros((3, N_LINE)) if lines is None else lines
    counters = np.zeros(N_COUNTERS) if counters is None else counters
    return np.array(mooring_load(pose_of(x), mooring, lines, counters))


def rotation(motion):
    """(3, 3) body to inertial."""
    x = np.zeros(N_RIGID)
    x[:6] = motion
    return np.array(pose_of(x)[3:12]).reshape(3, 3)


def random_spans(rng, n, longest=1.2):
    """n pairs (x_F, z_F) at chords from half to 1.2 times the line, all inclinations, all regimes."""
    chord = L * rng.uniform(0.5, longest, n)
    angle = rng.uniform(0.0, np.pi / 2, n)
    return np.column_stack([chord * np.cos(angle), chord * np.sin(angle)])


def random_motions(rng, n):
    """n platform positions and orientations that keep the fairleads high above the seabed."""
    reach = np.array([35.0, 35.0, 15.0, 0.3, 0.3, 0.6])
    return rng.uniform(-reach, reach, (n, 6))


def test_absent_mooring_is_exactly_no_load():
    x = np.zeros(N_RIGID)
    x[State.SURGE] = 20.0
    lines, counters = np.zeros((0, N_LINE)), np.zeros(N_COUNTERS)
    assert mooring_load(pose_of(x), None, lines, counters) == NO_LOAD
    assert build_mooring(()) is None


def test_rest_matches_published_tensions():
    """MAP++ summary of the OC3-Hywind OpenFAST model: 736939, 535728, 911089 N, 134.785 m on the seabed."""
    line = catenary(X_REST, Z_REST, *LINE, 0.0, 0.0)
    found = [line.H, line.V, line.fairlead_tension, line.seabed_length]
    assert found == pytest.approx([736939.0, 535728.0, 911089.0, 134.785], rel=5e-6)
    assert 3 * line.V == pytest.approx(1607000.0, rel=2e-4)  # Jonkman (2010): preload, four digits


def test_regimes_change_where_theory_says():
    assert catenary(652.2, Z_REST, *LINE, 0.0, 0.0).regime == SLACK
    assert catenary(652.3, Z_REST, *LINE, 0.0, 0.0).regime == TOUCHDOWN
    low, high = 850.0, 865.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if catenary(middle, Z_REST, *LINE, 0.0, 0.0).regime == TOUCHDOWN:
            low = middle
        else:
            high = middle
    assert low == pytest.approx(858.05, abs=0.05)  # published: about 858.5


def test_stiffness_matches_published_matrix():
    """Jonkman (2010), section 6: linearised mooring of OC3-Hywind, about the undisplaced origin."""
    mooring = build_mooring(oc3_lines())
    C = np.empty((6, 6))
    for j in range(6):
        step = 1e-2 if j < 3 else 1e-4
        inertial = []
        for side in (1.0, -1.0):
            motion = np.zeros(6)
            motion[j] = side * step
            R = rotation(motion)
            load = wrench(motion, mooring)
            inertial.append(np.r_[R @ load[:3], R @ load[3:]])
        C[:, j] = -(inertial[0] - inertial[1]) / (2 * step)
    assert C[0, 0] == pytest.approx(41181.0, abs=0.6)
    assert C[1, 1] == pytest.approx(C[0, 0], rel=1e-4)  # equal but for the differences' h^2
    assert C[2, 2] == pytest.approx(11942.0, abs=0.6)
    assert C[0, 4] == pytest.approx(-2.815e6, abs=600)
    assert C[4, 4] == pytest.approx(3.108e8, abs=6e4)
    assert C[5, 5] == pytest.approx(1.157e7, abs=6e3)
    published = [41180.0, 11940.0, -2.821e6, 3.111e8, 1.156e7]
    # 0.25 %: the published C15 and C51 differ by 0.18 % from each other
    assert [C[0, 0], C[2, 2], C[0, 4], C[4, 4], C[5, 5]] == pytest.approx(published, rel=2.5e-3)


def test_hanging_line_carries_its_own_weight():
    for x_f in (0.0, 1e-200, 0.5):
        line = catenary(x_f, Z_REST, *LINE, 0.3, 0.0)
        hanging = line.V / W
        assert line.H == 0.0 and line.anchor_tension == 0.0 and line.regime == SLACK
        assert hanging + 0.5 * W * hanging**2 / EA == pytest.approx(Z_REST, rel=1e-14)
        assert line.seabed_length == pytest.approx(L - hanging, rel=1e-14)


def test_fairlead_straight_above_the_anchor_stretches_the_line_vertically():
    line = catenary(0.0, 905.0, *LINE, 0.0, 0.0)
    assert line.H == 0.0 and line.regime == SUSPENDED
    assert line.V == pytest.approx(0.5 * W * L + EA * (905.0 / L - 1.0), rel=1e-13)
    assert line.anchor_tension == pytest.approx(line.V - W * L, rel=1e-13)
    aside = catenary(1e-3, 905.0, *LINE, 0.0, 0.0)
    assert aside.V == pytest.approx(line.V, rel=1e-9) and 0.0 < aside.H < 1e-4 * line.V


def test_line_on_the_seabed_is_a_bar_under_friction():
    """z_F = 0: no vertical force; with friction the tension falls by C_B w per metre."""
    bar = catenary(910.0, 0.0, *LINE, 0.0, 0.0)
    assert (bar.V, bar.seabed_length) == (0.0, L)
    assert bar.H == pytest.approx(EA * (910.0 / L - 1.0), rel=1e-12)
    held = catenary(910.0, 0.0, *LINE, 1.0, 0.0)
    assert held.H == pytest.approx(bar.H + 0.5 * W * L, rel=1e-12)
    assert held.anchor_tension == pytest.approx(held.H - W * L, rel=1e-12)
    gripped = catenary(902.3, 0.0, *LINE, 1.0, 0.0)  # friction uses up the tension before the anchor
    assert gripped.H == pytest.approx(np.sqrt(2 * EA * W * 0.1), rel=1e-10)
    assert gripped.anchor_tension == 0.0


def test_fairlead_below_the_anchor_counts_as_on_the_seabed():
    for x_f in (500.0, 902.5, 950.0):
        assert catenary(x_f, -5.0, *LINE, 0.4, 0.0) == catenary(x_f, 0.0, *LINE, 0.4, 0.0)


@pytest.mark.parametrize("friction", [0.0, 0.001, 1.0])
def test_line_matches_naive_twin(friction):
    rng = np.random.default_rng(11)
    seen = set()
    for x_f, z_f in random_spans(rng, 60):
        line = catenary(x_f, z_f, *LINE, friction, 0.0)
        H, V = naive.catenary(x_f, z_f, *LINE, friction)
        seen.add(line.regime)
        # 1e-9: the twin's differences of asinh cancel in taut lines
        assert [line.H, line.V] == pytest.approx([H, V], rel=1e-9, abs=1e-9 * V)
        assert line.fairlead_tension == pytest.approx(np.hypot(H, V), rel=1e-9)
        anchor = naive.anchor_tension(H, V, L, W, friction) if H > 0 else 0.0
        assert line.anchor_tension == pytest.approx(anchor, rel=1e-9, abs=1e-9 * V)
        assert line.seabed_length == pytest.approx(max(L - V / W, 0.0), abs=1e-9 * L)
    assert seen == {SLACK, TOUCHDOWN, SUSPENDED}


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_load_matches_naive_twin(friction):
    records = oc3_lines(friction)
    mooring = build_mooring(records)
    anchors = np.array([r.anchor for r in records])
    fairleads = np.array([r.fairlead for r in records])
    for motion in random_motions(np.random.default_rng(5), 15):
        force, moment = naive.load(motion[:3], rotation(motion), anchors, fairleads, *LINE, friction)
        load = wrench(motion, mooring)
        assert load[:3] == pytest.approx(force, abs=1e-9 * np.abs(force).max())
        assert load[3:] == pytest.approx(moment, abs=1e-9 * np.abs(moment).max())


@pytest.mark.parametrize("friction", [0.0, 0.001, 0.1, 5.0])
def test_solution_satisfies_the_printed_equations(friction):
    rng = np.random.default_rng(7)
    for x_f, z_f in random_spans(rng, 500):
        line = catenary(x_f, z_f, *LINE, friction, 0.0)
        assert line.converged
        if line.regime != SLACK:
            # 1e-10 m: rounding of the printed form; the solution itself is better
            assert naive.spans(line.H, line.V, *LINE, friction) == pytest.approx((x_f, z_f), abs=1e-10)


@pytest.mark.parametrize("friction", [0.0, 1.0])
def test_result_does_not_remember_the_warm_start(friction):
    rng = np.random.default_rng(3)
    spans = np.vstack([random_spans(rng, 5000), rng.uniform([640.0, 225.0], [885.0, 275.0], (5000, 2))])
    starts = 10.0 ** rng.uniform(-2, 9, len(spans))
    worst = 0.0
    for (x_f, z_f), start in zip(spans, starts, strict=True):
        cold = catenary(x_f, z_f, *LINE, friction, 0.0)
        warm = catenary(x_f, z_f, *LINE, friction, start)
        assert warm.converged and warm.regime == cold.regime
        scale = max(cold.fairlead_tension, 1e-300)
        worst = max(worst, abs(warm.H - cold.H) / scale, abs(warm.V - cold.V) / scale)
    assert worst < 1e-12


def test_lines_hold_what_each_line_does():
    mooring = build_mooring(oc3_lines(0.3))
    lines = np.zeros((3, N_LINE))
    wrench([30.0, 0, 0, 0, 0, 0], mooring, lines)
    x_f = 853.87 - 5.2 - 30.0
    line = catenary(x_f, Z_REST, *LINE, 0.3, 0.0)
    assert lines[0] == pytest.approx(
        [line.H, line.V, line.fairlead_tension, line.anchor_tension, line.seabed_length, line.regime],
        rel=1e-12,
    )
    assert list(lines[:, 5]) == [TOUCHDOWN, SUSPENDED, SUSPENDED]


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_force_is_continuous_where_the_line_lifts_off(friction):
    def at(x):
        return catenary(x, Z_REST, *LINE, friction, 0.0)

    low, high = 850.0, 865.0
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if at(middle).regime == TOUCHDOWN else (low, middle)
        if middle in (low, high) and np.nextafter(low, high) == high:
            break
    below, above = at(low), at(high)
    assert (below.regime, above.regime) == (TOUCHDOWN, SUSPENDED)
    assert below.V == pytest.approx(W * L, rel=1e-11)
    for name in ("H", "V", "fairlead_tension", "anchor_tension"):
        assert getattr(above, name) == pytest.approx(getattr(below, name), rel=1e-11)
    step = 1e-4  # the stiffness is continuous too, without friction
    if friction == 0.0:
        left = (at(low).H - at(low - step).H) / step
        right = (at(high + step).H - at(high).H) / step
        assert right == pytest.approx(left, rel=1e-3)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_force_is_continuous_where_the_line_goes_slack(friction):
    hanging = EA / W * (np.sqrt(1 + 2 * Z_REST * W / EA) - 1)
    edge = L - hanging
    slack = catenary(edge - 1e-9, Z_REST, *LINE, friction, 0.0)
    assert slack.regime == SLACK
    previous = 0.0
    for distance in (1e-9, 1e-7, 1e-5, 1e-3):
        line = catenary(edge + distance, Z_REST, *LINE, friction, 0.0)
        assert line.regime == TOUCHDOWN and line.converged
        assert previous < line.H < 100.0 * distance  # N: the stiffness at the edge is below 100 N/m
        assert line.V == pytest.approx(slack.V, abs=100.0 * distance)
        previous = line.H


@pytest.mark.parametrize("share", [0.5, 0.995, 1.0, 1.005, 2.0])
@pytest.mark.parametrize("friction", [0.5, 2.0])
def test_tensions_are_recovered_from_their_spans_around_full_grip(friction, share):
    """share: of the tension that friction can take before the anchor; 1 is where the branches of CB join."""
    seabed = 0.4 * L
    H, V = share * friction * W * seabed, W * (L - seabed)
    line = catenary(*naive.spans(H, V, *LINE, friction), *LINE, friction, 0.0)
    assert [line.H, line.V] == pytest.approx([H, V], rel=1e-11)
    assert line.anchor_tension == pytest.approx(max(H - friction * W * seabed, 0.0), abs=1e-11 * H)


def test_pull_of_a_nearly_vertical_line_points_at_its_anchor():
    def load_of(x, y):
        line = Line(anchor=(x, y, -975.0), fairlead=(0.0, 0.0, -70.0), length=L, wet_weight=W, EA=EA)
        return wrench(np.zeros(6), build_mooring((line,)), np.zeros((1, N_LINE)))

    H = catenary(0.5, 905.0, *LINE, 0.0, 0.0).H
    assert load_of(0.3, -0.4)[:2] == pytest.approx([0.6 * H, -0.8 * H], rel=1e-12)
    assert list(load_of(0.0, 0.0)[[0, 1, 3, 4, 5]]) == [0.0] * 5


@pytest.mark.parametrize("friction", [0.0, 0.001, 0.5, 5.0])
@pytest.mark.parametrize(
    "x_f, z_f", [(700.0, 250.0), (848.67, 250.0), (857.0, 250.0), (866.0, 250.0), (905.0, 300.0)]
)
def test_stiffness_is_the_inverse_of_the_printed_jacobian(x_f, z_f, friction):
    step = 1e-3
    K = np.empty((2, 2))
    for j, (dx, dz) in enumerate([(step, 0.0), (0.0, step)]):
        a = catenary(x_f + dx, z_f + dz, *LINE, friction, 0.0)
        b = catenary(x_f - dx, z_f - dz, *LINE, friction, 0.0)
        K[:, j] = (a.H - b.H) / (2 * step), (a.V - b.V) / (2 * step)
    line = catenary(x_f, z_f, *LINE, friction, 0.0)
    expected = np.linalg.inv(naive.jacobian(line.H, line.V, *LINE, friction))
    assert K == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_derivatives_of_the_solved_equations_match_differences():
    rng = np.random.default_rng(9)
    checked = {touchdown_residual: 0, suspended_residual: 0}
    for _ in range(300):
        Z, kappa = rng.uniform(0.05, 0.9), 10.0 ** rng.uniform(-4, 0)
        friction = rng.choice([0.0, 10.0 ** rng.uniform(-3, 1)])
        s = 2 * Z / (1 + np.sqrt(1 + 2 * kappa * Z))
        mu, X = 10.0 ** rng.uniform(-2, 0.5), rng.uniform(0.1, 1.2)
        h = 10.0 ** rng.uniform(-3, 1)
        known_touchdown, known_suspended = (Z, kappa, friction, s, 0.1), (X, Z, 0.5 * kappa)
        for residual, x, rest in (
            (touchdown_residual, h, known_touchdown),
            (suspended_residual, mu, known_suspended),
        ):
            step = 1e-6 * x
            _, slope, v, dv = residual(x, *rest)
            if residual is touchdown_residual and v >= 1.0:
                continue  # the iteration stays below lift-off
            checked[residual] += 1
            up, down = residual(x + step, *rest), residual(x - step, *rest)
            # 1e-7 absolute covers the rounding of f and v over the step, and a kink of friction inside it
            assert slope * x == pytest.approx((up[0] - down[0]) / 2e-6, rel=2e-6, abs=1e-9)
            assert dv * x == pytest.approx((up[2] - down[2]) / 2e-6, rel=2e-6, abs=1e-9)
            assert slope > 0.0
    assert min(checked.values()) > 100


def test_load_does_not_depend_on_the_heading_of_the_world():
    rng = np.random.default_rng(2)
    here = build_mooring(oc3_lines(0.1))
    for motion in random_motions(rng, 100):
        turn = rng.uniform(-np.pi, np.pi)
        c, s = np.cos(turn), np.sin(turn)
        there = build_mooring(oc3_lines(0.1, turned=turn))
        turned = motion.copy()
        turned[:2] = c * motion[0] - s * motion[1], s * motion[0] + c * motion[1]
        turned[5] += turn
        load = wrench(motion, here)
        assert wrench(turned, there) == pytest.approx(load, abs=1e-12 * np.abs(load).max())


@pytest.mark.parametrize("friction", [0.0, 0.001, 1.0])
def test_line_matches_moorpy(friction):
    """MoorPy 1.x on 1,000 random fairlead offsets, all regimes.

    Same model (Jonkman 2007), same friction law, same slack profile: with its tolerance tightened
    from 1e-6 m the tensions agree to about 1e-10, and 1e-8 is asked for. The two differ on purpose
    in two corners that MoorPy rounds off; see the next test.
    """
    moorpy = pytest.importorskip("moorpy.Catenary")
    rng = np.random.default_rng(17)
    spans = np.vstack([rng.uniform([600.0, 225.0], [885.0, 275.0], (600, 2)), random_spans(rng, 400)])
    regimes = np.zeros(3, dtype=int)
    for x_f, z_f in spans:
        line = catenary(x_f, z_f, *LINE, friction, 0.0)
        regimes[line.regime] += 1
        if z_f < 1e-5 * L or x_f < 1e-4 * z_f:
            continue
        with contextlib.redirect_stdout(io.StringIO()):
            HA, VA, HF, VF, info = moorpy.catenary(x_f, z_f, L, EA, W, CB=friction, Tol=1e-9)
        assert line.fairlead_tension == pytest.approx(np.hypot(HF, VF), rel=1e-8)
        assert line.anchor_tension == pytest.approx(
            np.hypot(HA, VA), rel=1e-8, abs=1e-8 * line.fairlead_tension
        )
        # its slack, all-on-seabed and vertical profiles report LBot of their own
        if info["ProfileType"] in (1, 2, 3, 4):
            assert line.seabed_length == pytest.approx(info["LBot"], abs=1e-6)
    assert (regimes > 100).all()


def test_moorpy_differs_only_where_it_rounds_the_geometry_off():
    """MoorPy lays a fairlead below 1e-5 L on the seabed, and makes x_F < 1e-4 z_F a vertical line.

    There the printed equations say which side is right: ours satisfies them, and the tension that
    MoorPy drops is small (31 N of a line of 630 kN; 4e-7 of the tension).
    """
    moorpy = pytest.importorskip("moorpy.Catenary")
    for x_f, z_f, difference in ((L, 1e-3, 31.05), (0.05, 905.0, 0.6023)):
        line = catenary(x_f, z_f, *LINE, 0.0, 0.0)
        HA, VA, HF, VF, info = moorpy.catenary(x_f, z_f, L, EA, W, Tol=1e-9)
        assert naive.spans(line.H, line.V, *LINE) == pytest.approx((x_f, z_f), abs=1e-12)
        assert HF == 0.0 and line.H > 0.0
        assert line.fairlead_tension - np.hypot(HF, VF) == pytest.approx(difference, rel=1e-3)


@pytest.mark.parametrize("friction", [0.0, 1e-6, 0.5, 1e3])
@pytest.mark.parametrize("kappa", [1e-9, 1.64e-3, 1.0, 1e3])
def test_no_finite_input_fails(kappa, friction):
    tiny = (0.0, 5e-324, 1e-300, 1e-160, 1e-30, 1e-9)
    stretched = 1.0 + 0.5 * kappa
    plain = (0.1, 0.5, 1.0 - 1e-15, 1.0, 1.0 + 1e-15, stretched, np.nextafter(stretched, 2e3), 1.2, 10.0)
    spans = [L * s for s in tiny + plain + (1e6, 1e120)]
    for x_f in spans:
        for z_f in [-s for s in spans] + spans:
            for start in (0.0, 5e-324, 1.0, 1e9, 1e200):
                line = catenary(x_f, z_f, L, W, W * L / kappa, friction, start)
                assert np.isfinite(line[:5]).all() and line.converged, (x_f, z_f, start, line)
                assert min(line[:5]) >= 0.0
                assert line.anchor_tension <= line.fairlead_tension * (1 + 1e-12)


def test_not_a_number_ends_and_is_counted():
    mooring = build_mooring(oc3_lines())
    lines, counters = np.zeros((3, N_LINE)), np.zeros(N_COUNTERS)
    assert np.isnan(wrench([np.nan, 0, 0, 0, 0, 0], mooring, lines, counters)).any()
    assert counters[Counter.MOORING_UNCONVERGED] == 3
    assert not catenary(np.inf, Z_REST, *LINE, 0.0, 0.0).converged
    assert wrench(np.zeros(6), mooring, lines, counters)[2] == pytest.approx(-1607182.0, rel=1e-6)
    assert counters[Counter.MOORING_UNCONVERGED] == 3


@pytest.mark.parametrize("friction", [0.0, 0.5, 5.0])
@pytest.mark.parametrize(
    "x_f, z_f",
    [(600.0, 250.0), (700.0, 250.0), (848.67, 250.0), (866.0, 250.0), (950.0, 250.0), (0.0, 905.0)],
)
def test_line_shape_ends_at_the_fairlead_and_strains_as_its_tension_says(x_f, z_f, friction):
    line = catenary(x_f, z_f, *LINE, friction, 0.0)
    n = 4001
    shape = line_shape(line.H, line.V, x_f, *LINE, friction, n)
    assert shape[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert shape[-1] == pytest.approx([x_f, z_f], abs=1e-8)
    assert (shape[:, 1] >= 0.0).all()
    if line.regime == SLACK:
        return  # the surplus on the seabed is drawn straight
    along = np.linspace(0.0, L, n)
    middle = 0.5 * (along[1:] + along[:-1])
    ds = along[1]
    V = line.V - W * (L - middle)
    T = np.hypot(line.H, V)
    curvature = W * line.H / T**2
    if line.regime == TOUCHDOWN:
        T = np.where(V > 0.0, T, np.maximum(line.H + friction * V, 0.0))
        curvature[V < 0.0] = 0.0
    strain = np.hypot(*np.diff(shape, axis=0).T) / ds - 1.0
    strain += (ds * curvature) ** 2 / 24.0  # a chord is that much shorter than its arc
    whole = np.abs(V) > W * ds  # a segment that is part on the seabed, part lifted has no one tension
    assert strain[whole] == pytest.approx((T / EA)[whole], rel=1e-4, abs=1e-8)


# The table


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_tabulated_lines_pull_as_the_solved_ones(friction):
    """Rms error over standard deviation of the wrench, in motions of operation and storms."""
    exact, table = build_mooring(oc3_lines(friction)), build_mooring(oc3_lines(friction), tabulated=True)
    rng = np.random.default_rng(5)
    reach = np.array([25.0, 15.0, 6.0, 0.1, 0.15, 0.2])
    motions = rng.uniform(-reach, reach, (500, 6))
    a, b = (np.array([wrench(motion, mooring) for motion in motions]) for mooring in (table, exact))
    assert np.all(np.std(a - b, axis=0) < 1e-4 * np.std(b, axis=0))


def test_tabulated_lines_report_the_same_state():
    exact, table = build_mooring(oc3_lines(0.5)), build_mooring(oc3_lines(0.5), tabulated=True)
    for motion in ([0.0] * 6, [20.0, 3.0, 1.0, 0.0, 0.05, 0.1], [-8.0, 0.0, -2.0, 0.02, 0.0, 0.0]):
        rows = np.zeros((2, 3, N_LINE))
        for row, mooring in zip(rows, (table, exact), strict=True):
            wrench(motion, mooring, row)
        assert np.array_equal(rows[0, :, 5], rows[1, :, 5])
        assert np.allclose(rows[0], rows[1], rtol=1e-4, atol=1e-2)


def test_beyond_the_table_lines_are_solved():
    exact, table = build_mooring(oc3_lines()), build_mooring(oc3_lines(), tabulated=True)
    for motion in ([80.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 40.0, 0.0, 0.0, 0.0]):
        lines = np.zeros((3, N_LINE)), np.zeros((3, N_LINE))
        pulls = [wrench(motion, mooring, row) for mooring, row in zip((table, exact), lines, strict=True)]
        outside = np.all(lines[0] == lines[1], axis=1)
        assert outside.any()
        assert np.allclose(*pulls, rtol=1e-4, atol=1e2)
    assert np.all(np.isnan(wrench([np.nan, 0.0, 0.0, 0.0, 0.0, 0.0], table)[:3]))


def test_the_tabulated_pull_has_no_steps():
    """Neighbouring places differ by the stiffness times the distance, across the cells of the table too."""
    table = build_mooring(oc3_lines(), tabulated=True)
    surge = np.linspace(5.0, 6.0, 20001)
    pull = np.array([wrench([s, 0.0, 0.0, 0.0, 0.0, 0.0], table)[0] for s in surge])
    slope = np.diff(pull) / np.diff(surge)
    assert np.abs(np.diff(slope)).max() < 0.01 * np.abs(slope).mean()


# Tendons of a tension-leg platform, eight in four pairs: the MIT/NREL TLP of OpenFAST's regression tests


def test_tendons_have_the_tensions_of_map():
    """MAP++'s summary of that test: 3833338.083 N at the fairlead and 3680014.476 N at the anchor."""
    lines = np.zeros((8, N_LINE))
    load = wrench(np.zeros(6), build_mooring(tendons()), lines)
    # it stops with a sideways pull of 247 N in a line that stands vertical, 6e-5 of the tension
    assert lines[:, 2] == pytest.approx(np.full(8, 3833338.083), rel=2e-6)
    assert lines[:, 3] == pytest.approx(np.full(8, 3680014.476), rel=2e-6)
    assert lines[:, 5] == pytest.approx(np.full(8, SUSPENDED))
    assert load == pytest.approx([0.0, 0.0, -8 * lines[0, 2], 0.0, 0.0, 0.0], abs=1e-6)


def test_a_vertical_tendon_is_a_spring():
    length, weight, stiffness = TENDON
    for height in (152.11, 151.9, 155.0):
        line = catenary(0.0, height, *TENDON, 0.0, 0.0)
        strain = height / length - 1.0
        assert line.fairlead_tension == pytest.approx(stiffness * strain + 0.5 * weight * length, rel=1e-12)
        near = catenary(1e-6, height, *TENDON, 0.0, 0.0)
        assert near.fairlead_tension == pytest.approx(line.fairlead_tension, rel=1e-12)
        # Eq. (18) where H vanishes: x = H (log(V / V_anchor) / w + L / EA)
        slope = np.log(line.fairlead_tension / line.anchor_tension) / weight + length / stiffness
        assert 1e-6 / near.H == pytest.approx(slope, rel=1e-9)


def test_taut_and_steep_lines_match_moorpy():
    """To 1e-7 of the tension. Of a very taut line MoorPy may find both tensions negative, equal in size."""
    moorpy = pytest.importorskip("moorpy.Catenary")
    rng = np.random.default_rng(21)
    length, weight, stiffness = TENDON
    for _ in range(300):
        chord = length * rng.uniform(0.995, 1.02)
        lean = 10.0 ** rng.uniform(-3.5, -0.1)
        x_f, z_f = chord * np.sin(lean), chord * np.cos(lean)
        line = catenary(x_f, z_f, *TENDON, 0.0, 0.0)
        assert line.converged
        with contextlib.redirect_stdout(io.StringIO()):
            HA, VA, HF, VF, _ = moorpy.catenary(x_f, z_f, length, stiffness, weight, CB=0.0, Tol=1e-10)
        scale = line.fairlead_tension
        assert [line.H, line.V] == pytest.approx(np.abs([HF, VF]), abs=1e-7 * scale)
        assert line.anchor_tension == pytest.approx(np.hypot(HA, VA), abs=1e-7 * scale)


def test_lines_that_no_table_follows_are_solved():
    exact, table = build_mooring(tendons()), build_mooring(tendons(), tabulated=True)
    assert np.isnan(table.table.origin).all()
    assert not np.isnan(build_mooring(oc3_lines(), tabulated=True).table.origin).any()
    motion = [4.0, -1.0, -0.1, 0.002, 0.001, 0.03]
    assert wrench(motion, table, np.zeros((8, N_LINE))) == pytest.approx(
        wrench(motion, exact, np.zeros((8, N_LINE))), rel=1e-12
    )


def test_a_table_stands_for_a_line_only_where_it_follows_it_within_2_percent():
    """A taut rope of little weight in water loses its sag, and its pull, within a step of the table."""
    missed = {}
    for weight in (5.0, 10.0, 20.0, 50.0):
        ends = {"anchor": (X_REST, 0.0, -Z_REST), "fairlead": (0.0, 0.0, 0.0)}
        rope = Line(**ends, length=886.0, wet_weight=weight, EA=EA)
        table, exact = build_mooring([rope], tabulated=True), build_mooring([rope])
        errors = []
        for surge, heave in np.ndindex(64, 4):
            motion = [8.0 - 0.25 * surge, 0.0, heave - 2.0, 0.0, 0.0, 0.0]
            a, b = (wrench(motion, mooring, np.zeros((1, N_LINE)))[:3] for mooring in (table, exact))
            errors.append(np.linalg.norm(np.subtract(a, b)) / np.linalg.norm(b))
        missed[weight] = max(errors)
    assert missed[5.0] == missed[10.0] == 0.0  # solved: a table would be 11 and 4 % off
    assert 0.005 < missed[20.0] < 0.02 and 0.0 < missed[50.0] < 0.002
