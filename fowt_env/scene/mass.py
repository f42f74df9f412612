"""Mass properties of a turbine on its platform, and the points that outputs need."""

import numpy as np

from fowt_env.plant.channels import Layout
from fowt_env.plant.drivetrain import build_drivetrain
from fowt_env.plant.model import RigidBody

SPAN_POINTS = 8  # along a blade, for the mean wind over the blades in the outputs


def assemble(bodies):
    """(6, 6) mass matrix about the body origin of rigid bodies (mass, centre (3,), inertia (3,) about it)."""
    matrix = np.zeros((6, 6))
    for mass, centre, inertia in bodies:
        x, y, z = centre
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        matrix[:3, :3] += mass * np.eye(3)
        matrix[:3, 3:] -= mass * cross
        matrix[3:, :3] += mass * cross
        matrix[3:, 3:] += np.diag(inertia) - mass * cross @ cross
    return matrix


def _upper_bodies(platform, turbine):
    """Tower, nacelle and rotor as (mass, centre, inertia)."""
    tower, nacelle, rotor = platform.tower, turbine.nacelle, turbine.rotor
    return [
        (tower.mass, (0.0, 0.0, tower.cm_height), tower.inertia),
        (nacelle.mass, (nacelle.cm_downwind, 0.0, nacelle.cm_height), nacelle.inertia),
        (
            rotor.mass,
            (-rotor.overhang, 0.0, rotor.hub_height),
            (rotor.inertia, rotor.inertia_diameter, rotor.inertia_diameter),
        ),
    ]


def build_rigid_body(platform, turbine, platform_fixed=False, rotor_fixed=False, plane=None):
    """RigidBody part: Eq. (10) from the four rigid bodies. plane: True holds sway, roll and yaw at zero."""
    ballast = platform.ballast
    place = (ballast.cm_downwind, ballast.cm_left, -ballast.cm_depth)
    matrix = assemble([(ballast.mass, place, ballast.inertia), *_upper_bodies(platform, turbine)])
    drivetrain = build_drivetrain(turbine)
    return RigidBody(
        np.ascontiguousarray(matrix),
        float(matrix[0, 0]),
        float(matrix[1, 5]),
        float(matrix[0, 4]),
        float(platform.environment.gravity),
        drivetrain.coupling,
        drivetrain.inertia_row,
        platform_fixed,
        rotor_fixed,
        plane,
    )


def build_layout(platform, turbine):
    """Layout part: points and masses that outputs need."""
    rotor = turbine.rotor
    return Layout(
        np.array([-rotor.overhang, 0.0, rotor.hub_height]),
        np.array([0.0, 0.0, platform.tower.top_height]),
        float(platform.tower.base_height),
        float(rotor.mass),
        float(rotor.inertia),
        np.ascontiguousarray(assemble(_upper_bodies(platform, turbine))),
        float(turbine.drivetrain.gear_ratio),
        float(turbine.drivetrain.generator_efficiency),
        int(rotor.blades),
        np.linspace(rotor.hub_radius, rotor.tip_radius, 2 * SPAN_POINTS + 1)[1::2].copy(),
    )
