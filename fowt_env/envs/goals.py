"""Defines the reward "score": goals in [0, 1] that rank controllers as the score of a suite does.

    goal = producing * (1 - min(deviation / usual, WORST) / WORST)

for a control period: its deviation from the operating point of the episode's mean wind, and the mean absolute
deviation under the controller gspi_oc3 in normal turbulence (`usual`). A turbine that hardly produces earns
little. A step is worth 0 to 1 and the step of a failure 0, so that ending an episode early forfeits the rest.
The mean over a run falls as the metrics of the score rise, each relative to gspi_oc3's in the same wind; the
deviation of the shaft torque is squared, as fatigue grows faster than deviations. Costs count in no reward.

The reward "score_blades", of scenes with individual pitch, has a further goal of the blade roots, with
ROOT_SHARE of the reward.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from fowt_env.descriptions.nrel5mw import GEAR_RATIO, RATED_WIND, ROTOR_SPEED, TORQUE
from fowt_env.descriptions.units import DEGREE
from fowt_env.envs.rewards import pitch_moved, unit_fraction
from fowt_env.plant.compile.decorators import kernel
from fowt_env.plant.measurement import N_MEASUREMENTS, BladeMeasure, Measure
from fowt_env.plant.state import BLADES

REWARD, ROOT_REWARD = "score", "score_blades"  # values of the setting `reward`
LEAST_POWER = 0.5  # of the operating power, below which goals are worth less in proportion
WORST = 3.0  # usual deviations, from which on a goal is worth 0
# Weights of the ratios in the order of GOALS, chosen on the validation seeds 1001 and 1002 such that ten
# controllers have in each wind of the suite above_rated the order of their scores; relative to WORST, and its
# square for the shaft.
SLOPES = np.array([0.229, 0.378, 0.330, 0.063])
LARGEST = np.array([WORST, WORST, WORST, WORST**2])
WEIGHTS = SLOPES * LARGEST / (SLOPES @ LARGEST)
# Usual deviations: means of 12 validation seeds (1001 to 1012), OC3-Hywind with the NREL 5 MW turbine, suite
# above_rated.
WINDS = np.array([12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0]) - RATED_WIND  # m/s above rated
USUAL = {
    "rotor_speed": np.array([0.052, 0.061, 0.060, 0.059, 0.058, 0.058, 0.058]),  # of rated
    "platform_pitch": np.array([0.80, 0.78, 0.66, 0.59, 0.54, 0.51, 0.50]) * DEGREE,  # rad
    "pitch_travel": np.array([0.157, 0.153, 0.114, 0.095, 0.084, 0.078, 0.075]) * DEGREE,  # rad/s
    "shaft": np.array([0.120, 0.041, 0.018, 0.016, 0.018, 0.020, 0.022]),  # root mean square, of rated torque
}
GOALS = {
    "rotor_speed": "rotor speed close to that of the operating point",
    "platform_pitch": "platform pitch close to that of the operating point",
    "pitch_travel": "little travel of the blade pitch; with individual pitch the mean over the blades",
    "shaft": "torque of the low-speed shaft close to that of the operating point",
}
ROOT_GOAL = {"blade_root": "equal out-of-plane bending moments at the blade roots"}
ROOT_SHARE = 0.4
# Usual root mean square over the blades of the deviation of these moments from their mean under pi, N m:
# means of the validation seeds 1001 and 1002, OC3-Hywind, fidelity elastic, winds WINDS in joint seas.
USUAL_ROOT = np.array([723.0, 820.0, 920.0, 1018.0, 1113.0, 1214.0, 1318.0]) * 1e3
COSTS = {
    "overspeed": "rotor speed above {SPEED_LIMIT:g} of rated",
    "tilt": "platform pitch more than {TILT_LIMIT:g} deg from that of the operating point",
    "acceleration": "acceleration of the tower top above {TOP_LIMIT:g} m/s2",
}
SPEED_LIMIT, TILT_LIMIT, TOP_LIMIT = 1.15, 5.0, 2.0
N_GOALS, N_COSTS = len(GOALS), len(COSTS)
COST = N_GOALS + N_COSTS  # entry of the sum of the costs
N_ENTRIES = COST + 1
ROOT = N_ENTRIES  # entry of the goal of the blade roots
KEYS = (*(f"reward/{name}" for name in GOALS), *(f"cost/{name}" for name in COSTS), "cost")
KEYS_WITH_ROOT = (*KEYS, *(f"reward/{name}" for name in ROOT_GOAL))
GOAL_KEYS = {REWARD: KEYS, ROOT_REWARD: KEYS_WITH_ROOT}  # of the infos
OPERATING_TORQUE, OPERATING_POWER, FIRST_USUAL = 3, 4, 5  # entries of a Reference


class Goals(NamedTuple):
    """Holds the turbine values of the goals."""

    gear_ratio: float
    inertia: float  # of the generator, at the low-speed shaft, kg m2
    control_dt: float  # s
    fastest: float  # rad/s, limits of the costs
    tilt: float  # rad
    acceleration: float  # m/s2


def build_goals(turbine, control_dt):
    """Return the Goals of a descriptions.turbine.Turbine at a control period (s)."""
    shaft = turbine.drivetrain
    return Goals(
        gear_ratio=float(shaft.gear_ratio),
        inertia=float(shaft.generator_inertia * shaft.gear_ratio**2),
        control_dt=float(control_dt),
        fastest=float(SPEED_LIMIT * turbine.rated_rotor_speed),
        tilt=float(TILT_LIMIT * DEGREE),
        acceleration=float(TOP_LIMIT),
    )


def usual_deviations(turbine, wind_speed):
    """Return the usual deviations, SI, of GOALS and ROOT_GOAL at a mean wind (m/s); constant outside WINDS.

    Those of another turbine have the same ratio to rated speed and torque, and equal travel in a revolution.
    """
    above = wind_speed - turbine.rated_wind_speed
    speed = turbine.rated_rotor_speed
    torque = turbine.torque_law.rated_torque * turbine.drivetrain.gear_ratio
    scales = (speed, 1.0, speed / ROTOR_SPEED, torque, torque / (GEAR_RATIO * TORQUE))
    return [
        scale * float(np.interp(above, WINDS, usual))
        for scale, usual in zip(scales, (*USUAL.values(), USUAL_ROOT), strict=True)
    ]


def goal_weights(reward=REWARD):
    """Return the weights of REWARD (KEYS) or ROOT_REWARD (KEYS_WITH_ROOT); costs have none."""
    weights = np.concatenate([WEIGHTS, np.zeros(N_COSTS + 1)])
    return np.append((1.0 - ROOT_SHARE) * weights, ROOT_SHARE) if reward == ROOT_REWARD else weights


@kernel
def root_deviation(m):
    """Return the root mean square over the blades of the deviation of the out-of-plane moments, N m."""
    first = N_MEASUREMENTS + BladeMeasure.ROOT_OUT_OF_PLANE_1
    mean, total = 0.0, 0.0
    for blade in range(BLADES):
        mean += m[first + blade] / BLADES
    for blade in range(BLADES):
        total += (m[first + blade] - mean) ** 2
    return sqrt(total / BLADES)


@kernel
def goal(deviation, usual, largest):
    """Return 1 without deviation, falling linearly to 0 at `largest` usual deviations; NaN gives 0."""
    return 1.0 - unit_fraction(deviation / (usual * largest))


@kernel
def fill_goals(m, previous, reference, failed, goals, entries):
    """Fill entries, in the order of KEYS or KEYS_WITH_ROOT, from m and previous, one control period apart."""
    speed, torque = m[Measure.ROTOR_SPEED], m[Measure.GENERATOR_TORQUE]
    change = (speed - previous[Measure.ROTOR_SPEED]) / goals.control_dt
    shaft = goals.gear_ratio * (torque - reference[OPERATING_TORQUE]) + goals.inertia * change
    tilt = abs(m[Measure.PLATFORM_PITCH] - reference[0])
    ratio = shaft / reference[FIRST_USUAL + 3]
    entries[0] = goal(abs(speed - reference[1]), reference[FIRST_USUAL], WORST)
    entries[1] = goal(tilt, reference[FIRST_USUAL + 1], WORST)
    entries[2] = goal(pitch_moved(previous, m) / goals.control_dt, reference[FIRST_USUAL + 2], WORST)
    entries[3] = goal(ratio * ratio, 1.0, WORST * WORST)
    producing = 1.0
    if reference[OPERATING_POWER] > 0.0:
        power = speed * torque * goals.gear_ratio
        producing = max(0.0, min(1.0, power / (LEAST_POWER * reference[OPERATING_POWER])))
    if failed:
        producing = 0.0
    for i in range(N_GOALS):
        entries[i] = producing * entries[i]
    if entries.shape[0] > ROOT:
        entries[ROOT] = producing * goal(root_deviation(m), reference[FIRST_USUAL + N_GOALS], WORST)
    entries[N_GOALS] = 1.0 if speed > goals.fastest else 0.0
    entries[N_GOALS + 1] = 1.0 if tilt > goals.tilt else 0.0
    entries[N_GOALS + 2] = 1.0 if abs(m[Measure.NACELLE_ACCELERATION]) > goals.acceleration else 0.0
    entries[COST] = entries[N_GOALS] + entries[N_GOALS + 1] + entries[N_GOALS + 2]
