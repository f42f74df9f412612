"""Computes positions, velocities and directions of the stations of a bent blade, and the arms of their loads.

All stations of a blade are placed at a time, LANES of them in each pass of a loop without branches, of which
the compiler makes vector instructions. The sweep over the stations (blade_sweep.py) then reads what it needs.
A table holds, for each LANES stations, rows of LANES values: constants in StationModes.table, in the order of
`constants`, and results in BentShape.places, in the order of the indices below.
"""

from typing import NamedTuple

import numpy as np

from fowt_env.plant.compile.decorators import inlined_kernel, shared_kernel
from fowt_env.plant.compile.vector_sums import SUM_LANES, root

LANES = 4  # stations in a row of a table, as `placed` has it: fewer lanes than by 8 remain without a station
# results: position (m) and normal of the blade axis, as in blade_shape.Station; velocity by bending along the
# normal and along t, m/s; pitch of a section without bending less the blade pitch, rad; components of the
# section's axes, against the rotation and downwind, on those of a coned blade; blade_shape.Lever but for the
# normal; of bent_sweep.py; then for each mode its generalised force per unit of each row of BentShape.loads
(
    X, R, T, NX, NR, V_NORMAL, V_T, CHANGE, ACROSS, ALONG, TURN, T_NX, T_NR, ARM_X, ARM_R, SQUARE, DIRECTION,
    ROW, MODAL,
) = (LANES * k for k in range(19))  # fmt: skip
N_PLACE = 18  # results of a station, and further ones of each mode
N_REST, N_MODE, N_PAIR = 8, 8, 2  # constants of a station, of each mode, of each pair of modes
# rows of BentShape.loads and modal: forces of a station along the normal and along t, and pitching moment
NORMAL, TANGENTIAL, MOMENT, N_STATION_LOAD = 0, LANES, 2 * LANES, 3
N_SUM = 6  # rows after those of all stations, for sums of lanes


class StationModes(NamedTuple):
    """Holds shapes of a blade's n bending modes at m stations, each per metre of a modal coordinate.

    x: normal to the cone at zero pitch, downwind; y: against the rotation at zero pitch.
    """

    first: int  # index in the state of the first blade's first deflection, set by the scene
    count: tuple  # n zeros: a tuple, so that n is known at compile time
    x: np.ndarray  # (m, n)
    y: np.ndarray
    slope_x: np.ndarray  # (m, n) 1/m, derivatives along the pitch axis
    slope_y: np.ndarray
    axial: np.ndarray  # (m, n) the station moves towards the root by axial q + q S q / 2
    shortening: np.ndarray  # (m, n, n) S, 1/m
    load_x: np.ndarray  # (m, n) the same three for the point where the load of the station acts
    load_y: np.ndarray
    load_axial: np.ndarray
    load_shortening: np.ndarray  # (m, n, n)
    table: np.ndarray  # these and the positions of the stations, see constants
    size: int  # of BentShape.modal of a mode
    lanes: int = LANES


class BentShape(NamedTuple):
    """Describes one blade that bends, in a state."""

    rest: object  # blade_shape.BladeShape
    modes: StationModes
    q: np.ndarray  # (n,) m, deflections
    v: np.ndarray  # (n,) m/s
    loads: np.ndarray  # output: rows of each LANES stations, zero to the size of a mode, then rows of sums
    places: np.ndarray  # output of place_stations
    modal: np.ndarray  # the same, of each mode the MODAL of all stations in the order of loads


def constants(shape, modes):
    """Return the table of constants of a BladeShape and StationModes.

    Rows: prebend, sweep, distance and sine of the slope; where the load acts, the first three; cosine of the
    slope; of each mode x, y, slope_x, slope_y, axial, load_x, load_y, load_axial; of each pair, shortening
    and load_shortening.
    Lanes without a station repeat the last one.
    """
    m, n = modes.x.shape
    rest = (
        shape.prebend, shape.sweep, shape.distance, shape.slope,
        shape.arm_prebend, shape.arm_sweep, shape.arm_distance, np.sqrt(1.0 - shape.slope * shape.slope),
    )  # fmt: skip
    of_mode = (
        modes.x, modes.y, modes.slope_x, modes.slope_y, modes.axial,
        modes.load_x, modes.load_y, modes.load_axial,
    )  # fmt: skip
    of_pair = (modes.shortening.reshape(m, n * n), modes.load_shortening.reshape(m, n * n))
    rows = np.vstack([*rest, *np.stack(of_mode, axis=2).reshape(m, -1).T, *np.hstack(of_pair).T])
    groups = -(-m // LANES)
    rows = np.hstack([rows, np.repeat(rows[:, -1:], LANES * groups - m, axis=1)])
    return np.ascontiguousarray(rows.reshape(len(rows), groups, LANES).swapaxes(0, 1).ravel())


def modal_size(stations):
    """Return the number of entries of BentShape.modal of a mode, which fill the lanes of a sum."""
    entries = LANES * N_STATION_LOAD * -(-stations // LANES)
    return -(-entries // SUM_LANES) * SUM_LANES


def blade_entries(modes):
    """Return the number of entries of loads, places and modal of a BentShape with StationModes."""
    m, n = modes.x.shape
    return (1 + n) * modes.size + LANES * (N_SUM + (N_PLACE + N_STATION_LOAD * n) * -(-m // LANES))


@inlined_kernel
def loaded_at(j, row):
    """Return the index in BentShape.loads of NORMAL, TANGENTIAL or MOMENT at station j."""
    return np.uintp((j >> 2) * (LANES * N_STATION_LOAD) + (j & (LANES - 1)) + row)


@inlined_kernel
def sum_of_lanes(row, sums):
    """Return the sum of LANES entries of sums from `row` on."""
    return (sums[row] + sums[row + 2]) + (sums[row + 1] + sums[row + 3])


@inlined_kernel
def placed(j, result, shape):
    """Return a result of place_stations (X, R, ...) at station j of a BentShape."""
    size = LANES * (N_PLACE + N_STATION_LOAD * len(shape.modes.count))
    at = (j >> 2) * size + (j & (LANES - 1)) + result
    return shape.places[np.uintp(at)]  # an unsigned index avoids the test for negative ones


@inlined_kernel
def _place_lanes(c, out, q, v, n, turn, cone_cosine, cone_sine, lanes):
    """Fill the rows `out` of LANES stations from the rows c of their constants; n: number of modes.

    lanes is LANES, unknown to the compiler, and indices are unsigned: otherwise it would not vectorise.
    """
    cos_pitch, sin_pitch = turn.cosine, turn.sine
    pairs = LANES * (N_REST + N_MODE * n)
    loaded = pairs + LANES * n * n
    for lane in range(lanes):
        px, py, z = c[np.uintp(lane)], c[np.uintp(LANES + lane)], c[np.uintp(2 * LANES + lane)]
        sine = c[np.uintp(3 * LANES + lane)]
        lx, ly, lz = (
            c[np.uintp(4 * LANES + lane)],
            c[np.uintp(5 * LANES + lane)],
            c[np.uintp(6 * LANES + lane)],
        )
        ahead = side = back = back_load = 0.0
        vx = vy = vz = turning_x = turning_y = 0.0
        for i in range(n):
            at = LANES * (N_REST + N_MODE * i) + lane
            axial, load_axial = c[np.uintp(at + 4 * LANES)], c[np.uintp(at + 7 * LANES)]
            shorter, load_shorter = axial, 2.0 * load_axial
            for k in range(n):
                shorter += c[np.uintp(pairs + LANES * (n * i + k) + lane)] * q[k]
                load_shorter += c[np.uintp(loaded + LANES * (n * i + k) + lane)] * q[k]
            px += c[np.uintp(at)] * q[i]
            py += c[np.uintp(at + LANES)] * q[i]
            z -= 0.5 * (shorter + axial) * q[i]
            lx += c[np.uintp(at + 5 * LANES)] * q[i]
            ly += c[np.uintp(at + 6 * LANES)] * q[i]
            lz -= 0.5 * load_shorter * q[i]
            back += axial * q[i]
            back_load += load_axial * q[i]
            ahead += c[np.uintp(at + 2 * LANES)] * q[i]
            side += c[np.uintp(at + 3 * LANES)] * q[i]
            vx += c[np.uintp(at)] * v[i]
            vy += c[np.uintp(at + LANES)] * v[i]
            vz -= shorter * v[i]
            turning_x += c[np.uintp(at + 2 * LANES)] * v[i]
            turning_y += c[np.uintp(at + 3 * LANES)] * v[i]
        # rotation of prebend and sweep, second order
        px, py = px - 0.5 * ahead * back, py - 0.5 * side * back
        lx, ly = lx - 0.5 * ahead * back_load, ly - 0.5 * side * back_load
        vx, vy = vx - turning_x * back, vy - turning_y * back
        # slopes are rotations of ElastoDyn about pitched axes, components of a rotation vector to second
        # order (SmllRotTrans), so that both together twist the section, as AeroDyn sees it
        cosine, both = c[np.uintp(7 * LANES + lane)], 0.5 * ahead * side
        w = root(1.0 - 0.25 * (ahead * ahead + side * side))
        level, lift = 1.0 - 0.5 * ahead * ahead, ahead * w
        lean = cos_pitch * (sine * level + cosine * lift) + sin_pitch * (cosine * side * w - sine * both)
        across = sin_pitch * (1.0 - 0.5 * side * side) - cos_pitch * both
        along = cos_pitch * (cosine * level - sine * lift) - sin_pitch * (cosine * both + sine * side * w)
        up, flat = root(1.0 - lean * lean), cosine * across
        change = (flat * cos_pitch - along * sin_pitch) / (along * cos_pitch + flat * sin_pitch)

        nx, nr = up * cone_cosine + lean * cone_sine, up * cone_sine - lean * cone_cosine
        outward, flapping = cos_pitch * px + sin_pitch * py, cos_pitch * vx + sin_pitch * vy
        out[np.uintp(X + lane)] = cone_cosine * outward - cone_sine * z
        out[np.uintp(R + lane)] = cone_cosine * z + cone_sine * outward
        out[np.uintp(T + lane)] = sin_pitch * px - cos_pitch * py
        out[np.uintp(NX + lane)], out[np.uintp(NR + lane)] = nx, nr
        out[np.uintp(V_NORMAL + lane)] = up * flapping - lean * vz
        out[np.uintp(V_T + lane)] = sin_pitch * vx - cos_pitch * vy
        out[np.uintp(CHANGE + lane)] = (
            change - change * change * change / 3.0
        )  # of its tangent, a few hundredths
        out[np.uintp(ACROSS + lane)], out[np.uintp(ALONG + lane)] = across, along
        outward, t = cos_pitch * lx + sin_pitch * ly, sin_pitch * lx - cos_pitch * ly
        x, r = cone_cosine * outward - cone_sine * lz, cone_cosine * lz + cone_sine * outward
        out[np.uintp(TURN + lane)] = x * nr - r * nx
        out[np.uintp(T_NX + lane)], out[np.uintp(T_NR + lane)] = t * nx, t * nr
        out[np.uintp(ARM_X + lane)], out[np.uintp(ARM_R + lane)] = x, r
        for i in range(n):
            at, to = LANES * (N_REST + N_MODE * i) + lane, MODAL + LANES * N_STATION_LOAD * i + lane
            slope_x, slope_y, shorter = (
                c[np.uintp(at + 2 * LANES)],
                c[np.uintp(at + 3 * LANES)],
                c[np.uintp(at + 7 * LANES)],
            )
            for k in range(n):
                shorter += c[np.uintp(loaded + LANES * (n * i + k) + lane)] * q[k]
            arm_x = c[np.uintp(at + 5 * LANES)] - back_load * slope_x
            arm_y = c[np.uintp(at + 6 * LANES)] - back_load * slope_y
            out[np.uintp(to + NORMAL)] = up * (cos_pitch * arm_x + sin_pitch * arm_y) + lean * shorter
            out[np.uintp(to + TANGENTIAL)] = sin_pitch * arm_x - cos_pitch * arm_y
            out[np.uintp(to + MOMENT)] = lean * (sin_pitch * slope_x - cos_pitch * slope_y)


@shared_kernel
def place_all(turn, table, count, size, lanes, places, modal, q, v, cone_cosine, cone_sine):
    """Fill places and modal of a blade at a Turn; table, count, size and lanes of its StationModes."""
    n, each = len(count), LANES * N_STATION_LOAD
    known, found = LANES * (N_REST + N_MODE * n + N_PAIR * n * n), LANES * N_PLACE + each * n
    for k in range(table.shape[0] // known):
        out = places[k * found : (k + 1) * found]
        _place_lanes(
            table[k * known : (k + 1) * known], out, q, v, n, turn, cone_cosine, cone_sine, lanes
        )  # fmt: skip
        for i in range(n):  # to one row of each mode, of which a sum makes the best use
            for row in range(each):
                modal[size * i + each * k + row] = out[MODAL + each * i + row]
