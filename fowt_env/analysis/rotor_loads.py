"""Aerodynamic loads of a rotor on a standing platform: about the hub in shaft axes, and at blade roots."""

from typing import NamedTuple

import numpy as np

from fowt_env.errors import InputError
from fowt_env.plant.aero.bem_rotor import FAST_ROTOR, SLOW_ROTOR, curved_blade_load, hub_flow
from fowt_env.plant.aero.blade_elements import build_blade_elements, smoothstep
from fowt_env.plant.aero.blade_shape import blade_wind
from fowt_env.plant.aero.wake import build_skewed_wake, skew_of
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.events import N_COUNTERS
from fowt_env.plant.state import N_RIGID, State, pose_of
from fowt_env.plant.tilt import build_tilt, rotor_pose
from fowt_env.scene.options import chosen_stations
from fowt_env.scene.parts import build_elements


class RotorLoads(NamedTuple):
    """Aerodynamic loads of a rotor, N and N m. Shaft axes: x along the shaft downwind, y to the left."""

    force: np.ndarray  # (3,) shaft axes, which do not turn with the rotor
    moment: np.ndarray  # (3,) about the rotor centre, shaft axes
    root_in_plane: np.ndarray  # (blades,) about the root, around the normal of the coned blade: RootMxc
    root_out_of_plane: np.ndarray  # (blades,) around the direction against the rotation: RootMyc


def rotor_loads(scene, rotor_speed, blade_pitch, azimuth=0.0, time=0.0):
    """RotorLoads of a scene's rotor by blade element momentum, the platform at rest where it was described.

    rotor_speed rad/s, blade_pitch rad, azimuth rad, time s. Induction is quasi-steady, whatever the scene's
    rotor model; skewed_wake and blade_stations are those of the scene.
    Raises: InputError for a scene without wind.
    """
    aero, turbine = scene.model.aero, scene.turbine
    if aero is None:
        raise InputError("rotor_loads: the scene has no wind (wind = None)")
    density, count = scene.platform.environment.air_density, scene.options["blade_stations"]
    rotor = build_elements(turbine, density, count)
    if rotor.shape is None:
        rotor = build_blade_elements(turbine, density, chosen_stations(count, turbine), shaped=True)
    skew = build_skewed_wake() if scene.options["skewed_wake"] else None
    x = np.zeros(N_RIGID)
    x[State.ROTOR_SPEED], x[State.BLADE_PITCH], x[State.AZIMUTH] = rotor_speed, blade_pitch, azimuth
    pose = rotor_pose(pose_of(x), build_tilt(turbine.rotor.shaft_tilt))
    now, field = wind_now(time, aero.wind), aero.field
    hub = hub_flow(time, pose, now, aero.wind, field, rotor.overhang, rotor.hub_height)
    induction = smoothstep(rotor_speed * rotor.tip_radius, SLOW_ROTOR * hub.speed, FAST_ROTOR * hub.speed)
    force, moment = np.zeros(3), np.zeros(3)
    roots = np.zeros((rotor.blades, 2))
    cosine, sine = np.cos(turbine.rotor.cone), np.sin(turbine.rotor.cone)
    root = turbine.rotor.hub_radius * np.array([-sine, cosine, 0.0])
    for number in range(rotor.blades):
        psi = azimuth + 2.0 * np.pi * number / rotor.blades
        out, turning = np.array([0.0, -np.sin(psi), np.cos(psi)]), np.array([0.0, -np.cos(psi), -np.sin(psi)])
        load = curved_blade_load(
            number, time, pose, hub, blade_wind(out[1], out[2], rotor_speed, pose, hub), induction, x, now,
            aero.wind, field, rotor, rotor.shape, skew_of(hub, skew), skew, None, np.zeros_like(x),
            np.zeros(N_COUNTERS), None,
        )  # fmt: skip
        axes = np.array([[1.0, 0.0, 0.0], out, turning])
        own_force, own_moment = np.array(load[:3]), np.array(load[3:])
        force += own_force @ axes
        moment += own_moment @ axes
        about_root = own_moment - np.cross(root, own_force)
        roots[number] = about_root @ np.array([cosine, sine, 0.0]), -about_root[2]
    return RotorLoads(force, moment, roots[:, 0], roots[:, 1])
