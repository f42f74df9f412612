"""Loads of coned, prebent, swept blades on a tilted shaft by plain rotation matrices, station by station.

Only the solution of a section (normal and tangential wind to line loads) is the package's.
"""

import numpy as np
from naive.rigid_body import rotation

from fowt_env.plant.aero.blade_elements import blade_section


def about_y(angle):
    return rotation(0.0, angle, 0.0)


def axis_points(turbine):
    """(n + 2, 3) points of the blade axis from hub to tip: prebend, sweep, distance."""
    blade, rotor = turbine.blade, turbine.rotor
    z = np.asarray(blade.radius)
    columns = []
    for values in (blade.prebend, blade.sweep, z):
        values = np.zeros(len(z)) if values is None else np.asarray(values)
        ends = [
            values[a] + (at - z[a]) * (values[b] - values[a]) / (z[b] - z[a])
            for at, a, b in ((rotor.hub_radius, 0, 1), (rotor.tip_radius, -1, -2))
        ]
        columns.append(np.concatenate(([ends[0]], values, [ends[1]])))
    return np.column_stack(columns)


def section_cm(turbine, j, alpha):
    polar = turbine.blade.polars[turbine.blade.airfoil[j]]
    return np.interp((alpha + np.pi) % (2 * np.pi) - np.pi, polar[:, 0], polar[:, 3])


def loads(turbine, elements, x, wind, density, pitches=None):
    """(6,) force and moment about the body origin, body axes; wind: inertial point (3,) to velocity (3,).

    x: state of the plant, rows as in fowt_env.plant.state.State. pitches: rad, one for each blade; None: that
    of the state for all.
    """
    rotor, blade = turbine.rotor, turbine.blade
    place, angles, v, w = x[:3], x[3:6], x[7:10], x[10:13]
    azimuth, speed = x[6], x[13]
    body = rotation(*angles)
    shaft = about_y(rotor.shaft_tilt)  # columns are the rotor axes in body components
    hub = np.array([-rotor.overhang, 0.0, rotor.hub_height])
    points = axis_points(turbine)
    slope = np.arctan(np.gradient(points[1:-1, 0], points[1:-1, 2], edge_order=2))
    force, moment = np.zeros(3), np.zeros(3)
    for number in range(rotor.blades):
        pitch = x[14] if pitches is None else pitches[number]
        turn = rotation(azimuth + 2 * np.pi * number / rotor.blades, 0.0, 0.0)
        coned = shaft @ turn @ about_y(-rotor.cone)  # blade axes without pitch, in body components
        pitched = coned @ rotation(0.0, 0.0, -pitch)
        at = hub + points @ pitched.T
        line = np.zeros((len(points), 3))  # of forces
        couple = np.zeros((len(points), 3))  # of pitching moments
        for j in range(len(blade.radius)):
            p = at[j + 1]
            section = coned.T @ pitched @ about_y(slope[j])  # columns: normal, chordwise, axis
            cant = np.arcsin(section[0, 2])
            turned = np.arctan2(section[0, 1], section[0, 0])  # the last of three turns about x, y, z
            annulus = coned @ about_y(cant)
            own = v + np.cross(w, p) + speed * np.cross(shaft[:, 0], p - hub)
            relative = body.T @ wind(place + body @ p) - own
            normal, across = annulus[:, 0] @ relative, annulus[:, 1] @ relative
            found = blade_section(normal, across, turned, j, 1.0, elements)
            flow = normal + found.induced_normal, across + found.induced_tangential
            alpha = np.arctan2(*flow) - blade.twist[j] - turned
            pressure = 0.5 * density * (flow[0] ** 2 + flow[1] ** 2) * blade.chord[j] ** 2
            line[j + 1] = found.fn * annulus[:, 0] - found.ft * annulus[:, 1]
            couple[j + 1] = pressure * section_cm(turbine, j, alpha) * annulus[:, 2]
        for low, high in zip(range(len(points) - 1), range(1, len(points)), strict=True):
            length = np.linalg.norm(at[high] - at[low])
            for node in (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)):  # exact for products of lines
                p = (1 - node) * at[low] + node * at[high]
                f = 0.5 * length * ((1 - node) * line[low] + node * line[high])
                force += f
                moment += np.cross(p, f)
                moment += 0.5 * length * ((1 - node) * couple[low] + node * couple[high])
    return np.concatenate([force, moment])
