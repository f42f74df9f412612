"""Checks whether a platform file is plausible: statics at rest, natural periods, inconsistencies."""

from math import cos, degrees, hypot, pi, sin, sqrt, tan
from typing import NamedTuple

import numpy as np

from fowt_env.analysis.campbell import BLADES, campbell
from fowt_env.analysis.equilibrium import MOTION_LABELS, causes_of, evaluated, metacentre
from fowt_env.analysis.statics import Evaluation, Statics, named_periods, rotation_of, statics
from fowt_env.analysis.tower_frequencies import TowerFrequency, tower_frequencies
from fowt_env.analysis.trim import DIFFERENCE_STEPS, trim
from fowt_env.errors import InputError, muted
from fowt_env.plant.model import LoadCache
from fowt_env.plant.state import State, pose_of
from fowt_env.scene.build import build_scene
from fowt_env.scene.geometry import geometry_faults

DRIFT, TILT = 0.05, 5.0  # of the water depth; deg: limits of a plausible equilibrium without wind
SETTLED_HEAVE = 0.05  # of the draft: tolerance of the balance of weight and buoyancy
ROUNDS, SETTLED = 40, 1e-6  # of the iteration for the added mass at a mode's natural frequency
FULL_SIZE = 90.0  # m, hub height for which BANDS hold; a scale model has shorter periods
BANDS = {  # s, natural periods of floating turbines from tension legs and barges to spars, with wide margins
    "surge": (15.0, 600.0),
    "sway": (15.0, 600.0),
    "heave": (0.5, 100.0),
    "roll": (0.5, 120.0),
    "platform pitch": (0.5, 120.0),
    "yaw": (1.0, 600.0),
}


class RotorFrequency(NamedTuple):
    """Holds the undamped natural frequencies of one mode of blades or shaft on a fixed base, Hz."""

    standstill: float
    rated: float  # at the rated rotor speed, in still air, blade pitch zero


class Check(NamedTuple):
    """Holds statics, equilibrium, natural periods and faults of a platform in still water without wind."""

    label: str
    draft: float  # m
    statics: Statics  # of the undisplaced platform
    rest: dict[str, float] | None  # equilibrium {motion: m or deg}; None if there is no equilibrium
    periods: dict[str, float] | None  # {motion: s}, undamped; inf: no restoring
    tower: dict[str, TowerFrequency]  # of the bending modes in the file; empty without an equilibrium
    faults: tuple[str, ...]  # sentences on inconsistencies
    rotor: dict[str, RotorFrequency]  # of blades and shaft, as far as the turbine's file describes them


def check_platform(platform, **options):
    """Return the Check of a platform: a built-in name, a path or a Platform; options: of the scene.

    Blades and shaft are rigid but for their own frequencies, as their bending hardly moves the platform.
    Raises: InputError for a file that cannot be read.
    """
    with muted():  # faults are listed in the Check instead
        scene = build_scene(platform, **options | {"blades": "rigid", "shaft": "rigid"})
    undisplaced = statics(scene)
    faults = geometry_faults(scene.platform)
    faults |= _static_faults(scene, undisplaced)
    rest, periods, tower = None, None, {}
    try:
        with muted():
            point = trim(scene)
    except InputError as error:
        faults["rest"] = str(error).rstrip(".")
    else:
        values = point.state[:6].tolist()
        rest = dict(zip(MOTION_LABELS, [*values[:3], *map(degrees, values[3:])], strict=True))
        if abs(rest["heave"]) <= SETTLED_HEAVE * scene.platform.draft:
            faults.pop("vertical", None)  # a large waterplane compensates the difference
        periods, tower = natural_modes(scene, point)
        faults |= _rest_faults(scene, rest) | _period_faults(periods, scene.turbine.rotor.hub_height)
    return Check(
        scene.label, scene.platform.draft, undisplaced, rest, periods, tower,
        tuple(f"{text[0].upper()}{text[1:]}." for text in faults.values()), rotor_frequencies(scene),
    )  # fmt: skip


def rotor_frequencies(scene):
    """Return {mode: RotorFrequency} of bending blades and a twisting shaft, with all modes of the files."""
    turbine, modes = scene.turbine, scene.platform.tower.modes
    parts = {
        "blades": "rigid" if turbine.blade_structure is None else "modes2",
        "shaft": "rigid" if turbine.shaft_torsion is None else "torsion",
    }
    if set(parts.values()) == {"rigid"} or turbine.rotor.blades != BLADES:
        return {}
    tower = "rigid" if modes is None else ("modes", "modes2")[len(modes.fore_aft) - 1]
    found = campbell(scene.platform, turbine, [0.0, turbine.rated_rotor_speed], tower=tower, **parts)
    modes = {mode: RotorFrequency(*map(float, values)) for mode, values in found.frequency.items()}
    return {mode: values for mode, values in modes.items() if not mode.endswith("tower")}


def _static_faults(scene, undisplaced):
    """Return {name: sentence} of weight, buoyancy, lines and stability of the undisplaced platform."""
    evaluation = Evaluation(scene)
    rest = np.zeros(scene.n_state)
    evaluation.at(rest, LoadCache.TOTAL)
    faults = causes_of(scene, evaluated(rest, evaluation.data))
    tethered = undisplaced.pull > 0.15 * undisplaced.buoyancy  # tension-leg platform: stable by its lines
    if not min(undisplaced.metacentric_height) > 0.0 and undisplaced.buoyancy > 0.0 and not tethered:
        faults["upright"] = metacentre(scene, undisplaced)
    return faults


def _rest_faults(scene, rest):
    """Return {name: sentence} of an equilibrium far from the undisplaced position."""
    faults, depth, draft = {}, scene.platform.environment.water_depth, scene.platform.draft
    drift = hypot(rest["surge"], rest["sway"])
    if drift > DRIFT * depth:
        faults["drift"] = f"without wind the equilibrium is {drift:.4g} m off, in water of {depth:g} m"
    if abs(rest["heave"]) > 0.1 * draft:
        faults["heave"] = (
            f"without wind the equilibrium is at {rest['heave']:+.4g} m in heave, at a draft of {draft:.4g} m"
        )
    tilt = max(abs(rest["roll"]), abs(rest["platform pitch"]))
    if tilt > TILT:
        faults["tilt"] = (
            f"without wind the equilibrium is tilted by {tilt:.3g} deg (roll {rest['roll']:.3g}, platform"
            f" pitch {rest['platform pitch']:.3g} deg)"
        )
    return faults


def _period_faults(periods, hub_height):
    """Return {name: sentence} of natural periods outside the BANDS of floating turbines of this size."""
    faults, scale = {}, sqrt(hub_height / FULL_SIZE)  # Froude scale of times
    for motion, period in periods.items():
        low, high = BANDS[motion][0] * min(scale, 1.0), BANDS[motion][1] * max(scale, 1.0)
        if not np.isfinite(period):
            faults[motion] = f"there is no restoring in {motion}"
        elif not low <= period <= high:
            faults[motion] = (
                f"the natural period in {motion} is {period:.3g} s, outside {low:.3g} to {high:.3g} s"
            )
    return faults


def natural_modes(scene, point):
    """Return ({motion: undamped natural period s}, {mode: TowerFrequency}) about an operating point.

    Periods follow from stiffness and mass, for a potential-flow body with the added mass at each mode's
    natural frequency. Modes are named by their largest motion about the centre of mass, angles weighted with
    half the draft; inf: no restoring.
    """
    evaluation = Evaluation(scene)
    x = point.state.copy()
    evaluation.u[:] = point.command
    slopes = np.zeros((6, 6))
    for motion in range(6):
        step = DIFFERENCE_STEPS[motion]
        for side in (1.0, -1.0):
            x[motion] = point.state[motion] + side * step
            slopes[:, motion] += side * evaluation.at(x, LoadCache.TOTAL) / (2.0 * step)
        x[motion] = point.state[motion]
    evaluation.at(x, LoadCache.TOTAL)
    mass = scene.model.rigid_body.mass_matrix + evaluation.data.added_mass
    moved = _kinematics(x)
    potential, arm = scene.platform.potential_flow, 0.5 * scene.platform.draft
    same = {"moved": moved, "slopes": slopes, "height": mass[0, 4] / mass[0, 0], "arm": arm}
    periods = _periods(mass, **same)
    if potential is not None:
        for motion, period in periods.items():
            periods[motion] = _at_own_frequency(motion, period, mass, potential, same)
    return periods, tower_frequencies(scene, mass, slopes, moved)


def _kinematics(x):
    """Return (6, 6) rates of the motions by the velocities in body components, at a state."""
    roll, pitch, rates = x[State.ROLL], x[State.PLATFORM_PITCH], np.zeros((6, 6))
    rates[:3, :3] = rotation_of(pose_of(np.ascontiguousarray(x)))
    rates[3:, 3:] = [
        [1.0, sin(roll) * tan(pitch), cos(roll) * tan(pitch)],
        [0.0, cos(roll), -sin(roll)],
        [0.0, sin(roll) / cos(pitch), cos(roll) / cos(pitch)],
    ]
    return rates


def _periods(mass, moved, slopes, height, arm):
    """Return {motion: period s} of the six modes of a mass matrix and the load slopes over the motions."""
    values, vectors = np.linalg.eig(moved @ np.linalg.solve(mass, slopes))
    shapes = vectors.copy()
    shapes[0] += height * vectors[4]  # at the water line a pitch mode moves more in surge than in pitch
    shapes[1] -= height * vectors[3]
    shapes = np.abs(shapes) * np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None]
    shapes /= shapes.sum(axis=0)
    return named_periods(values, shapes, MOTION_LABELS)


def _at_own_frequency(motion, period, mass, potential, same):
    """Return the natural period, s, of a motion with the added mass at the natural frequency."""
    for _ in range(ROUNDS):
        if not np.isfinite(period):
            return period
        change = _added_mass(potential, 2.0 * pi / period) - potential.added_mass_infinite
        new = _periods(mass + 0.5 * (change + change.T), **same)[motion]
        if not np.isfinite(new) or abs(new - period) < SETTLED * period:
            return new
        period = new
    return period


def _added_mass(potential, omega):
    """Return the (6, 6) added mass of a PotentialFlow at a frequency, rad/s, interpolated linearly."""
    tabulated, values = potential.omega, potential.added_mass
    if potential.added_mass_zero is not None:
        tabulated = np.concatenate([[0.0], tabulated])
        values = np.concatenate([potential.added_mass_zero[None], values])
    rows = values.reshape(len(tabulated), 36).T
    return np.array([np.interp(omega, tabulated, row) for row in rows]).reshape(6, 6)
