"""Sweeps over the stations of a blade that bends, in a sheared wind, with their loads from a table.

The result is that of blade_sweep.sheared_forces but for the order of the sum. There each station waits for
two divisions, then for its entries of the table. Here wind and place in the table are first found for all
stations, LANES of them in each pass of a loop without branches, so that the look-ups wait for nothing but the
memory; then LANES loads at a time are added.
"""

import numpy as np

from fowt_env.plant.aero.bent_blade import (
    ARM_R,
    ARM_X,
    CHANGE,
    DIRECTION,
    LANES,
    MOMENT,
    N_PLACE,
    N_STATION_LOAD,
    NORMAL,
    NR,
    NX,
    ROW,
    SQUARE,
    T_NR,
    T_NX,
    TANGENTIAL,
    TURN,
    V_NORMAL,
    V_T,
    R,
    T,
    X,
    loaded_at,
    sum_of_lanes,
)
from fowt_env.plant.aero.blade_elements import LARGEST_SPEED
from fowt_env.plant.aero.blade_shape import BentStation, BladeLoad, Lever, StationLoad, add_by_lever
from fowt_env.plant.aero.blade_sweep import BladeForce, relative_wind, sheared_forces, sheared_winds
from fowt_env.plant.aero.station_response import cell_at, direction_of, looked_up, row_within, rows_between
from fowt_env.plant.compile.decorators import inlined_kernel, shared_kernel


@inlined_kernel
def _aim_lanes(wind, pitch, place, lanes):
    """Fill the rows SQUARE, DIRECTION and ROW of LANES stations; return how many lie outside the table."""
    outside = 0
    for lane in range(lanes):
        at = BentStation(
            place[np.uintp(X + lane)], place[np.uintp(R + lane)], place[np.uintp(T + lane)],
            place[np.uintp(NX + lane)], place[np.uintp(NR + lane)], place[np.uintp(V_NORMAL + lane)],
            place[np.uintp(V_T + lane)],
        )  # fmt: skip
        v_normal, v_tangential = relative_wind(wind, at)
        total = abs(v_normal) + abs(v_tangential)
        place[np.uintp(SQUARE + lane)] = total * total
        place[np.uintp(DIRECTION + lane)] = direction_of(v_normal, v_tangential, total, 0)
        place[np.uintp(ROW + lane)] = row_within(pitch + place[np.uintp(CHANGE + lane)])
        outside += 0 if v_normal > 0.0 and total < LARGEST_SPEED else 1
    return outside


@inlined_kernel
def _look_up(j, at, places, table, loads):
    """Put the load of station j over the air density into loads; at: index of its results in places."""
    rows = rows_between(places[np.uintp(at + ROW)], table)
    cell, square = cell_at(places[np.uintp(at + DIRECTION)], 0), places[np.uintp(at + SQUARE)]
    loads[loaded_at(j, NORMAL)] = square * looked_up(cell, j, 0, rows)
    loads[loaded_at(j, TANGENTIAL)] = square * looked_up(cell, j, 1, rows)
    loads[loaded_at(j, MOMENT)] = square * looked_up(cell, j, 2, rows)


@inlined_kernel
def _add_lanes(place, load, sums, lanes):
    """Add the loads of LANES stations to sums: a row for each component of BladeLoad."""
    for lane in range(lanes):
        a, b, c, d, e, f = (
            np.uintp(lane), np.uintp(lane + LANES), np.uintp(lane + 2 * LANES), np.uintp(lane + 3 * LANES),
            np.uintp(lane + 4 * LANES), np.uintp(lane + 5 * LANES),
        )  # fmt: skip
        part = StationLoad(
            load[np.uintp(NORMAL + lane)], load[np.uintp(TANGENTIAL + lane)], load[np.uintp(MOMENT + lane)],
            1.0, 0.0, 0, None,
        )  # fmt: skip
        lever = Lever(
            place[np.uintp(NX + lane)], place[np.uintp(NR + lane)], place[np.uintp(TURN + lane)],
            place[np.uintp(T_NX + lane)], place[np.uintp(T_NR + lane)], place[np.uintp(ARM_X + lane)],
            place[np.uintp(ARM_R + lane)],
        )  # fmt: skip
        total = add_by_lever(BladeLoad(sums[a], sums[b], sums[c], sums[d], sums[e], sums[f]), part, lever)
        sums[a], sums[b], sums[c] = total.fx, total.fr, total.ft
        sums[d], sums[e], sums[f] = total.mx, total.mr, total.mt


@shared_kernel
def _force(wind, pitch, table, places, loads, count, size, lanes):
    """Return the BladeForce of a blade; pitch: its pitch, rad; the rest: of its response and BentShape."""
    each = LANES * N_STATION_LOAD
    found = LANES * N_PLACE + each * len(count)
    groups, outside = places.shape[0] // found, 0
    for k in range(groups):
        outside += _aim_lanes(wind, pitch, places[k * found : (k + 1) * found], lanes)
    for j in range(table.shape[1]):
        _look_up(j, (j >> 2) * found + (j & (LANES - 1)), places, table, loads)
    sums = loads[size:]
    sums[:] = 0.0
    for k in range(groups):
        _add_lanes(places[k * found : (k + 1) * found], loads[k * each : (k + 1) * each], sums, lanes)
    load = BladeLoad(
        sum_of_lanes(0, sums), sum_of_lanes(LANES, sums), sum_of_lanes(2 * LANES, sums),
        sum_of_lanes(3 * LANES, sums), sum_of_lanes(4 * LANES, sums), sum_of_lanes(5 * LANES, sums),
    )  # fmt: skip
    return BladeForce(load, outside)


@inlined_kernel
def _force_of(wind, blade):
    shape, modes = blade.shape, blade.shape.modes
    table = blade.response.rows.table
    return _force(
        wind, blade.turn.pitch, table, shape.places, shape.loads, modes.count, modes.size, modes.lanes
    )


@inlined_kernel
def bent_forces(p, q, r, flow, reach, radius, near):
    """Return the BladeForces of sheared_forces of three Blades that bend; near: of p, as in Blade."""
    if near is not None:
        return sheared_forces(p, q, r, flow, reach, radius)
    winds = sheared_winds(p, q, r, flow, reach)
    return _force_of(winds[0], p), _force_of(winds[1], q), _force_of(winds[2], r)
