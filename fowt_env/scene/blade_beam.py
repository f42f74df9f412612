"""Integrates mass, stiffness and shapes of a blade along its bending modes.

Axes of a blade, which turn with its pitch: z from the apex along the pitch axis to the tip; x, at zero
pitch, normal to the cone of the pitch axes, downwind; y = z cross x, at zero pitch against the rotation. A
particle at the distance z from the apex lies at (U1 q, U2 q, z - q S q / 2): deflections by shapes times
modal coordinates q (m), and the shortening of the bent axis. All integrals are ElastoDyn's sums over equal
elements (subroutine Coeff).
"""

import numpy as np

from fowt_env.descriptions.blade_structure import SHAPES
from fowt_env.errors import InputError
from fowt_env.plant.aero.blade_shape import Bending, BladeLine, blade_line
from fowt_env.plant.aero.station_choice import outer_fit
from fowt_env.plant.elastic.blades import BladeModes, Point, Section
from fowt_env.plant.state import BLADES
from fowt_env.scene.beam import (
    BeamNodes,
    Shapes,
    carried_shapes,
    integrated,
    outer_part,
    section_columns,
    shape_values,
    shapes_between,
    summed,
)

MODES = {  # option blades: modes of each blade, from SHAPES
    "rigid": (),
    "modes": ("flap_1", "edge_1"),
    "modes2": ("flap_1", "flap_2", "edge_1"),
}


LIFT_SLOPE = 2.0 * np.pi  # 1/rad
YIELDING = 0.5 * BLADES  # blades whose reaction turns the rotor of a rigid shaft: between none and all
DAMPED = 1.6  # factor on the damping at rated speed, for gusts and overspeed
FINE = 20_001  # points of the sums over the span that divide a station's load
SECTIONS = (0.25, 0.5)  # of the span, for internal loads


def build_blade_modes(turbine, options, first_state, aero):
    """Return the BladeModes of a scene's options, with states from first_state on; None for rigid blades.

    aero: Aero or None. Raises: InputError for a turbine without [blade_structure].
    """
    option = options["blades"]
    beam = blade_beam(turbine, option)
    if beam is None:
        return None
    rotor = turbine.rotor
    return BladeModes(
        first=int(first_state),
        beam=beam,
        cone_cosine=float(np.cos(rotor.cone)),
        cone_sine=float(np.sin(rotor.cone)),
        hub_radius=float(rotor.hub_radius),
        spring=_spring(beam, rotor.inertia, YIELDING if options["shaft"] == "rigid" else 0.0),
        decay=_decay(beam, aero, turbine.rated_rotor_speed),
        tip=_point(shapes_at(turbine, option, [rotor.tip_radius])),
        inner=section_at(turbine, option, SECTIONS[0], aero),
        outer=section_at(turbine, option, SECTIONS[1], aero),
    )


def _spring(beam, inertia, yielding):
    """Return the (n, n) accelerations (1/s2) per deflection by stiffness, of a hub that gives way.

    A rotor of this inertia (kg m2) turns with the reaction of three blades in phase, and not at all out of
    phase. With a hub at rest, motions in phase would be unstable at 0.05 s where the wind hardly damps them,
    and on a shaft that twists they are exact (in_phase.py).
    """
    turning = yielding * np.outer(beam.f, beam.f) / inertia
    return np.ascontiguousarray(np.linalg.solve(beam.A + beam.B - turning, beam.stiffness))


def _decay(beam, aero, rotor_speed):
    """Return the (n, n) decay rates (1/s) of modal velocities: structural, and by lift at a speed (rad/s).

    A section that moves downwind by v has the angle of attack, in a flow of speed times radius, smaller by
    their quotient.
    """
    damping = beam.damping
    if aero is not None:
        e = aero.rotor.elements
        line = 0.5 * e.air_density * LIFT_SLOPE * e.chord * e.weight * rotor_speed * e.radius
        damping = damping + DAMPED * np.einsum("j,ji,jk->ik", line, e.modes.x, e.modes.x)
    return np.ascontiguousarray(np.linalg.solve(beam.A + beam.B, damping))


def _point(shapes):
    """Return the Point of Shapes at one distance."""
    return Point(
        *(
            np.ascontiguousarray(values[:, axis, 0])
            for values in (shapes.U, shapes.slope)
            for axis in range(2)
        ),
        np.ascontiguousarray(shapes.S[:, :, 0]),
    )


def section_at(turbine, option, fraction, aero):
    """Return the Section at a fraction of a blade's span."""
    rotor = turbine.rotor
    distance = rotor.hub_radius + fraction * (rotor.tip_radius - rotor.hub_radius)
    outside = further = np.zeros(0)
    if aero is not None:
        outside, further = _outer_loads(turbine, aero.rotor.elements, distance)
    point = _point(shapes_at(turbine, option, [distance]))
    structure = turbine.blade_structure
    twist = np.interp(fraction, structure.span_fraction, structure.structural_twist)
    outer = outer_part(blade_nodes(turbine, blade_modes(turbine, option)), distance)
    columns = section_columns(outer)
    return Section(
        float(distance), float(np.cos(twist)), float(np.sin(twist)), point, float(outer.mass.sum()),
        columns @ outer.mass, np.ascontiguousarray((columns * outer.mass) @ columns.T), outside, further,
    )  # fmt: skip


def _outer_loads(turbine, elements, distance):
    """Return, for each station's load, the fraction outside of a distance (m), and that part's moment, m.

    The moment is about the point where the whole load acts, along the pitch axis. Of stations that stand for
    others, both are fitted (outer_fit).
    """
    stations, known = elements.shape.distance, np.asarray(turbine.blade.radius)
    share, moment = _hat_parts(stations, turbine.rotor, distance)
    if len(stations) == len(known):
        return share, moment
    whole = _hat_parts(known, turbine.rotor, distance)
    return outer_fit(turbine, elements, np.searchsorted(known, stations), whole, (share, moment))


def _hat_parts(stations, rotor, distance):
    """Return _outer_loads of a load that is linear between stations and zero at hub and tip."""
    nodes = np.array([rotor.hub_radius, *stations, rotor.tip_radius])
    fine = np.linspace(rotor.hub_radius, rotor.tip_radius, FINE)
    hats = np.array([np.interp(fine, nodes, row) for row in np.eye(len(nodes))[1:-1]])
    whole, beyond = hats.sum(axis=1), fine >= distance
    share, first = hats[:, beyond].sum(axis=1) / whole, hats[:, beyond] @ fine[beyond] / whole
    return share, first - share * (hats @ fine / whole)


def blade_modes(turbine, modes):
    """Return the names of the modes of an option "modes" or "modes2". Raises: InputError."""
    if turbine.blade_structure is None:
        raise InputError(
            f"blades = {modes!r}: the turbine {turbine.name!r} has no [blade_structure] in its file; allowed:"
            " 'rigid'"
        )
    return MODES[modes]


def blade_beam(turbine, modes):
    """Return the Beam of one blade about the apex; None for "rigid".

    modes: "rigid", "modes" (first flapwise, first edgewise) or "modes2" (second flapwise, too, in the order
    flap 1, flap 2, edge 1). Raises: InputError for a turbine without [blade_structure].
    """
    if modes == "rigid":
        return None
    names = blade_modes(turbine, modes)
    return integrated(blade_nodes(turbine, names), *_stiffness_and_damping(turbine, names))


def blade_nodes(turbine, names=SHAPES):
    """Return the BeamNodes of one blade with the modes of these names: root, elements, tip.

    Slopes, shapes and shortening are sums of half elements from the root on, as ElastoDyn's.
    """
    structure, rotor = turbine.blade_structure, turbine.rotor
    lumps = structure.lumps(rotor.hub_radius, rotor.tip_radius)
    x, length, curvature = _elements(turbine, names)
    twist = np.interp(x, structure.span_fraction, structure.structural_twist)
    flapwise, edgewise = [np.cos(twist), -np.sin(twist)], [np.sin(twist), np.cos(twist)]
    axes = np.array([edgewise if name.startswith("edge") else flapwise for name in names])
    slope = summed(curvature[:, None] * axes, length)
    shape = summed(slope[..., 1:-1], length)
    shortening = summed(np.einsum("iak,jak->ijk", slope, slope)[..., 1:-1], length)
    ends = np.concatenate([[0.0], np.full(len(x), length), [0.0]])
    z = np.concatenate([[rotor.hub_radius], lumps.radius])
    mass = np.concatenate([[0.0], lumps.mass])
    return BeamNodes(z, z + 0.5 * ends, ends, mass, Shapes(shape, slope, shortening))


def shapes_at(turbine, modes, radii):
    """Return the Shapes of a blade's modes at distances radii (m,) from the apex along the pitch axis, in m.

    As OpenFAST passes motions from ElastoDyn's nodes to AeroDyn's (Line2 of ModMesh_Mapping): weighted by
    the distance, each of the two neighbours moves the point as a rigid body, with its slope. Slopes are
    linear between the neighbours. A point beyond root or tip moves with that end. Raises: InputError.
    """
    nodes = blade_nodes(turbine, blade_modes(turbine, modes))
    return shapes_between(nodes, np.asarray(radii, dtype=float))


def blade_states(blades):
    """Return the number of states of BladeModes or None: deflections and their velocities."""
    return 0 if blades is None else 2 * BLADES * len(blades.beam.count)


def kept_states(blades, shaft):
    """Return the number of quantities of BladeModes or None that steps keep: deflections, then those of a
    Torsion or None, its twist and what the generator torque accelerates it by.
    """
    deflections = blade_states(blades) // 2
    return deflections + (2 if deflections and shaft is not None else 0)


def station_bending(turbine, option):
    """Return the Bending of an option blades on the turbine's blade_line; None for "rigid".

    As OpenFAST passes loads from AeroDyn's line to ElastoDyn's nodes, the middles of the elements: the line
    is divided at these nodes, each division's load is shared linearly between its ends, and each end is
    moved by the nearest node. Motions go another way, see shapes_at.
    """
    if option == "rigid":
        return None
    rotor = turbine.rotor
    line = blade_line(turbine.blade, rotor.hub_radius, rotor.tip_radius)
    nodes = blade_nodes(turbine, blade_modes(turbine, option))
    middles = nodes.z[1:-1]
    z = np.union1d(line.points[:, 2], middles)
    length = np.interp(z, line.points[:, 2], line.length)
    nearest = 1 + np.abs(z[:, None] - middles).argmin(axis=1)
    # Simpson's rule, exact here; its middle stands twice, moved by one end's node and by the other's
    low, high = length[:-1], length[1:]
    at = np.stack([low, 0.5 * (low + high), 0.5 * (low + high), high], axis=1).ravel()
    weight = np.outer(high - low, [1.0, 2.0, 2.0, 1.0]).ravel() / 6.0
    mover = np.stack([nearest[:-1], nearest[:-1], nearest[1:], nearest[1:]], axis=1).ravel()
    points = np.column_stack([np.interp(at, line.length, values) for values in line.points.T])
    return Bending(
        shapes_between(nodes, line.points[:, 2]), BladeLine(points, at), weight,
        carried_shapes(nodes, points[:, 2], mover),
    )  # fmt: skip


def _elements(turbine, names):
    """Return the elements' (m,) span fractions, their length (m), (n, m) curvatures of the modes, 1/m2."""
    structure, span = turbine.blade_structure, turbine.rotor.tip_radius - turbine.rotor.hub_radius
    x = (np.arange(structure.elements) + 0.5) / structure.elements
    curvature = shape_values(_coefficients(structure, names), x, 2).T / span**2
    return x, span / structure.elements, curvature


def _coefficients(structure, names):
    """Return the (n, 5) coefficients of the modes' polynomials."""
    return np.array([getattr(structure, name) for name in names])


def _stiffness_and_damping(turbine, names):
    """Return the (n, n) structural stiffness and damping of a blade's modes.

    Flapwise and edgewise modes are uncoupled. ElastoDyn's damping uses the frequency of the polynomial shape
    without twist, tip mass and rotation.
    """
    structure, rotor = turbine.blade_structure, turbine.rotor
    x, length, curvature = _elements(turbine, names)
    edge = np.array([name.startswith("edge") for name in names])
    mine = [SHAPES.index(name) for name in names]
    tuner = np.array([*structure.flap_tuner, 1.0])[mine]
    stiffness = np.zeros((len(names), len(names)))
    for rows, values in (
        (np.flatnonzero(~edge), structure.flapwise_stiffness),
        (np.flatnonzero(edge), structure.edgewise_stiffness),
    ):
        line = length * np.interp(x, structure.span_fraction, values)
        stiffness[np.ix_(rows, rows)] = np.einsum("k,ik,jk->ij", line, curvature[rows], curvature[rows])
    stiffness *= np.sqrt(np.outer(tuner, tuner))
    mass = structure.lumps(rotor.hub_radius, rotor.tip_radius).mass[:-1]
    generalised = mass @ shape_values(_coefficients(structure, names), x) ** 2
    bare = np.sqrt(np.diag(stiffness) / generalised)  # rad/s
    return stiffness, stiffness * (2.0 * np.array(structure.damping_ratio)[mine] / bare)
