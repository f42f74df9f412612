"""Defines the OpenFAST reference runs: their files, and the settings of fowt_env for the same cases."""

import lzma
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.controllers.rosco import find_library
from fowt_env.errors import InputError
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene

PLATFORM = "oc3_hywind_openfast"
FOLDER = Path(__file__).parent / "reference"
NAMED = {  # channel of simulate: column of a reference file, in the same unit
    "Time_[s]": "time_s", "Wave1Elev_[m]": "wave_elev_m", "PtfmSurge_[m]": "surge_m",
    "PtfmSway_[m]": "sway_m", "PtfmHeave_[m]": "heave_m", "PtfmRoll_[deg]": "roll_deg",
    "PtfmPitch_[deg]": "pitch_deg", "PtfmYaw_[deg]": "yaw_deg", "RotSpeed_[rpm]": "rotor_speed_rpm",
    "BldPitch1_[deg]": "blade_pitch_deg", "GenPwr_[kW]": "gen_power_elec_kW",
    "GenTq_[kN-m]": "gen_torque_kNm",
    "RtFldFxh_[N]": "aero_thrust_N", "RtFldMxh_[N-m]": "aero_torque_Nm", "FAIRTEN1_[kN]": "fair_tension1_kN",
    "FAIRTEN2_[kN]": "fair_tension2_kN", "FAIRTEN3_[kN]": "fair_tension3_kN", "TTDspFA_[m]": "tower_top_fa_m",
    "TTDspSS_[m]": "tower_top_ss_m", "TwrBsMyt_[kN-m]": "twr_base_My_kNm",
    "TwrBsMxt_[kN-m]": "twr_base_Mx_kNm", "NcIMUTAxs_[m/s^2]": "nacelle_acc_x_mps2",
}  # fmt: skip
COLUMNS = {column: channel for channel, column in NAMED.items()} | {  # kN and kN m are converted to N and N m
    "aero_thrust_kN": "RtFldFxh_[N]", "aero_torque_kNm": "RtFldMxh_[N-m]", "hydro_Fx_kN": "HydroFxi_[N]",
    "hydro_Fz_kN": "HydroFzi_[N]", "hydro_My_kNm": "HydroMyi_[N-m]",
}  # fmt: skip
REGULAR = {"kind": "regular", "H": 3.0, "T": 5.0}
DECAYS = {  # case: (channel, start value, seconds)
    "decay_surge": ("PtfmSurge_[m]", 10.0, 600.0),
    "decay_sway": ("PtfmSway_[m]", 10.0, 600.0),
    "decay_heave": ("PtfmHeave_[m]", 3.0, 300.0),
    "decay_roll": ("PtfmRoll_[deg]", 5.0, 300.0),
    "decay_pitch": ("PtfmPitch_[deg]", 5.0, 300.0),
    "decay_yaw": ("PtfmYaw_[deg]", 8.0, 200.0),
}


def _path(folder, name):
    path = Path(folder or FOLDER) / name
    if not path.is_file():
        raise InputError(
            f"reference file {str(path)!r} not found: the OpenFAST runs are part of the source tree"
            " (training/validation/reference); set --reference to that folder"
        )
    return path


def table(name, folder=None):
    """Return a file of the reference folder as a DataFrame. Raises: InputError if absent."""
    return pd.read_csv(_path(folder, name), comment="#")


def reference(case, folder=None, place=""):
    """Return a reference run as a DataFrame with the columns of simulate. Raises: InputError if absent."""
    frame = table(f"{place}/{case}.csv.gz" if place else f"{case}.csv.gz", folder)
    thousands = [name for name in frame if "kN" in name and "[N" in COLUMNS.get(name, "")]
    frame[thousands] *= 1e3
    return frame.rename(columns=COLUMNS)


def steady_reference(folder=None):
    """Return the steady operating points as a DataFrame, one row per wind speed (columns as in the file)."""
    return table("steady.csv.gz", folder)


def hub_wind(folder=None, bts=None):
    """Return the wind specification of the recorded hub wind, uniform over the rotor."""
    frame = table("wind_hub_18mps.csv.gz", folder)
    return {"kind": "series", "time": frame["time_s"].to_numpy(), "speed": frame["u_mps"].to_numpy()}


def wave_components(folder=None):
    """Return the sea specification of the recorded wave components (file: omega t + phase; here: minus)."""
    frame = table("waves_hs7.5_tp10.csv.gz", folder)
    return {
        "kind": "components",
        "omega": frame["omega_rad_s"].to_numpy(),
        "amplitude": frame["amplitude_m"].to_numpy(),
        "phase": -np.radians(frame["phase_deg"].to_numpy()),
    }


def box_wind(folder=None, bts=None):
    """Return the wind specification of the TurbSim box: file bts, or the stored region if None.

    The stored region is rounded to 0.04 m/s (u) and 0.08 m/s (v, w): training/validation/reference/make.py.
    """
    if bts is not None:
        return {"kind": "bts", "path": str(bts)}
    with np.load(_path(folder, "turbsim_18mps_region.npz")) as data:
        shape = tuple(data["shape"])
        planes = np.frombuffer(lzma.decompress(data["codes"].tobytes()), dtype=np.uint8).reshape(2, -1)
        steps = np.ascontiguousarray(planes.T).view(np.int16).reshape(3, *shape[1:], shape[0])
        velocity = np.cumsum(steps, axis=-1, dtype=np.int32) * data["steps"][:, None, None, None]
        u, v, w = np.transpose(velocity, (0, 3, 1, 2)).astype(np.float32)
        box = {key: data[key] for key in ("y", "z")}
        box |= {key: float(data[key]) for key in ("dt", "speed", "shift")}
    return {"kind": "box", "u": u, "v": v, "w": w, **box}


@dataclass(frozen=True)
class ReferenceRun:
    """Holds the settings with which fowt_env repeats a reference run."""

    case: str  # name of the reference file
    duration: float
    dt: float  # s, of the deck; used as physics step and control period
    wind: object = None  # function of (folder, bts) -> wind specification, or the specification
    sea: object = None
    controlled: bool = False
    initial: dict = field(default_factory=dict)
    options: dict = field(default_factory=dict)
    platform: object = PLATFORM  # name, or function that returns the description
    controller: object = "openfast_oc3"  # name, or function of (folder) -> controller
    output_dt: float = 0.1  # of the reference file
    place: str = ""  # subfolder of the reference file
    held: bool = False  # whether platform and rotor speed are fixed
    before: float = 0.0  # s simulated before the reference starts, for the wake to settle

    def theirs(self, folder=None):
        """Return the OpenFAST run as a DataFrame. Raises: InputError if absent."""
        return reference(self.case, folder, self.place)

    def frame(self, folder=None, bts=None, dt=None, wind=None, rotor="bem", progress=False, **options):
        """Simulate the case and return a DataFrame at the times of the reference.

        wind, dt: None: those of the run; options: of build_scene, and controller.
        """
        if wind is None:
            wind = self.wind(folder, bts) if callable(self.wind) else self.wind
        controller = options.pop("controller", self.controller)
        if callable(controller):
            controller = controller(folder)
        scene = build_scene(
            self.platform() if callable(self.platform) else self.platform, wind=wind,
            sea=self.sea(folder) if callable(self.sea) else self.sea, rotor=rotor,
            **{"fidelity": "reference", "duration": max(700.0, self.duration), **self.options, **options},
        )  # fmt: skip
        if self.held:
            scene = scene.with_model({"rigid_body.platform_fixed": True, "rigid_body.rotor_fixed": True})
        dt = self.dt if dt is None else dt
        frame = simulate(
            scene, controller=controller if self.controlled else None, duration=self.before + self.duration,
            dt=dt, control_dt=dt, output_dt=self.output_dt, initial={"start": "zero"} | (self.initial or {}),
            progress=progress,
        )  # fmt: skip
        if self.before:
            frame = frame[frame["Time_[s]"] >= self.before - 1e-6].reset_index(drop=True)
            frame["Time_[s]"] -= self.before
        return frame


def without_rosco():
    """Return the error message of a missing ROSCO library, or None if the library is installed."""
    try:
        find_library()
    except InputError as error:
        return str(error)
    return None


def rotor_start(rotor_speed, blade_pitch):
    """Return initial conditions with a rotor speed (rpm) and blade pitch (deg)."""
    return {"RotSpeed": rotor_speed, "BldPitch1": blade_pitch}


def _run(case, duration, dt, start, **settings):
    """Return a controlled ReferenceRun that starts at (rotor speed in rpm, blade pitch in deg)."""
    return ReferenceRun(case, duration, dt, controlled=True, initial=rotor_start(*start), **settings)


WIND_STEPS = {"kind": "steps", "speeds": [float(v) for v in range(12, 25)], "every": 100.0, "ramp": 0.1}


def _turbulent(name, wind, **settings):
    start = (12.1, 14.92)
    return _run(f"turb_18mps_Hs7.5_{name}", 600.0, 0.0125, start, sea=wave_components, wind=wind, **settings)


RUNS = {
    run.case: run
    for run in (
        *(
            ReferenceRun(case, seconds, 0.025, initial={channel: start})
            for case, (channel, start, seconds) in DECAYS.items()
        ),
        _run("float_steady_8mps", 600.0, 0.0125, (9.16, 0.0), wind=8.0),
        _run("float_steady_18mps", 600.0, 0.0125, (12.1, 14.92), wind=18.0),
        _run("float_windsteps_12_24", 1300.0, 0.025, (12.1, 3.83), wind=WIND_STEPS),
        ReferenceRun("regwave_H3T5", 600.0, 0.025, sea=REGULAR),
        ReferenceRun(
            "regwave_H3T5_displaced", 600.0, 0.025, sea=REGULAR,
            options={"kinematics_position": "instantaneous"},
        ),
        _turbulent("uniform", hub_wind),
        _turbulent("uniform_flex", hub_wind, options={"tower": "modes"}),
        _turbulent("box", box_wind),
    )
}  # fmt: skip
