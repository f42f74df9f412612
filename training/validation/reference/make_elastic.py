"""Runs OpenFAST with elastic blades, tower, drivetrain, options of AeroDyn, dynamic lines, sum frequencies.

    make_elastic.py DECKS OPENFAST RUNS CASE ...    runs cases: outputs in RUNS/CASE, existing ones are reused
    make_elastic.py DECKS OPENFAST RUNS             writes elastic/ from the outputs of finished cases
    make_elastic.py DECKS TURBSIM RUNS wind         runs TurbSim and writes the hub winds of 8, 12 and 24 m/s

DECKS     folder with the decks of openfast_decks.py
OPENFAST  the executable: v5.0.0, Release, -O2, double precision, without OpenMP
ROSCO_LIB, DISCON_OC3_LIB: paths of libdiscon (rosco 2.10.6) and of the compiled DISCON_OC3Hywind.f90
"""

import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.training.evaluation.metrics import damage_equivalent_load

sys.path.insert(0, str(Path(__file__).resolve().parent))
from make import six_digits, sources, write
from make_openfast import HERE, INPUTS, run
from openfast_decks import MOTIONS, OPENFAST, TURBSIM, Oc3, Oc4, Volturnus, filled

PLACE = HERE / "elastic"
CHANNELS = (
    "Azimuth", "RotSpeed", "GenSpeed", *(f"BldPitch{k}" for k in (1, 2, 3)), "RotThrust", "RotTorq",
    *(f"{name}{k}" for name in ("OoPDefl", "IPDefl") for k in (1, 2, 3)),
    "TipDxc1", "TipDyc1", "TipDxb1", "TipDyb1", "RootFxc1", "RootFyc1", "RootFzc1", "RootMzc1",
    *(f"RootM{axis}c{k}" for axis in "xy" for k in (1, 2, 3)),
    *(f"RootM{axis}b{k}" for axis in "xy" for k in (1, 2, 3)),
    "Spn1MLxb1", "Spn1MLyb1", "Spn2MLxb1", "Spn2MLyb1", "LSShftFxa", "LSShftFya", "LSShftFza",
    "LSSTipMya", "LSSTipMza", "LSSTipMys", "LSSTipMzs", "LSSGagVxa", "HSShftV", "HSShftTq",
    *(f"YawBr{name}p" for name in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")),
    *(f"TwrBs{name}t" for name in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")),
    "TTDspFA", "TTDspSS", "NcIMUTAxs", "NcIMUTAys",
    *(f"{rate}_B1{mode}" for rate in ("Q", "QD") for mode in ("F1", "F2", "E1")), "Q_DrTr", "QD_DrTr",
    *MOTIONS,
)  # fmt: skip
OPERATING = {  # wind, m/s: (rotor speed rpm, blade pitch deg, first tip deflection out of and in plane m)
    Volturnus: {8: (5.68, 0.0, 9.0, 0.0), 12: (7.56, 6.3, 10.3, -1.3), 18: (7.56, 15.4, 3.6, -0.9),
                24: (7.56, 21.8, 1.0, -0.5)},
    Oc3: {8: (9.208, 0.0, 3.2, -0.4), 12: (12.1, 3.963, 4.0, -0.6), 18: (12.1, 14.95, 1.2, -0.6),
          24: (12.1, 22.141, 0.0, -0.5)},
}  # fmt: skip
NAMES = {Volturnus: "iea15", Oc3: "nrel5mw"}
GAUGES = {Volturnus: "13, 25", Oc3: "5, 9"}  # blade nodes of Spn1 and Spn2, of 50 and 17
BENT = {Volturnus: (4.0, 2.0), Oc3: (2.0, 1.0)}  # m, tip deflections at the start of free decays
TORQUE = {Volturnus: 20.4e6, Oc3: 43093.55}  # N m at the generator: balances steady 12 m/s nearly
# ROSCO at every time step: ServoDyn extrapolates what it sends (README of elastic/)
SHEARED = dict(shear=0.2, t=400, control_dt="0.0125")
STEP = {Volturnus: 0.002, Oc3: 0.005}  # s, with constant torque: torsion of the IEA 15 MW is at 31 Hz


def _start(deck, wind):
    """Return settings of a run with three modes a blade that starts near its mean state."""
    rpm, pitch, out, inside = OPERATING[deck][wind]
    return {"rpm": rpm, "pitch": pitch, "OoPDefl": out, "IPDefl": inside, "blades": 3, "wind": wind,
            "channels": CHANNELS, "gauges": GAUGES[deck]}  # fmt: skip


def _held(deck, wind, **more):
    """Return a case with platform, tower and rotor speed held."""
    return deck, _start(deck, wind) | dict(t=130, dt=0.01, dtout=0.05, fixed=True) | more


def _decay(deck, rpm, **more):
    """Return a free decay of the blades without air and gravity."""
    out, inside = BENT[deck]
    case = _start(deck, 12) | dict(t=60, dt=0.005, dtout=0.02, fixed=True, wind=None, Gravity=0.0)
    return deck, case | dict(rpm=rpm, pitch=0.0, OoPDefl=out, IPDefl=inside) | more


def _torque_loss(deck, **more):
    """Return a case with constant generator torque that is lost at 20 s, platform and tower held."""
    case = _start(deck, 12) | dict(t=30, dt=STEP[deck], dtout=0.01, fixed=True, torsion=True)
    return deck, case | dict(torque=TORQUE[deck], torque_until=20.0) | more


def _turbulent(deck, wind, **more):
    """Return a floating case with uniform turbulent wind, waves and controller."""
    case = _start(deck, wind) | dict(t=600, dt=0.0125, dtout=0.05, waves=True, control=True, tower=2)
    file = INPUTS["hub_wind"] if wind == 18 else f"elastic/wind_hub_{wind}mps.csv.gz"
    return deck, case | dict(wind="hub_wind", wind_file=file, torsion=deck is Oc3) | more


def _turbine_cases(deck):
    """Return {name: settings} of the cases that every turbine has."""
    rated, pitch, *_ = OPERATING[deck][12]
    both = dict(shear=0.14, pitches=(pitch + 2.0, pitch - 1.0, pitch))
    rigid = dict(blades=0, OoPDefl=0, IPDefl=0)
    return {f"steady_{wind}mps": _held(deck, wind) for wind in OPERATING[deck]} | {
        **{f"steady_{wind}mps_tip": _held(deck, wind, last_node=5e-4) for wind in (18, 24)},
        "steady_12mps_shear": _held(deck, 12, shear=0.14),
        "steady_12mps_shear_pitches": _held(deck, 12, **both),
        "steady_12mps_2modes": _held(deck, 12, blades=2),
        "decay_rest": _decay(deck, 0.0),
        "decay_rated": _decay(deck, rated),
        "decay_rated_pitch15": _decay(deck, rated, pitch=15.0),
        "decay_rated_2modes": _decay(deck, rated, blades=2),
        "torque_loss": _torque_loss(deck),
        "torque_loss_rigid_blades": _torque_loss(deck, **rigid),
        **{f"turb_{wind}mps": _turbulent(deck, wind) for wind in OPERATING[deck]},
        "turb_18mps_dbemt": _turbulent(deck, 18, dbemt=2, t=400),
    }


CASES = {
    f"{name}/{case}": settings
    for deck, name in NAMES.items()
    for case, settings in _turbine_cases(deck).items()
}
CASES |= {
    "iea15/turb_18mps_shear": _turbulent(Volturnus, 18, **SHEARED),
    "iea15/turb_18mps_shear_ipc": _turbulent(Volturnus, 18, **SHEARED, individual=True),
    "iea15/check_18mps": _turbulent(Volturnus, 18, t=60),
    "iea15/check_18mps_fine": _turbulent(Volturnus, 18, t=60, dt=0.00625),
}
_WAVES = dict(t=600, waves=True, dtout=0.05)
CASES |= {
    "lines/volturnus_map": (Volturnus, _WAVES),
    "lines/volturnus_moordyn": (Volturnus, _WAVES | dict(moordyn=True)),
    "lines/oc3_map": (Oc3, _WAVES),
    "lines/oc3_moordyn": (Oc3, _WAVES | dict(moordyn=True)),
    "lines/oc4_first": (Oc4, _WAVES | dict(t=400)),
    "lines/oc4_sum": (Oc4, _WAVES | dict(t=400, sum_qtf=12)),
    "lines/oc4_sum_difference": (Oc4, _WAVES | dict(t=400, sum_qtf=12, qtf=12)),
}
_AIR = dict(
    t=60, dt=0.0125, dtout=0.05, wind=12, shear=0.14, rpm=7.56, pitch=6.3, nodes=(12, 22, 32, 42, 48),
    fixed=True, channels=CHANNELS,
)  # fmt: skip
_YAW = _AIR | dict(shear=0.0)
_GUSTY = _YAW | dict(t=200, wind="hub_wind", wind_file="elastic/wind_hub_12mps.csv.gz")
_AIR_CASES = {
    "shear": _AIR,
    "shear_aoa34": _AIR | dict(at_3_4_chord=True),
    **{f"shear_ua{k}": _AIR | dict(unsteady=k) for k in (3, 6)},
    "shear_potential": _AIR | dict(potential=1),
    "shear_bak": _AIR | dict(potential=2),
    "shear_shadow": _AIR | dict(shadow=1),
    "shear_potential_shadow": _AIR | dict(potential=1, shadow=1),
    "yaw_0": _YAW,
    "yaw_20": _YAW | dict(NacYaw=20.0),
    "wind_direction_20": _YAW | dict(direction=20.0),
    "turb_12mps": _GUSTY,
    **{f"turb_12mps_ua{k}": _GUSTY | dict(unsteady=k) for k in (3, 6)},
}
CASES |= {f"air/{name}": (Volturnus, case) for name, case in _AIR_CASES.items()}

WRITTEN = f"{OPENFAST}, double precision, loose coupling, ConvTol 1e-6, written by openfast_decks.py: "
MODELS = {
    Volturnus: f"{WRITTEN}IEA 15 MW on VolturnUS-S, IEAWindSystems/IEA-15-240-RWT ac5248a",
    Oc3: f"{WRITTEN}NREL 5 MW on OC3-Hywind, old-NWTC/FAST 0badc8d, turbine of NREL/ROSCO fc11f43, no tilt",
    Oc4: f"{WRITTEN}NREL 5 MW on the OC4 semi, old-NWTC/FAST 0badc8d, turbine of NREL/ROSCO fc11f43",
}
HELD = (
    "platform, tower and rotor speed held, steady wind; last 8 turns: mean, standard deviation, extremes, and"
    " cos and sin parts of the harmonics over the azimuth of blade 1 (0: up)"
)
DECAY = (
    "free decay of the blades from a bent tip, no air, no gravity; platform, tower and rotor speed held; dt"
    " 0.005 s"
)
LOSS = (
    "steady 12 m/s, platform and tower held, torsion of the drivetrain, constant generator torque, none after"
    " 20 s"
)
TURBULENT = (
    "wind blown uniformly, components of waves_hs7.5_tp10, three modes a blade, two tower modes each way,"
    " torsion of the drivetrain in the NREL 5 MW; dt 0.0125 s; IEA 15 MW: ROSCO 2.10.6 every 0.025 s, NREL 5"
    " MW: DISCON of OC3-Hywind every 0.0125 s; platform starts at zero"
)
EACH_STEP = "; turb_18mps_shear*: ROSCO every 0.0125 s"
MOORED = "components of waves_hs7.5_tp10, no wind, rotor at rest, rigid, dt 0.025 s; starts at zero"
TURNS, HARMONICS = 8, 6  # last whole turns of a steady run; harmonics fitted, of which three are stored
BEGIN = 100.0  # s, start-up omitted from runs in waves or turbulence
SERIES = (
    "RotSpeed", "BldPitch1", "GenPwr", "RotThrust", "RotTorq", "PtfmSurge", "PtfmHeave", "PtfmPitch",
    "TTDspFA", "TwrBsMyt", "TwrBsMxt", "YawBrMyp", "LSSTipMya", "OoPDefl1", "IPDefl1", "RootMyb1", "RootMxb1",
    "Spn2MLyb1",
)  # fmt: skip
DECAYING = (
    "TipDxc1", "TipDyc1", "TipDxb1", "TipDyb1", "RootMxb1", "RootMyb1", "RootFzc1", "Q_B1F1", "Q_B1F2",
    "Q_B1E1",
)  # fmt: skip
TWISTED = (
    "RotSpeed", "GenSpeed", "GenTq", "RotTorq", "HSShftTq", "Q_DrTr", "QD_DrTr", "IPDefl1", "OoPDefl1",
    "RootMxb1", "RootMyb1", "YawBrMxp", "RtFldMxh",
)  # fmt: skip
GUSTY = ("RotTorq", "RtFldFxh", "RtFldMxh", "RootMxc1", "RootMyc1") + tuple(
    f"B1N{k}{name}" for k in (1, 3, 5) for name in ("Alpha", "Cl", "Cd", "Cm")
)
TENSIONS = tuple(f"{end}{k}" for end in ("FAIRTEN", "ANCHTEN") for k in (1, 2, 3)) + tuple(
    f"{end}[{k}]" for end in ("T", "T_a") for k in (1, 2, 3)
)  # of MoorDyn; of MAP++
FORCES = ("B1WvsF2xi", "B1WvsF2zi", "B1WvsM2yi")
EXPONENTS = {  # of the S-N curves of channels that start so
    "RootM": 10, "Spn": 10, "RotTorq": 4, "LSSTip": 4, "YawBrM": 4, "TwrBsM": 4, "FAIRTEN": 3, "ANCHTEN": 3,
    "T[": 3, "T_a[": 3,
}  # fmt: skip


def channels(folder):
    """Return the output of a run as a DataFrame: time_s, and channels with units, such as RotSpeed_[rpm]."""
    with open(folder / "model.out", encoding="utf-8") as file:
        names = next(line for line in file if line.startswith("Time")).split()
        units = [unit.strip().strip("()[]") for unit in next(file).split("\t")]
        columns = ["time_s"] + [f"{name}_[{unit}]" for name, unit in zip(names[1:], units[1:], strict=True)]
        frame = pd.read_csv(file, sep="\t", header=None, names=columns, skipinitialspace=True)
    solver = [column for column in columns if column.startswith(("ConvIter", "ConvError", "NumUJac"))]
    return frame.astype(np.float64).drop(columns=solver)


def constant(values):
    """Return whether a channel is zero throughout, but for rounding of the solver."""
    return np.abs(values).max() < 1e-9


def turns(frame, rpm):
    """Return rows of a steady run: mean, deviation, extremes and harmonics of each channel."""
    time = frame["time_s"].to_numpy()
    kept = frame[time > time[-1] - TURNS * 60.0 / rpm]
    angle = np.radians(kept["Azimuth_[deg]"].to_numpy())
    waves = [f(order * angle) for order in range(1, HARMONICS + 1) for f in (np.cos, np.sin)]
    basis = np.column_stack([np.ones_like(angle), *waves])
    rows = []
    for name in frame.columns.drop(["time_s", "Azimuth_[deg]"]):
        values = kept[name].to_numpy()
        if constant(values):
            continue
        mean, *parts = np.linalg.lstsq(basis, values, rcond=None)[0]
        deviation = np.sqrt(0.5 * np.sum(np.square(parts)))
        row = {"channel": name, "mean": mean, "std": deviation, "min": values.min(), "max": values.max()}
        keys = [f"{wave}{order}" for order in (1, 2, 3) for wave in ("cos", "sin")]
        rows.append(row | dict(zip(keys, parts, strict=False)))
    return rows


def poles(frame, names, step=0.06):
    """Return rows (mode, frequency in Hz, damping ratio) of a free decay, second half of the record.

    Poles of a linear system with the modal coordinates `names` as outputs, and a constant: right singular
    vectors of their Hankel matrix (Hua and Sarkar, IEEE Trans. Signal Process. 39, 1991).
    """
    time = frame["time_s"].to_numpy()
    values = frame.loc[time >= 0.5 * time[-1], names].to_numpy()[:: round(step / (time[1] - time[0]))]
    width = len(values) // 2
    hankel = np.vstack([np.lib.stride_tricks.sliding_window_view(column, width) for column in values.T])
    space = np.linalg.svd(hankel, full_matrices=False)[2][: 2 * len(names) + 1].T
    shift = np.linalg.lstsq(space[:-1], space[1:], rcond=None)[0]
    found = np.log(np.linalg.eigvals(shift).astype(complex)) / step
    found = sorted(found[found.imag > 0.1], key=abs)
    rows = [(abs(pole) / (2.0 * np.pi), -pole.real / abs(pole)) for pole in found]
    return [{"mode": k, "frequency_Hz": f, "damping_ratio": z} for k, (f, z) in enumerate(rows, 1)]


def statistics(frame):
    """Return rows of a run after its start-up: mean, deviation, extremes, 1 Hz damage-equivalent loads."""
    frame = frame[frame["time_s"] >= BEGIN - 1e-6]
    time = frame["time_s"].to_numpy()
    rows = []
    for name in frame.columns.drop("time_s"):
        values = frame[name].to_numpy()
        if constant(values):
            continue
        row = {"channel": name, "end_s": time[-1], "mean": values.mean(), "std": values.std()}
        row |= {"min": values.min(), "max": values.max()}
        if exponent := next((m for start, m in EXPONENTS.items() if name.startswith(start)), 0):
            row["exponent"] = exponent
            row["DEL"] = damage_equivalent_load(values, time[-1] - time[0], exponent)
            row["DEL_10Hz"] = damage_equivalent_load(values[::2], time[-1] - time[0], exponent)
        rows.append(row)
    return rows


def digits(values, count):
    """Return a series rounded to `count` digits of its largest value."""
    if constant(values):
        return 0.0 * values
    return values.round(max(0, count - int(np.ceil(np.log10(np.abs(values).max())))))


class Reduction:
    """Writes tables and series of the finished runs of a folder, with SHA-256 of their inputs."""

    def __init__(self, runs, decks):
        self.runs, self.decks = runs, decks

    def finished(self, pattern):
        """Return the names of finished cases that match a pattern."""
        logs = {name: self.runs / name / "log" for name in CASES if fnmatch(name, pattern)}
        done = "terminated normally"
        return [name for name, log in logs.items() if log.exists() and done in log.read_text()]

    def _inputs(self, names):
        """Return header lines of the inputs of cases, each once."""
        lines = {}
        for name in names:
            deck, case = CASES[name]
            files = [INPUTS["components"]] if case.get("waves") else []
            files += [case["wind_file"]] if "wind_file" in case else []
            paths = [*deck(self.decks).inputs(case), *(HERE / file for file in files)]
            lines |= dict.fromkeys(sources(*paths))
        return list(lines)

    def table(self, name, pattern, rows, words):
        """Write a table: the rows of all finished cases that match a pattern, rows(case, output)."""
        names = self.finished(pattern)
        outputs = {case: channels(self.runs / case) for case in names}
        all_rows = [{"case": case} | row for case in names for row in rows(case, outputs[case])]
        models = dict.fromkeys(MODELS[CASES[case][0]] for case in names)
        if names:
            write(PLACE / f"{name}.csv.gz", (*models, words, *self._inputs(names)), six_digits(all_rows))

    def series(self, pattern, names, span, step, words, count=5):
        """Write channels of finished cases between two times, each `step` s, to `count` digits."""
        for name in self.finished(pattern):
            frame = channels(self.runs / name)
            every = round(step / (frame["time_s"][1] - frame["time_s"][0]))
            begin, end = span
            kept = frame[frame["time_s"].between(begin - 1e-6, end + 1e-6)].iloc[::every]
            chosen = [c for wanted in names for c in frame if c.split("_[")[0] == wanted]
            columns = {c: digits(kept[c], count) for c in chosen if not constant(kept[c])}
            rows = pd.DataFrame({"time_s": kept["time_s"].round(4)} | columns)
            head = MODELS[CASES[name][0]], words, *self._inputs([name])
            write(PLACE / f"{name.replace('/', '_')}.csv.gz", head, rows)

    def write(self):
        """Write all files of elastic/ but the winds."""
        held, free = "elastic blades, three modes; dt 0.01 s, 130 s", "rigid blades; dt 0.0125 s, 60 s"
        self.table("steady", "*/steady_*", lambda n, f: turns(f, CASES[n][1]["rpm"]), f"{held}; {HELD}")
        self.table("air_steady", "air/[!t]*", lambda n, f: turns(f, CASES[n][1]["rpm"]), f"{free}; {HELD}")
        self.series("air/turb_12mps*", GUSTY, (20.0, 120.0), 0.1, f"held at 7.56 rpm and 6.3 deg; {free}", 4)
        modes = {2: ("F1", "E1"), 3: ("F1", "F2", "E1")}

        def decay(name, frame):
            return poles(frame, [f"Q_B1{mode}_[m]" for mode in modes[CASES[name][1]["blades"]]])

        words = f"{DECAY}; natural frequency and damping ratio between 30 and 60 s"
        self.table("blade_modes", "*/decay_*", decay, words)
        self.series("*/decay_r*", DECAYING, (0.0, 12.0), 0.04, DECAY)
        self.series("*/torque_loss*", TWISTED, (18.0, 26.0), 0.02, LOSS, 6)
        for name in NAMES.values():
            every = EACH_STEP if name == "iea15" else ""
            words = f"{TURBULENT}{every}; from 100 s, 20 Hz; DEL_10Hz of every second row"
            self.table(f"{name}_turbulent", f"{name}/turb_*", lambda n, f: statistics(f), words)
            self.series(f"{name}/turb_*mps", SERIES, (BEGIN, 600.0), 0.1, TURBULENT, 4)
        self.series("iea15/turb_18mps_shear*", SERIES, (BEGIN, 400.0), 0.1, TURBULENT + EACH_STEP, 4)
        self.table("lines", "lines/*", lambda n, f: statistics(f), f"{MOORED}; from 100 s, 20 Hz")
        moved = ("PtfmSurge", "PtfmHeave", "PtfmPitch")
        self.series("lines/[!o]*", (*moved, *TENSIONS), (BEGIN, 500.0), 0.1, MOORED, 5)
        self.series("lines/oc3*", (*moved, *TENSIONS), (BEGIN, 500.0), 0.1, MOORED, 5)
        self.series("lines/oc4*", (*moved, *FORCES), (BEGIN, 400.0), 0.1, MOORED, 4)


def winds(program, runs):
    """Run TurbSim and write the wind at the hub point for 8, 12 and 24 m/s."""
    from openfast_io.turbsim_file import TurbSimFile

    (runs / "wind").mkdir(parents=True, exist_ok=True)
    for speed in (8, 12, 24):
        settings, box = {"RandSeed1": f"{speed}0{speed}", "URef": speed}, runs / "wind" / f"hub_{speed}.bts"
        box.with_suffix(".inp").write_text(f"v5\n-\n{filled(TURBSIM, **settings)}")
        subprocess.run([program, f"hub_{speed}.inp"], cwd=box.parent, check=True, stdout=subprocess.DEVNULL)
        file = TurbSimFile(str(box))
        speeds = file["u"][0, :12021, 1, 1].round(3)  # the middle of the grid
        rows = pd.DataFrame({"time_s": (0.05 * np.arange(speeds.size)).round(2), "u_mps": speeds})
        words = f"Kaimal, {speed} m/s, class B, seed {settings['RandSeed1']}, no shift"
        head = f"u at the hub point of a TurbSim box ({words})", *sources(box)
        write(PLACE / f"wind_hub_{speed}mps.csv.gz", head, rows)


if __name__ == "__main__":
    decks, program, runs = sys.argv[1], str(Path(sys.argv[2]).resolve()), Path(sys.argv[3]).resolve()
    PLACE.mkdir(exist_ok=True)
    if sys.argv[4:] == ["wind"]:
        winds(program, runs)
    elif not sys.argv[4:]:
        Reduction(runs, decks).write()
    else:
        for name in sys.argv[4:]:
            deck, case = CASES[name]
            run(deck(decks), case, runs / name, program)
            print(name, flush=True)
