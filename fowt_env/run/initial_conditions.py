"""Computes the state and command at the beginning of a run."""

from collections.abc import Mapping
from math import cos, pi, sin
from typing import Any

import numpy as np

from fowt_env.analysis.blade_coordinates import bending_states, turned_to
from fowt_env.analysis.equilibrium import impossible_place
from fowt_env.analysis.trim import trim, trim_prescribed
from fowt_env.descriptions.checks import check_number, refusal
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.errors import (
    InputError,
    unknown,
)
from fowt_env.plant.line_dynamics import rest_lines
from fowt_env.plant.state import BLADES, OUT_OF_PLANE, Command, State, pose_of
from fowt_env.scene.actuators import rest_actuators
from fowt_env.scene.channel_names import channel_name
from fowt_env.scene.scene import Scene

STARTS = ("trim", "zero", "parked")
INITIAL = {  # channel: (state, factor to SI)
    "PtfmSurge": (State.SURGE, 1.0),
    "PtfmSway": (State.SWAY, 1.0),
    "PtfmHeave": (State.HEAVE, 1.0),
    "PtfmRoll": (State.ROLL, DEGREE),
    "PtfmPitch": (State.PLATFORM_PITCH, DEGREE),
    "PtfmYaw": (State.YAW, DEGREE),
    "Azimuth": (State.AZIMUTH, DEGREE),
    "RotSpeed": (State.ROTOR_SPEED, RPM),
    "BldPitch1": (State.BLADE_PITCH, DEGREE),  # and BldPitch2 and 3 with individual pitch
    "PtfmTVxi": (State.VX, 1.0),
    "PtfmTVyi": (State.VY, 1.0),
    "PtfmTVzi": (State.VZ, 1.0),
    "PtfmRVxi": (State.WX, DEGREE),
    "PtfmRVyi": (State.WY, DEGREE),
    "PtfmRVzi": (State.WZ, DEGREE),
}
TIPS = tuple(f"{name}{blade}" for name in ("OoPDefl", "IPDefl") for blade in ("", *range(1, BLADES + 1)))


def initial_state(
    scene: Scene, initial: str | Mapping[str, Any] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return (state, command) at the beginning of a run.

    initial: "trim" (or None), the floating steady state in the mean wind; "zero", all states of platform,
    tower and blade bending zero, with the rotor speed and blade pitch of that wind on a fixed platform;
    "parked", the floating steady state with the rotor at rest, feathered blades and no torque; or a mapping
    of absolute values of channels at the trim, or at {"start": "zero"} or "parked". Channels are named
    PtfmPitch or PtfmPitch_[deg]; BldPitch1 sets the pitch of all blades, with individual pitch that of
    blade 1; TTDspFA and TTDspSS bend the tower in its first modes only; OoPDefl and IPDefl of the blade tips
    (OoPDefl1: of blade 1) bend the blades in the first flapwise and the edgewise mode only, as in ElastoDyn.
    Raises: InputError for unknown channels, values that are not numbers, and impossible positions:
    below the sea bed; with wind also out of the water, with the tower base under water, or with the rotor
    facing away from the wind.
    """
    if not isinstance(initial, str | Mapping | None):
        raise InputError(f"initial = {initial!r}: must be 'trim', 'zero', 'parked' or a mapping of channels")
    values = dict(initial) if isinstance(initial, Mapping) else {"start": initial or "trim"}
    start = values.pop("start", "trim")
    if start not in STARTS:
        raise unknown("start", start, STARTS)
    if start == "parked":
        point = trim_prescribed(scene, 0.0, scene.turbine.pitch_drive.maximum)
    else:
        point = trim(scene, platform="floating" if start == "trim" else "fixed")
    x, u = point.state.copy(), point.command.copy()
    known = INITIAL | {f"BldPitch{blade}": (i, DEGREE) for blade, i in enumerate(scene.pitch_states, 1)}
    if (tower := scene.model.tower) is not None:
        known |= {"TTDspFA": (tower.first, 1.0), "TTDspSS": (tower.first + 1, 1.0)}
        deflections = slice(tower.first, tower.first + len(tower.slope))
        if start == "zero" or any(str(name).startswith("TTDsp") for name in values):
            x[deflections] = 0.0
    tips = TIPS if scene.model.blades is not None else ()
    bent = bending_states(scene)
    if start == "zero":
        x[bent] = 0.0
    rates, deflected = {}, {}
    for name, value in values.items():
        key = channel_name(name)
        if key not in known and key not in tips:
            raise unknown("channel of initial", name, (*known, *tips))
        check_number(f"initial[{name!r}]", value)
        if key in tips:
            deflected[key] = value
            continue
        index, factor = known[key]
        if scene.model.rigid_body.plane is not None and index in OUT_OF_PLANE and value != 0.0:
            raise refusal(f"initial[{name!r}]", value, "0 in a planar scene")
        if State.VX <= index <= State.WZ:
            rates[index] = value * factor
        elif index == State.AZIMUTH:
            x[:] = turned_to(x, value * factor, bent)
        else:
            x[index] = value * factor
    if abs(x[State.PLATFORM_PITCH]) >= 0.5 * pi:
        raise InputError(
            f"initial['PtfmPitch'] = {x[State.PLATFORM_PITCH] / DEGREE:g}: must be inside (-90, 90) deg"
        )
    if values:
        _check_position(scene, x)
    if rates:  # inertial axes to body axes
        inertial = np.zeros(6)
        for index, value in rates.items():
            inertial[index - State.VX] = value
        p = pose_of(x)
        rotation = np.array([[p.r11, p.r12, p.r13], [p.r21, p.r22, p.r23], [p.r31, p.r32, p.r33]])
        x[State.VX : State.VX + 3] = rotation.T @ inertial[:3]
        x[State.WX : State.WX + 3] = rotation.T @ inertial[3:]
    drive = scene.turbine.pitch_drive
    for blade, index in enumerate(scene.pitch_states):
        if not drive.minimum <= x[index] <= drive.maximum:
            raise InputError(
                f"initial['BldPitch{blade + 1}'] = {x[index] / DEGREE:g} deg: must be in"
                f" [{drive.minimum / DEGREE:g}, {drive.maximum / DEGREE:g}] deg"
            )
        u[Command.BLADE_PITCH + blade] = x[index]
    if deflected:
        _bend_blades(scene, x, deflected)
    rest_actuators(scene.model, x, u)
    if values:
        rest_lines(scene, x)
    return x, u


def _bend_blades(scene, x, deflected):
    """Set the deflections of blades whose tips have an initial displacement; rates and other modes are zero.

    deflected: {channel of TIPS: m}; a displacement that is not given is zero.
    """
    blades = scene.model.blades
    flap, edge = 0, len(blades.beam.count) - 1  # first flapwise, edgewise: blade_beam.MODES
    shapes = np.array([blades.tip.x[[flap, edge]], blades.tip.y[[flap, edge]]])
    bent = bending_states(scene)
    for number, pitch in enumerate(scene.pitch_states):
        keys = [[f"{name}{blade}" for blade in ("", number + 1)] for name in ("OoPDefl", "IPDefl")]
        if not any(key in deflected for pair in keys for key in pair):
            continue
        out, inward = (next((deflected[key] for key in pair[::-1] if key in deflected), 0.0) for pair in keys)
        c, s = cos(x[pitch]), sin(x[pitch])
        x[bent[:, number]] = 0.0
        x[bent[[flap, edge], number]] = np.linalg.solve(shapes, [c * out - s * inward, s * out + c * inward])


def _check_position(scene, x):
    """Raise InputError for a position that a platform cannot have or in which the rotor cannot operate."""
    blown = scene.model.aero is not None
    if scene.model.hydro is not None:
        upright = cos(x[State.PLATFORM_PITCH]) * cos(x[State.ROLL])
        reasons = impossible_place(scene, float(x[State.HEAVE]), float(upright))
        reasons = [text for what, text in reasons.items() if what == "bed" or blown and what != "tilt"]
        if reasons:
            lean, roll = x[State.PLATFORM_PITCH] / DEGREE, x[State.ROLL] / DEGREE
            raise InputError(
                f"initial: the run of platform {scene.label!r} would begin with {' and '.join(reasons)}"
                f" (PtfmHeave = {x[State.HEAVE]:.4g} m, PtfmPitch = {lean:.3g} deg, PtfmRoll = {roll:.3g}"
                " deg)"
            )
    if blown and cos(x[State.YAW]) <= 0.0:
        raise InputError(
            f"initial['PtfmYaw'] = {x[State.YAW] / DEGREE:g}: must be within 90 deg of 0 or a multiple of"
            " 360 with wind: the rotor would face away from the wind"
        )
