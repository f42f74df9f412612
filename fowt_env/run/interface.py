"""Builds the interface of a run from descriptions: protection, faults, sensors and wind ahead."""

from collections.abc import Sequence
from math import exp, inf, isfinite, isinf, radians
from typing import Any

import numpy as np

from fowt_env.control import foreseen, hidden, lidar_of, preview_leads
from fowt_env.descriptions.faults import BLADE_FAULTS, STOP_FAULTS, Fault
from fowt_env.descriptions.protection import Protection
from fowt_env.descriptions.sensors import SensorChain
from fowt_env.errors import InputError
from fowt_env.loop.interface import Interface
from fowt_env.loop.protection import ROUNDING, Failure, Guard, Stop, Trip, build_guard
from fowt_env.loop.sensing import WindAhead, no_wind_ahead
from fowt_env.plant.drivetrain import build_torque_curve
from fowt_env.plant.measurement import BladeMeasurement, Measurement
from fowt_env.plant.state import BLADES
from fowt_env.scene.scene import Scene
from fowt_env.weather.lidar_gates import Gates, lidar_gates
from fowt_env.weather.preview import Motion
from fowt_env.weather.sensor_noise import draw_sensors

FAILURES = {
    "stuck_pitch": Failure.STUCK,
    "pitch_runaway": Failure.RUNAWAY,
    "pitch_offset": Failure.OFFSET,
    "sensor_bias": Failure.BIAS,
    "sensor_freeze": Failure.FREEZE,
    "sensor_loss": Failure.LOSS,
    "line_loss": Failure.LINE_LOSS,
}


def guard_of(
    scene: Scene,
    limits: Protection,
    faults: Sequence[Fault],
    control_dt: float,
    controller: Any = None,
) -> Guard:
    """Return the Guard of a run: the trips of a protection, and the faults. Raises: InputError.

    controller: the law of the run, before it is prepared, which may have a start-up of its own; None: none.
    """
    turbine, drive = scene.turbine, scene.turbine.pitch_drive
    units = {
        Trip.OVERSPEED: turbine.rated_rotor_speed,
        Trip.OVERPOWER: turbine.torque_law.rated_power,
        Trip.ACCELERATION: 1.0,
        Trip.PITCH_DEVIATION: 1.0,
    }
    trips = []
    for kind, unit in units.items():
        trip = getattr(limits, kind.name.lower())
        if trip is None:
            trips.append((inf, 0.0, Stop.EMERGENCY))
        else:
            trips.append((float(trip.limit * unit), trip.time, Stop[trip.stop.upper()]))
    ordered, rates, rows = [inf, inf], [limits.normal_rate, limits.emergency_rate], []
    for fault in faults:
        rows += _failures(scene, fault)
        stop = Stop.NORMAL if fault.kind == "normal_stop" else Stop.EMERGENCY
        if fault.kind in STOP_FAULTS or fault.delay is not None:
            ordered[stop] = min(ordered[stop], fault.time + (fault.delay or 0.0))
            if fault.rate is not None:
                rates[stop] = radians(fault.rate)
    steps = [min(rate, drive.rate_limit) * control_dt for rate in rates]
    off_speed = limits.off_speed * turbine.rated_rotor_speed
    losses = [fault.grid_loss for fault in faults if fault.grid_loss is not None]
    grid_loss = min(losses, default=inf) - ROUNDING
    start, start_rate = _start_of(faults, limits, controller)
    cut_in = turbine.torque_law.cut_in_speed / turbine.torque_law.rated_speed
    connect = cut_in if limits.connect_speed is None else limits.connect_speed
    return build_guard(
        trips,
        ordered,
        steps,
        drive.maximum,
        off_speed,
        grid_loss,
        rows,
        [_flood(scene, fault) for fault in faults if fault.kind == "flooded_compartment"],
        start,
        min(start_rate, drive.rate_limit) * control_dt,
        drive.minimum,
        connect * turbine.rated_rotor_speed,
        None if isinf(start) else build_torque_curve(turbine.torque_law),
    )


def starts_parked(faults: Sequence[Fault]) -> bool:
    """Return whether a run with these faults begins with a parked turbine: it has a start-up."""
    return any(fault.kind == "start_up" for fault in faults)


def _start_of(faults, limits, controller):
    """Return (time, pitch rate rad/s) of the supervisor's start-up; an infinite time: none.

    A controller with order_start_up(time) has a start-up of its own, and is told its time, or None.
    """
    ordered = [fault for fault in faults if fault.kind == "start_up"]
    if len(ordered) > 1:
        times = ", ".join(f"{fault.time:g}" for fault in ordered)
        raise InputError(f"faults: start_up at {times} s: must be one in a run")
    law = controller
    while not hasattr(law, "order_start_up") and hasattr(law, "controller"):
        law = law.controller
    own = getattr(law, "order_start_up", None)
    fault = ordered[0] if ordered else None
    if fault is not None and fault.by == "controller" and own is None:
        raise InputError(
            f"faults: start_up: by = 'controller': controller {getattr(controller, 'name', None)!r} has no"
            " start-up of its own; must be 'supervisor'"
        )
    if own is not None:
        itself = fault is not None and fault.by != "supervisor"
        if itself and fault.rate is not None:
            raise InputError(
                f"faults: start_up: rate = {fault.rate:g}: is a key of the supervisor's start-up (by ="
                f" 'supervisor'), and controller {law.name!r} starts by its own"
            )
        own(fault.time if itself else None)
        if itself:
            return inf, 0.0
    if fault is None:
        return inf, 0.0
    return fault.time, limits.start_rate if fault.rate is None else radians(fault.rate)


def _flood(scene, fault):
    """Return the row of Guard.floods of a Fault."""
    where = "faults: flooded_compartment"
    if scene.model.hydro is None:
        raise InputError(f"{where}: needs a scene with hydrodynamics")
    most, base = scene.model.rigid_body.mass, scene.model.layout.base_height
    if fault.mass > most:
        raise InputError(f"{where}: mass = {fault.mass:g} kg: must be at most {most:.4g} kg, the turbine's")
    x, y, z = fault.point
    if not -scene.platform.environment.water_depth <= z <= base:
        depth = scene.platform.environment.water_depth
        raise InputError(
            f"{where}: point = {list(fault.point)}: z must be in [{-depth:g}, {base:g}] m, from the sea bed"
            " to the base of the tower"
        )
    if scene.model.rigid_body.plane is not None and y != 0.0:
        raise InputError(f"{where}: point = {list(fault.point)}: y must be 0 in a planar scene")
    return (fault.time, fault.duration or 0.0, fault.mass, x, y, z)


def _failures(scene, fault):
    """Return the rows of Guard.faults of a Fault: (kind, time, index, value, backup)."""
    if fault.kind not in FAILURES:
        return []
    kind, time = FAILURES[fault.kind], fault.time
    if kind == Failure.LINE_LOSS:
        count = scene.n_lines
        if fault.line > count:
            raise InputError(f"faults: line_loss: line = {fault.line}: the scene has {count} mooring lines")
        return [(kind, time, fault.line - 1, 0.0, 0.0)]
    individual = scene.model.pitches is not None
    if fault.kind not in BLADE_FAULTS:
        fields = (*Measurement._fields, *(BladeMeasurement._fields if individual else ()))
        if fault.field not in fields:
            raise InputError(
                f"faults: {fault.kind}: field = {fault.field!r}: needs a scene with pitch='individual'"
            )
        return [(kind, time, fields.index(fault.field), fault.value or 0.0, 0.0)]
    if fault.blades is not None and not individual:
        raise InputError(
            f"faults: {fault.kind}: blades = {list(fault.blades)}: needs a scene with pitch='individual'"
        )
    blades = range(BLADES if individual else 1)
    if fault.blades is not None:
        blades = [number - 1 for number in fault.blades]
    value = radians(fault.offset or 0.0)
    if fault.towards is not None:
        value = -1.0 if fault.towards == "fine" else 1.0
    return [(kind, time, blade, value, float(fault.backup)) for blade in blades]


def build_interface(
    scene: Scene,
    controller: Any,
    guard: Guard | None,
    chain: SensorChain | None,
    preview: Any,
    control_dt: float,
    periods: int,
) -> Interface:
    """Return the Interface of a run of `periods` control periods for the information of a controller.

    chain None: exact sensors. Raises: InputError if the controller declares a field that the chain or the
    scene does not have.
    """
    individual = scene.model.pitches is not None
    available = None if chain is None else (chain.name, chain.available + chain.available_of_blades)
    return Interface(
        control_dt,
        draw_sensors(chain, control_dt, scene.seed, periods + 1, individual),
        hidden(controller, available, individual),
        law_wind_ahead(scene, controller, preview, control_dt, control_dt * periods),
        guard,
    )


def law_wind_ahead(scene, controller, preview, control_dt, duration) -> WindAhead:
    """Return the WindAhead of a controller from the argument preview of simulate: preview or lidar.

    The rows of a lidar are speeds and freshness of its gates.
    """
    leads, lidar = preview_leads(controller), lidar_of(controller, preview)
    if lidar is None:
        return wind_ahead_of(scene, leads, preview, control_dt, duration)
    seen = preview.series if isinstance(preview, Gates) else lidar_gates(scene, lidar).series
    taps, weight = np.zeros((0, 0)), np.zeros(3)
    if seen.motion is not None:
        taps, weight = nacelle_motion(seen.motion, control_dt)
        taps[len(taps) // 2 :] = 0.0  # motion does not change the freshness
    return WindAhead(seen.time, seen.values, taps, weight)


def wind_ahead_of(scene, leads, preview, control_dt, duration) -> WindAhead:
    """Return the WindAhead of a run at look-ahead times (s) from the argument preview of simulate."""
    if not leads:
        return no_wind_ahead()
    time, values, motion = foreseen(scene, leads, preview, duration)
    taps, weight = np.zeros((0, 0)), np.zeros(3)
    if motion is not None:
        taps, weight = nacelle_motion(motion, control_dt)
    return WindAhead(time, values, taps, weight)


def nacelle_motion(motion: Motion, control_dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (taps, weight) of a WindAhead, the Motion of a preview sampled at the control instants.

    Between two instants the velocity is linear.
    """
    step = motion.corner * control_dt
    weight = np.array([0.0, 0.0, 1.0])
    if isfinite(step):
        decay = exp(-step)
        new = 1.0 - (1.0 - decay) / step  # exact for a ramp from one instant to the next
        weight = np.array([decay, 1.0 - decay - new, new])
    offsets, delays = (np.asarray(lag, dtype=float) / control_dt for lag in (motion.offset, motion.delay))
    size = int(max(offsets.max(), 0.0)) + int(max(delays.max(), 0.0)) + 3
    taps = np.zeros((len(delays), size))
    for j, delay in enumerate(delays):
        for offset, fraction in zip(offsets, motion.weight, strict=True):
            for late, part in _linear(delay):
                for later, piece in _linear(offset):
                    taps[j, late + later] += fraction * part * piece
    return taps, weight


def _linear(lag):
    """Return ((instants ago, weight), ...) of a lag in control periods, interpolated between two instants."""
    whole = int(max(lag, 0.0))
    part = max(lag, 0.0) - whole
    return (whole, 1.0 - part), (whole + 1, part)
