"""Compares OC3-Hywind with OpenFAST, and runs the validations of all platforms.

Decays and floating runs in steady wind are compared from the start, turbulent ones after 100 s, regular waves
over the last 200 s. Errors are normalised by the reference standard deviation. Nothing is tuned to fit.
"""

import numpy as np

from fowt_env.analysis.trim import trim
from fowt_env.errors import unknown
from fowt_env.scene.build import build_scene
from fowt_env.training.validation import costs, elastic, oc4, responses, tower_modes, volturnus
from fowt_env.training.validation.comparison import (
    COMBINATIONS,
    SETTLED,
    TIME,
    Channel,
    Study,
    name_and_unit,
    since,
)
from fowt_env.training.validation.openfast_cases import DECAYS, PLATFORM, RUNS, steady_reference
from fowt_env.training.validation.signal_errors import band_energy, harmonics, normalised_rms

WAVE_WINDOW = (400.0, 600.0)  # s, forty periods of 5 s
BANDS = {"platform pitch": (0.025, 0.042), "wave": (0.08, 0.125), "rotor speed": (0.16, 0.25)}  # Hz


def decays(study):
    """Compare free decays in the six motions; allowed: period 0.2 %, decrement 3 %, rms error 3 %."""
    for case, (channel, _, duration) in DECAYS.items():
        study.add_decay(case, channel, duration, period=0.2, decrement=3.0, rms=3.0)


def steady(study):
    """Compare rotors on a locked platform in steady wind; speed and pitch 0.2 %, thrust and torque 0.3 %."""
    for row in steady_reference(study.folder).to_dict("records"):
        case = f"steady_{row['wind_mps']:g}mps"
        study.say(case)
        scene = build_scene(PLATFORM, wind=row["wind_mps"], fidelity="reference")
        point = trim(scene, platform="fixed")
        for quantity, unit, there, here, allowed in (
            ("RotSpeed", "rpm", "rotor_speed_rpm", point["RotSpeed"], 0.2),
            ("BldPitch1", "deg", "blade_pitch_deg", point["BldPitch1"], 0.2),
            ("aerodynamic thrust", "kN", "aero_thrust_kN", 1e-3 * point["RtFldFxh"], 0.3),
            ("aerodynamic torque", "kN-m", "aero_torque_kNm", 1e-3 * point["RtFldMxh"], 0.3),
        ):
            study.add(case, quantity, unit, row[there], here, allowed=allowed)


def floating(study):
    """Compare floating runs in steady wind: surge, pitch, line tensions and rotor speed, 3 % rms error."""
    channels = (Channel.SURGE, Channel.PITCH, *Channel.TENSIONS, Channel.SPEED)
    for case in ("float_steady_8mps", "float_steady_18mps"):
        for start, words in ((0.0, ", whole record"), (SETTLED, f", t >= {SETTLED:g} s")):
            study.add_statistics(case, channels, ("rms",), start, words=words, rms=3.0)


def waves(study):
    """Compare a regular wave, H 3 m, T 5 s: first harmonics 1 %; second ones of four kinematics reported."""
    cases = {"fixed": "regwave_H3T5", "instantaneous": "regwave_H3T5_displaced"}
    for case in cases.values():
        study.add_harmonics(case, (*Channel.PLANE, *Channel.TENSIONS), 5.0, WAVE_WINDOW, vector=True)
    for position, surface, stretching in COMBINATIONS:
        study.say(f"regular wave, position {position}, surface {surface}")
        options = {"kinematics_position": position, "surface": surface, "stretching": stretching}
        frames = [RUNS["regwave_H3T5"].frame(study.folder, **options)]
        if surface == "swl":
            frames.append(study.pair(cases[position])[1])
        for channel in (Channel.SURGE, Channel.PITCH, Channel.TENSIONS[0]):
            ratio = []
            for part in since(frames, *WAVE_WINDOW):
                c = np.abs(harmonics(part[TIME].to_numpy(), part[channel].to_numpy(), 2.0 * np.pi / 5.0))
                ratio.append(100.0 * c[1] / c[0])
            here, there = (*ratio, float("nan"))[:2]
            case = f"second harmonic, position {position}, surface {surface}"
            quantity = f"{name_and_unit(channel)[0]}, second over first harmonic"
            study.add(case, quantity, "%", there, here, float("nan"))


def steps(study):
    """Compare wind steps from 12 to 24 m/s: rms error of each step, mean removed, 5 %."""
    case = "float_windsteps_12_24"
    for channel in (Channel.SPEED, Channel.BLADE, Channel.PITCH):
        for number in range(13):
            name, unit, _, *both = study.series(case, channel, 100.0 * number, 100.0 * (number + 1) - 0.05)
            theirs, ours = (value - value.mean() for value in both)
            error = 100.0 * normalised_rms(ours, theirs)
            quantity = f"{name} at {12 + number} m/s, normalised rms error without mean"
            study.add(case, quantity, unit, theirs.std(), ours.std(), error, 5.0)


def turbulence(study):
    """Compare runs in 18 m/s turbulence, uniform and full-field, with waves of Hs 7.5 m.

    Allowed errors: standard deviations 3 %, energies of frequency bands 5 %, rms errors 10 %.
    """
    operating = (Channel.SPEED, Channel.BLADE, Channel.POWER, Channel.THRUST)
    for case in ("turb_18mps_Hs7.5_uniform", "turb_18mps_Hs7.5_box"):
        study.add_statistics(case, (*Channel.MOTIONS, *operating, *Channel.TENSIONS), ("std",), std=3.0)
        for channel in (Channel.PITCH, Channel.SPEED):
            name, unit, time, *both = study.series(case, channel, SETTLED)
            for band, (low, high) in BANDS.items():
                energies = [band_energy(time, value, low, high) for value in both]
                quantity = f"{name}, energy in {low:g} to {high:g} Hz ({band})"
                study.add(case, quantity, f"({unit})^2", *energies, allowed=5.0)
        study.add_statistics(case, (Channel.PITCH, Channel.SPEED), ("rms",), rms=10.0)


GROUPS = {  # name -> (function, number of runs)
    "decays": (decays, 6),
    "steady": (steady, 18),
    "floating": (floating, 2),
    "waves": (waves, 6),
    "steps": (steps, 1),
    "turbulence": (turbulence, 2),
    "tower": (tower_modes.oc3, 1),
    **elastic.groups(elastic.NREL5),
    "costs": (costs.cheaper_choices, 8),
}
PLATFORMS = {  # name -> function that returns (groups, runs)
    "oc3_hywind": lambda: (GROUPS, RUNS),
    "iea15_volturnus_s": lambda: (volturnus.GROUPS, volturnus.RUNS),
    "nrel5mw_iti_barge": lambda: (responses.groups("nrel5mw_iti_barge"), {}),
    "nrel5mw_oc4_semi": lambda: ({**responses.groups("nrel5mw_oc4_semi"), **oc4.GROUPS}, oc4.RUNS),
}


def validate_cases(groups=None, folder=None, bts=None, report=None, platform="oc3_hywind"):
    """Run the comparisons of a platform's groups (names; None: all but costs) and return their Study.

    folder: reference series (None: training/validation/reference); bts: path of the full TurbSim box, used
    instead of the stored region; report: called before each run with (text, runs done, total runs).
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
    study = Study(folder, bts, report, total, platform=platform, groups=tuple(names), cases=runs)
    for name in names:
        known[name][0](study)
    return study
