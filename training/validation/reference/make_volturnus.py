"""Writes the compact reference series of iea15_volturnus_s/: make_volturnus.py SERIES_FOLDER [LINEAR_FOLDER].

SERIES_FOLDER has the OpenFAST outputs of the rigid IEA 15 MW on VolturnUS-S (make_openfast.py, VOLTURNUS),
LINEAR_FOLDER the linearisation files (lin_NN.A.lin: operating point NN, azimuth A) of NREL/ROSCO fc11f43,
Examples/Test_Cases/IEA-15-240-RWT/IEA-15-240-RWT-UMaineSemi/linearizations.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.descriptions.units import RPM

sys.path.insert(0, str(Path(__file__).resolve().parent))
from make import series, six_digits, sources, write
from make_openfast import STEADY as HELD

HERE = Path(__file__).resolve().parent / "iea15_volturnus_s"
PLANE = ["surge_m", "heave_m", "pitch_deg"]
LATERAL = ["sway_m", "roll_deg", "yaw_deg"]
ROTOR = ["rotor_speed_rpm", "blade_pitch_deg", "gen_torque_kNm", "gen_power_elec_kW", "aero_thrust_N"]
MODEL = (
    "OpenFAST v5.0.0 (2895884d2b), double precision, IEA 15 MW on VolturnUS-S, rigid: six platform motions,"
    " and the generator where the rotor turns; potential flow with convolution, quadratic drag matrix,"
    " quasi-static lines; loose coupling, ConvTol 1e-6, dt 0.025 s"
)
BENDING = MODEL.replace(
    ", rigid: six platform motions,", ", six platform motions, first fore-aft and side-to-side tower modes,"
).replace("dt 0.025 s", "dt 0.0125 s")
TOWER = ["twr_base_My_kNm", "tower_top_fa_m", "nacelle_acc_x_mps2"]
STILL = "still water, no wind, rotor at rest, blade pitch 0; all other states start at zero"
ROSCO = "ROSCO 2.10.6 every 0.025 s, blade pitch follows its command at once; platform starts at zero"
_CONTROLLED = [*PLANE, *ROTOR]
_TURBULENCE = (
    "wind_hub_18mps blown uniformly, components of waves_hs7.5_tp10; rotor 7.56 rpm, blade pitch 15.4 deg;"
    f" {ROSCO}"
)
_QTF = (
    "components of waves_hs7.5_tp10, with the difference-frequency forces of the full QTF; no wind, rotor at"
    " rest"
)
CASES = {  # case -> (columns, step, model, settings)
    "static": (PLANE, 0.2, MODEL, f"from rest at the undisplaced position; {STILL}"),
    "decay_surge": (PLANE, 0.2, MODEL, f"free decay from surge 10 m; {STILL}"),
    "decay_heave": (PLANE, 0.1, MODEL, f"free decay from heave 3 m; {STILL}"),
    "decay_pitch": (PLANE, 0.1, MODEL, f"free decay from platform pitch 5 deg; {STILL}"),
    "decay_yaw": (["yaw_deg"], 0.2, MODEL, f"free decay from yaw 8 deg; {STILL}"),
    "regwave_H4T9": (
        PLANE, 0.1, MODEL, "regular wave H 4 m T 9 s, crest at t = 0, no ramp; no wind, rotor at rest",
    ),
    "waves_Hs7.5": (
        ["wave_elev_m", *PLANE], 0.2, MODEL,
        "components of waves_hs7.5_tp10, first order; no wind, rotor at rest",
    ),
    "waves_Hs7.5_qtf": (["wave_elev_m", *PLANE], 0.2, MODEL, _QTF),
    "float_steady_12mps": (
        _CONTROLLED, 0.1, MODEL,
        f"uniform steady 12 m/s, still water; rotor 7.56 rpm, blade pitch 6.3 deg; {ROSCO}",
    ),
    "float_steady_18mps": (
        _CONTROLLED, 0.1, MODEL,
        f"uniform steady 18 m/s, still water; rotor 7.56 rpm, blade pitch 15.4 deg; {ROSCO}",
    ),
    "turb_18mps_Hs7.5_uniform": ([*_CONTROLLED, *LATERAL], 0.1, MODEL, _TURBULENCE),
    "decay_pitch_tower": (
        [*PLANE, *TOWER], 0.1, BENDING, f"free decay from platform pitch 5 deg; {STILL}",
    ),
    "turb_18mps_Hs7.5_uniform_tower": (
        [*_CONTROLLED, *TOWER, "twr_base_Mx_kNm", "tower_top_ss_m"], 0.1, BENDING, _TURBULENCE,
    ),
}  # fmt: skip
STEADY = {  # case -> (wind, rotor speed, blade pitches, shear exponent)
    **{f"{wind}mps": (float(wind), rpm, (pitch,) * 3, 0.0) for wind, (rpm, pitch) in HELD.items()},
    "12mps_shear": (12.0, 7.56, (6.3,) * 3, 0.14),
    "12mps_pitches": (12.0, 7.56, (8.3, 5.3, 6.3), 0.0),
}  # fmt: skip
SETTLED = 15.0  # s, start-up omitted from a steady case
TURNING = (("aero_Fy_N", "aero_Fz_N"), ("aero_My_Nm", "aero_Mz_Nm"))
ROOTS = ("root1_Mx_kNm", "root1_My_kNm", "root2_My_kNm", "root3_My_kNm")


def rounded(values, digits=5):
    """Return a series rounded to `digits` significant digits of its largest value."""
    largest = np.abs(values).max()
    if largest < 1e-7:
        return 0.0 * values
    return values.round(max(0, digits - int(np.ceil(np.log10(largest)))))


def wave_forces(source):
    """Write wave forces every 2 s: first order, and difference frequencies of the full QTF."""
    path = source / "waves_Hs7.5_qtf.csv.gz"
    columns = ["time_s", "wave_elev_m", "excitation_Fx_N", "excitation_Fz_N", "excitation_My_Nm",
               "second_order_Fx_N", "second_order_My_Nm"]  # fmt: skip
    full = pd.read_csv(path, usecols=columns)[columns]
    every = round(2.0 / (full["time_s"][1] - full["time_s"][0]))
    settings = (
        f"{_QTF}; HydroDyn's forces at the undisplaced place (B1WvsF1, B1WvsF2), differences of frequency up"
        " to 0.737863 rad/s"
    )
    write(HERE / "wave_forces.csv.gz", (MODEL, settings, *sources(path)), full.iloc[::every])


def held(source, case):
    """Return (arrays of a steady case, azimuth of blade 1, row of settings), whole revolutions only."""
    wind, rpm, pitches, shear = STEADY[case]
    frame = pd.read_csv(source / f"steady_{case}_fixed.csv.gz")
    time, period = frame["time_s"].to_numpy(), 60.0 / rpm
    end = SETTLED + np.floor((time[-1] - SETTLED) / period + 1e-9) * period
    kept = (time >= SETTLED - 1e-9) & (time < end - 0.5 * (time[1] - time[0]))
    row = {"case": case, "wind_mps": wind, "shear_exponent": shear, "rotor_speed_rpm": rpm}
    row |= {f"blade_pitch{k}_deg": value for k, value in enumerate(pitches, 1)}
    columns = {name: frame[name].to_numpy()[kept] for name in frame}
    return columns, rpm * RPM * time[kept], row  # blade 1 up at t = 0


def write_steady(name, settings, source, cases, rows):
    """Write the reduced rows of steady cases."""
    paths = [source / f"steady_{case}_fixed.csv.gz" for case in cases]
    write(HERE / f"{name}.csv.gz", (MODEL, settings, *sources(*paths)), six_digits(rows))


def steady(source):
    """Write mean rotor loads in steady wind on a fixed platform: whole revolutions, non-rotating axes."""
    rows = []
    for case in STEADY:
        values, angle, row = held(source, case)
        for name in ("aero_thrust_N", "aero_torque_Nm"):
            row[name] = values[name].mean()
        for y, z in TURNING:
            a, b = values[y], values[z]
            row[y] = (a * np.cos(angle) - b * np.sin(angle)).mean()
            row[z] = (a * np.sin(angle) + b * np.cos(angle)).mean()
        for name in ROOTS:
            row[name] = values[name].mean() if name in values else np.nan
        for name in ROOTS[:2]:
            for part, wave in (("cos", np.cos(angle)), ("sin", np.sin(angle))):
                row[f"{name}_{part}"] = 2.0 * (values[name] * wave).mean() if name in values else np.nan
        rows.append(row)
    settings = (
        "platform and tower held, steady wind at 150 m, rotor speed and blade pitch held; means over whole"
        " turns after 15 s; aero loads about the rotor centre, x along the shaft, y and z not turning with"
        " the rotor (z up when blade 1 is); root moments of the structure (with weight and inertia): means,"
        " and cos and sin parts over the azimuth of blade 1 (0: up)"
    )
    write_steady("steady", settings, source, STEADY, rows)


def sheared(source):
    """Write rotor loads in sheared wind over one revolution."""
    path = source / "steady_12mps_shear_fixed.csv.gz"
    columns = ["time_s", "azimuth_deg", "aero_thrust_N", "aero_torque_Nm", "aero_My_Nm", "aero_Mz_Nm"]
    frame = pd.read_csv(path, usecols=columns)[columns]
    kept = frame[(frame["time_s"] >= 30.0) & (frame["time_s"] < 37.9)].iloc[::26]  # every 0.65 s
    settings = (
        "platform and tower held, steady 12 m/s at 150 m with a power law of 0.14, 7.56 rpm, blade pitch 6.3"
        " deg; loads about the rotor centre, x along the shaft, axes turn with the rotor"
    )
    write(HERE / "rotor_in_shear.csv.gz", (MODEL, settings, *sources(path)), kept)


BLADE_CASES = ("12mps_shear", "12mps_pitches")
BLADE_CHANNELS = {
    "RootMxc1": "root1_Mx_kNm", "RootMyc1": "root1_My_kNm", "RootMyc2": "root2_My_kNm",
    "RootMyc3": "root3_My_kNm", "YawBrMyp": "yaw_bearing_My_kNm", "YawBrMzp": "yaw_bearing_Mz_kNm",
    "TwrBsMyt": "twr_base_My_kNm", "TwrBsMxt": "twr_base_Mx_kNm",
}  # fmt: skip


def blade_loads(source):
    """Write moments of single blades, yaw bearing and tower base: means and harmonics over the azimuth."""
    rows = []
    for case in BLADE_CASES:
        columns, angle, settings = held(source, case)
        for channel, column in BLADE_CHANNELS.items():
            values = columns[column]
            row = settings | {"channel": channel, "mean_kNm": values.mean()}
            for order in (1, 3):
                row[f"cos{order}_kNm"] = 2.0 * (values * np.cos(order * angle)).mean()
                row[f"sin{order}_kNm"] = 2.0 * (values * np.sin(order * angle)).mean()
            rows.append(row)
    settings = (
        "platform and tower held, steady wind at 150 m, rotor speed and blade pitches held; ElastoDyn's"
        " moments over whole turns after 15 s: mean, cos and sin parts of the first and third harmonic over"
        " the azimuth of blade 1 (0: up)"
    )
    write_steady("blade_loads", settings, source, BLADE_CASES, rows)


if __name__ == "__main__":
    HERE.mkdir(exist_ok=True)
    folder = Path(sys.argv[1])
    series(folder, HERE, CASES, rounded)
    wave_forces(folder)
    steady(folder)
    sheared(folder)
    blade_loads(folder)
    if len(sys.argv) > 2:
        from reduce_linear import responses

        responses(Path(sys.argv[2]), HERE)
