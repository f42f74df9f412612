"""Computes mass properties of a turbine on its platform, and the points for outputs."""

import numpy as np

from fowt_env.descriptions.rotor_mass import BLADE_MASSES
from fowt_env.errors import InputError
from fowt_env.plant.blade_outputs import BladeMasses
from fowt_env.plant.channels import Layout
from fowt_env.plant.drivetrain import build_drivetrain
from fowt_env.plant.model import RigidBody
from fowt_env.plant.tilt import build_tilt, rotor_axes

SPAN_POINTS = 8  # along a blade, for the mean wind over the blades in the outputs


def assemble(bodies):
    """Return (6, 6) mass matrix about the body origin of rigid bodies (mass, centre (3,), central inertia).

    inertia: (3,) about the body axes, or a (3, 3) tensor.
    """
    matrix = np.zeros((6, 6))
    for mass, centre, inertia in bodies:
        x, y, z = centre
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        matrix[:3, :3] += mass * np.eye(3)
        matrix[:3, 3:] -= mass * cross
        matrix[3:, :3] += mass * cross
        tensor = np.diag(inertia) if np.ndim(inertia) == 1 else inertia
        matrix[3:, 3:] += tensor - mass * cross @ cross
    return matrix


def _rotor_body(rotor):
    """Return the rotor as (mass, centre, inertia), with the centre on the shaft, a principal axis."""
    shaft = np.array([np.cos(rotor.shaft_tilt), 0.0, -np.sin(rotor.shaft_tilt)])  # downwind
    centre = np.array([-rotor.overhang, 0.0, rotor.hub_height]) + rotor.cm_offset * shaft
    inertia = np.array([rotor.inertia, rotor.inertia_diameter, rotor.inertia_diameter])
    if rotor.shaft_tilt != 0.0:
        along = np.outer(shaft, shaft)
        inertia = rotor.inertia * along + rotor.inertia_diameter * (np.eye(3) - along)
    return rotor.mass, centre, inertia


def nacelle_centre(nacelle):
    """Return the centre of mass of a nacelle, m from the body origin."""
    return nacelle.cm_downwind, nacelle.cm_left, nacelle.cm_height


def _lower_bodies(platform):
    """Return ballast and tower as (mass, centre, inertia)."""
    ballast, tower = platform.ballast, platform.tower
    return [
        (ballast.mass, (ballast.cm_downwind, ballast.cm_left, -ballast.cm_depth), ballast.inertia),
        (tower.mass, (0.0, 0.0, tower.cm_height), tower.inertia),
    ]


def _bodies(platform, turbine):
    """Return ballast, tower, nacelle and rotor as (mass, centre, inertia)."""
    nacelle = turbine.nacelle
    return [
        *_lower_bodies(platform),
        (nacelle.mass, nacelle_centre(nacelle), nacelle.inertia),
        _rotor_body(turbine.rotor),
    ]


def rotor_mass_matrix(rotor):
    """Return (6, 6) mass matrix of a Rotor about the body origin."""
    return assemble([_rotor_body(rotor)])


def top_mass_matrix(platform, turbine):
    """Return (6, 6) mass matrix of nacelle and rotor about the body origin."""
    return assemble(_bodies(platform, turbine)[2:])


def build_rigid_body(platform, turbine, platform_fixed=False, rotor_fixed=False, plane=None):
    """Return the RigidBody, Eq. (10), of the four bodies; plane: True keeps sway, roll and yaw at zero."""
    matrix = assemble(_bodies(platform, turbine))
    if plane is not None and matrix[0, 5] != 0.0:
        left = -matrix[0, 5] / matrix[0, 0]
        raise InputError(
            f"cm_left of ballast or nacelle: the centre of mass lies {left:g} m to the left; a planar scene"
            " needs 0 (planar = False)"
        )
    drivetrain = build_drivetrain(turbine)
    return _rigid_body(
        matrix,
        platform,
        (drivetrain.coupling, drivetrain.inertia_row, build_tilt(turbine.rotor.shaft_tilt)),
        (platform_fixed, rotor_fixed, plane),
    )


def build_lower_body(platform):
    """Return the RigidBody of floater and straight tower alone, without a rotor."""
    return _rigid_body(assemble(_lower_bodies(platform)), platform, (0.0, 0.0, None), (False, False))


def _rigid_body(matrix, platform, rotor, fixed):
    return RigidBody(
        np.ascontiguousarray(matrix),
        float(matrix[0, 0]),
        float(matrix[1, 5]),
        float(-matrix[0, 5]) if matrix[0, 5] != 0.0 else None,
        float(matrix[0, 4]),
        float(platform.environment.gravity),
        *rotor,
        *fixed,
    )


def build_blade_masses(platform, turbine):
    """Return the BladeMasses of a turbine. Raises: InputError if the turbine file lacks them."""
    rotor = turbine.rotor
    if rotor.blade_mass is None:
        raise InputError(
            f"rotor.blade_mass: is missing in the turbine {turbine.name!r}; pitch = 'individual' needs"
            f" {', '.join(BLADE_MASSES)} for the moments at blade roots"
        )
    return BladeMasses(
        float(rotor.hub_radius),
        float(rotor.blade_first_moment),
        float(rotor.blade_second_moment + rotor.hub_radius * rotor.blade_first_moment),
        float(rotor.cm_offset),
        float(rotor.inertia_diameter),
        np.ascontiguousarray(top_mass_matrix(platform, turbine)),
    )


def build_layout(platform, turbine, individual=False, elastic=False):
    """Return the layout part: points and masses for outputs; individual: including those of single blades.

    elastic: nacelle and rotor are not in the mass matrix above the tower base.
    """
    rotor = turbine.rotor
    hub_x, hub_z = rotor_axes(-rotor.overhang, rotor.hub_height, rotor.shaft_tilt)
    return Layout(
        np.array([-rotor.overhang, 0.0, rotor.hub_height]),
        np.array([0.0, 0.0, platform.tower.top_height]),
        float(platform.tower.base_height),
        float(rotor.mass),
        float(rotor.inertia),
        np.ascontiguousarray(assemble(_bodies(platform, turbine)[1 : 2 if elastic else None])),
        float(turbine.drivetrain.gear_ratio),
        float(turbine.drivetrain.generator_efficiency),
        int(rotor.blades),
        np.linspace(rotor.hub_radius, rotor.tip_radius, 2 * SPAN_POINTS + 1)[1::2].copy(),
        build_tilt(rotor.shaft_tilt),
        np.array([hub_x, 0.0, hub_z]),
        float(np.sin(rotor.cone)),
        float(np.cos(rotor.cone)),
        np.ascontiguousarray(_rotor_body(rotor)[1]),
        build_blade_masses(platform, turbine) if individual else None,
    )
