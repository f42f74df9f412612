"""Integrals of a blade that bends: sums one by one from the decks, closed forms, ElastoDyn's frequencies."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from naive.beam import beam_frequencies
from naive.blade_sums import blade_sums

from fowt_env.descriptions.blade_structure import BladeStructure
from fowt_env.descriptions.turbine import read_turbine, turbine_names
from fowt_env.errors import InputError
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.blade_shape import blade_line
from fowt_env.plant.aero.station_choice import line_loads
from fowt_env.scene.blade_beam import (
    blade_beam,
    blade_nodes,
    section_at,
    shapes_at,
    shapes_between,
    station_bending,
)
from fowt_env.scene.parts import build_elements

DECKS = Path(__file__).parents[1] / "reference" / "decks"
BLADES = {  # turbine: ElastoDyn's blade file
    "iea15": DECKS / "IEA-15-240-RWT/OpenFAST/IEA-15-240-RWT/IEA-15-240-RWT_ElastoDyn_blade.dat",
    "nrel5mw": DECKS / "ROSCO/Examples/Test_Cases/NREL-5MW/NRELOffshrBsline5MW_Blade.dat",
    "nrel5mw_openfast": DECKS / "ROSCO/Examples/Test_Cases/NREL-5MW/NRELOffshrBsline5MW_Blade.dat",
    "nrel5mw_tilted": DECKS / "ROSCO/Examples/Test_Cases/NREL-5MW/NRELOffshrBsline5MW_Blade.dat",
}
ORDER = {"modes": (0, 2), "modes2": (0, 1, 2)}


def with_structure(name, **changes):
    """The built-in turbine with other figures of its blade structure, unchecked."""
    turbine = read_turbine(name)
    return turbine.model_copy(update={"blade_structure": turbine.blade_structure.model_copy(update=changes)})


def sums(turbine, name):
    rotor, structure = turbine.rotor, turbine.blade_structure
    return blade_sums(
        BLADES[name], rotor.hub_radius, rotor.tip_radius, structure.elements, structure.tip_mass
    )


def integrals(nodes, modes):
    """{field of Beam: value} of nodes of blade_sums, added node by node."""
    n = len(modes)
    total = {"mass": 0.0, "first": 0.0, "second": 0.0}
    total |= {key: np.zeros(n) for key in "abef"}
    total |= {key: np.zeros((n, n)) for key in ("A", "B", "C", "S0", "S1")}
    total |= {"P": np.zeros((n,) * 3), "Q": np.zeros((n,) * 3), "T": np.zeros((n,) * 4)}
    for z, m, shape, _, short in nodes:
        total["mass"], total["first"] = total["mass"] + m, total["first"] + m * z
        total["second"] += m * z * z
        for i, k in enumerate(modes):
            u, w = shape[k]
            total["a"][i] += m * u
            total["b"][i] += m * w
            total["e"][i] += m * z * u
            total["f"][i] += m * z * w
            for j, other in enumerate(modes):
                total["A"][i, j] += m * u * shape[other][0]
                total["B"][i, j] += m * w * shape[other][1]
                total["C"][i, j] += m * u * shape[other][1]
                total["S0"][i, j] += m * short[k][other]
                total["S1"][i, j] += m * z * short[k][other]
                for p, third in enumerate(modes):
                    total["P"][i, j, p] += m * u * short[other][third]
                    total["Q"][i, j, p] += m * w * short[other][third]
                    for q, fourth in enumerate(modes):
                        total["T"][i, j, p, q] += m * short[k][other] * short[third][fourth]
    return total


def close(found, wanted, rel):
    """Whether arrays agree, relative to the largest value wanted."""
    return np.abs(np.subtract(found, wanted)).max() <= rel * np.abs(wanted).max()


@pytest.mark.parametrize("modes", ["modes", "modes2"])
@pytest.mark.parametrize("name", BLADES)
def test_a_blade_has_the_sums_of_its_deck(name, modes):
    """To the ten digits of the built-in files."""
    turbine = with_structure(name, tip_mass=321.0)
    beam, twin = blade_beam(turbine, modes), sums(turbine, name)
    order = list(ORDER[modes])
    for key, wanted in integrals(twin["nodes"], order).items():
        assert close(getattr(beam, key), wanted, 2e-8), key
    assert close(beam.stiffness, twin["stiffness"][np.ix_(order, order)], 1e-8)
    assert close(beam.damping, twin["damping"][np.ix_(order, order)], 1e-8)
    assert beam.count == (0,) * len(order)
    assert all(array.flags.c_contiguous and array.dtype == float for array in beam[4:])


def test_all_turbines_with_a_blade_file_are_tested():
    found = {name for name in turbine_names() if read_turbine(name).blade_structure is not None}
    assert found == set(BLADES)


def test_stiffness_tuners_and_damping_are_those_of_each_mode():
    changed = with_structure("iea15", flap_tuner=(4.0, 9.0), damping_ratio=(0.01, 0.02, 0.03))
    plain, tuned = (blade_beam(turbine, "modes2") for turbine in (read_turbine("iea15"), changed))
    factor = np.array([[4.0, 6.0, 1.0], [6.0, 9.0, 1.0], [1.0, 1.0, 1.0]])
    assert tuned.stiffness == pytest.approx(factor * plain.stiffness, rel=1e-12)
    # 2 zeta K / omega, of the second mode: omega grows with the root of the tuner
    ratio = np.array([0.01 / 2.0, 0.02 / 3.0, 0.03]) / 0.0048
    assert tuned.damping == pytest.approx(factor * plain.damping * ratio, rel=1e-9)


@pytest.mark.parametrize(
    "name, frequencies, near",
    [("iea15", (0.54279, 1.60614, 0.74136), 0.017), ("nrel5mw_openfast", (0.67622, 1.95777, 1.08766), 0.005)],
)
def test_the_frequencies_at_rest_are_elastodyns_and_near_those_of_finite_elements(name, frequencies, near):
    """FreqBF and FreqBE of Coeff, of shapes without twist; a beam of finite elements has no given shapes."""
    turbine = read_turbine(name)
    assert sums(turbine, name)["frequency"] == pytest.approx(frequencies, rel=1e-5)
    beam, structure, rotor = blade_beam(turbine, "modes2"), turbine.blade_structure, turbine.rotor
    alone = [
        beam_frequencies(
            rotor.tip_radius - rotor.hub_radius, structure.span_fraction, structure.mass_density, line,
            (0.0, 0.0, 0.0), 0.0,
        )
        for line in (structure.flapwise_stiffness, structure.edgewise_stiffness)
    ]  # fmt: skip
    assert frequencies == pytest.approx((*alone[0][:2], alone[1][0]), rel=near)
    # twist couples the modes
    squares = np.linalg.eigvals(np.linalg.solve(beam.A + beam.B, beam.stiffness))
    coupled = np.sort(np.sqrt(squares.real)) / (2.0 * np.pi)
    assert coupled == pytest.approx(sorted(frequencies), rel=0.012)


def uniform(elements, **changes):
    """The IEA 15 MW turbine with uniform untwisted blades: flap x^2 and x^3, edge 2 x^2 - x^3."""
    structure = BladeStructure(
        span_fraction=[0.0, 1.0], structural_twist=[0.0, 0.0], mass_density=[500.0] * 2,
        flapwise_stiffness=[1e9] * 2, edgewise_stiffness=[2e9] * 2, flap_1=(1, 0, 0, 0, 0),
        flap_2=(0, 1, 0, 0, 0), edge_1=(2, -1, 0, 0, 0), damping_ratio=(0.0, 0.0, 0.0), elements=elements,
        **changes,
    )  # fmt: skip
    return read_turbine("iea15").model_copy(update={"blade_structure": structure})


def test_a_uniform_blade_has_the_integrals_of_its_powers():
    turbine = uniform(999)
    beam, rotor = blade_beam(turbine, "modes2"), turbine.rotor
    hub, length = rotor.hub_radius, rotor.tip_radius - rotor.hub_radius
    mass = 500.0 * length
    assert beam.mass == pytest.approx(mass, rel=1e-12)
    assert beam.second == pytest.approx(500.0 * (rotor.tip_radius**3 - hub**3) / 3.0, rel=1e-6)
    assert beam.a == pytest.approx(mass * np.array([1 / 3, 1 / 4, 0.0]), rel=1e-5, abs=1e-9 * mass)
    assert beam.b == pytest.approx(mass * np.array([0.0, 0.0, 2 / 3 - 1 / 4]), rel=1e-5, abs=1e-9 * mass)
    assert beam.e[0] == pytest.approx(mass * (hub / 3 + length / 4), rel=1e-5)
    assert beam.A[0, 1] == pytest.approx(mass / 6, rel=1e-5)
    assert beam.C[0, 2] == pytest.approx(mass * (2 / 5 - 1 / 6), rel=1e-5) and beam.C[2, 0] == 0.0
    # shortening of flap 1: the integral of (2 x)^2 over the length, 4 x^3 / 3 over the length
    assert beam.S0[0, 0] == pytest.approx(mass / 3 / length, rel=1e-5)
    assert beam.P[1, 0, 0] == pytest.approx(mass * 4 / 3 / 7 / length, rel=1e-5)
    assert beam.T[0, 0, 0, 0] == pytest.approx(mass * 16 / 9 / 7 / length**2, rel=1e-5)
    assert beam.stiffness == pytest.approx(
        1e9 / length**3 * np.array([[4, 6, 0], [6, 12, 0], [0, 0, 2 * (16 - 24 + 12)]]), rel=1e-5, abs=1e-6
    )


def test_shapes_between_nodes_are_those_of_the_polynomial():
    turbine = uniform(100)
    hub, tip = turbine.rotor.hub_radius, turbine.rotor.tip_radius
    radii = np.array([hub, hub + 0.3, 50.0, 77.7, tip - 0.1, tip])
    found, x, length = shapes_at(turbine, "modes", radii), (radii - hub) / (tip - hub), tip - hub
    assert found.U[0, 0] == pytest.approx(x**2, abs=1e-4) and not found.U[0, 1].any()
    assert found.U[1, 1] == pytest.approx(2 * x**2 - x**3, abs=1e-4) and not found.U[1, 0].any()
    assert found.slope[0, 0] * length == pytest.approx(2 * x, abs=2e-4)
    assert found.S[0, 0] * length == pytest.approx(4 / 3 * x**3, abs=2e-4)
    assert not found.U[..., 0].any() and not found.slope[..., 0].any() and not found.S[..., 0].any()


def test_shapes_at_a_station_are_weighted_rigid_motions_of_its_neighbours():
    """OpenFAST's mapping of motions between meshes of lines, with rotations that are small."""
    turbine = read_turbine("iea15")
    nodes = blade_nodes(turbine)
    twin = sums(turbine, "iea15")["nodes"]
    (z1, _, u1, s1, w1), (z2, _, u2, s2, w2) = twin[30:32]
    z = z1 + 0.3 * (z2 - z1)
    found = shapes_between(nodes, np.array([z]))
    one, two = u1 + s1 * (z - z1), u2 + s2 * (z - z2)
    assert close(found.U[..., 0], 0.7 * one + 0.3 * two, 1e-8)
    assert close(found.slope[..., 0], 0.7 * s1 + 0.3 * s2, 1e-8)
    one, two = w1 + s1 @ s1.T * (z - z1), w2 + s2 @ s2.T * (z - z2)
    assert close(found.S[..., 0], 0.7 * one + 0.3 * two, 1e-8)
    for k, node in enumerate(twin):
        at = shapes_between(nodes, np.array([node[0]]))
        assert close(at.U[..., 0], node[2], 1e-8) and close(at.S[..., 0], node[4], 1e-7), k
    beyond = shapes_between(nodes, np.array([twin[-1][0] + 2.0]))
    assert close(beyond.U[..., 0], twin[-1][2] + 2.0 * twin[-1][3], 1e-8)


def assert_sums(section, wanted):
    """Assert that a Section has the integrals wanted, in the order z, U1, U2, S of pairs (i, j), j <= i."""
    n = len(wanted["a"])
    i, j = np.tril_indices(n)
    first = np.concatenate([[wanted["first"]], wanted["a"], wanted["b"], np.asarray(wanted["S0"])[i, j]])
    P, Q = (np.asarray(wanted[key])[:, i, j] for key in "PQ")
    S1, T = np.asarray(wanted["S1"])[i, j], np.asarray(wanted["T"])[i, j][:, i, j]
    e, f, C = (np.asarray(wanted[key]) for key in "efC")
    second = np.vstack(
        [
            np.concatenate([[wanted["second"]], e, f, S1]),
            np.column_stack([e, wanted["A"], C, P]),
            np.column_stack([f, C.T, wanted["B"], Q]),
            np.column_stack([S1, P.T, Q.T, T]),
        ]
    )
    assert section.mass == pytest.approx(wanted["mass"], rel=1e-7)
    assert close(section.first, first, 1e-7) and section.first.shape == (1 + 2 * n + n * (n + 1) // 2,)
    for row, sums in zip(section.second, second, strict=True):
        assert close(row, sums, 1e-7)


def test_the_part_outside_a_station_has_the_sums_of_its_nodes():
    turbine = with_structure("iea15", tip_mass=55.0)
    twin = sums(turbine, "iea15")["nodes"]
    rotor, half = turbine.rotor, 0.5 * (twin[1][0] - twin[0][0])

    def outside(z, modes="modes2"):
        fraction = (z - rotor.hub_radius) / (rotor.tip_radius - rotor.hub_radius)
        return section_at(turbine, modes, fraction, None)

    whole = blade_beam(turbine, "modes2")
    assert_sums(outside(rotor.hub_radius), {key: getattr(whole, key) for key in integrals(twin, (0, 1, 2))})
    assert_sums(outside(twin[20][0] - half), integrals(twin[20:], (0, 1, 2)))
    # a cut through the middle of an element: its outer half, in the middle of this half
    z, m, u, _, w = twin[20]
    beyond = twin[21]
    near = [z + half / 2, m / 2, 0.75 * u + 0.25 * beyond[2], None, 0.75 * w + 0.25 * beyond[4]]
    assert_sums(outside(z), integrals([near, *twin[21:]], (0, 1, 2)))
    assert outside(rotor.tip_radius, "modes").mass == pytest.approx(55.0, rel=1e-14)
    assert outside(rotor.tip_radius + 1.0, "modes").mass == 0.0


def test_a_turbine_without_the_structure_of_its_blades_bends_none():
    turbine = read_turbine("liu_1_50")
    assert blade_beam(turbine, "rigid") is None
    with pytest.raises(InputError) as caught:
        blade_beam(turbine, "modes")
    assert all(word in str(caught.value) for word in ("blades = 'modes'", "[blade_structure]", "'rigid'"))


def carried_arms(turbine, station):
    """(force, sums of U1, U2, axial (n,), S (n, n)) of a unit line load at a station, in 40,000 slices.

    The load falls linearly to the neighbouring stations. As OpenFAST's mapping: the line is cut at
    ElastoDyn's nodes too, both ends of a piece take their share of each slice, and the node nearest to an end
    moves that share as a rigid body.
    """
    rotor, twin = turbine.rotor, sums(turbine, "iea15")["nodes"][:-1]
    line = blade_line(turbine.blade, rotor.hub_radius, rotor.tip_radius)
    at, lengths = line.points[:, 2], line.length
    cuts = np.sort(np.concatenate([at, [node[0] for node in twin]]))
    force, total = 0.0, [0.0, 0.0, 0.0, 0.0]
    for a, b in zip(cuts[:-1], cuts[1:], strict=True):
        if not at[station - 1] <= 0.5 * (a + b) <= at[station + 1]:
            continue
        for share in (np.arange(800) + 0.5) / 800.0:
            z = a + share * (b - a)
            step = (np.interp(b, at, lengths) - np.interp(a, at, lengths)) / 800.0
            load = step * np.interp(z, at[station - 1 : station + 2], [0.0, 1.0, 0.0])
            offset = [np.interp(z, at, values) for values in line.points[:, :2].T]
            force += load
            for end, part in ((a, 1.0 - share), (b, share)):
                node, _, u, s, w = min(twin, key=lambda row: abs(row[0] - end))
                moved = u + s * (z - node), s @ offset, w + s @ s.T * (z - node)
                for k, value in enumerate((moved[0][:, 0], moved[0][:, 1], *moved[1:])):
                    total[k] = total[k] + part * load * value
    return force, *total


@pytest.mark.parametrize("station", [3, 27, 50])
def test_loads_act_on_the_nearest_of_elastodyn_s_nodes(station):
    turbine = read_turbine("iea15")
    modes = build_blade_elements(turbine, 1.225, bending=station_bending(turbine, "modes2")).modes
    force, *wanted = carried_arms(turbine, station)
    for name, value in zip(("load_x", "load_y", "load_axial", "load_shortening"), wanted, strict=True):
        assert close(getattr(modes, name)[station - 1], value / force, 1e-5), name


@pytest.mark.parametrize("count", [50, 18])
def test_loads_outside_of_a_section_are_those_of_the_line_beyond_it(count):
    """Force and moment of a line load that is linear between all stations; few stations are fitted to it."""
    turbine, bent = read_turbine("iea15"), station_bending(read_turbine("iea15"), "modes2")
    rotor, known = turbine.rotor, np.asarray(turbine.blade.radius)
    full = build_blade_elements(turbine, 1.225, shaped=True)
    elements = build_elements(turbine, 1.225, None if count == 50 else count, bent)
    aero, chosen = SimpleNamespace(rotor=SimpleNamespace(elements=elements)), elements.shape.distance
    normal, tangential = line_loads(full)
    for fraction in (0.25, 0.5):
        section = section_at(turbine, "modes2", fraction, aero)
        z = np.linspace(section.distance, rotor.tip_radius, 20_001)
        for loads in (normal[::200], tangential[::200]):
            for row in loads:
                density = np.interp(z, [rotor.hub_radius, *known, rotor.tip_radius], [0.0, *row, 0.0])
                force, moment = np.trapezoid(density, z), np.trapezoid(density * (z - section.distance), z)
                held = elements.weight * row[np.searchsorted(known, chosen)]
                arms = section.outside * (elements.shape.arm_distance - section.distance) + section.further
                assert held @ section.outside == pytest.approx(force, rel=3e-3)
                assert held @ arms == pytest.approx(moment, rel=5e-3)


def test_few_stations_are_fitted_to_the_modes_of_each_blade():
    """Blades of equal aerodynamics share the line loads, not the shapes."""
    turbines = read_turbine("iea15"), with_structure("iea15", flap_1=(1.0, 0.0, 0.0, 0.0, 0.0))
    one, other = (build_elements(t, 1.225, 18, station_bending(t, "modes")).modes for t in turbines)
    assert not close(one.load_x[:, 0], other.load_x[:, 0], 0.05)
    whole = build_blade_elements(turbines[1], 1.225, bending=station_bending(turbines[1], "modes")).modes
    assert close(other.load_x[-1, 0], whole.load_x[-1, 0], 0.05)
