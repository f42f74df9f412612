"""Checks whether a steady state is possible for a platform, and explains a failed search for one."""

from math import acos, cos, degrees, hypot, isnan, sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.analysis.statics import rotation_of, statics
from fowt_env.errors import InputError, warn_once
from fowt_env.plant.advance import CAPSIZE
from fowt_env.plant.model import LoadCache
from fowt_env.plant.mooring import SLACK
from fowt_env.plant.rigid_body import gravity_load
from fowt_env.plant.state import State, pose_of
from fowt_env.scene.geometry import in_radians

MOTION_LABELS = ("surge", "sway", "heave", "roll", "platform pitch", "yaw")
LOADS = {  # name: first index of its wrench in Data.cache
    "rotor": LoadCache.ROTOR,
    "tower drag": LoadCache.TOWER,
    "buoyancy and water": LoadCache.HYDRO,
    "mooring": LoadCache.MOORING,
}
# limits of a plausible steady state: warnings; the built-in platforms stay far within
HEAVE = 0.1  # of the draft
TILT = 20.0  # deg
WEAK = 1e-3  # sum of line tensions, as a fraction of the weight
ONE_SIDED = 0.9  # horizontal resultant of the lines, as a fraction of the sum of magnitudes
GROWTH = 1e-3  # square of a motion's growth rate, as a fraction of gravity over draft
MOORINGS = {"slack": "slack moorings", "weak": "loose moorings", "one-sided": "moorings to one side"}
HEAVY = 0.02  # net vertical force on the undisplaced platform that is reported, as a fraction of the weight


class Evaluated(NamedTuple):
    """Holds a state vector and the loads at that state."""

    x: np.ndarray  # (n_state,)
    cache: np.ndarray  # Data.cache
    lines: np.ndarray  # Work.lines


def evaluated(x, data):
    """Return the Evaluated of the state x, at which the loads in data were evaluated last."""
    return Evaluated(x.copy(), data.cache.copy(), data.lines.copy())


def check_equilibrium(scene, rest, start, slope, fresh_slope):
    """Refuse an impossible steady state of a platform; warn, once per platform, of an implausible one.

    rest: state vector; start: Evaluated of the undisplaced platform; slope: (n, n) derivatives of the
    accelerations of the motions by the motions, at or near the state (None: unknown); fresh_slope()
    computes these derivatives at the state.

    Raises: InputError.
    """
    if scene.model.hydro is None:
        return
    heave, roll, platform_pitch = float(rest[State.HEAVE]), rest[State.ROLL], rest[State.PLATFORM_PITCH]
    upright = cos(platform_pitch) * cos(roll)  # vertical component of the tower axis
    tilt = degrees(acos(upright))
    if impossible := impossible_place(scene, heave, upright):
        places = " and ".join(impossible.values())
        raise InputError(
            f"{label(scene)}: its loads balance only with {places} ({_position(rest)})."
            f" {_sentences(causes_of(scene, start))}".rstrip()
        )
    odd = {}
    draft = scene.platform.draft
    if abs(heave) > HEAVE * draft:
        odd["heave"] = f"heave of {heave:.3g} m, {abs(heave) / draft:.0%} of the draft of {draft:g} m"
    if tilt > TILT:
        odd["tilt"] = f"{tilt:.3g} deg from upright"
    # recompute the slope only if the available one shows an unstable motion: it costs a third of a trim
    if (slope is None or _growing(scene, slope)) and (growing := _growing(scene, fresh_slope())):
        time = min(growing.values())
        odd["unstable"] = f"unstable in {' and '.join(growing)}, which grows by a factor e in {time:.2g} s"
    causes = causes_of(scene, start)
    odd |= {name: text for name, text in MOORINGS.items() if name in causes}
    if not odd:
        return
    key = hash((repr(scene.platform), scene.turbine.name, *odd))
    if "tilt" in odd or "unstable" in odd:
        causes["upright"] = metacentre(scene, statics(scene))
    text = f"{label(scene)}: {'; '.join(odd.values())} ({_position(rest)}). {_sentences(causes)}"
    warn_once(key, text.rstrip())


def unbalanced(scene, start, end, ending=None):
    """Return the message of a failed trim: faults of the undisplaced platform, and the search's last state.

    start, end: Evaluated; ending: text on the last state, for a failure other than the platform's balance.
    """
    causes = causes_of(scene, start)
    if scene.model.mooring is None:
        why = "mooring = False" if scene.platform.lines else "no mooring lines"
        causes["unheld"] = (
            f"there is no restoring in surge and sway: {why} (a run can start upright: start = 'zero')"
        )
    text = f"no steady state found for {label(scene)}. {_sentences(causes)}".rstrip()
    return f"{text} The search ended at {_position(end.x)}, {ending or _left(scene, end)}"


def label(scene):
    """Return the name of a scene's platform and its wind, for messages."""
    wind = "without wind" if scene.wind_speed is None else f"in wind of {scene.wind_speed:g} m/s"
    return f"platform {scene.label!r} {wind}"


def impossible_place(scene, heave, upright):
    """Return {bound: text} of the bounds that a platform's position violates.

    heave: m; upright: vertical component of the tower axis. Keys: "bed", "air", "tower base", "tilt".
    """
    hull, depth = scene.platform.hull, scene.platform.environment.water_depth
    across = sqrt(max(1.0 - upright * upright, 0.0))
    width = 0.0 if hull is None else hull.diameter[0]
    keel = heave - upright * scene.platform.draft - 0.5 * across * width
    base_height = scene.platform.tower.base_height
    base = heave + upright * base_height
    faults = {}
    if keel < -depth:
        faults["bed"] = f"its keel {-depth - keel:.3g} m below the sea bed"
    if keel > 0.0:
        faults["air"] = f"its keel {keel:.3g} m above the water"
    if base < 0.0 < base_height:
        faults["tower base"] = f"its tower base {-base:.3g} m under water"
    if (tilt := acos(upright)) > CAPSIZE:
        faults["tilt"] = f"its tower {degrees(tilt):.3g} deg from upright"
    return faults


def causes_of(scene, start):
    """Return {name: sentence} of the faults of the undisplaced platform."""
    model, platform = scene.model, scene.platform
    weight = model.rigid_body.mass * model.rigid_body.gravity
    net = _total(model, start)[2]
    causes = {}
    if model.mooring is not None:
        causes |= _mooring_causes(model.mooring, start, weight, net)
    if abs(net) <= HEAVY * weight:
        return causes
    if model.hydro is None:
        causes["vertical"] = f"its weight of {_kilo(weight)} kN has no buoyancy: hydrodynamics = False"
        return causes
    specific_weight = platform.environment.water_density * model.rigid_body.gravity
    buoyancy, pull = start.cache[LoadCache.HYDRO + 2], -start.cache[LoadCache.MOORING + 2]
    lines = f" and its lines pull down with {_kilo(pull)} kN" if model.mooring is not None else ""
    causes["vertical"] = (
        f"undisplaced it weighs {_kilo(weight)} kN{lines}, against a buoyancy of {_kilo(buoyancy)} kN"
        f" ({_shown(buoyancy / specific_weight)} m3): {_kilo(abs(net))} kN"
        f" ({_shown(abs(net) / model.rigid_body.gravity / 1e3)} t) too {'light' if net > 0.0 else 'heavy'}"
    )
    ballast = platform.ballast.mass
    enough = ballast + net / model.rigid_body.gravity
    if len(causes) == 1 and enough > 0.0:  # with wrong moorings the ballast is not the cause
        causes["vertical"] += f"; ballast.mass = {enough:.6g} kg (now {ballast:.6g}) floats at this draft"
    return causes


def _mooring_causes(mooring, start, weight, net):
    """Return {name: sentence} of faults of the undisplaced platform's mooring; net: vertical force, N."""
    span = mooring.anchor - mooring.fairlead
    along, up = np.hypot(span[:, 0], span[:, 1]), -span[:, 2]
    way = np.hypot(along, up)
    pull, tension, regime = start.lines[:, 0], start.lines[:, 2], start.lines[:, 5]
    causes = {}
    # taut lines are short on purpose, but must not exceed the excess buoyancy
    if net < -HEAVY * weight and (short := np.flatnonzero(mooring.length < way)).size:
        i = short[0]
        causes["short"] = (
            f"{short.size} of {len(way)} mooring lines are shorter than the distance from anchor to fairlead"
            f" (line {i + 1}: length {mooring.length[i]:g} m against {way[i]:.4g} m, which takes"
            f" {_kilo(tension[i])} kN)"
        )
    first = (
        f"(line 1: length {mooring.length[0]:g} m, wet_weight {mooring.weight[0]:g} N/m, EA"
        f" {mooring.EA[0]:g} N; {along[0]:.4g} m from anchor to fairlead and {up[0]:.4g} m up)"
    )
    if (regime == SLACK).all():
        causes["slack"] = f"all mooring lines hang slack and provide no restoring force {first}"
    elif tension.sum() < WEAK * weight:
        causes["weak"] = (
            f"its mooring lines pull with {_kilo(tension.sum())} kN together, and it weighs"
            f" {_kilo(weight)} kN {first}"
        )
    together = hypot(start.cache[LoadCache.MOORING], start.cache[LoadCache.MOORING + 1])
    if len(pull) > 1 and together > ONE_SIDED * pull.sum() > 0.0:
        anchors = ", ".join(f"({x:.4g}, {y:.4g})" for x, y, _ in mooring.anchor[:4])
        azimuths = in_radians(mooring.anchor, mooring.fairlead)
        shown = ", ".join(f"{azimuth:.4g}" for azimuth in (azimuths or ())[:4])
        hint = f": {shown} look like radians" if shown else ""
        causes["one-sided"] = (
            f"all mooring lines pull to the same side, with {_kilo(together)} kN (anchors at (x, y) ="
            f" {anchors} m; azimuth_deg is in degrees{hint})"
        )
    return causes


def metacentre(scene, undisplaced):
    """Return a sentence on the stability of the undisplaced platform as a floating body, from its Statics."""
    buoyancy, height = undisplaced.buoyancy_centre[2], undisplaced.metacentric_height
    shown = "" if isnan(buoyancy) else f", that of buoyancy at {buoyancy:.3g} m"
    return (
        f"undisplaced its centre of mass is at z = {undisplaced.mass_centre[2]:.3g} m{shown} and its"
        f" metacentric height {min(height):.3g} m (ballast.cm_depth = {scene.platform.ballast.cm_depth:g} m"
        " is positive downwards)"
    )


def _growing(scene, slope):
    """Return {motion: e-folding time s} of the unstable motions of an equilibrium with this slope."""
    draft = scene.platform.draft
    limit = GROWTH * scene.model.rigid_body.gravity / draft
    if np.max(np.linalg.eigvals(slope).real) <= limit:
        return {}
    values, shapes = np.linalg.eig(slope)
    names = MOTION_LABELS if len(slope) == 6 else MOTION_LABELS[::2]  # in the plane: surge, heave, pitch
    arms = [0.5 * draft if name in MOTION_LABELS[3:] else 1.0 for name in names]
    times = {}
    for value, shape in zip(values, shapes.T, strict=True):
        if value.real > limit:
            times[names[int(np.argmax(np.abs(shape) * arms))]] = 1.0 / sqrt(value.real)
    return times


def _left(scene, end):
    """Return a text on the imbalance at a state: the largest net force or moment, and its contributions."""
    loads = _by_load(scene, end)
    total = sum(loads.values())
    arm = 0.5 * scene.platform.draft
    motion = int(np.argmax(np.abs(total) / [1.0, 1.0, 1.0, arm, arm, arm]))
    parts = {name: load[motion] for name, load in loads.items()}
    most = max(abs(part) for part in parts.values())
    shown = ", ".join(f"{name} {_kilo(part)}" for name, part in parts.items() if abs(part) > 1e-3 * most)
    unit = "kN" if motion < 3 else "kN m about the centre of mass"
    return f"with {_kilo(total[motion])} {unit} left in {MOTION_LABELS[motion]}: {shown}"


def _by_load(scene, end):
    """Return {load: (6,)}: force in inertial axes, moment about the centre of mass in body axes."""
    to_inertial, body = rotation_of(pose_of(end.x)), scene.model.rigid_body
    centre = np.array([body.s_x, body.s_y or 0.0, body.s_z]) / body.mass
    weight = -body.mass * body.gravity * to_inertial[2]
    wrenches = {name: end.cache[first : first + 6] for name, first in LOADS.items()}
    wrenches["weight"] = np.concatenate([weight, np.cross(centre, weight)])
    if scene.loads:
        wrenches["custom loads"] = _total(scene.model, end) - sum(wrenches.values())
    return {
        name: np.concatenate([to_inertial @ wrench[:3], wrench[3:] - np.cross(centre, wrench[:3])])
        for name, wrench in wrenches.items()
    }


def _total(model, evaluated):
    """Return the load (6,) of an Evaluated; with elastic parts the weight of nacelle and rotor is added."""
    total = evaluated.cache[LoadCache.TOTAL : LoadCache.TOTAL + 6]
    if model.structure is None:
        return total
    pose = pose_of(evaluated.x)
    return total + np.subtract(
        gravity_load(pose, model.rigid_body), gravity_load(pose, model.structure.lower)
    )


def _position(x):
    """Return the surge, heave and platform pitch of a state as a text."""
    return (
        f"surge {x[State.SURGE]:.4g} m, heave {x[State.HEAVE]:.4g} m, platform pitch"
        f" {degrees(x[State.PLATFORM_PITCH]):.3g} deg"
    )


def _sentences(causes):
    """Return the causes as one text of sentences."""
    return " ".join(f"{text[0].upper()}{text[1:]}." for text in causes.values())


def _shown(value):
    """Format a number with three significant digits, or as an integer from 100 to 1e9."""
    return f"{value:.0f}" if 100.0 <= abs(value) < 1e9 else f"{value:.3g}"


def _kilo(value):
    """Format a number of N or N m in kN or kN m."""
    return _shown(value / 1e3)
