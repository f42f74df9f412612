"""The equation of motion: sum of loads to accelerations, theory.md Eq. (9).

Unknowns (v', w', w_b'): one symmetric positive-definite system. The rotor row is eliminated, which
leaves a 6x6 solve.
"""

from enum import IntEnum
from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.bem_rotor import RotorLoad, rotor_load
from fowt_env.plant.aero.coefficient_table import rotor_table_load
from fowt_env.plant.aero.section_table import rotor_lookup_load
from fowt_env.plant.aero.tower_drag import tower_load
from fowt_env.plant.aero.wind import wind_now
from fowt_env.plant.compile.decorators import inlined_kernel, kernel
from fowt_env.plant.compile.variants import chosen_by_class
from fowt_env.plant.drivetrain import pitch_rate, shaft_torque
from fowt_env.plant.hydro.hydrostatics import hydrostatic_load
from fowt_env.plant.hydro.linear_damping import damping_load
from fowt_env.plant.hydro.morison import StripLoad, morison_load
from fowt_env.plant.hydro.wave_bands import FastScratch, Lanes, fast_morison_load
from fowt_env.plant.mooring import mooring_load
from fowt_env.plant.state import NO_LOAD, State, Wrench, add, pose_in, pose_of
from fowt_env.plant.user_loads import evaluate_own, with_own


class Body(NamedTuple):
    """Mass properties of the whole turbine about the body origin, theory.md Eq. (10)."""

    mass_matrix: np.ndarray  # (6, 6) M1
    mass: float
    s_x: float  # first moments: S = (s_x, 0, s_z), kg m
    s_z: float
    gravity: float
    coupling: float  # H = I_rotor + N_g I_g
    rotor_row: float  # I_rx = I_rotor + N_g^2 I_g
    platform_held: bool
    rotor_held: bool
    plane: object = None  # True: surge, heave and platform pitch alone move; None: all six motions


class Model(NamedTuple):
    """Everything that does not change while stepping. A part that a scene lacks is None."""

    by_reference = True

    body: Body
    layout: object  # channels.Layout
    drivetrain: object  # loads.drivetrain.Drivetrain
    actuator: object  # loads.drivetrain.PitchActuator
    generator: object  # loads.drivetrain.TorqueLimits
    hull: object  # loads.hydrostatics.Hull or None
    strips: object  # loads.morison.Strips or None
    waves: object  # weather.waves.Waves or None
    lanes: object  # loads.fast_waves.Lanes or None: strip loads by loads.morison
    sea: object  # loads.fast_waves.FastWaves or None
    diffraction: object  # loads.diffraction.StripDiffraction or None: 1 + C_A in every wave
    lane_diffraction: object  # loads.fast_waves.LaneDiffraction, the same for lanes, or None
    current: object  # loads.morison.Current or None
    mooring: object  # loads.mooring.Mooring or None
    damping: object  # loads.damping.LinearDamping or None
    rotor: object  # loads.rotor.BladeElements or None
    rotor_lookup: object  # loads.rotor_lookup.SectionTable or None
    rotor_table: object  # loads.rotor_table.RotorTable or None
    skew: object  # loads.wake.SkewedWake or None
    wake: object  # loads.wake.DynamicInflow or None
    tower: object  # loads.tower.TowerDrag or None
    wind: object  # weather.wind.WindSeries or None: no aerodynamics at all
    wind_field: object  # weather.wind_field.WindField or None: the wind series alone
    multistep: object  # integrators.Multistep or None: Runge-Kutta 4
    own: object = None  # loads.own.OwnLoads, the user's, or None


class Kept(IntEnum):
    """Entries of Work.kept: the last evaluation of the loads, which the state alone decides.

    FRESH is 1 while they belong to the present state (at TIME), so that an observation and the step after it
    share one evaluation. STEPS counts the steps since the start, for the multistep integrators.
    """

    FRESH = 0
    STEPS = 1
    TORQUE = 2  # aerodynamic, about the shaft
    THRUST = 3
    S0 = 4  # strip added mass
    S1 = 5
    S2 = 6
    A33 = 7
    TOTAL = 8  # six entries each: sum of all loads, ...
    ROTOR = 14
    TOWER = 20
    HYDRO = 26  # buoyancy and strips
    MOORING = 32
    TIME = 38
    ELEVATED = 39  # 1 while ELEVATION, of the surface at the origin, is of TIME
    ELEVATION = 40
    TORQUE_LIMITED = 41  # 1 in a control period whose torque command the generator could not follow


N_KEPT = 42


class Work(NamedTuple):
    """Scratch of one plant. lines, counters, kept, history and samples carry over between calls."""

    by_reference = True

    lines: np.ndarray  # (n_lines, 6) mooring warm start and results
    counters: np.ndarray  # (N_COUNTERS,)
    kinematics: np.ndarray  # (7, n_nodes) water kinematics at the strip nodes
    fast: FastScratch  # the same for fast strip loads
    matrix: np.ndarray  # (6, 6)
    stages: np.ndarray  # (5, n_state) Runge-Kutta stages and stage state
    kept: np.ndarray  # (N_KEPT + room,), room of the user's loads (loads.own.room_of)
    history: np.ndarray  # (4, n_state) derivatives of past steps, latest first
    samples: np.ndarray  # (4 integrators.Gusts.samples, 7) rotor loads within past steps, latest first


class Loads(NamedTuple):
    """Loads of one evaluation, for outputs (body components about the body origin)."""

    rotor: RotorLoad
    tower: Wrench  # drag, and the user's loads above the tower base
    hydro: Wrench  # buoyancy, strip loads with added mass times acceleration, additional linear terms
    mooring: Wrench


@kernel
def gravity_load(pose, body):
    """Weight of the whole turbine, Eq. (13)."""
    nx, ny, nz = pose.r31, pose.r32, pose.r33
    mg = -body.mass * body.gravity
    g = body.gravity
    return Wrench(
        mg * nx,
        mg * ny,
        mg * nz,
        g * body.s_z * ny,
        -g * (body.s_z * nx - body.s_x * nz),
        -g * body.s_x * ny,
    )


@kernel
def inertial_load(pose, rotor_speed, mass_matrix, coupling):
    """C1 nu + C2 w_b: velocity-dependent part of the momentum rate, Eqs (9)-(10)."""
    m = mass_matrix
    vx, vy, vz, wx, wy, wz = pose.vx, pose.vy, pose.vz, pose.wx, pose.wy, pose.wz
    px = m[0, 0] * vx + m[0, 1] * vy + m[0, 2] * vz + m[0, 3] * wx + m[0, 4] * wy + m[0, 5] * wz
    py = m[1, 0] * vx + m[1, 1] * vy + m[1, 2] * vz + m[1, 3] * wx + m[1, 4] * wy + m[1, 5] * wz
    pz = m[2, 0] * vx + m[2, 1] * vy + m[2, 2] * vz + m[2, 3] * wx + m[2, 4] * wy + m[2, 5] * wz
    kx = m[3, 0] * vx + m[3, 1] * vy + m[3, 2] * vz + m[3, 3] * wx + m[3, 4] * wy + m[3, 5] * wz
    ky = m[4, 0] * vx + m[4, 1] * vy + m[4, 2] * vz + m[4, 3] * wx + m[4, 4] * wy + m[4, 5] * wz
    kz = m[5, 0] * vx + m[5, 1] * vy + m[5, 2] * vz + m[5, 3] * wx + m[5, 4] * wy + m[5, 5] * wz
    kx += coupling * rotor_speed
    return Wrench(
        wy * pz - wz * py,
        wz * px - wx * pz,
        wx * py - wy * px,
        vy * pz - vz * py + wy * kz - wz * ky,
        vz * px - vx * pz + wz * kx - wx * kz,
        vx * py - vy * px + wx * ky - wy * kx,
    )


@kernel
def attitude_rate(x, dx, plane):
    """Position and Euler-angle rates: r' = R v, phi' = J^-1 w (singular at 90 deg of platform pitch)."""
    if plane is not None:
        pose = pose_in(x, plane)
        dx[State.SURGE] = pose.r11 * pose.vx + pose.r13 * pose.vz
        dx[State.HEAVE] = pose.r31 * pose.vx + pose.r33 * pose.vz
        dx[State.PLATFORM_PITCH] = pose.wy
        dx[State.SWAY] = dx[State.ROLL] = dx[State.YAW] = 0.0
        return
    pose = pose_of(x)
    dx[State.SURGE] = pose.r11 * pose.vx + pose.r12 * pose.vy + pose.r13 * pose.vz
    dx[State.SWAY] = pose.r21 * pose.vx + pose.r22 * pose.vy + pose.r23 * pose.vz
    dx[State.HEAVE] = pose.r31 * pose.vx + pose.r32 * pose.vy + pose.r33 * pose.vz
    s1, c1 = sin(x[State.ROLL]), cos(x[State.ROLL])
    s2, c2 = sin(x[State.PLATFORM_PITCH]), cos(x[State.PLATFORM_PITCH])
    swing = (s1 * pose.wy + c1 * pose.wz) / c2
    dx[State.ROLL] = pose.wx + swing * s2
    dx[State.PLATFORM_PITCH] = c1 * pose.wy - s1 * pose.wz
    dx[State.YAW] = swing


@kernel
def solve_spd(a, b):
    """Solve a b = b in place; a is (6, 6) symmetric positive definite and is overwritten.

    L D L^T with the reciprocals of D kept on the diagonal: six divisions and no root.
    """
    for i in range(6):  # a known count, which the compiler unrolls
        for j in range(i):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = total  # L D
        pivot = a[i, i]
        for j in range(i):
            scaled = a[i, j] * a[j, j]
            pivot -= scaled * a[i, j]
            a[i, j] = scaled  # L
        a[i, i] = 1.0 / pivot
    for i in range(6):
        total = b[i]
        for k in range(i):
            total -= a[i, k] * b[k]
        b[i] = total
    for i in range(5, -1, -1):
        total = b[i] * a[i, i]
        for k in range(i + 1, 6):
            total -= a[k, i] * b[k]
        b[i] = total


@kernel
def rotor_part(t, pose, x, now, wind, field, rotor, lookup, table, skew, wake, dx, counters):
    """Load of whichever rotor model the scene has; none without wind."""
    if wind is None:
        return RotorLoad(NO_LOAD, 0.0, 0.0)
    if rotor is not None:
        return rotor_load(t, pose, x, now, wind, field, rotor, skew, wake, dx, counters)
    if lookup is not None:
        return rotor_lookup_load(t, pose, x, now, wind, field, lookup, counters)
    if table is not None:
        return rotor_table_load(pose, x, now, wind, table)
    return RotorLoad(NO_LOAD, 0.0, 0.0)


@kernel
def _exact_strips(
    t, pose, strips, waves, current, kinematics, lanes, sea, scratch, diffraction, lane_diffraction
):
    return morison_load(t, pose, strips, waves, current, kinematics, diffraction)


@kernel
def _fast_strips(
    t, pose, strips, waves, current, kinematics, lanes, sea, scratch, diffraction, lane_diffraction
):
    return fast_morison_load(t, pose, lanes, sea, current, scratch, lane_diffraction)


strip_part = chosen_by_class("lanes", {type(None): _exact_strips, Lanes: _fast_strips})


@kernel
def own_part(t, pose, x, now, wind, field, waves, sea, current, scratch, own, kept):
    """Have the user's loads evaluated into the end of kept; nothing without any."""
    if own is None:
        return
    evaluate_own(t, pose, x, now, wind, field, waves, sea, current, scratch, own, kept[N_KEPT:])


@kernel
def with_own_part(load, above, own, kept):
    """The load with the user's loads above the tower base, or the others, added; as it is without any."""
    if own is None:
        return load
    return with_own(load, above, own, kept[N_KEPT:])


@kernel
def _keep(kept, start, wrench):
    """Store a wrench in six entries of kept."""
    kept[start] = wrench.fx
    kept[start + 1] = wrench.fy
    kept[start + 2] = wrench.fz
    kept[start + 3] = wrench.mx
    kept[start + 4] = wrench.my
    kept[start + 5] = wrench.mz


@kernel
def _kept_wrench(kept, start):
    """The wrench stored by _keep."""
    return Wrench(
        kept[start], kept[start + 1], kept[start + 2], kept[start + 3], kept[start + 4], kept[start + 5]
    )


@kernel
def evaluate(t, x, scene, work, dx):
    """Every load at a state, kept in work.kept; writes only the wake rates of dx. The command has no part."""
    body, kept = scene.body, work.kept
    pose = pose_in(x, body.plane)
    now = wind_now(t, scene.wind)
    aero = rotor_part(
        t, pose, x, now, scene.wind, scene.wind_field, scene.rotor, scene.rotor_lookup,
        scene.rotor_table, scene.skew, scene.wake, dx, work.counters,
    )  # fmt: skip
    tower = tower_load(t, pose, now, scene.wind, scene.wind_field, scene.tower)
    buoyancy = hydrostatic_load(pose, scene.hull, work.counters)
    strips = strip_part(
        t, pose, scene.strips, scene.waves, scene.current, work.kinematics, scene.lanes, scene.sea, work.fast,
        scene.diffraction, scene.lane_diffraction,
    )  # fmt: skip
    mooring = mooring_load(pose, scene.mooring, work.lines, work.counters)
    own_part(
        t, pose, x, now, scene.wind, scene.wind_field, scene.waves, scene.sea, scene.current, work.fast,
        scene.own, kept,
    )  # fmt: skip
    tower = with_own_part(tower, True, scene.own, kept)

    load = add(aero.wrench, tower)
    load = add(load, gravity_load(pose, body))
    load = add(load, buoyancy)
    load = add(load, strips.wrench)
    load = add(load, mooring)
    damping = damping_load(pose, x, scene.damping)
    load = add(load, damping)
    load = with_own_part(load, False, scene.own, kept)

    _keep(kept, Kept.TOTAL, load)
    _keep(kept, Kept.ROTOR, aero.wrench)
    _keep(kept, Kept.TOWER, tower)
    _keep(kept, Kept.HYDRO, add(add(buoyancy, strips.wrench), damping))
    _keep(kept, Kept.MOORING, mooring)
    kept[Kept.TORQUE] = aero.torque
    kept[Kept.THRUST] = aero.thrust
    kept[Kept.S0] = strips.s0
    kept[Kept.S1] = strips.s1
    kept[Kept.S2] = strips.s2
    kept[Kept.A33] = strips.a33


@inlined_kernel
def respond(x, u, scene, work, dx):
    """Rates of the state under the command u with the loads of the last evaluate at this state."""
    kept = work.kept
    pose = pose_in(x, scene.body.plane)
    torque = shaft_torque(kept[Kept.TORQUE], u[0], x[State.ROTOR_SPEED], scene.drivetrain)
    attitude_rate(x, dx, scene.body.plane)
    dx[State.AZIMUTH] = x[State.ROTOR_SPEED]
    dx[State.BLADE_PITCH] = pitch_rate(x[State.BLADE_PITCH], u[1], scene.actuator)
    strips = StripLoad(NO_LOAD, kept[Kept.S0], kept[Kept.S1], kept[Kept.S2], kept[Kept.A33])
    accelerate(pose, x, _kept_wrench(kept, Kept.TOTAL), torque, strips, scene.body, work.matrix, dx)


@inlined_kernel
def derivative(t, x, u, scene, work, dx):
    """dx = f(t, x, u). u: generator torque (N m) and blade-pitch command (rad)."""
    work.kept[Kept.FRESH] = 0.0
    evaluate(t, x, scene, work, dx)
    respond(x, u, scene, work, dx)


@kernel
def loads_of(work, dx):
    """Loads of the last evaluate and the accelerations dx that followed from them."""
    kept = work.kept
    strips = StripLoad(NO_LOAD, kept[Kept.S0], kept[Kept.S1], kept[Kept.S2], kept[Kept.A33])
    hydro = add(_kept_wrench(kept, Kept.HYDRO), added_mass_load(strips, dx))
    rotor = RotorLoad(_kept_wrench(kept, Kept.ROTOR), kept[Kept.THRUST], kept[Kept.TORQUE])
    return Loads(rotor, _kept_wrench(kept, Kept.TOWER), hydro, _kept_wrench(kept, Kept.MOORING))


@kernel
def added_mass_load(strips, dx):
    """-A_a nu': the part of the strip load that went to the left-hand side."""
    ax, ay, az = dx[State.VX], dx[State.VY], dx[State.VZ]
    bx, by = dx[State.WX], dx[State.WY]
    return Wrench(
        -strips.s0 * ax - strips.s1 * by,
        -strips.s0 * ay + strips.s1 * bx,
        -strips.a33 * az,
        strips.s1 * ay - strips.s2 * bx,
        -strips.s1 * ax - strips.s2 * by,
        0.0,
    )


@kernel
def accelerate_in_plane(pose, load, torque, strips, body, dx):
    """The same with sway, roll and yaw held: the rotor then turns apart from the platform."""
    m, vx, vz, wy = body.mass_matrix, pose.vx, pose.vz, pose.wy
    px = m[0, 0] * vx + m[0, 2] * vz + m[0, 4] * wy
    pz = m[2, 0] * vx + m[2, 2] * vz + m[2, 4] * wy
    b1, b2 = load.fx - wy * pz, load.fz + wy * px
    b3 = load.my - vz * px + vx * pz
    l11 = sqrt(m[0, 0] + strips.s0)
    l21, l31 = m[2, 0] / l11, (m[4, 0] + strips.s1) / l11
    l22 = sqrt(m[2, 2] + strips.a33 - l21 * l21)
    l32 = (m[4, 2] - l31 * l21) / l22
    square = m[4, 4] + strips.s2 - l31 * l31 - l32 * l32
    b1 /= l11
    b2 = (b2 - l21 * b1) / l22
    b3 = (b3 - l31 * b1 - l32 * b2) / square
    b2 = (b2 - l32 * b3) / l22
    dx[State.VX] = (b1 - l21 * b2 - l31 * b3) / l11
    dx[State.VZ] = b2
    dx[State.WY] = b3
    dx[State.VY] = dx[State.WX] = dx[State.WZ] = 0.0
    dx[State.ROTOR_SPEED] = 0.0 if body.rotor_held else torque / body.rotor_row


@kernel
def accelerate(pose, x, load, torque, strips, body, matrix, dx):
    """Solve (M1 + A_a, M2; M2^T, I_rx) (nu', w_b') = loads - C1 nu - C2 w_b into dx."""
    b = dx[State.VX : State.WZ + 1]
    if body.platform_held:
        b[:] = 0.0
        dx[State.ROTOR_SPEED] = 0.0 if body.rotor_held else torque / body.rotor_row
        return
    if body.plane is not None:
        accelerate_in_plane(pose, load, torque, strips, body, dx)
        return
    c = inertial_load(pose, x[State.ROTOR_SPEED], body.mass_matrix, body.coupling)
    b[0] = load.fx - c.fx
    b[1] = load.fy - c.fy
    b[2] = load.fz - c.fz
    b[3] = load.mx - c.mx
    b[4] = load.my - c.my
    b[5] = load.mz - c.mz
    for i in range(6):
        for j in range(6):
            matrix[i, j] = body.mass_matrix[i, j]
    matrix[0, 0] += strips.s0
    matrix[1, 1] += strips.s0
    matrix[2, 2] += strips.a33
    matrix[0, 4] += strips.s1
    matrix[4, 0] += strips.s1
    matrix[1, 3] -= strips.s1
    matrix[3, 1] -= strips.s1
    matrix[3, 3] += strips.s2
    matrix[4, 4] += strips.s2
    if body.rotor_held:
        solve_spd(matrix, b)
        dx[State.ROTOR_SPEED] = 0.0
        return
    share = body.coupling / body.rotor_row
    matrix[3, 3] -= share * body.coupling
    b[3] -= share * torque
    solve_spd(matrix, b)
    dx[State.ROTOR_SPEED] = (torque - body.coupling * b[3]) / body.rotor_row
