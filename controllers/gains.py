"""Computes gains of the scheduled PI law by the published formula, for turbines without published gains.

The formula is Jonkman's (NREL/TP-500-38060, section 7.4), (A6) of theory.md, with the slope dP/d theta of the
aerodynamic power over blade pitch at rated speed and frozen induction along the steady curve, and theta_K of
the schedule from a straight line through the slopes. On a floater the frequency of the rotor loop is DETUNED
times the platform's pitch frequency (NREL/TP-500-47535; Larsen and Hanson, 2007), limited to the frequency
on land: LAND times the rated rotor speed over that of the NREL 5 MW turbine.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from fowt_env.analysis.linear_model import STRUCTURAL, VELOCITIES, differentiated, settled
from fowt_env.analysis.linear_plant import bending_names
from fowt_env.analysis.statics import central_difference, mean_derivative
from fowt_env.analysis.trim import AZIMUTHS, trim, water_key, without_fluctuations
from fowt_env.analysis.trim_cache import plant_key
from fowt_env.caches import Cache
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.turbine import PitchGains
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError, unknown
from fowt_env.plant.aero.blade_elements import airload, blade_section, build_blade_elements, element_of
from fowt_env.plant.compile.decorators import entry
from fowt_env.plant.state import MOTIONS, State

DAMPING = 0.7  # of the rotor loop, floating and on land
DETUNED = 0.915  # w0 over the platform's pitch frequency: 0.2 over 0.2185 rad/s of OC3-Hywind
LAND = 0.6  # rad/s, of the NREL 5 MW turbine on land
FLOATING = 0.2  # rad/s, of OC3-Hywind: scaled by rated rotor speed for an unknown platform
REFERENCE_SPEED = 1.267109  # rad/s, rated rotor speed of that turbine
POSITIVE = ("design_frequency", "damping", "inertia", "rated_speed", "gear_ratio")  # arguments of gains
SETS = ("floating", "land")
OTHER_NAMES = {"oc3": "floating"}  # aliases of sets: name of the floating set in the NREL 5 MW file
AIR = 1.225  # kg/m3, default without a scene
STEEPEST_PITCH = 45.0 * DEGREE
PITCH_STEP = 0.1 * DEGREE  # of finite differences
SPEEDS = 14  # number of wind speeds of the steady curve, from rated torque to cut-out
POSITION_STEPS = (1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5)  # m, rad


class PowerSlope(NamedTuple):
    """Holds dP/d theta (W/rad) at rated speed along the steady curve: at_zero (1 + theta/doubling)."""

    at_zero: float
    doubling: float  # rad, blade pitch at which the slope has doubled
    blade_pitch: np.ndarray  # (n,) rad, points of the fitted line
    slope: np.ndarray  # (n,) W/rad
    wind: np.ndarray  # (n,) m/s


def gains(design_frequency, damping, inertia, rated_speed, gear_ratio, dP_dpitch):
    """Return (KP s, KI) of a rotor-speed loop with a frequency (rad/s) and damping ratio at zero pitch.

    inertia: I_D about the low-speed shaft, kg m2; rated_speed: w_b0 of the rotor, rad/s; dP_dpitch:
    slope of the aerodynamic power at rated speed, W/rad, negative. theory.md, section 4.
    Raises: InputError unless all arguments are finite, dP_dpitch < 0 and the others > 0.
    """
    values = (design_frequency, damping, inertia, rated_speed, gear_ratio)
    for key, value in zip(POSITIVE, values, strict=True):
        check_number(key, value, 0.0, low_open=True, allowed="positive and finite")
    check_number("dP_dpitch", dP_dpitch, high=0.0, high_open=True, allowed="negative and finite, W/rad")
    scale = inertia * rated_speed / (gear_ratio * -dP_dpitch)
    return 2.0 * damping * design_frequency * scale, design_frequency**2 * scale


_SLOPES = Cache(16)  # (id of the turbine, density) -> (turbine, PowerSlope)


def power_slope(turbine, density=AIR):
    """Return the PowerSlope of a turbine's rotor in uniform steady wind, from its blade elements.

    Raises: InputError if the rotor cannot reach rated torque below cut-out, or if its power does not
    decrease with blade pitch.
    """
    key = id(turbine), float(density)
    return _SLOPES.get(key, lambda: (turbine, _power_slope(turbine, density)))[1]


@entry
def _rotor_torque(wind, rotor_speed, blade_pitch, step, rotor, result):
    """Fill result (2,): torque (N m) of a rotor in uniform wind and its slope over pitch, frozen wake."""
    result[0] = result[1] = 0.0
    for j in range(rotor.radius.shape[0]):
        tangential = rotor_speed * rotor.radius[j]
        here = blade_section(wind, tangential, blade_pitch, j, 1.0, rotor)
        arm = rotor.blades * rotor.moment_weight[j]
        result[0] += arm * here.ft
        for side in range(2):
            sign = 1.0 - 2.0 * side
            element = element_of(j, blade_pitch + sign * step, rotor)
            _, ct, square = airload(
                wind + here.induced_normal, tangential + here.induced_tangential, element, rotor.polars
            )
            result[1] += arm * sign * element.half_density_chord * square * ct / (2.0 * step)


def _power_slope(turbine, density):
    elements = build_blade_elements(turbine, density)
    rated, fastest = turbine.rated_rotor_speed, turbine.cut_out_wind_speed
    target = turbine.torque_law.rated_torque * turbine.drivetrain.gear_ratio
    finest, result = turbine.pitch_drive.minimum, np.zeros(2)

    def surplus(pitch, wind):
        _rotor_torque(float(wind), rated, float(pitch), PITCH_STEP, elements, result)
        return result[0] - target

    where, slowest = f"turbine {turbine.name!r}", turbine.cut_in_wind_speed
    if not surplus(finest, slowest) < 0.0 < surplus(finest, fastest):
        raise InputError(f"{where}: its rotor does not reach rated torque at rated speed below cut-out")
    reached = brentq(lambda wind: surplus(finest, wind), slowest, fastest)
    pitches, slopes, winds = [], [], np.linspace(reached, fastest, SPEEDS)
    for wind in winds:
        if surplus(STEEPEST_PITCH, wind) > 0.0:
            raise InputError(f"{where}: its rotor exceeds rated torque at {wind:.3g} m/s at any blade pitch")
        # at the first wind the finest pitch is the solution, except for rounding
        low = surplus(finest, wind)
        pitch = finest if low <= 0.0 else brentq(lambda b, w=wind: surplus(b, w), finest, STEEPEST_PITCH)
        surplus(pitch, wind)
        pitches.append(pitch)
        slopes.append(rated * result[1])
    growth, at_zero = np.polyfit(pitches, slopes, 1)
    if not (at_zero < 0.0 and growth < 0.0):
        raise InputError(f"{where}: its power does not fall increasingly fast with blade pitch")
    return PowerSlope(float(at_zero), float(at_zero / growth), np.array(pitches), np.array(slopes), winds)


def land_frequency(turbine):
    """Return w0 (rad/s) of the land set of a turbine without published gains."""
    return LAND * turbine.rated_rotor_speed / REFERENCE_SPEED


def derived_gains(turbine, frequency, damping=DAMPING, density=AIR):
    """Return the PitchGains of a rotor loop with a frequency (rad/s) and damping ratio, by the formula."""
    slope, drive = power_slope(turbine, density), turbine.drivetrain
    inertia = turbine.rotor.inertia + drive.gear_ratio**2 * drive.generator_inertia
    rated = turbine.rated_rotor_speed
    kp, ki = gains(frequency, damping, inertia, rated, drive.gear_ratio, slope.at_zero)
    return PitchGains(KP=kp, KI=ki, gain_schedule_pitch=slope.doubling)


def published_set(turbine, gain_set):
    """Return the PitchGains in a turbine's file by name; None if the file has none.

    gain_set: a name in the file, or one of SETS or OTHER_NAMES ("floating" and "oc3" are the same set).
    Raises: InputError for any other name.
    """
    if gain_set in turbine.gains:
        return turbine.gains[gain_set]
    meaning = OTHER_NAMES.get(gain_set, gain_set)
    if meaning not in SETS:
        raise unknown("gain set", gain_set, sorted({*turbine.gains, *SETS, *OTHER_NAMES}))
    names = (meaning, *(name for name, other in OTHER_NAMES.items() if other == meaning))
    return next((turbine.gains[name] for name in names if name in turbine.gains), None)


def gains_of_turbine(turbine, gain_set="oc3"):
    """Return the PitchGains of a set: published, else derived from the rotor for an unknown platform.

    A floating set without published gains uses the frequency FLOATING scaled by rated rotor speed; with_gains
    derives the gains for a platform.
    """
    published = published_set(turbine, gain_set)
    if published is not None:
        return published
    speed = turbine.rated_rotor_speed / REFERENCE_SPEED
    return derived_gains(turbine, (LAND if gain_set == "land" else FLOATING) * speed)


_MODES = Cache(64)  # (plant, water) -> eigenvalues, fractions of motions


def platform_frequency(scene, motion=State.PLATFORM_PITCH):
    """Return the undamped natural frequency (rad/s) of a platform motion about a scene's trim in rated wind.

    motion: State.SURGE ... State.YAW; the mode is the one with the largest contribution of this motion.
    The stiffness follows from the accelerations after small displacements, with quasi-static deflection of a
    flexible tower, of blades and of the shaft; other states (wake, radiation memory) are held constant.
    Results are cached per plant.
    Raises: InputError as trim, and for a motion without restoring force.
    """
    values, fractions = _MODES.get((plant_key(scene), water_key(scene)), lambda: _modes(scene))
    square = -float(values[np.argmax(fractions[motion])].real)
    if not square > 0.0:
        what = "pitch" if motion == State.PLATFORM_PITCH else State(motion).name.lower()
        raise InputError(
            f"platform {scene.platform.name!r}: no restoring force in {what}: cannot derive gains"
        )
    return square**0.5


def _modes(scene):
    """Return eigenvalues (6,) of acceleration over position and fractions (6, 6) of motions in modes."""
    if scene.model.aero is not None:
        speed = float(scene.turbine.rated_wind_speed)
        scene = replace(without_fluctuations(scene, speed), wind=speed, sea=None, wind_speed=speed)
    point = trim(scene)
    tables = _slopes if scene.model.structure is None else _settled_slopes
    kinematics, stiffness = tables(scene, point)
    values, vectors = np.linalg.eig(kinematics @ stiffness)
    arm = 0.5 * scene.platform.draft
    size = np.abs(vectors) * np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None]
    return values, size / size.sum(axis=0)


def _settled_slopes(scene, point):
    """Return _slopes of a turbine with bending blades or a twisting shaft."""
    model = differentiated(scene, point, bending_names(scene))
    model = settled(model, [name for name in model.states if name.removesuffix("_rate") in STRUCTURAL])
    positions, speeds = (list(map(model.index, names)) for names in (MOTIONS, VELOCITIES))
    return model.A[np.ix_(positions, speeds)], model.A[np.ix_(speeds, positions)]


def _slopes(scene, point):
    """Return (6, 6) derivatives of the rates of the motions by velocities, of accelerations by motions."""
    x, u = point.state.copy(), point.command.copy()
    body = scene.model.rigid_body._replace(platform_fixed=False, rotor_fixed=False)
    handle = without_fluctuations(scene, point.wind_speed).with_model(rigid_body=body).handle()
    dx, mean = np.zeros_like(x), np.zeros_like(x)

    def mean_rates():
        mean_derivative(handle, x, u, AZIMUTHS, dx, mean)
        return mean.copy()

    def rates(entry, step):
        return central_difference(mean_rates, x, entry, step)

    tower = {block.name: range(block.offset, block.offset + block.size) for block in scene.blocks}
    bent, bending = (tower.get(name, ()) for name in ("tower_deflection", "tower_velocity"))
    moved = [*zip(range(6), POSITION_STEPS, strict=True), *((i, POSITION_STEPS[0]) for i in bent)]
    speeds = [*range(State.VX, State.VX + 6), *bending]
    stiffness = np.array([rates(i, step)[speeds] for i, step in moved]).T
    if bent:  # eliminate the tower deflection quasi-statically
        follows = np.linalg.solve(stiffness[6:, 6:], stiffness[6:, :6])
        stiffness = stiffness[:6, :6] - stiffness[:6, 6:] @ follows
    kinematics = np.array([rates(State.VX + i, 1e-5)[:6] for i in range(6)]).T
    return kinematics, stiffness


def floating_frequency(scene):
    """Return w0 (rad/s) of the floating gain set for the platform of a scene."""
    return min(DETUNED * platform_frequency(scene), land_frequency(scene.turbine))


_TURBINES = Cache(64)  # (id of the turbine, plant, water) -> (turbine, the one with gains)


def with_gains(scene):
    """Return the scene's turbine with gains for its platform; unchanged if its file has both sets.

    Missing SETS, "floating" or "land", are computed by the published formula.
    """
    turbine = scene.turbine
    missing = [name for name in SETS if published_set(turbine, name) is None]
    if not missing:
        return turbine

    def make():
        density = scene.platform.environment.air_density
        frequency = {"floating": floating_frequency, "land": lambda s: land_frequency(s.turbine)}
        added = {name: derived_gains(turbine, frequency[name](scene), density=density) for name in missing}
        return turbine, turbine.model_copy(update={"gains": {**turbine.gains, **added}})

    return _TURBINES.get((id(turbine), plant_key(scene), water_key(scene)), make)[1]
