"""Computes the performance limit of linear control: fronts of rotor-speed and platform-pitch deviation.

    fowt design bound --wind 12,14,16,18,20,22,24
    fowt design bound --wind 18 --fidelity elastic --lidar four_beam_pulsed

Per wind speed, on the linear plant of bound_plant.py: the minimum weighted sum of both variances at no more
blade-pitch travel and power deviation than those of gspi_oc3 on the same model, and a torque deviation
within the drivetrain's range. The limits are met by multipliers in the quadratic cost, so that each point is
optimal among all linear controllers with the same information, for weather of the fitted spectra; deviations
are computed with the exact spectra. The model has no saturation of torque, pitch or rates and no sampling.
"""

from dataclasses import replace
from itertools import pairwise, product
from math import ceil
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.controllers.lqr.design import SENSORS
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.errors import InputError, unknown
from fowt_env.training.design.bound_control import Information, Problem, baseline_deviations, front
from fowt_env.training.design.bound_lidar import lidar_of
from fowt_env.training.design.bound_plant import BoundPlant

BOUND = Path(__file__).parent / "data" / "linear_bound.csv"  # output of fowt design bound
FRACTIONS = (0.05, 0.2, 0.4, 0.55, 0.68, 0.8, 0.88, 0.94, 0.98)  # weights of platform pitch
TORQUE_STD = 0.05  # fraction of rated torque: half the margin to maximum torque
PREVIEWS = (3.0, 11.0)  # s
KNOWN = {  # information of the feedback: name: (text, sensors)
    "full": ("plant, wind and waves", None),
    "measured": ("five sensors", SENSORS),
    "speed": ("rotor speed and blade pitch", SENSORS[:2]),
}
FITTED = ("wind", "elevation", "surge_force", "heave_force", "pitch_moment")
PITCH_ONLY = "_pitch_only"
LIDAR = "measured_lidar"
PLOTTED = ("full", "measured", "speed", "measured_pitch_only", "full_preview_3", "full_preview_11")
RATIOS = {  # column of ratio_table: metric
    "speed_ratio_[-]": "RotSpeed_std_[rpm]",
    "pitch_ratio_[-]": "PtfmPitch_std_[deg]",
    "power_ratio_[-]": "GenPwr_std_[kW]",
    "travel_ratio_[-]": "blade_pitch_travel_[deg/s]",
}


def information_sets(previews=PREVIEWS):
    """Return {name: Information} of KNOWN, each without and with wind preview, with and without torque."""
    sets = {}
    for torque, time in product((True, False), (None, *previews)):
        suffix, ahead = ("", "") if time is None else (f"_preview_{time:g}", f", wind {time:g} s ahead")
        suffix, ahead = (suffix, ahead) if torque else (suffix + PITCH_ONLY, f"{ahead}; no torque")
        for name, (text, sensors) in KNOWN.items():
            sets[name + suffix] = Information(text + ahead, sensors, time, torque)
    for suffix, torque in (("", True), (PITCH_ONLY, False)):
        text = "five sensors and a lidar" + ("" if torque else "; no torque")
        sets[LIDAR + suffix] = Information(text, SENSORS, torque=torque, lidar=True)
    return sets


def usual(previews=PREVIEWS, lidar=False):
    """Return {name: text} of the default information_sets of a table.

    With exact preview of the wind, limits with sensors and with all states differ by less than 1 %: only
    those with all states are included.
    """
    sets = information_sets(previews).items()
    kept = ((name, known) for name, known in sets if lidar or not known.lidar)
    return {name: known.text for name, known in kept if known.preview is None or known.sensors is None}


INFORMATION = usual()  # name: label in plots


def winds_of(turbine):
    """Return the default winds of the limit, m/s: even values above rated up to cut-out."""
    first = 2 * ceil(0.5 * (turbine.rated_wind_speed + 0.1))
    return tuple(float(wind) for wind in range(first, int(turbine.cut_out_wind_speed) + 1, 2))


def bound_table(
    scene, winds=None, information=None, *, travel=1.0, power=1.0, torque_std=TORQUE_STD,
    torque_travel=float("inf"), previews=PREVIEWS, noise=None, sea=None, fractions=FRACTIONS, lidar=None,
    distance=None, progress=None,
):  # fmt: skip
    """Return a DataFrame of the Pareto front per wind and information, absolute and relative to gspi_oc3.

    winds        m/s; None: winds_of the scene's turbine
    information  names of information_sets(previews); None: those of usual(previews, lidar)
    travel       limit of blade-pitch travel over that of gspi_oc3; power: the same for the power deviation
    torque_std   limit of the torque deviation, fraction of rated torque; inf: no limit, as for the others
    torque_travel  limit of the mean absolute torque rate, rated torques per second; inf: no limit
    previews     preview times of the wind, s
    noise        {sensor: standard deviation of a sample every 0.1 s, SI}; None: noise_of() the standard chain
    sea          sea state of every wind; None: the joint sea states of the named suites
    fractions    weights of platform pitch in the minimised sum
    lidar        name, path or Lidar that the information with a lidar reads, at its distance (m), None: the
                 farthest

    fit_difference_[%]: largest difference of a deviation (rotor speed, platform pitch, travel) between fitted
    and exact spectra. attrs["fits"]: DataFrame of the errors of the fits, and the drag; attrs["omitted"]:
    texts of the points that did not converge.
    Raises: InputError for winds that are not above rated, limits that are not positive, unknown information,
    information with a lidar without one, and for a scene that BoundPlant does not support.
    """
    known = information_sets(previews)
    chosen = tuple(usual(previews, lidar is not None) if information is None else information)
    for name in chosen:
        if name not in known:
            raise unknown("information", name, known)
        if known[name].lidar and lidar is None:
            raise InputError(f"information = {name!r}: needs a lidar")
    allowed = "positive (inf: no limit)"
    limits = {"travel": travel, "power": power, "torque_std": torque_std, "torque_travel": torque_travel}
    for key, value in limits.items():
        check_number(key, value, 0.0, low_open=True, infinite=True, allowed=allowed)
    low, high = scene.turbine.rated_wind_speed, scene.turbine.cut_out_wind_speed
    winds = winds_of(scene.turbine) if winds is None else winds
    allowed = f"above {low:g} and at most {high:g} m/s"
    for wind in winds:
        check_number("wind", wind, low, high, low_open=True, allowed=allowed)
    rows, fits, omitted, total = [], [], [], len(winds) * len(chosen)
    for number, wind in enumerate(winds):
        plant = BoundPlant(scene, wind, sea)
        base, fitted = (baseline_deviations(plant, weather) for weather in (plant.true, plant.fitted))
        errors = (plant.wind_filter.error, plant.wave_filter.error, *plant.force_errors)
        fits.append({"wind_[m/s]": plant.wind_speed})
        fits[-1] |= {f"{of}_error_[%]": 100.0 * float(x) for of, x in zip(FITTED, errors, strict=True)}
        fits[-1]["surge_drag_[kN-s/m]"] = 1e-3 * float(plant.drag.damping[0, 0])
        fits[-1]["pitch_drag_[MN-m-s/rad]"] = 1e-6 * float(plant.drag.damping[4, 4])
        rows.append(_row(wind, "gspi_oc3", float("nan"), base, base, fitted))
        limits = replace(
            base, travel=travel * base.travel, power=power * base.power, torque=torque_std,
            torque_travel=torque_travel,
        )  # fmt: skip
        reader = None if lidar is None else lidar_of(plant, scene, lidar, distance)
        for index, name in enumerate(chosen, 1):
            problem = Problem(plant, known[name], noise, reader)
            points = front(problem, limits, fractions)
            for fraction, reached, q in points:
                rows.append(_row(wind, name, fraction, reached, base, problem.deviations(q, plant.fitted)))
            for fraction in sorted({float(x) for x in fractions} - {point[0] for point in points}):
                omitted.append(f"{name} at {wind:g} m/s, share {fraction:g}")
            if progress is not None:
                progress(number * len(chosen) + index, total)
    table = pd.DataFrame(rows)
    table.attrs["fits"], table.attrs["omitted"] = pd.DataFrame(fits), omitted
    return table


def _row(wind, information, fraction, best, base, fitted):
    """Return one row of bound_table as a dict."""
    names = ("rotor_speed", "platform_pitch", "travel")
    difference = max(abs(getattr(fitted, name) / getattr(best, name) - 1.0) for name in names)
    return {
        "wind_[m/s]": float(wind), "information": information, "share_[-]": fraction,
        "RotSpeed_std_[rpm]": best.rotor_speed / RPM, "PtfmPitch_std_[deg]": best.platform_pitch / DEGREE,
        "blade_pitch_travel_[deg/s]": best.travel / DEGREE, "power_std_[%]": 100.0 * best.power,
        "torque_std_[%]": 100.0 * best.torque, "torque_travel_[%/s]": 100.0 * best.torque_travel,
        "speed_ratio_[-]": best.rotor_speed / base.rotor_speed,
        "pitch_ratio_[-]": best.platform_pitch / base.platform_pitch,
        "fit_difference_[%]": 100.0 * difference,
    }  # fmt: skip


def rounded(table):
    """Return a bound_table rounded to five significant digits, as stored."""
    numbers = table.columns.drop("information")
    short = table.copy()
    short[numbers] = table[numbers].map(lambda value: float(f"{value:.5g}"))
    return short


def fraction_of_bound(table, wind, speed_ratio, pitch_ratio, information="full"):
    """Return the position of a controller between gspi_oc3 (0) and the Pareto front (1) on a straight line.

    speed_ratio, pitch_ratio: deviations over those of gspi_oc3. 1: on the Pareto front; 0: no better than
    gspi_oc3; NaN if the line does not meet the front (or the controller improves neither).
    """
    here = table[(table["wind_[m/s]"] == float(wind)) & (table["information"] == information)]
    line = efficient(here[["speed_ratio_[-]", "pitch_ratio_[-]"]])
    way = 1.0 - np.array([speed_ratio, pitch_ratio])
    if not len(line) or not np.any(way > 0.0):
        return float("nan")
    # the front continues straight up and to the right from its ends
    line = np.vstack([[line[0, 0], 10.0], line, [10.0, line[-1, 1]]])
    for start, end in pairwise(1.0 - line):
        try:
            along, along_front = np.linalg.solve(np.column_stack([way, start - end]), start)
        except np.linalg.LinAlgError:
            continue
        if along > 0.0 and 0.0 <= along_front <= 1.0:
            return float(1.0 / along)
    return float("nan")


def ratio_table(runs, bound=None):
    """Return a DataFrame of the means over seeds of a sweep (sweeps.sweep), relative to those of gspi_oc3.

    Columns: wind, variant, ratios of speed, platform pitch, power and travel; with a bound_table also the
    fractions of the limit with all states and with measured channels. Cases are named kind_WIND.
    Raises: InputError for a table without the columns, without gspi_oc3, or with other cases.
    """
    needed = ("case", "variant", "seed", *RATIOS.values())
    missing = [name for name in needed if name not in runs]
    if missing:
        raise InputError(f"runs: column {missing[0]!r} is missing; fowt design lqr-sweep --out writes it")
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
            ratios = row["speed_ratio_[-]"], row["pitch_ratio_[-]"]
            row["of_bound_[-]"] = fraction_of_bound(bound, wind, *ratios)
            row["of_measured_[-]"] = fraction_of_bound(bound, wind, *ratios, "measured")
        rows.append(row)
    return pd.DataFrame(rows)


def efficient(points):
    """Return the non-dominated rows of (n, 2) points (smaller is better), sorted by the first column."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    points = points[np.lexsort((points[:, 1], points[:, 0]))]
    lowest = np.minimum.accumulate(points[:, 1])
    return points[points[:, 1] < np.r_[np.inf, lowest[:-1]]]
