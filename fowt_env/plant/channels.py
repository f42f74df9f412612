"""Computes OpenFAST-named outputs and measurements from a state: the only file with deg, rpm and kN."""

from enum import IntEnum
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from fowt_env.plant.aero.load import wind_of
from fowt_env.plant.aero.wind import wind_at, wind_now
from fowt_env.plant.blade_outputs import measure_blades, record_blades
from fowt_env.plant.blade_pitches import mean_pitch
from fowt_env.plant.compile.decorators import inlined_kernel, kernel, separate_kernel
from fowt_env.plant.drivetrain import torque_in_force
from fowt_env.plant.elastic.chain import weighed_body
from fowt_env.plant.elastic.outputs import add_upper_load, bent_rotor, record_bending, shaft_load
from fowt_env.plant.elastic.shaft import generator_speed, record_twist, twist_channels
from fowt_env.plant.elastic.tower import Twist, kept_bend, nacelle_rates, turned_pose
from fowt_env.plant.hydro.load import surface_at_origin
from fowt_env.plant.measurement import Measure
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State, pose_by_sines, to_inertial
from fowt_env.plant.tilt import along_shaft, rotor_pose
from fowt_env.plant.tower_outputs import carried_at_base, record_tower, tower_channels
from fowt_env.plant.user_loads import record_user_loads, user_channels

DEG_PER_RAD = 180.0 / pi
RPM_PER_RAD_S = 30.0 / pi
UNITS = {  # of output channels: factors from SI
    **dict.fromkeys(("-", "s", "m", "m/s", "m/s^2", "rad", "rad/s", "N", "N-m"), 1.0),
    **dict.fromkeys(("deg", "deg/s", "deg/s^2"), DEG_PER_RAD),
    "rpm": RPM_PER_RAD_S,
    **dict.fromkeys(("kN", "kN-m", "kW"), 1e-3),
}


class Channel(NamedTuple):
    """Describes an output channel: OpenFAST name, unit, and factor from SI."""

    name: str
    unit: str
    scale: float

    @property
    def column(self):
        return f"{self.name}_[{self.unit}]"


def _channels(columns):
    """Return the channels of columns such as "RotSpeed_[rpm]"."""
    pairs = [column.rstrip("]").split("_[") for column in columns.split()]
    return tuple(Channel(name, unit, UNITS[unit]) for name, unit in pairs)


FIXED_CHANNELS = _channels(
    "Time_[s] PtfmSurge_[m] PtfmSway_[m] PtfmHeave_[m] PtfmRoll_[deg] PtfmPitch_[deg] PtfmYaw_[deg]"
    " PtfmTVxi_[m/s] PtfmTVyi_[m/s] PtfmTVzi_[m/s] PtfmRVxi_[deg/s] PtfmRVyi_[deg/s] PtfmRVzi_[deg/s]"
    " PtfmTAxi_[m/s^2] PtfmTAyi_[m/s^2] PtfmTAzi_[m/s^2] PtfmRAxi_[deg/s^2] PtfmRAyi_[deg/s^2]"
    " PtfmRAzi_[deg/s^2] NcIMUTAxs_[m/s^2] NcIMUTAys_[m/s^2] Azimuth_[deg] RotSpeed_[rpm] GenSpeed_[rpm]"
    " BldPitch1_[deg] GenTq_[kN-m] GenPwr_[kW] GenTqLim_[-] RotThrust_[kN] RotTorq_[kN-m] RtFldFxh_[N]"
    " RtFldMxh_[N-m] TwrBsFxt_[kN] TwrBsFyt_[kN] TwrBsFzt_[kN] TwrBsMxt_[kN-m] TwrBsMyt_[kN-m]"
    " TwrBsMzt_[kN-m] HydroFxi_[N] HydroFyi_[N] HydroFzi_[N] HydroMxi_[N-m] HydroMyi_[N-m] HydroMzi_[N-m]"
    " Wave1Elev_[m] Wind1VelX_[m/s] Wind1VelY_[m/s] Wind1VelZ_[m/s] RtVAvgxh_[m/s]"
)
Out = IntEnum("Out", [c.name.upper() for c in FIXED_CHANNELS], start=0)
N_FIXED = len(FIXED_CHANNELS)
# of each user load: about the body origin, inertial axes, as HydroFxi
LOAD_CHANNELS = tuple(
    channel[:2] for channel in _channels("Fxi_[N] Fyi_[N] Fzi_[N] Mxi_[N-m] Myi_[N-m] Mzi_[N-m]")
)
BLADE_CHANNELS = _channels(  # of a rotor with individual pitch
    "BldPitch2_[deg] BldPitch3_[deg] RootMxc1_[kN-m] RootMxc2_[kN-m] RootMxc3_[kN-m] RootMyc1_[kN-m]"
    " RootMyc2_[kN-m] RootMyc3_[kN-m] LSSTipMys_[kN-m] LSSTipMzs_[kN-m] YawBrMxp_[kN-m] YawBrMyp_[kN-m]"
    " YawBrMzp_[kN-m]"
)
BENDING_CHANNELS = _channels(  # of bending blades; OoPDefl and IPDefl are TipDxc and TipDyc
    "OoPDefl1_[m] OoPDefl2_[m] OoPDefl3_[m] IPDefl1_[m] IPDefl2_[m] IPDefl3_[m] TipDzc1_[m] TipDzc2_[m]"
    " TipDzc3_[m] RootFxc1_[kN] RootFxc2_[kN] RootFxc3_[kN] RootFyc1_[kN] RootFyc2_[kN] RootFyc3_[kN]"
    " RootFzc1_[kN] RootFzc2_[kN] RootFzc3_[kN] RootMxb1_[kN-m] RootMxb2_[kN-m] RootMxb3_[kN-m]"
    " RootMyb1_[kN-m] RootMyb2_[kN-m] RootMyb3_[kN-m] Spn1MLxb1_[kN-m] Spn1MLxb2_[kN-m] Spn1MLxb3_[kN-m]"
    " Spn1MLyb1_[kN-m] Spn1MLyb2_[kN-m] Spn1MLyb3_[kN-m] Spn2MLxb1_[kN-m] Spn2MLxb2_[kN-m] Spn2MLxb3_[kN-m]"
    " Spn2MLyb1_[kN-m] Spn2MLyb2_[kN-m] Spn2MLyb3_[kN-m] LSSTipMya_[kN-m] LSSTipMza_[kN-m] LSShftFys_[kN]"
    " LSShftFzs_[kN] TipDxb1_[m] TipDxb2_[m] TipDxb3_[m] TipDyb1_[m] TipDyb2_[m] TipDyb3_[m] RootMzc1_[kN-m]"
    " RootMzc2_[kN-m] RootMzc3_[kN-m] LSShftFya_[kN] LSShftFza_[kN]"
)
# of a flexible tower
TOWER_CHANNELS = _channels("TTDspFA_[m] TTDspSS_[m] YawBrTAxp_[m/s^2] YawBrTAyp_[m/s^2]")
# of a shaft that twists, as ElastoDyn's
SHAFT_CHANNELS = _channels("Q_DrTr_[rad] QD_DrTr_[rad/s]")
GROUPS = {
    "tower": TOWER_CHANNELS,
    "shaft": SHAFT_CHANNELS,
    "bending": BENDING_CHANNELS,
    "blades": BLADE_CHANNELS,
}  # of parts that a scene may have, in row order


def channels(n_lines, loads=(), groups=()):
    """Return every output channel of a model with n_lines mooring lines and these user loads, in row order.

    groups: names of those GROUPS that the model has.
    """
    lines = range(1, n_lines + 1)
    return (
        *FIXED_CHANNELS,
        *(Channel(f"FAIRTEN{i}", "kN", UNITS["kN"]) for i in lines),
        *(Channel(f"ANCHTEN{i}", "kN", UNITS["kN"]) for i in lines),
        *(Channel(f"{name}{end}", unit, UNITS[unit]) for name in loads for end, unit in LOAD_CHANNELS),
        *(channel for name, group in GROUPS.items() if name in groups for channel in group),
    )


class Layout(NamedTuple):
    """Holds points and masses that outputs need in addition to the dynamics."""

    hub: np.ndarray  # (3,) body, m
    tower_top: np.ndarray  # (3,)
    base_height: float  # tower base
    rotor_mass: float
    rotor_inertia: float  # about the shaft, without generator
    upper_matrix: np.ndarray  # (6, 6) mass matrix of everything above the tower base
    gear_ratio: float
    generator_efficiency: float
    blades: int
    span: np.ndarray  # (n,) distances along a blade at which the rotor-averaged wind is evaluated, m
    tilt: object  # tilt.Tilt of the shaft or None
    shaft_hub: np.ndarray  # (3,) hub in rotor axes, whose x axis is the shaft, m
    lean: float  # m upwind per metre along a blade, sine of the cone
    reach: float  # m from the shaft per metre along a blade, cosine of the cone
    rotor_cm: np.ndarray  # (3,) centre of mass of the rotor, m
    blade_masses: object = None  # blade_outputs.BladeMasses, or None: one pitch for all blades


@kernel
def rotor_wind(t, pose, azimuth, aero, layout):
    """Return the mean wind over the blades, relative to the hub and along the shaft, m/s: AeroDyn's RtVAvgxh.

    As in AeroDyn every length of blade has equal weight. The mean of a series is over the azimuth at rest, of
    a wind box over the current positions of the blades.
    """
    if aero is None:
        return 0.0
    turned = rotor_pose(pose, layout.tilt)
    return _rotor_wind(t, turned, azimuth, wind_now(t, aero.wind), aero.wind, aero.field, layout)


@kernel
def _rotor_wind(t, pose, azimuth, now, series, field, layout):
    """Return rotor_wind for a pose in rotor axes."""
    hub = layout.shaft_hub
    if field is None:
        u, v, w = now.u * series.rotor_factor, now.v * series.rotor_factor, now.w
    else:
        u = v = w = 0.0
        for blade in range(layout.blades):
            psi = azimuth + 2.0 * pi * blade / layout.blades
            ey, ez = -sin(psi), cos(psi)
            for distance in layout.span:
                radius, ahead = layout.reach * distance, layout.lean * distance
                X, Y, Z = to_inertial(pose, hub[0] - ahead, hub[1] + radius * ey, hub[2] + radius * ez)
                a, b, c = wind_at(t, pose.x + X, pose.y + Y, pose.z + Z, now, series, field)
                u += a
                v += b
                w += c
        n = layout.blades * layout.span.shape[0]
        u, v, w = u / n, v / n, w / n
    hub_velocity = pose.vx + pose.wy * hub[2] - pose.wz * hub[1]
    return pose.r11 * u + pose.r21 * v + pose.r31 * w - hub_velocity


@kernel
def point_acceleration(pose, dx, px, py, pz):
    """Return the absolute acceleration (body components) of a body-fixed point, from the rates of a state."""
    rates = Twist(dx[State.VX], dx[State.VY], dx[State.VZ], dx[State.WX], dx[State.WY], dx[State.WZ])
    return acceleration_at(pose, rates, px, py, pz)


@kernel
def acceleration_at(pose, rates, px, py, pz):
    """Return the absolute acceleration of a point of a Pose's frame: v' + w x v + w' x p + w x (w x p).

    rates: Twist of the pose. All components are in the frame's axes.
    """
    wx, wy, wz = pose.wx, pose.wy, pose.wz
    ux = pose.vx + wy * pz - wz * py
    uy = pose.vy + wz * px - wx * pz
    uz = pose.vz + wx * py - wy * px
    ax = rates.vx + rates.wy * pz - rates.wz * py + wy * uz - wz * uy
    ay = rates.vy + rates.wz * px - rates.wx * pz + wz * ux - wx * uz
    az = rates.vz + rates.wx * py - rates.wy * px + wx * uy - wy * ux
    return ax, ay, az


@kernel
def elevation_now(t, hydro, data):
    """Return the elevation surface_at_origin, computed once for all outputs of an instant."""
    cache = data.cache
    if cache[LoadCache.ELEVATED] < 0.5:
        cache[LoadCache.ELEVATION] = surface_at_origin(t, hydro, data)
        cache[LoadCache.ELEVATED] = 1.0
    return cache[LoadCache.ELEVATION]


@separate_kernel
def measure(model, data, x, dx, u, t, m):
    """Fill the measurement array m (Scene.n_measurements,) from a state, its loads in data and its rates."""
    layout, sines = model.layout, data.cache[LoadCache.SINES :]
    pose, bend = pose_by_sines(x, sines, model.rigid_body.plane), kept_bend(model.tower, data.rotor)
    nacelle, moving = turned_pose(pose, bend), nacelle_rates(pose, x, bend, dx, model.tower)
    wind = wind_of(t, 0.0, 0.0, layout.hub[2], model.aero)
    top = layout.tower_top
    ax, _, _ = acceleration_at(nacelle, moving, top[0], top[1], top[2])
    m[Measure.TIME] = t
    m[Measure.ROTOR_SPEED] = x[State.ROTOR_SPEED]
    m[Measure.GENERATOR_SPEED] = layout.gear_ratio * generator_speed(x, model.shaft)
    m[Measure.BLADE_PITCH] = mean_pitch(x, model.pitches)
    m[Measure.GENERATOR_TORQUE] = torque_in_force(x, u, model.converter)
    for i in range(6):
        m[Measure.SURGE + i] = x[State.SURGE + i]
        m[Measure.SURGE_RATE + i] = dx[State.SURGE + i]
    m[Measure.NACELLE_ACCELERATION] = ax
    m[Measure.NACELLE_VELOCITY] = nacelle.vx + nacelle.wy * top[2] - nacelle.wz * top[1]
    m[Measure.NACELLE_PITCH_ACCELERATION] = moving.wy
    m[Measure.WIND_SPEED] = wind[0]
    m[Measure.WAVE_ELEVATION] = elevation_now(t, model.hydro, data)
    measure_blades(nacelle, moving, x, dx, model.pitches, model, data, m)


@separate_kernel
def record(model, data, x, dx, u, t, loads, row):
    """Fill one output row (n_channels,), SI, in the order of channels()."""
    layout = model.layout
    body, sines = model.rigid_body, data.cache[LoadCache.SINES :]
    pose, bend = pose_by_sines(x, sines, body.plane), kept_bend(model.tower, data.rotor)
    nacelle, moving = turned_pose(pose, bend), nacelle_rates(pose, x, bend, dx, model.tower)
    row[Out.TIME] = t
    for i in range(6):
        row[Out.PTFMSURGE + i] = x[State.SURGE + i]
    rates = to_inertial(pose, pose.wx, pose.wy, pose.wz)
    spins = to_inertial(pose, dx[State.WX], dx[State.WY], dx[State.WZ])
    a = point_acceleration(pose, dx, 0.0, 0.0, 0.0)
    accelerations = to_inertial(pose, a[0], a[1], a[2])
    for i in range(3):
        row[Out.PTFMTVXI + i] = dx[State.SURGE + i]
    row[Out.PTFMRVXI], row[Out.PTFMRVYI], row[Out.PTFMRVZI] = rates
    row[Out.PTFMTAXI], row[Out.PTFMTAYI], row[Out.PTFMTAZI] = accelerations
    row[Out.PTFMRAXI], row[Out.PTFMRAYI], row[Out.PTFMRAZI] = spins
    top = layout.tower_top
    ax, ay, _ = acceleration_at(nacelle, moving, top[0], top[1], top[2])
    row[Out.NCIMUTAXS], row[Out.NCIMUTAYS] = ax, ay

    speed = x[State.ROTOR_SPEED]
    row[Out.AZIMUTH] = x[State.AZIMUTH] % (2.0 * pi)
    row[Out.ROTSPEED] = speed
    speed = generator_speed(x, model.shaft)
    row[Out.GENSPEED] = layout.gear_ratio * speed
    row[Out.BLDPITCH1] = x[State.BLADE_PITCH]
    torque = torque_in_force(x, u, model.converter)
    row[Out.GENTQ] = torque
    row[Out.GENPWR] = layout.generator_efficiency * layout.gear_ratio * speed * torque
    row[Out.GENTQLIM] = data.cache[LoadCache.TORQUE_LIMITED]
    rotor = bent_rotor(
        pose, bend, x, dx, body, model.structure, model.tower, model.blades, data.blades, data.rotor
    )  # fmt: skip
    # shaft loads: aerodynamics less inertia and weight of the rotor
    hub, cm, tilt = layout.hub, layout.rotor_cm, layout.tilt
    cx, _, cz = acceleration_at(nacelle, moving, cm[0], cm[1], cm[2])
    push = along_shaft(cx + body.gravity * nacelle.r31, cz + body.gravity * nacelle.r33, tilt)
    turning = dx[State.ROTOR_SPEED] + along_shaft(moving.wx, moving.wz, tilt)
    row[Out.ROTTHRUST], row[Out.ROTTORQ] = shaft_load(
        loads.rotor.thrust - layout.rotor_mass * push,
        loads.rotor.torque - layout.rotor_inertia * turning,
        rotor,
    )
    row[Out.RTFLDFXH] = loads.rotor.thrust
    row[Out.RTFLDMXH] = loads.rotor.torque
    tower_base(pose, x, dx, loads, bend, body, layout, model.tower, model.structure, data.rotor, row)

    h = loads.hydro
    row[Out.HYDROFXI], row[Out.HYDROFYI], row[Out.HYDROFZI] = to_inertial(pose, h.fx, h.fy, h.fz)
    row[Out.HYDROMXI], row[Out.HYDROMYI], row[Out.HYDROMZI] = to_inertial(pose, h.mx, h.my, h.mz)
    row[Out.WAVE1ELEV] = elevation_now(t, model.hydro, data)
    wind = wind_of(t, 0.0, 0.0, hub[2], model.aero)
    row[Out.WIND1VELX], row[Out.WIND1VELY], row[Out.WIND1VELZ] = wind
    row[Out.RTVAVGXH] = rotor_wind(t, nacelle, x[State.AZIMUTH], model.aero, layout)
    n = data.lines.shape[0]
    for i in range(n):
        row[N_FIXED + i] = data.lines[i, 2]
        row[N_FIXED + n + i] = data.lines[i, 3]
    n = N_FIXED + 2 * n
    record_user_loads(pose, bend, model.user, data, row[n:])
    n += user_channels(model.user)
    record_tower(bend, ax, ay, row[n:])
    n += tower_channels(bend)
    record_twist(x, model.shaft, row[n:])
    n += twist_channels(model.shaft)
    record_bending(rotor, x, dx, model, model.blades, data.blades, data.rotor, row[n:])
    record_blades(nacelle, moving, x, dx, rotor, model.pitches, model, data, row)


@inlined_kernel
def tower_base(pose, x, dx, loads, bend, body, layout, tower, structure, work, row):
    """Fill the tower-base loads of a row: aerodynamics and weight above it less the momentum rate there.

    Body axes at (0, 0, base_height), quasi-static sense of OpenFAST's TwrBs (load of the upper part
    on the lower one).
    """
    load = carried_at_base(pose, x, dx, loads, bend, weighed_body(body, structure), layout, tower, work)
    load = add_upper_load(load, bend, structure, work)
    z = layout.base_height
    row[Out.TWRBSFXT], row[Out.TWRBSFYT], row[Out.TWRBSFZT] = load.fx, load.fy, load.fz
    row[Out.TWRBSMXT] = load.mx + z * load.fy
    row[Out.TWRBSMYT] = load.my - z * load.fx
    row[Out.TWRBSMZT] = load.mz


def put_hub_wind(rows, hub_wind, period):
    """Fill the hub wind of rows (k, n_channels), SI, from (time, value (n, 3)); period 0: not periodic."""
    time, value = hub_wind
    at = rows[:, Out.TIME] % period if period > 0.0 else rows[:, Out.TIME]
    for column in range(3):
        rows[:, Out.WIND1VELX + column] = np.interp(at, time, value[:, column])


def to_units(rows, n_lines, loads=(), groups=()):
    """Return a copy of rows (k, n_channels) from SI to the units of channels(n_lines, loads, groups)."""
    return rows * scales(n_lines, loads, groups)


def scales(n_lines, loads=(), groups=()):
    """Return the (n_channels,) factors from SI to the units of channels(n_lines, loads, groups)."""
    return np.array([c.scale for c in channels(n_lines, loads, groups)])
