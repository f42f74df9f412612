"""Twin of the stations of a bent blade: places, velocities, directions and loads by turning vectors.

All in the pitched axes of a blade about the rotor centre. A station is carried by the section of the pitch
axis at its distance, which bending turns by a rotation vector across the blade whose length is twice the sine
of half the angle: ElastoDyn's small rotations, to their second order.
"""

import numpy as np
from naive.flexible_turbine import Air


def turning(ahead, side):
    """Rotation (3, 3) of a section with slopes along x and y."""
    vector = np.array([-side, ahead, 0.0])
    size = np.linalg.norm(vector)
    if size == 0.0:
        return np.eye(3)
    x, y, _ = vector / size
    K = np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])
    angle = 2.0 * np.arcsin(0.5 * size)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


class Section:
    """The section of station j of a blade with deflections q, at a blade pitch."""

    def __init__(self, j, q, pitch, rest, modes):
        slopes = np.array([modes.slope_x[j], modes.slope_y[j]])  # (2, n)
        R, self.rotations = turning(*slopes @ q), np.array([-slopes[1], slopes[0], 0.0 * slopes[0]])
        c, s = np.cos(pitch), np.sin(pitch)
        self.downwind, self.against = np.array([c, s, 0.0]), np.array([-s, c, 0.0])  # of the coned blade
        sine = rest.slope[j]
        cosine = np.sqrt(1.0 - sine**2)
        chordwise = R @ [0.0, 1.0, 0.0]
        flapwise = R @ [cosine, 0.0, -sine]
        self.pitch = np.arctan2(self.downwind @ chordwise, self.downwind @ flapwise)
        lean = self.downwind @ R @ [sine, 0.0, cosine]
        up = np.sqrt(1.0 - lean**2)  # the slope within the rotor's surface is left out
        self.normal = up * self.downwind - [0.0, 0.0, lean]
        self.axis = lean * self.downwind + [0.0, 0.0, up]
        self.slopes = slopes @ q

    def moved(self, q, straight, x, y, axial, shortening):
        """(place, velocity by each modal rate (3, n)) of a point at `straight` (3,) before bending."""
        sunk = axial @ q
        second = -0.5 * self.slopes * sunk
        place = straight + [x @ q + second[0], y @ q + second[1], -sunk - 0.5 * q @ shortening @ q]
        offset = np.array([0.0, 0.0, -sunk])  # of the point from the pitch axis, along it
        own = np.array([x, y, -axial - shortening @ q])
        return place, own + np.cross(self.rotations.T, offset).T


def station(j, q, v, pitch, rest, modes):
    """(place, velocity, Section) of station j."""
    section = Section(j, q, pitch, rest, modes)
    straight = np.array([rest.prebend[j], rest.sweep[j], rest.distance[j]])
    parts = (modes.x[j], modes.y[j], modes.axial[j], modes.shortening[j])
    place, rates = section.moved(q, straight, *parts)
    return place, rates @ v, section


def air_of(loads, q, pitch, rest, modes, outer=None):
    """Air of station loads (k, 3): normal, along the rotation, pitching moment; outer: part outside of a cut.

    outer: (k,) fractions of the loads, and (k,) m, moments of these parts about where the loads act.
    """
    force, moment, modal = np.zeros(3), np.zeros(3), np.zeros(len(q))
    for j, (normal, forward, twisting) in enumerate(loads):
        section = Section(j, q, pitch, rest, modes)
        part, further = (1.0, 0.0) if outer is None else (outer[0][j], outer[1][j])
        straight = np.array([rest.arm_prebend[j], rest.arm_sweep[j], rest.arm_distance[j]])
        parts = (modes.load_x[j], modes.load_y[j], modes.load_axial[j], modes.load_shortening[j])
        place, rates = section.moved(q, straight, *parts)
        F = normal * section.normal - forward * section.against
        M = part * twisting * section.axis + further * np.cross(section.axis, F)
        F = part * F
        force, moment = force + F, moment + np.cross(place, F) + M
        modal = modal + F @ rates + M @ section.rotations
    return Air(force, moment, modal)


def air_of_row(row, pitch, cone):
    """Air of a plant's BladeLoad (6,), along the shaft, outwards and along the rotation; of a rigid blade."""
    c, s, cosine, sine = np.cos(pitch), np.sin(pitch), np.cos(cone), np.sin(cone)
    x, r = (
        cosine * np.array([c, s, 0.0]) - [0.0, 0.0, sine],
        sine * np.array([c, s, 0.0]) + [0.0, 0.0, cosine],
    )
    axes = np.column_stack([x, r, [s, -c, 0.0]])
    return Air(axes @ row[:3], axes @ row[3:6], np.zeros(0))
