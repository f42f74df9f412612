"""The OpenFAST reference runs: where they are, and how this project's plant is run on the same case."""

import lzma
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from fowt_env.errors import InputError

PLATFORM = "oc3_hywind_openfast"
FOLDER = Path(__file__).parent / "reference"
COLUMNS = {  # column of a reference file: (OpenFAST channel as simulate names it, factor)
    "time_s": ("Time_[s]", 1.0),
    "wave_elev_m": ("Wave1Elev_[m]", 1.0),
    "surge_m": ("PtfmSurge_[m]", 1.0),
    "sway_m": ("PtfmSway_[m]", 1.0),
    "heave_m": ("PtfmHeave_[m]", 1.0),
    "roll_deg": ("PtfmRoll_[deg]", 1.0),
    "pitch_deg": ("PtfmPitch_[deg]", 1.0),
    "yaw_deg": ("PtfmYaw_[deg]", 1.0),
    "rotor_speed_rpm": ("RotSpeed_[rpm]", 1.0),
    "blade_pitch_deg": ("BldPitch1_[deg]", 1.0),
    "gen_power_elec_kW": ("GenPwr_[kW]", 1.0),
    "gen_torque_kNm": ("GenTq_[kN-m]", 1.0),
    "aero_thrust_N": ("RtFldFxh_[N]", 1.0),
    "aero_thrust_kN": ("RtFldFxh_[N]", 1e3),
    "aero_torque_kNm": ("RtFldMxh_[N-m]", 1e3),
    "aero_torque_Nm": ("RtFldMxh_[N-m]", 1.0),
    "fair_tension1_kN": ("FAIRTEN1_[kN]", 1.0),
    "fair_tension2_kN": ("FAIRTEN2_[kN]", 1.0),
    "fair_tension3_kN": ("FAIRTEN3_[kN]", 1.0),
    "tower_top_fa_m": ("TTDspFA_[m]", 1.0),
    "tower_top_ss_m": ("TTDspSS_[m]", 1.0),
    "twr_base_My_kNm": ("TwrBsMyt_[kN-m]", 1.0),
    "twr_base_Mx_kNm": ("TwrBsMxt_[kN-m]", 1.0),
    "nacelle_acc_x_mps2": ("NcIMUTAxs_[m/s^2]", 1.0),
    "hydro_Fx_kN": ("HydroFxi_[N]", 1e3),
    "hydro_Fz_kN": ("HydroFzi_[N]", 1e3),
    "hydro_My_kNm": ("HydroMyi_[N-m]", 1e3),
}
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
            f"reference file {str(path)!r} not found: the OpenFAST runs come with the source tree,"
            " in training/validation/reference; point --reference at that folder"
        )
    return path


def table(name, folder=None):
    """DataFrame of a file of the references, as it is. Raises: InputError if absent."""
    return pd.read_csv(_path(folder, name), comment="#")


def reference(case, folder=None, place=""):
    """DataFrame of a reference run, columns named as simulate names them. Raises: InputError if absent.

    place: folder of the run in the folder of all references.
    """
    frame = table(f"{place}/{case}.csv.gz" if place else f"{case}.csv.gz", folder)
    values = {}
    for name in frame.columns:
        channel, factor = COLUMNS[name]
        values[channel] = frame[name] * factor
    return pd.DataFrame(values)


def steady_reference(folder=None):
    """DataFrame of the steady curve, one row per wind speed (columns as in the file)."""
    return table("steady.csv.gz", folder)


def hub_wind(folder=None):
    """Wind specification of the recorded hub wind, blown uniformly."""
    frame = table("wind_hub_18mps.csv.gz", folder)
    return {"kind": "series", "time": frame["time_s"].to_numpy(), "speed": frame["u_mps"].to_numpy()}


def wave_components(folder=None):
    """Sea specification of the recorded wave components (there omega t + phase, here minus both)."""
    frame = table("waves_hs7.5_tp10.csv.gz", folder)
    return {
        "kind": "components",
        "omega": frame["omega_rad_s"].to_numpy(),
        "amplitude": frame["amplitude_m"].to_numpy(),
        "phase": -np.radians(frame["phase_deg"].to_numpy()),
    }


def box_wind(folder=None, bts=None):
    """Wind specification of the TurbSim box: the file itself if its path is given, else the stored region.

    The region is rounded to 0.04 m/s (u) and 0.08 m/s (v, w); training/validation/reference/make.py wrote it.
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
    """One reference run as this project's plant repeats it."""

    case: str  # name of the reference file
    duration: float
    dt: float  # of the deck: physics step and control period here too
    wind: object = None  # function of (folder, bts) -> wind specification, or the specification
    sea: object = None
    controlled: bool = False
    initial: dict = field(default_factory=dict)
    options: dict = field(default_factory=dict)
    platform: object = PLATFORM  # name, or function that returns the description
    controller: object = "openfast_oc3"  # name, or function of (folder) -> controller
    output_dt: float = 0.1  # of the reference file
    place: str = ""  # folder of the reference file in that of all of them
    held: bool = False  # platform and rotor speed
    before: float = 0.0  # s that this plant runs before the reference begins, its wake settling

    def theirs(self, folder=None):
        """DataFrame of OpenFAST's run. Raises: InputError if absent."""
        return reference(self.case, folder, self.place)

    def frame(self, folder=None, bts=None, dt=None, wind=None, rotor="bem", progress=False, **options):
        """DataFrame of this project's run at the reference's times.

        wind None: the run's own, dt None: the deck's. controller and other arguments of build_scene may be
        among the options.
        """
        from fowt_env.run.simulation import simulate
        from fowt_env.scene.build import build_scene

        if wind is None:
            wind = self.wind(folder, bts) if callable(self.wind) else self.wind
        sea = self.sea(folder) if callable(self.sea) else self.sea
        controller = options.pop("controller", self.controller)
        scene = build_scene(
            self.platform() if callable(self.platform) else self.platform,
            wind=wind,
            sea=sea,
            rotor=rotor,
            **{"fidelity": "reference", "duration": max(700.0, self.duration), **self.options, **options},
        )
        if self.held:
            body = scene.model.rigid_body._replace(platform_fixed=True, rotor_fixed=True)
            scene = scene.with_model(rigid_body=body)
        dt = self.dt if dt is None else dt
        frame = simulate(
            scene,
            controller=(controller(folder) if callable(controller) else controller)
            if self.controlled
            else None,
            duration=self.before + self.duration,
            dt=dt,
            control_dt=dt,
            output_dt=self.output_dt,
            initial={"start": "zero"} | (self.initial or {}),
            progress=progress,
        )
        if self.before:
            frame = frame[frame["Time_[s]"] >= self.before - 1e-6].reset_index(drop=True)
            frame["Time_[s]"] -= self.before
        return frame


def _start(rotor_speed, blade_pitch):
    return {"RotSpeed": rotor_speed, "BldPitch1": blade_pitch}


WIND_STEPS = {"kind": "steps", "speeds": [float(v) for v in range(12, 25)], "every": 100.0, "ramp": 0.1}
RUNS = {
    **{
        case: ReferenceRun(case, seconds, 0.025, initial={channel: start})
        for case, (channel, start, seconds) in DECAYS.items()
    },
    "float_steady_8mps": ReferenceRun(
        "float_steady_8mps", 600.0, 0.0125, wind=8.0, controlled=True, initial=_start(9.16, 0.0)
    ),
    "float_steady_18mps": ReferenceRun(
        "float_steady_18mps", 600.0, 0.0125, wind=18.0, controlled=True, initial=_start(12.1, 14.92)
    ),
    "float_windsteps_12_24": ReferenceRun(
        "float_windsteps_12_24", 1300.0, 0.025, wind=WIND_STEPS, controlled=True, initial=_start(12.1, 3.83)
    ),
    "regwave_H3T5": ReferenceRun("regwave_H3T5", 600.0, 0.025, sea=REGULAR),
    "regwave_H3T5_displaced": ReferenceRun(
        "regwave_H3T5_displaced", 600.0, 0.025, sea=REGULAR, options={"kinematics_position": "instantaneous"}
    ),
    "turb_18mps_Hs7.5_uniform": ReferenceRun(
        "turb_18mps_Hs7.5_uniform",
        600.0,
        0.0125,
        wind=lambda folder, bts: hub_wind(folder),
        sea=wave_components,
        controlled=True,
        initial=_start(12.1, 14.92),
    ),
    "turb_18mps_Hs7.5_uniform_flex": ReferenceRun(
        "turb_18mps_Hs7.5_uniform_flex",
        600.0,
        0.0125,
        wind=lambda folder, bts: hub_wind(folder),
        sea=wave_components,
        controlled=True,
        initial=_start(12.1, 14.92),
        options={"tower": "modes"},
    ),
    "turb_18mps_Hs7.5_box": ReferenceRun(
        "turb_18mps_Hs7.5_box",
        600.0,
        0.0125,
        wind=box_wind,
        sea=wave_components,
        controlled=True,
        initial=_start(12.1, 14.92),
    ),
}
