"""Computes aerodynamic loads of a rotor on a fixed platform, at the hub in shaft axes and at blade roots."""

from typing import NamedTuple

import numpy as np

from fowt_env.errors import InputError
from fowt_env.plant.aero.bem_rotor import rotor_load
from fowt_env.plant.aero.blade_elements import build_blade_elements
from fowt_env.plant.aero.wake import build_skewed_wake
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.blade_pitches import BladePitches
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.state import N_RIGID, State, pose_of
from fowt_env.plant.tilt import build_tilt, rotor_pose
from fowt_env.scene.options import chosen_stations
from fowt_env.scene.parts import build_elements, tower_influence_of


class RotorLoads(NamedTuple):
    """Holds aerodynamic rotor loads, N and N m. Shaft axes: x along the shaft downwind, y to the left."""

    force: np.ndarray  # (3,) shaft axes, which do not rotate with the rotor
    moment: np.ndarray  # (3,) about the rotor centre, shaft axes
    root_in_plane: np.ndarray  # (blades,) about the root, around the normal of the coned blade: RootMxc
    root_out_of_plane: np.ndarray  # (blades,) around the direction against the rotation: RootMyc


def rotor_loads(scene, rotor_speed, blade_pitch, azimuth=0.0, time=0.0):
    """Return the RotorLoads of a scene's rotor by blade element momentum theory, on the undisplaced platform.

    rotor_speed rad/s, blade_pitch rad, azimuth rad, time s. Induction is quasi-steady for any rotor model of
    the scene; skewed wake, tower influence and blade stations are those of the scene.
    Raises: InputError for a scene without wind.
    """
    aero, turbine = scene.model.aero, scene.turbine
    if aero is None:
        raise InputError("rotor_loads: the scene has no wind (wind = None)")
    density, count = scene.platform.environment.air_density, scene.options["blade_stations"]
    rotor = build_elements(turbine, density, count)
    if rotor.shape is None:
        rotor = build_blade_elements(turbine, density, chosen_stations(count, turbine), shaped=True)
    rotor = rotor._replace(tower=tower_influence_of(scene.platform, turbine, scene.options))
    skew = build_skewed_wake() if scene.options["skewed_wake"] else None
    pitches = BladePitches(N_RIGID)  # individual pitch, for which the load of each blade is stored
    x = np.zeros(N_RIGID + rotor.blades - 1)
    x[State.ROTOR_SPEED], x[State.AZIMUTH], x[State.BLADE_PITCH :] = rotor_speed, azimuth, blade_pitch
    pose = rotor_pose(pose_of(x), build_tilt(turbine.rotor.shaft_tilt))
    blades = np.zeros((rotor.blades, 6))
    rotor_load(
        time, pose, x, wind_now(time, aero.wind), aero.wind, aero.field, rotor, skew, None, np.zeros_like(x),
        np.zeros(N_COUNTERS), pitches, blades,
    )  # fmt: skip
    force, moment = np.zeros(3), np.zeros(3)
    roots = np.zeros((rotor.blades, 2))
    cosine, sine = np.cos(turbine.rotor.cone), np.sin(turbine.rotor.cone)
    root = turbine.rotor.hub_radius * np.array([-sine, cosine, 0.0])
    for number, load in enumerate(blades):
        psi = azimuth + 2.0 * np.pi * number / rotor.blades
        out, turning = np.array([0.0, -np.sin(psi), np.cos(psi)]), np.array([0.0, -np.cos(psi), -np.sin(psi)])
        axes = np.array([[1.0, 0.0, 0.0], out, turning])
        force += load[:3] @ axes
        moment += load[3:] @ axes
        about_root = load[3:] - np.cross(root, load[:3])
        roots[number] = about_root @ np.array([cosine, sine, 0.0]), -about_root[2]
    return RotorLoads(force, moment, roots[:, 0], roots[:, 1])
