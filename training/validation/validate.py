"""Validation against OpenFAST: the same cases on this project's plant, and every figure with its verdict.

Windows: decays and the floating steady winds over the whole record from the common start, turbulent cases
from 100 s on, regular waves over the last 200 s. An error is normalised by the standard deviation of the
reference over the same window; relative errors are of the reference. Nothing here is adjusted to fit.
"""

from dataclasses import dataclass, field
from math import pi

import numpy as np
import pandas as pd

from fowt_env.errors import InputError, unknown
from fowt_env.training.validation.openfast_cases import DECAYS, PLATFORM, RUNS, steady_reference
from fowt_env.training.validation.signal_errors import (
    band_energy,
    decay_decrement,
    decay_period,
    harmonics,
    normalised_rms,
)

TIME = "Time_[s]"
MOTION_CHANNELS = (
    "PtfmSurge_[m]", "PtfmSway_[m]", "PtfmHeave_[m]", "PtfmRoll_[deg]", "PtfmPitch_[deg]", "PtfmYaw_[deg]",
)  # fmt: skip
TENSION_CHANNELS = ("FAIRTEN1_[kN]", "FAIRTEN2_[kN]", "FAIRTEN3_[kN]")
SPEED, PITCH, SURGE, BLADE = "RotSpeed_[rpm]", "PtfmPitch_[deg]", "PtfmSurge_[m]", "BldPitch1_[deg]"
THRUST, POWER = "RtFldFxh_[N]", "GenPwr_[kW]"
SETTLED = 100.0  # s left out of statistics
WAVE_WINDOW = (400.0, 600.0)  # s, forty periods of 5 s
BANDS = {"platform pitch": (0.025, 0.042), "wave": (0.08, 0.125), "rotor speed": (0.16, 0.25)}  # Hz
COMBINATIONS = (  # kinematics position, surface, stretching
    ("fixed", "swl", "none"),
    ("instantaneous", "swl", "none"),
    ("fixed", "instantaneous", "wheeler"),
    ("instantaneous", "instantaneous", "wheeler"),
)


@dataclass(frozen=True)
class Row:
    """One figure: what was compared, both values, the error, and what is allowed."""

    case: str
    quantity: str
    unit: str
    openfast: float  # or the reference that the case names; nan if there is none
    here: float
    error: float  # %, relative or normalised as the quantity says; nan if only reported
    allowed: float = float("nan")  # %
    note: str = ""

    @property
    def verdict(self):
        """ "met", "MISSED" or "reported"."""
        if not np.isfinite(self.allowed):
            return "reported"
        return "met" if abs(self.error) <= self.allowed else "MISSED"


@dataclass
class Study:
    """What a validation run works with and what it has found so far."""

    folder: object = None  # of the reference series
    bts: object = None  # path of the full TurbSim box
    report: object = None  # called with the text of what is being done, the runs done and their number
    total: int = 0  # runs
    done: int = 0
    platform: str = "oc3_hywind"  # a name of PLATFORMS
    cases: dict = field(default_factory=lambda: RUNS)  # case -> ReferenceRun
    rows: list = field(default_factory=list)
    runs: dict = field(default_factory=dict)  # case -> (this project's frame, OpenFAST's frame)

    def say(self, text):
        """Tell what is being done."""
        if self.report is not None:
            self.report(text, self.done, self.total)
        self.done += 1

    def add(self, case, quantity, unit, openfast, here, error=None, allowed=float("nan"), note=""):
        """A row; without an error the relative one in percent."""
        if error is None:
            error = relative(here, openfast)
        row = Row(case, quantity, unit, float(openfast), float(here), float(error), allowed, note)
        self.rows.append(row)

    def pair(self, case, **changes):
        """(this project's frame, OpenFAST's frame) of a case, cut to common length."""
        if case not in self.runs:
            self.say(case)
            run = self.cases[case]
            theirs = run.theirs(self.folder)
            ours = run.frame(self.folder, self.bts, **changes)
            if len(ours) != len(theirs) or not np.allclose(ours[TIME], theirs[TIME], atol=1e-6):
                raise InputError(
                    f"reference run {case!r}: its times are not those of the run, every {run.output_dt:g} s"
                )
            self.runs[case] = (ours, theirs)
        return self.runs[case]

    def table(self):
        """DataFrame of all rows with their verdicts."""
        return pd.DataFrame([{**vars(row), "verdict": row.verdict} for row in self.rows])


def relative(value, reference_value):
    """Error in percent of the reference; 0 where both are zero."""
    if reference_value == 0.0:
        return 0.0 if value == 0.0 else float("inf")
    return 100.0 * (value / reference_value - 1.0)


def _name(channel):
    name, unit = channel.split("_[")
    return name, unit[:-1]


def _since(pair, start, end=np.inf):
    """Both frames from start to end (s)."""
    return [frame[(frame[TIME] >= start - 1e-6) & (frame[TIME] <= end + 1e-6)] for frame in pair]


def decays(study):
    """Free decays in the six motions: period 0.2 %, decrement 3 %, normalised rms error 3 %."""
    for case, (channel, _, duration) in DECAYS.items():
        add_decay(study, case, channel, duration, period=0.2, decrement=3.0, rms=3.0)


def add_decay(study, case, channel, duration, period, decrement, rms, cycles=4, counted=(1, 3)):
    """Rows of a free decay: mean period of the first cycles, decrements of some, and the rms error (%)."""
    ours, theirs = study.pair(case)
    time = theirs[TIME].to_numpy()
    centre = theirs[channel][time > 0.5 * duration].mean()
    mine, wanted = ours[channel].to_numpy(), theirs[channel].to_numpy()
    periods = [decay_period(time, value, centre, cycles) for value in (wanted, mine)]
    counts = "cycle" if cycles == 1 else f"{cycles} cycles"
    study.add(case, f"period, first {counts}", "s", *periods, allowed=period)
    for cycle in counted:
        both = [decay_decrement(time, value, centre, cycle) for value in (wanted, mine)]
        words = {1: "first", 2: "second", 3: "third"}[cycle]
        study.add(case, f"logarithmic decrement, {words} cycle", "-", *both, allowed=decrement)
    error = 100.0 * normalised_rms(mine, wanted)
    name, unit = _name(channel)
    study.add(case, f"{name}, normalised rms error", unit, wanted.std(), mine.std(), error, rms)


def steady(study):
    """Steady winds, platform locked: rotor speed and blade pitch 0.2 %, thrust and torque 0.3 %."""
    from fowt_env.analysis.trim import trim
    from fowt_env.scene.build import build_scene

    for row in steady_reference(study.folder).to_dict("records"):
        wind = row["wind_mps"]
        case = f"steady_{wind:g}mps"
        study.say(case)
        point = trim(build_scene(PLATFORM, wind=wind, fidelity="reference"), platform="fixed")
        study.add(case, "RotSpeed", "rpm", row["rotor_speed_rpm"], point["RotSpeed"], allowed=0.2)
        study.add(case, "BldPitch1", "deg", row["blade_pitch_deg"], point["BldPitch1"], allowed=0.2)
        thrust, torque = 1e-3 * point["RtFldFxh"], 1e-3 * point["RtFldMxh"]
        study.add(case, "aerodynamic thrust", "kN", row["aero_thrust_kN"], thrust, allowed=0.3)
        study.add(case, "aerodynamic torque", "kN-m", row["aero_torque_kNm"], torque, allowed=0.3)


def floating(study):
    """Floating steady winds from the same start: surge, pitch, tensions, rotor speed within 3 % rms."""
    for case in ("float_steady_8mps", "float_steady_18mps"):
        for start, words in ((0.0, "whole record"), (SETTLED, f"t >= {SETTLED:g} s")):
            ours, theirs = _since(study.pair(case), start)
            for channel in (SURGE, PITCH, *TENSION_CHANNELS, SPEED):
                name, unit = _name(channel)
                error = 100.0 * normalised_rms(ours[channel], theirs[channel])
                quantity = f"{name}, normalised rms error, {words}"
                study.add(case, quantity, unit, theirs[channel].std(), ours[channel].std(), error, 3.0)


def waves(study):
    """Regular wave H 3 m T 5 s: first harmonics 1 %; second ones reported for four kinds of kinematics."""
    omega = 2.0 * pi / 5.0
    channels = (SURGE, "PtfmHeave_[m]", PITCH, *TENSION_CHANNELS)
    for case in ("regwave_H3T5", "regwave_H3T5_displaced"):
        ours, theirs = _since(study.pair(case), *WAVE_WINDOW)
        for channel in channels:
            name, unit = _name(channel)
            both = [harmonics(f[TIME].to_numpy(), f[channel].to_numpy(), omega) for f in (theirs, ours)]
            first = [abs(c[0]) for c in both]
            turn = np.degrees(np.angle(both[1][0] / both[0][0]))
            error = 100.0 * abs(both[1][0] - both[0][0]) / first[0]
            turned = f"phase {turn:+.2f} deg"
            study.add(case, f"{name}, first harmonic", unit, *first, allowed=1.0, note=turned)
            study.add(case, f"{name}, first harmonic as a vector", unit, *first, error)
    second = {"fixed": "regwave_H3T5", "instantaneous": "regwave_H3T5_displaced"}
    for position, surface, stretching in COMBINATIONS:
        study.say(f"regular wave, position {position}, surface {surface}")
        options = {"kinematics_position": position, "surface": surface, "stretching": stretching}
        frames = [RUNS["regwave_H3T5"].frame(study.folder, **options)]
        if surface == "swl":
            frames.append(study.pair(second[position])[1])
        for channel in (SURGE, PITCH, TENSION_CHANNELS[0]):
            name, unit = _name(channel)
            ratio = []
            for frame in frames:
                (part,) = _since([frame], *WAVE_WINDOW)
                c = np.abs(harmonics(part[TIME].to_numpy(), part[channel].to_numpy(), omega))
                ratio.append(100.0 * c[1] / c[0])
            case = f"second harmonic, position {position}, surface {surface}"
            theirs = ratio[1] if len(ratio) > 1 else float("nan")
            study.add(case, f"{name}, second over first harmonic", "%", theirs, ratio[0], float("nan"))


def steps(study):
    """Wind steps 12 to 24 m/s: each step with its mean removed, normalised rms error 5 %."""
    case = "float_windsteps_12_24"
    pair = study.pair(case)
    for channel in (SPEED, BLADE, PITCH):
        name, unit = _name(channel)
        for number in range(13):
            ours, theirs = (
                f[channel].to_numpy() for f in _since(pair, 100.0 * number, 100.0 * (number + 1) - 0.05)
            )
            error = 100.0 * normalised_rms(ours - ours.mean(), theirs - theirs.mean())
            quantity = f"{name} at {12 + number} m/s, normalised rms error without mean"
            study.add(case, quantity, unit, theirs.std(), ours.std(), error, 5.0)


def turbulence(study):
    """18 m/s turbulence with Hs 7.5 m, uniform and full field: deviations 3 %, bands 5 %, rms errors 10 %."""
    for case in ("turb_18mps_Hs7.5_uniform", "turb_18mps_Hs7.5_box"):
        ours, theirs = _since(study.pair(case), SETTLED)
        for channel in (*MOTION_CHANNELS, SPEED, BLADE, POWER, THRUST, *TENSION_CHANNELS):
            name, unit = _name(channel)
            both = [frame[channel].std() for frame in (theirs, ours)]
            study.add(case, f"{name}, standard deviation", unit, *both, allowed=3.0)
        time = theirs[TIME].to_numpy()
        for channel in (PITCH, SPEED):
            name, unit = _name(channel)
            for band, (low, high) in BANDS.items():
                both = [band_energy(time, f[channel].to_numpy(), low, high) for f in (theirs, ours)]
                quantity = f"{name}, energy in {low:g} to {high:g} Hz ({band})"
                study.add(case, quantity, f"({unit})^2", *both, allowed=5.0)
        for channel in (PITCH, SPEED):
            name, unit = _name(channel)
            error = 100.0 * normalised_rms(ours[channel], theirs[channel])
            quantity = f"{name}, normalised rms error"
            study.add(case, quantity, unit, theirs[channel].std(), ours[channel].std(), error, 10.0)


def costs(study):
    """What the cheaper choices cost, each as an error against the dearer one on the same run."""
    from fowt_env.training.validation.costs import cheaper_choices

    cheaper_choices(study)


def tower(study):
    """A tower that bends against ElastoDyn with all its modes: tower-base moment by bands, motions."""
    from fowt_env.training.validation.tower_modes import oc3

    oc3(study)


GROUPS = {  # name -> (function, runs that it takes)
    "decays": (decays, 6),
    "steady": (steady, 18),
    "floating": (floating, 2),
    "waves": (waves, 6),
    "steps": (steps, 1),
    "turbulence": (turbulence, 2),
    "tower": (tower, 1),
    "costs": (costs, 8),
}


def _volturnus():
    from fowt_env.training.validation import volturnus

    return volturnus.GROUPS, volturnus.RUNS


def _barge():
    from fowt_env.training.validation import responses

    return responses.groups("nrel5mw_iti_barge"), {}


def _oc4():
    from fowt_env.training.validation import oc4, responses

    return {**responses.groups("nrel5mw_oc4_semi"), **oc4.GROUPS}, oc4.RUNS


PLATFORMS = {  # name -> function that returns (groups, runs)
    "oc3_hywind": lambda: (GROUPS, RUNS),
    "iea15_volturnus_s": _volturnus,
    "nrel5mw_iti_barge": _barge,
    "nrel5mw_oc4_semi": _oc4,
}


def validate_cases(groups=None, folder=None, bts=None, report=None, platform="oc3_hywind"):
    """Study with every figure of the groups (names of the platform's groups; None: all but costs).

    folder: reference series (None: training/validation/reference); bts: the full TurbSim box instead of the
    stored region; report: called with (text, runs done, runs in all) before each run; platform: a name of
    PLATFORMS.
    Raises: InputError for an unknown platform or group or a missing reference.
    """
    if platform not in PLATFORMS:
        raise unknown("platform of a validation", platform, PLATFORMS)
    known, runs = PLATFORMS[platform]()
    names = [name for name in known if name != "costs"] if groups is None else list(groups)
    for name in names:
        if name not in known:
            raise unknown("validation case", name, known)
    total = sum(known[name][1] for name in names)
    study = Study(folder, bts, report, total, platform=platform, cases=runs)
    for name in names:
        known[name][0](study)
    return study
