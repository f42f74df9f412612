"""Writes the compact reference series of this folder from full OpenFAST outputs: make.py SOURCE_FOLDER.

Series have the compared columns every 0.1 s and a header with the settings of the run and the SHA-256 of the
full output. The wind box is cut to the region of rotor and tower, and rounded (see box()).
"""

import gzip
import hashlib
import lzma
import sys
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).resolve().parent
MOTION_COLUMNS = ["surge_m", "sway_m", "heave_m", "roll_deg", "pitch_deg", "yaw_deg"]
TENSION_COLUMNS = ["fair_tension1_kN", "fair_tension2_kN", "fair_tension3_kN"]
ROTOR = ["rotor_speed_rpm", "blade_pitch_deg", "gen_power_elec_kW", "aero_thrust_kN", "aero_torque_kNm"]
HYDRO = ["hydro_Fx_kN", "hydro_Fz_kN", "hydro_My_kNm"]
MODEL = (
    "OpenFAST v5.0.0 (2895884d2b), double precision, rigid strip-theory OC3-Hywind with the NREL 5 MW: zero"
    " tilt and cone, hub at z = 90 m, six platform motions and generator; loose coupling, ConvTol 1e-6"
)
FLEXIBLE = MODEL.replace("rigid strip-theory", "strip-theory").replace(
    "six platform motions and generator",
    "six platform motions, generator, two flap and one edge mode per blade, two tower modes each way,"
    " drivetrain torsion, nacelle yaw",
)
STILL = "still water, rotor parked, no aerodynamics; all other states start at zero"
WIND = "platform starts at zero; DISCON of OC3-Hywind; no waves"
SEA = (
    "platform starts at zero, rotor 12.1 rpm, blade pitch 14.92 deg; DISCON of OC3-Hywind; irregular sea"
    " Hs 7.5 m Tp 10 s"
)
_PARKED = [*MOTION_COLUMNS, *TENSION_COLUMNS, *HYDRO]
_FLOATING = [*MOTION_COLUMNS, *ROTOR, *TENSION_COLUMNS]
_WAVE = "dt 0.025 s; regular wave H 3 m T 5 s, crest at t = 0, no ramp; WaveDisp"
_HUB_WIND = "dt 0.0125 s; hub wind of wind_hub_18mps blown uniformly over rotor and tower"
CASES = {  # case -> (columns, settings)
    **{
        f"decay_{name}": (MOTION_COLUMNS, f"dt 0.025 s; free decay from {start}; {STILL}")
        for name, start in (
            ("surge", "10 m"), ("sway", "10 m"), ("heave", "3 m"), ("roll", "5 deg"), ("pitch", "5 deg"),
            ("yaw", "8 deg"),
        )
    },
    "float_steady_8mps": (
        _FLOATING, f"dt 0.0125 s; uniform steady 8 m/s; rotor 9.16 rpm, blade pitch 0; {WIND}",
    ),
    "float_steady_18mps": (
        _FLOATING, f"dt 0.0125 s; uniform steady 18 m/s; rotor 12.1 rpm, blade pitch 14.92 deg; {WIND}",
    ),
    "float_windsteps_12_24": (
        _FLOATING,
        "dt 0.025 s; uniform wind, 12 m/s, then +1 m/s every 100 s (0.1 s ramp); rotor 12.1 rpm, blade pitch"
        f" 3.83 deg; {WIND}",
    ),
    "regwave_H3T5": (_PARKED, f"{_WAVE} 0; {STILL}"),
    "regwave_H3T5_displaced": (_PARKED, f"{_WAVE} 1; {STILL}"),
    "turb_18mps_Hs7.5_uniform": (["wave_elev_m", *_FLOATING], f"{_HUB_WIND}; {SEA}"),
    "turb_18mps_Hs7.5_uniform_flex": (
        [*_FLOATING, "twr_base_My_kNm", "tower_top_fa_m"], f"{_HUB_WIND}; {SEA}",
    ),
    "turb_18mps_Hs7.5_box": (["wave_elev_m", *_FLOATING], f"dt 0.0125 s; full-field TurbSim box; {SEA}"),
}  # fmt: skip


def sha256(path):
    """Return the SHA-256 of a file, or of the list of names and SHA-256 of the files of a folder."""
    path = Path(path)
    if path.is_dir():
        lines = [f"{sha256(part)} {part.name}\n" for part in sorted(path.iterdir())]
        return hashlib.sha256("".join(lines).encode()).hexdigest()
    return hashlib.sha256(path.read_bytes()).hexdigest()


def sources(*paths):
    """Return header lines with SHA-256 and name of each source file."""
    return [f"sha256 {sha256(path)} {Path(path).name}" for path in paths]


def write(path, comment, frame):
    """Write a gzipped CSV with comment lines; the bytes are reproducible."""
    text = "".join(f"# {line}\n" for line in comment) + frame.to_csv(index=False)
    path.write_bytes(gzip.compress(text.encode(), compresslevel=9, mtime=0))


def six_digits(rows):
    """Return a DataFrame of rows with floats rounded to six digits."""
    return pd.DataFrame(rows).map(lambda v: float(f"{v:.6g}") if isinstance(v, float) else v)


def series(source, folder, cases, rounded):
    """Write time series of {case: (columns, step in s, header lines)}; rounded is applied to each column."""
    for case, (columns, step, *head) in cases.items():
        path, names = source / f"{case}.csv.gz", ["time_s", *columns]
        full = pd.read_csv(path, usecols=names)[names]
        frame = full.iloc[:: round(step / (full["time_s"][1] - full["time_s"][0]))].copy()
        for name in columns:
            frame[name] = rounded(frame[name])
        write(folder / f"{case}.csv.gz", (*head, *sources(path)), frame)


def without_noise(values):
    """Return a series, or 0 if all values are below 1e-7 (rounding of the solver)."""
    return values if np.abs(values).max() >= 1e-7 else 0.0


def inputs(source):
    """Write the steady curve, the wind and the wave components."""
    steady = "platform and tower locked, uniform steady wind, DISCON of OC3-Hywind; means of the last 50 s"
    wind = "u at the hub point of the TurbSim box (Kaimal, 18 m/s, class B, seed 180018), shift included"
    waves = "JONSWAP Hs 7.5 m Tp 10 s gamma 3.3; eta(0, t) = sum amplitude cos(omega t + phase), to +x"
    columns = ["wind_mps", "rotor_speed_rpm", "blade_pitch_deg", "aero_thrust_kN", "aero_torque_kNm"]
    for name, file, head, kept in (
        ("steady", "steady_operating_points.csv", (MODEL, steady), lambda full: full[columns]),
        ("wind_hub_18mps", "wind_hub_18mps.csv.gz", (wind,), lambda full: full[full["time_s"] <= 601.0]),
        ("waves_hs7.5_tp10", "waves_hs7.5_tp10.csv", (waves,), lambda full: full[full["amplitude_m"] > 0.0]),
    ):
        path = source / file
        write(HERE / f"{name}.csv.gz", (*head, *sources(path)), kept(pd.read_csv(path)))


# region of the box: half width (m), height (m), duration (s)
SIDE, TOP, LENGTH = 68.0, 162.0, 612.0
REACH = 78.0  # m from the hub: outside, no grid point is used by a blade station
ROUNDING = np.array([0.04, 0.08, 0.08])  # m/s, rounding of u, v, w


def box(source):
    """Write the region of the TurbSim box at rotor and tower: rounded, differences in time, lzma.

    Points that are not used are zero.
    """
    from openfast_io.turbsim_file import TurbSimFile

    file = TurbSimFile(str(source / "turbsim_18mps.bts"))
    y, z = np.asarray(file["y"]), np.asarray(file["z"])
    dt = float(file["dt"])
    columns, rows = np.abs(y) < SIDE, z < TOP
    count = round(LENGTH / dt)
    velocity = np.transpose(file["u"], (1, 3, 2, 0))[:count][:, rows][:, :, columns]
    y, z = y[columns], z[rows]
    used = (np.hypot(y[None, :], z[:, None] - 90.0) < REACH) | (np.abs(y[None, :]) < 8.0)
    codes = np.round(velocity / ROUNDING).astype(np.int16) * used[None, :, :, None].astype(np.int16)
    steps = np.diff(codes, axis=0, prepend=np.zeros_like(codes[:1]))
    # components and points first: the time series of each point is then contiguous
    packed = np.ascontiguousarray(np.transpose(steps, (3, 1, 2, 0)))
    shape = (codes.shape[0], z.size, y.size)
    planes = packed.view(np.uint8).reshape(-1, 2)
    payload = np.ascontiguousarray(planes.T).tobytes()
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "pb": 0, "dict_size": 1 << 26}]
    np.savez(
        HERE / "turbsim_18mps_region.npz",
        about="TurbSim IEC Kaimal 18 m/s class B, seed 180018, 21 x 21 points over 150 x 170 m, shear 0.14;"
        " region of rotor and tower, rounded; see make.py",
        shape=shape, steps=ROUNDING, y=y, z=z, dt=dt, speed=float(file["uRef"]),
        shift=75.0 / float(file["uRef"]),
        codes=np.frombuffer(lzma.compress(payload, format=lzma.FORMAT_XZ, filters=filters), dtype=np.uint8),
    )  # fmt: skip


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    heads = {case: FLEXIBLE if case.endswith("_flex") else MODEL for case in CASES}
    cases = {case: (columns, 0.1, heads[case], words) for case, (columns, words) in CASES.items()}
    series(folder, HERE, cases, without_noise)
    inputs(folder)
    box(folder)
