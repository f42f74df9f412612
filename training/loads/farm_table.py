"""Tabulates power, thrust, tilt and surge of a floating turbine over wind and sea, for tools of wind farms.

    table = performance_table("iea15_volturnus_s", "rosco", winds, Hs=(2.0, 6.0), Tp=(8.0, 12.0))
    write_floris("farm", table)        iea15_volturnus_s.yaml and iea15_volturnus_s_Tp_Hs.csv

FLORIS (NREL) reads them as a turbine with multi_dimensional_cp_ct: the nearest Tp and Hs, linear over wind.
"""

from dataclasses import dataclass
from itertools import product
from math import pi
from pathlib import Path

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.platform import read_platform, turbine_of
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.metrics import TIME

DURATION, SKIP = (
    1200.0,
    400.0,
)  # s, of a run and of its start that is left out: some periods of platform pitch
COLUMNS = (
    "Tp_s", "Hs_m", "wind_m_s", "power_kW", "Cp", "Ct", "tilt_deg", "surge_m", "rotor_speed_rpm",
    "blade_pitch_deg",
)  # fmt: skip
STEP = 0.01  # m/s outside the operating range, where power and thrust are zero
COSINE_EXPONENT = 1.88  # of losses with yaw and tilt, the default of FLORIS's turbines


@dataclass(frozen=True)
class PerformanceTable:
    """Holds a table of COLUMNS, and what describes the turbine.

    tilt_deg: shaft tilt plus mean platform pitch, positive where the rotor faces upwards. power: electrical;
    Cp: electrical power over that of the wind through the rotor's area; Ct: of the aerodynamic thrust.
    """

    frame: pd.DataFrame
    name: str
    hub_height: float  # m
    diameter: float  # m
    shaft_tilt: float  # deg
    air_density: float
    optimal_tip_speed_ratio: float


def performance_table(
    platform, controller, winds, Hs=(0.0,), Tp=(10.0,), *, seed=1, duration=DURATION, skip=None, options=None,
    progress=None,
):  # fmt: skip
    """Return the PerformanceTable of a platform with a controller in steady wind and JONSWAP seas.

    winds: mean speeds at the hub, m/s, increasing, in the operating range; Hs (m) and Tp (s): every pair is
    run; Hs = 0 is still water, for which Tp is a label. options: of build_scene. Values are means after
    `skip` s, None: a third of the duration.
    progress: called as progress(done, total, text).
    Raises: InputError naming the argument and the allowed range.
    """
    winds, turbine = _increasing("winds", winds), turbine_of(read_platform(platform))
    for wind in winds:
        check_number("winds", float(wind), turbine.cut_in_wind_speed, turbine.cut_out_wind_speed)
    heights = [check_number("Hs", value, 0.0, 30.0) for value in Hs]
    periods = [check_number("Tp", value, 1.0, 40.0) for value in Tp]
    check_number("duration", duration, 0.0, low_open=True)
    skip = duration / 3.0 if skip is None else check_number("skip", skip, 0.0, duration, high_open=True)
    say, radius = progress or (lambda done, total, text: None), turbine.rotor.tip_radius
    rows, conditions, calm = [], list(product(periods, heights, winds)), {}
    for number, (period, height, wind) in enumerate(conditions):
        say(number, len(conditions), f"wind {wind:g} m/s, Hs {height:g} m, Tp {period:g} s")
        if height == 0.0 and wind in calm:  # no sea: any period
            rows.append((period, *calm[wind]))
            continue
        sea = {"kind": "jonswap", "Hs": height, "Tp": period} if height > 0.0 else None
        scene = fowt_env.build_scene(
            platform, wind=float(wind), sea=sea, seed=seed, duration=duration, **(options or {})
        )
        air = scene.platform.environment.air_density
        frame = fowt_env.simulate(scene, controller, duration=duration)
        mean = frame[frame[TIME] >= skip - 1e-9].mean()
        pressure = 0.5 * air * pi * radius**2 * wind**2
        tilt = tilt_of(turbine, mean["PtfmPitch_[deg]"])
        row = (
            height, wind, mean["GenPwr_[kW]"], 1e3 * mean["GenPwr_[kW]"] / (pressure * wind),
            mean["RtFldFxh_[N]"] / pressure, tilt, mean["PtfmSurge_[m]"], mean["RotSpeed_[rpm]"],
            mean["BldPitch1_[deg]"],
        )  # fmt: skip
        rows.append((period, *row))
        if height == 0.0:
            calm[wind] = row
    table = pd.DataFrame(rows, columns=COLUMNS)
    best = table.loc[table["Cp"].idxmax()]
    ratio = best["rotor_speed_rpm"] * pi / 30.0 * radius / best["wind_m_s"]
    return PerformanceTable(
        table, scene.platform.name, turbine.rotor.hub_height, 2.0 * radius,
        float(np.degrees(turbine.rotor.shaft_tilt)), air, float(ratio),
    )  # fmt: skip


def tilt_of(turbine, platform_pitch):
    """Return the tilt of the rotor, deg, positive where it faces upwards, at a platform pitch (deg)."""
    return float(np.degrees(turbine.rotor.shaft_tilt) + platform_pitch)


def _increasing(name, values):
    """Return numbers as an array. Raises: InputError unless there are two or more that increase."""
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 1 or len(values) < 2 or not (np.diff(values) > 0.0).all():
        raise InputError(f"{name} = {values.tolist()}: must be two or more increasing numbers, m/s")
    return values


def write_floris(folder, table):
    """Write NAME.yaml and NAME_Tp_Hs.csv for FLORIS, and NAME.csv of all COLUMNS; return the three paths.

    The curves are of the tilted turbine, so FLORIS is told not to correct them for tilt. Its tilt table is
    over the wind alone: that of the least Hs and Tp.
    """
    folder, frame = Path(folder), table.frame
    rows = []
    for (period, height), part in frame.groupby(["Tp_s", "Hs_m"], sort=True):
        wind = part["wind_m_s"].to_numpy()
        rows += [(period, height, 0.0, 0.0, 0.0), (period, height, wind[0] - STEP, 0.0, 0.0)]
        rows += list(part[["Tp_s", "Hs_m", "wind_m_s", "power_kW", "Ct"]].itertuples(index=False, name=None))
        rows += [(period, height, wind[-1] + STEP, 0.0, 0.0), (period, height, 50.0, 0.0, 0.0)]
    names = ["Tp", "Hs", "ws", "power", "thrust_coefficient"]
    data = write_table(pd.DataFrame(rows, columns=names), folder / f"{table.name}_Tp_Hs.csv")
    least = frame[frame["Tp_s"] == frame["Tp_s"].min()]
    least = least[least["Hs_m"] == least["Hs_m"].min()]
    lines = [
        f"turbine_type: '{table.name}'",
        f"hub_height: {table.hub_height:.10g}",
        f"rotor_diameter: {table.diameter:.10g}",
        f"TSR: {table.optimal_tip_speed_ratio:.6g}",
        "multi_dimensional_cp_ct: True",
        "power_thrust_table:",
        f"  ref_air_density: {table.air_density:.10g}",
        f"  ref_tilt: {table.shaft_tilt:.10g}",
        f"  cosine_loss_exponent_yaw: {COSINE_EXPONENT}",
        f"  cosine_loss_exponent_tilt: {COSINE_EXPONENT}",
        f"  power_thrust_data_file: '{data.name}'",
        "# shaft tilt plus mean platform pitch; power and thrust above are already those of the tilted rotor",
        "floating_tilt_table:",
        "  tilt:",
        *(f"    - {value:.8g}" for value in least["tilt_deg"]),
        "  wind_speed:",
        *(f"    - {value:.8g}" for value in least["wind_m_s"]),
        "correct_cp_ct_for_tilt: False",
    ]
    about = folder / f"{table.name}.yaml"
    with replacing(about) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return about, data, write_table(frame, folder / f"{table.name}.csv")
