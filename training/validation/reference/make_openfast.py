"""Runs OpenFAST on the public decks and writes the series: make_openfast.py DECKS OPENFAST RUNS [CASE ...].

DECKS     folder with iea15_volturnus_s, nrel5mw_oc4_semi, nrel5mw_turbine (sources: openfast_decks.py)
OPENFAST  the executable: v5.0.0, Release, -O2, double precision, without OpenMP
RUNS      folder of the full outputs, one subfolder per case; existing outputs are reused
CASE      names of CASES, or volturnus/NAME of VOLTURNUS; default: all of CASES but the mended ones

Series are written next to this file, with settings and SHA-256 of every source file. "mended" cases need an
executable with the correction named in their headers. Outputs of VOLTURNUS are written to RUNS, for
make_volturnus.py; runs with a controller load the ROSCO library from the path ROSCO_LIB.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parent))
from make import six_digits, sources, write
from openfast_decks import OPENFAST, Oc4, Volturnus

HERE = Path(__file__).resolve().parent
COLUMNS = {  # channel of OpenFAST: column of a series
    "Time": "time_s", "Wave1Elev": "wave_elev_m", "PtfmSurge": "surge_m", "PtfmSway": "sway_m",
    "PtfmHeave": "heave_m", "PtfmRoll": "roll_deg", "PtfmPitch": "pitch_deg", "PtfmYaw": "yaw_deg",
    "RotSpeed": "rotor_speed_rpm", "Azimuth": "azimuth_deg", "BldPitch1": "blade_pitch_deg",
    "GenTq": "gen_torque_kNm",
    "GenPwr": "gen_power_elec_kW", "RtFldFxh": "aero_thrust_N", "RtFldMxh": "aero_torque_Nm",
    "RtFldFyh": "aero_Fy_N", "RtFldFzh": "aero_Fz_N", "RtFldMyh": "aero_My_Nm", "RtFldMzh": "aero_Mz_Nm",
    "NcIMUTAxs": "nacelle_acc_x_mps2", "TTDspFA": "tower_top_fa_m", "TTDspSS": "tower_top_ss_m",
    "TwrBsMyt": "twr_base_My_kNm", "TwrBsMxt": "twr_base_Mx_kNm", "YawBrMyp": "yaw_bearing_My_kNm",
    "YawBrMzp": "yaw_bearing_Mz_kNm", "RootMxc1": "root1_Mx_kNm", "RootMyc1": "root1_My_kNm",
    "RootMyc2": "root2_My_kNm", "RootMyc3": "root3_My_kNm", "B1WvsF1xi": "excitation_Fx_N",
    "B1WvsF1zi": "excitation_Fz_N", "B1WvsM1yi": "excitation_My_Nm", "B1WvsF2xi": "second_order_Fx_N",
    "B1WvsM2yi": "second_order_My_Nm",
}  # fmt: skip
PLANE = ("surge_m", "heave_m", "pitch_deg")
INPUTS = {"components": "waves_hs7.5_tp10.csv.gz", "hub_wind": "wind_hub_18mps.csv.gz"}
MODEL = f"{OPENFAST}, double precision, loose coupling, ConvTol 1e-6, dt 0.025 s"
OC4 = (
    "; old-NWTC/FAST 0badc8d with the turbine of NREL/ROSCO fc11f43, written by openfast_decks.py: NREL 5 MW"
    " on the OC4 semi-submersible, rigid, rotor at rest, no wind; potential flow with convolution over 60 s,"
    " drag of the deck's members (2 to 6 m strips, undisplaced position, no stretching), water in them,"
    " AddCLin less what that water restores in v5, excitation of the package for the .3 that the deck lacks;"
    " SeaState grid 60 m x 40 m x 24 m; six members above the water left out"
)
IEA15 = (
    "; IEAWindSystems/IEA-15-240-RWT ac5248a, written by openfast_decks.py: IEA 15 MW, rigid, platform and"
    " rotor speed held, BEM with skewed wake, quasi-steady polars"
)
STILL = "still water; all other states start at zero"
LINES = "MAP++ lines"
GUST = "uniform wind from 17 to 19 m/s between 20 and 21 s, 7.56 rpm, blade pitch 15.4 deg"
MENDED = (
    "AD_UpdateStates of AeroDyn.f90 mended: wind for DBEMT at BEMT_utimes(i) from m%Inflow(1), where v5.0.0"
    " has that of t + dt at both ends of a step"
)
TAU = "DBEMT_Mod 2 (time constants from the means over the disk)"


STEP = [(0.0, 17.0), (20.0, 17.0), (21.0, 19.0), (400.0, 19.0)]  # (time, wind)


CASES = {  # case: (deck, arguments of its writer, columns, words)
    **{
        f"decay_{name}": (Oc4, case, PLANE, f"free decay from {start}; {LINES}; {STILL}")
        for name, start, case in (
            ("surge", "surge 8 m", dict(t=250, PtfmSurge=8)),
            ("heave", "heave 3 m", dict(t=100, PtfmHeave=3)),
            ("pitch", "platform pitch 6 deg", dict(t=150, PtfmPitch=6)),
        )
    },
    "waves_Hs7.5": (
        Oc4, dict(t=400, waves=True), ("wave_elev_m", *PLANE),
        f"components of waves_hs7.5_tp10, first order; {LINES}",
    ),
    "waves_Hs7.5_qtf": (
        Oc4, dict(t=400, waves=True, qtf=12), ("wave_elev_m", *PLANE),
        f"components of waves_hs7.5_tp10, with the difference-frequency forces of the full QTF; {LINES}",
    ),
    "waves_Hs7.5_moordyn": (
        Oc4, dict(t=400, waves=True, moordyn=True), PLANE,
        "components of waves_hs7.5_tp10, first order; MoorDyn lines, 20 segments, with drag and added mass",
    ),
    "wake_pitch_step": (
        Volturnus, dict(t=120, fixed=True, wind=10.0, rpm=7.05, pitch=0.0, pitch_to=3.0, dbemt=2),
        ("blade_pitch_deg", "aero_thrust_N", "aero_torque_Nm"),
        f"steady 10 m/s, 7.05 rpm, all blades from 0 to 3 deg at 2 deg/s from 20 s; {TAU}",
    ),
    "wake_pitch_step_18mps": (
        Volturnus, dict(t=120, fixed=True, wind=18.0, rpm=7.56, pitch=15.4, pitch_to=13.4, dbemt=2),
        ("blade_pitch_deg", "aero_thrust_N", "aero_torque_Nm"),
        f"steady 18 m/s, 7.56 rpm, all blades from 15.4 to 13.4 deg at 2 deg/s from 20 s; {TAU}",
    ),
    **{
        f"wake_wind_step_18mps{end}": (
            Volturnus, dict(t=120, fixed=True, wind=STEP, rpm=7.56, pitch=15.4, dbemt=2),
            ("aero_thrust_N", "aero_torque_Nm"), words,
        )
        for end, words in (("", f"{GUST}; {TAU}"), ("_mended", f"{GUST}; {TAU}; {MENDED}"))
    },
}  # fmt: skip
PLACES = {Oc4: "nrel5mw_oc4_semi", Volturnus: "iea15_volturnus_s"}
_TURBULENT = dict(t=600, wind="hub_wind", waves=True, control=True, rpm=7.56, pitch=15.4)
STEADY = {  # wind, m/s: (rotor speed rpm, blade pitch deg), held
    6: (5.0, 0.0), 10: (7.05, 0.0), 12: (7.56, 6.3), 14: (7.56, 10.0), 18: (7.56, 15.4), 24: (7.56, 21.8),
}  # fmt: skip
_STEADY = {u: dict(t=40, wind=u, fixed=True, rpm=r, pitch=p, dtout=0.5) for u, (r, p) in STEADY.items()}
VOLTURNUS = {  # full outputs that make_volturnus.py reduces
    "static": dict(t=600),
    "decay_surge": dict(t=600, PtfmSurge=10),
    "decay_heave": dict(t=200, PtfmHeave=3),
    "decay_pitch": dict(t=300, PtfmPitch=5),
    "decay_yaw": dict(t=500, PtfmYaw=8),
    "decay_pitch_tower": dict(t=300, PtfmPitch=5, tower=1, dt=0.0125, dtout=0.05),
    "regwave_H4T9": dict(t=500, sea=(4.0, 9.0)),
    "waves_Hs7.5": dict(t=600, waves=True),
    "waves_Hs7.5_qtf": dict(t=600, waves=True, qtf=12),
    "float_steady_12mps": dict(t=600, wind=12, control=True, rpm=7.56, pitch=6.3),
    "float_steady_18mps": dict(t=600, wind=18, control=True, rpm=7.56, pitch=15.4),
    "turb_18mps_Hs7.5_uniform": _TURBULENT,
    "turb_18mps_Hs7.5_uniform_tower": _TURBULENT | dict(tower=1, dt=0.0125, dtout=0.05),
    **{f"steady_{u}mps_fixed": case for u, case in _STEADY.items()},
    "steady_12mps_shear_fixed": _STEADY[12] | dict(shear=0.14, dtout=0.025),
    "steady_12mps_pitches_fixed": _STEADY[12] | dict(pitches=(8.3, 5.3, 6.3), dtout=0.025),
}


def run(deck, case, folder, program):
    """Run a case in a new folder (or reuse its output) and return a DataFrame. Raises: RuntimeError."""
    if not (folder / "model.out").exists():
        files = INPUTS | ({"hub_wind": case["wind_file"]} if "wind_file" in case else {})
        deck.write(
            folder, case, rosco=os.environ.get("ROSCO_LIB", "libdiscon.so"),
            baseline=os.environ.get("DISCON_OC3_LIB", "DISCON_OC3Hywind.so"),
            **{name: pd.read_csv(HERE / file, comment="#") for name, file in files.items()},
        )  # fmt: skip
        environment = {"OPENBLAS_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"}
        done = subprocess.run(
            [program, "model.fst"], cwd=folder, capture_output=True, text=True, env=environment
        )
        (folder / "log").write_text(done.stdout + done.stderr)
        if done.returncode:
            (folder / "model.out").unlink(missing_ok=True)
            raise RuntimeError(f"{folder}: OpenFAST failed: {(done.stdout + done.stderr)[-2000:]}")
    lines = (folder / "model.out").read_text().split("\n")
    head = next(number for number, line in enumerate(lines) if line.startswith("Time"))
    names = [name.strip() for name in lines[head].split("\t")]
    return pd.DataFrame(np.loadtxt(lines[head + 2 :], ndmin=2), columns=names)


if __name__ == "__main__":
    decks, program, runs = sys.argv[1], str(Path(sys.argv[2]).resolve()), Path(sys.argv[3]).resolve()
    for name in sys.argv[4:] or [case for case in CASES if not case.endswith("mended")]:
        if name in CASES:
            kind, case, columns, words = CASES[name]
            deck, place = kind(decks), PLACES[kind]
            full = run(deck, case, runs / place / name, program).rename(columns=COLUMNS)
            waves = [HERE / INPUTS["components"]] if case.get("waves") else []
            (HERE / place).mkdir(exist_ok=True)
            head = MODEL + (OC4 if kind is Oc4 else IEA15), words, *sources(*deck.inputs(case), *waves)
            write(HERE / place / f"{name}.csv.gz", head, six_digits(full[["time_s", *columns]]))
        else:
            case = name.removeprefix("volturnus/")
            full = run(Volturnus(decks), VOLTURNUS[case], runs / "volturnus" / case, program)
            frame = full[[name for name in full if name in COLUMNS]].rename(columns=COLUMNS)
            write(runs / f"{case}.csv.gz", (), six_digits(frame))  # input of make_volturnus.py
        print(name, flush=True)
