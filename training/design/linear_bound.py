"""The performance limit of linear control: Pareto fronts of rotor-speed and platform-pitch deviation.

    python -m fowt_env.training.design.linear_bound      (or fowt design bound --wind 12,14,16,18,20,22,24)

Per wind speed, on the plant of controllers/lqr/design.py (surge, platform pitch, rotor, pitch actuator; the
rotor-averaged Kaimal wind and the site's sea as shaped white noise): standard deviations from Lyapunov
equations, for the least weighted sum of both variances at no more blade-pitch travel and no more power
deviation than gspi_oc3 has on the same model, and a torque deviation that the drivetrain can give (the
torque's own maximum is 10 % above rated). The limits are met by multipliers in the quadratic cost, so
with full information, and with the measured channels and their noise, each point is optimal among all
linear controllers. Feedback without wind or waves among its inputs is optimal where those are white noise.
The linear model has no limits of torque, pitch or their rates, and nothing is sampled.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

from fowt_env.controllers.lqr.design import (
    MOMENT,
    N_FEEDBACK,
    N_PLANT,
    PLANT,
    SENSOR_NOISE,
    design_model,
    feedback_plant,
)
from fowt_env.controllers.pi import PISettings, schedule_gain
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.errors import InputError

BOUND = Path(__file__).parent / "data" / "linear_bound.csv"  # what fowt design bound wrote
WINDS = (12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0)  # m/s
INFORMATION = {  # what the feedback knows: what it is called in plots
    "full": "state, wind and waves: the performance limit",
    "wind": "state and wind",
    "state": "state only",
    "measured": "measured channels (Kalman)",
}
# of platform pitch
FRACTIONS = (0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.68, 0.75, 0.82, 0.88, 0.93, 0.97, 0.99)
TORQUE_STD = 0.05  # of rated torque: twice this is the way to the torque's maximum
RATIOS = {  # column of ratio_table: metric
    "speed_ratio_[-]": "RotSpeed_std_[rpm]",
    "pitch_ratio_[-]": "PtfmPitch_std_[deg]",
    "power_ratio_[-]": "GenPwr_std_[kW]",
    "travel_ratio_[-]": "blade_pitch_travel_[deg/s]",
}
TORQUE_RATE = 1e-3  # cost of (torque rate / 5 % of rated a second)^2: keeps the problem well posed
COMMAND_RATE = 1e-4  # cost of (rate of the pitch command / 0.2 deg/s)^2: the same
SAMPLE_TIME = 0.1  # s, at which SENSOR_NOISE holds per sample
TOLERANCE = 2e-3  # of the limits, relative
ROUNDS = 80
STEP = 2.0  # of the multipliers' logarithms per relative excess
LOWEST, HIGHEST = np.log(1e-6), np.log(1e6)  # of a multiplier
GAUSSIAN_MEAN = sqrt(2.0 / pi)  # mean |x| of a Gaussian over its standard deviation
LIMITED = ("travel", "power", "torque")  # fields of Deviations
SPEED, LEAN, BLADE = (PLANT.index(name) for name in ("rotor_speed", "platform_pitch", "blade_pitch"))
TORQUE, COMMAND, INTEGRAL, WIND, WAVE = N_PLANT, N_PLANT + 1, N_PLANT + 2, N_PLANT + 3, N_PLANT + 5


@dataclass(frozen=True)
class Deviations:
    """Standard deviations of a closed loop: rad/s, rad, mean |rad/s|, fractions of rated power and torque."""

    rotor_speed: float
    platform_pitch: float
    travel: float
    power: float
    torque: float


class Problem:
    """The plant of one wind with its weather, in the states of lqr/design.py's feedback_plant."""

    def __init__(self, model, turbine):
        rated = turbine.rated_rotor_speed
        self.model, self.turbine = model, turbine
        self.a, self.b, self.g = feedback_plant(model, rated)
        rate, power = self.a[BLADE].copy(), np.zeros(N_FEEDBACK)
        power[SPEED], power[TORQUE] = 1.0 / rated, 1.0
        eye = np.eye(N_FEEDBACK)
        self.rows = {  # output rows, each in units of which one is of order one
            "rotor_speed": eye[SPEED] / (0.05 * rated),
            "platform_pitch": eye[LEAN] / DEGREE,
            "travel": rate / (0.2 * DEGREE),
            "power": power / 0.05,
            "torque": eye[TORQUE] / 0.05,
        }
        self.scales = {"rotor_speed": 0.05 * rated, "platform_pitch": DEGREE}
        self.scales |= {"travel": GAUSSIAN_MEAN * (0.2 * DEGREE), "power": 0.05, "torque": 0.05}

    def deviations(self, covariance):
        """Deviations for a covariance (13, 13) of the states."""
        found = {
            name: self.scales[name] * sqrt(max(row @ covariance @ row, 0.0))
            for name, row in self.rows.items()
        }
        return Deviations(**found)

    def cost(self, fraction, *multipliers):
        """(Q, R) with a fraction of platform pitch and multipliers on travel, power and torque."""
        weights = {"rotor_speed": 1.0 - fraction, "platform_pitch": fraction}
        weights |= dict(zip(LIMITED, multipliers, strict=True))
        q = sum(weight * np.outer(self.rows[name], self.rows[name]) for name, weight in weights.items())
        # the integral is not scored; a trace of it makes its mode stable
        q[INTEGRAL, INTEGRAL] += 1e-4 / (0.5 * self.turbine.rated_rotor_speed) ** 2
        return q, np.diag([TORQUE_RATE / 0.05**2, COMMAND_RATE / (0.2 * DEGREE) ** 2])

    @cached_property
    def kalman(self):
        """(A, C, L, R) of the estimator of plant and weather from the channels of lqr/design.py's SENSORS.

        The torque and the pitch command are known to the controller, and so is the integral.
        """
        a, c = self.model.A[:MOMENT, :MOMENT], self.model.C[:, :MOMENT]
        g, r = self.model.G[:MOMENT], np.diag(np.square(SENSOR_NOISE)) * SAMPLE_TIME
        p = solve_continuous_are(a.T, c.T, g @ g.T, r)
        return a, c, p @ c.T @ np.linalg.inv(r), r

    def closed(self, information, q, r):
        """Covariance (13, 13) under the feedback that is best for (q, r) with this information."""
        known = {"full": N_FEEDBACK, "wind": WAVE, "state": WIND, "measured": N_FEEDBACK}[information]
        # what is not known is white noise to the feedback: it acts on the plant but is not fed back
        a, b = self.a[:known, :known], self.b[:known]
        k = np.zeros((2, N_FEEDBACK))
        k[:, :known] = np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q[:known, :known], r))
        noise = self.g @ self.g.T
        if information != "measured":
            return solve_continuous_lyapunov(self.a - self.b @ k, -noise)
        return self._estimated(k, noise)

    def _estimated(self, k, noise):
        """Covariance of the states under gain k on the Kalman filter's estimates."""
        n, m = N_FEEDBACK, MOMENT
        ae, ce, gain, r = self.kalman
        places = [*range(N_PLANT), *range(WIND, N_FEEDBACK)]  # of the estimated states among all
        both, drive = np.zeros((n + m, n + m)), np.zeros((n + m, n + m))
        both[:n, :n] = self.a - self.b @ k
        both[:n, n:] = self.b @ k[:, places]  # the error (state less estimate) acts against the feedback
        both[n:, n:] = ae - gain @ ce
        g = np.vstack([self.g, self.g[places]])
        drive[:, :] = g @ g.T
        drive[n:, n:] += gain @ r @ gain.T
        return solve_continuous_lyapunov(both, -drive)[:n, :n]


def gspi_covariance(problem, settings=None):
    """(Deviations, closed-loop matrix) of gspi_oc3, linear, on the states and weather of a Problem.

    The law in continuous time, with the slope of its schedule (theory.md, Eq. (A7)) and its speed filter.
    """
    settings = PISettings.published(problem.turbine) if settings is None else settings
    model, ratio = problem.model, settings.gear_ratio
    gain = schedule_gain(model.pitch, settings.gain_schedule_pitch)
    gain *= ratio / (2.0 - gain)
    # the places of torque and command now hold the filtered speed; the command follows at once
    a = problem.a.copy()
    a[:, [TORQUE, COMMAND]] = 0.0
    command = np.zeros(N_FEEDBACK)
    command[TORQUE], command[INTEGRAL] = gain * settings.KP, gain * settings.KI
    a += np.outer(problem.a[:, COMMAND], command)
    a[TORQUE] = 0.0
    a[TORQUE, [SPEED, TORQUE]] = settings.speed_filter_corner, -settings.speed_filter_corner
    a[INTEGRAL] = 0.0
    a[INTEGRAL, TORQUE] = 1.0
    keep = [i for i in range(N_FEEDBACK) if i != COMMAND]
    x = solve_continuous_lyapunov(a[np.ix_(keep, keep)], -(problem.g @ problem.g.T)[np.ix_(keep, keep)])
    rate = a[BLADE, keep]
    rated = problem.turbine.rated_rotor_speed
    speed = sqrt(x[SPEED, SPEED])
    found = Deviations(
        speed, sqrt(x[LEAN, LEAN]), GAUSSIAN_MEAN * sqrt(rate @ x @ rate), speed / rated, 0.0
    )  # constant torque: power goes with speed
    return found, a[np.ix_(keep, keep)]


def front(problem, limits, information, fractions=FRACTIONS):
    """[(fraction, Deviations)] that are best for each fraction of platform pitch, limits (Deviations) kept.

    Each multiplier grows while its limit is exceeded and shrinks while it is kept. Fractions at which ROUNDS
    rounds of that end outside the limits are left out.
    Raises: InputError where that is all of them.
    """
    found, multipliers = [], np.log([1.0, 0.3, 0.1])
    wanted = np.array([getattr(limits, name) for name in LIMITED])
    for fraction in fractions:
        for _ in range(ROUNDS):
            reached = problem.deviations(
                problem.closed(information, *problem.cost(fraction, *np.exp(multipliers)))
            )
            excess = np.log(np.array([getattr(reached, name) for name in LIMITED]) / wanted)
            slack = (excess < 0.0) & (multipliers <= LOWEST)
            if np.all((np.abs(excess) < TOLERANCE) | slack):
                break
            multipliers = np.clip(multipliers + STEP * excess, LOWEST, HIGHEST)
        if excess.max() < 2.0 * TOLERANCE:
            found.append((float(fraction), reached))
    if not found:
        raise InputError(f"information {information!r}: no gains meet the limits of gspi_oc3")
    return found


def bound_table(scene, winds=WINDS, information=tuple(INFORMATION), torque_std=TORQUE_STD, progress=None):
    """DataFrame: per wind and information the Pareto front, beside gspi_oc3; absolute and over gspi_oc3's.

    torque_std: limit, as a fraction of rated torque; inf for none.
    Raises: InputError for winds that are not above rated, or a torque_std that is not positive.
    """
    allowed = "positive (inf: no limit)"
    check_number("torque_std", torque_std, 0.0, low_open=True, infinite=True, allowed=allowed)
    rows = []
    low, high = scene.turbine.rated_wind_speed, scene.turbine.cut_out_wind_speed
    allowed = f"above {low:g} and at most {high:g} m/s"
    for number, wind in enumerate(winds, 1):
        check_number("wind", wind, low, high, low_open=True, allowed=allowed)
        problem = Problem(design_model(scene, wind), scene.turbine)
        base, _ = gspi_covariance(problem)
        rows.append(_row(wind, "gspi_oc3", float("nan"), base, base))
        limits = replace(base, torque=torque_std)
        for name in information:
            rows += [_row(wind, name, fraction, d, base) for fraction, d in front(problem, limits, name)]
        if progress is not None:
            progress(number, len(winds))
    return pd.DataFrame(rows)


def _row(wind, information, fraction, found, base):
    """One row of bound_table."""
    return {
        "wind_[m/s]": float(wind),
        "information": information,
        "share_[-]": fraction,
        "RotSpeed_std_[rpm]": found.rotor_speed / RPM,
        "PtfmPitch_std_[deg]": found.platform_pitch / DEGREE,
        "blade_pitch_travel_[deg/s]": found.travel / DEGREE,
        "power_std_[%]": 100.0 * found.power,
        "torque_std_[%]": 100.0 * found.torque,
        "speed_ratio_[-]": found.rotor_speed / base.rotor_speed,
        "pitch_ratio_[-]": found.platform_pitch / base.platform_pitch,
    }


def fraction_of_bound(table, wind, speed_ratio, pitch_ratio, information="full"):
    """Share of what the Pareto front allows that a controller reaches, on the line from gspi_oc3 through it.

    speed_ratio, pitch_ratio: its deviations over those of gspi_oc3. 1: on the Pareto front; 0: no better than
    gspi_oc3; NaN where the line meets no front (or the controller betters neither).
    """
    here = table[(table["wind_[m/s]"] == float(wind)) & (table["information"] == information)]
    line = efficient(here[["speed_ratio_[-]", "pitch_ratio_[-]"]])
    way = 1.0 - np.array([speed_ratio, pitch_ratio])
    if not len(line) or not np.any(way > 0.0):
        return float("nan")
    # the front goes on straight up and to the right from its ends
    line = np.vstack([[line[0, 0], 10.0], line, [10.0, line[-1, 1]]])
    for start, end in pairwise(1.0 - line):
        try:
            along, place = np.linalg.solve(np.column_stack([way, start - end]), start)
        except np.linalg.LinAlgError:
            continue
        if along > 0.0 and 0.0 <= place <= 1.0:
            return float(1.0 / along)
    return float("nan")


def ratio_table(runs, bound=None):
    """DataFrame of a sweep's means over seeds (sweeps.sweep) over those of its gspi_oc3.

    Columns: wind, variant, ratios of speed, platform pitch, power and travel; with a bound_table also the
    fractions of the limit, and of that for measured channels. Cases are named kind_WIND.
    Raises: InputError for a table without the columns, without gspi_oc3, or with other cases.
    """
    needed = ("case", "variant", "seed", *RATIOS.values())
    missing = [name for name in needed if name not in runs]
    if missing:
        raise InputError(f"runs: column {missing[0]!r} is missing; make the table with fowt design lqr --out")
    means = runs.groupby(["case", "variant"], sort=False)[list(RATIOS.values())].mean()
    rows = []
    for (case, variant), mean in means.iterrows():
        if variant == "gspi_oc3":
            continue
        try:
            wind, base = float(case.rpartition("_")[2]), means.loc[(case, "gspi_oc3")]
        except (ValueError, KeyError):
            raise InputError(f"runs: case {case!r} has no wind speed in its name or no gspi_oc3") from None
        row = {"wind_[m/s]": wind, "variant": variant}
        row |= {name: float(mean[column] / base[column]) for name, column in RATIOS.items()}
        if bound is not None:
            for information, name in (("full", "of_bound_[-]"), ("measured", "of_measured_[-]")):
                row[name] = fraction_of_bound(
                    bound, wind, row["speed_ratio_[-]"], row["pitch_ratio_[-]"], information
                )
        rows.append(row)
    return pd.DataFrame(rows)


def efficient(points):
    """The rows of (n, 2) points that no other betters in both columns, by rising first column."""
    points = np.asarray(points, dtype=float)
    best, kept = np.inf, []
    for x, y in points[np.lexsort((points[:, 1], points[:, 0]))]:
        if y < best:
            kept.append((x, y))
            best = y
    return np.array(kept).reshape(-1, 2)
