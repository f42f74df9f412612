"""Compares the IEA 15 MW on VolturnUS-S with OpenFAST v5 runs of the public deck and ROSCO's linear models.

Settings of the runs are in the headers of the series. Nothing is tuned to fit.
"""

from math import pi

import numpy as np

from fowt_env.analysis.rotor_loads import rotor_loads
from fowt_env.controllers import make
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import RPM
from fowt_env.scene.build import build_scene
from fowt_env.training.validation import elastic
from fowt_env.training.validation.blade_loads import blades
from fowt_env.training.validation.comparison import Channel, name_and_unit
from fowt_env.training.validation.linear_cases import linear
from fowt_env.training.validation.openfast_cases import (
    ReferenceRun,
    hub_wind,
    rotor_start,
    table,
    wave_components,
    without_rosco,
)
from fowt_env.training.validation.signal_errors import normalised_rms, recovery
from fowt_env.training.validation.tower_modes import volturnus as tower

PLATFORM = "iea15_volturnus_s"
DT = 0.025  # s, as in OpenFAST
# as in the OpenFAST runs: wake skewed by the shaft tilt, uniform wind
OPTIONS = {"skewed_wake": True, "shear_exponent": 0.0}
BENDING = {**OPTIONS, "tower": "modes"}
DECAYS = {  # case: (channel, start value, seconds, step of the reference)
    "decay_surge": (Channel.SURGE, 10.0, 600.0, 0.2),
    "decay_heave": (Channel.HEAVE, 3.0, 200.0, 0.1),
    "decay_pitch": (Channel.PITCH, 5.0, 300.0, 0.1),
    "decay_yaw": (Channel.YAW, 8.0, 500.0, 0.2),
}
WAVE = {"kind": "regular", "H": 4.0, "T": 9.0}
WAVE_WINDOW = (302.0, 499.9)  # s, twenty-two periods
STEP, WAKE_SETTLED = 20.0, 100.0  # s: time of the step of wind or blade pitch; run before the record
WAKES = {  # case: whether limits apply
    "wake_pitch_step": True,
    "wake_pitch_step_18mps": True,
    "wake_wind_step_18mps_mended": True,
    "wake_wind_step_18mps": False,  # see `wake`
}
CONTROLLED = ("float_steady_12mps", "float_steady_18mps", "turb_18mps_Hs7.5_uniform")


def _run(case, duration, **settings):
    """Return a ReferenceRun of this platform."""
    settings = {"platform": PLATFORM, "place": PLATFORM, "options": OPTIONS, **settings}
    return ReferenceRun(case, duration, DT, **settings)


def rosco(folder):
    """Return the ROSCO library as a controller with DISCON.IN and rotor table of the deck."""
    return make("rosco", read_turbine(read_platform(PLATFORM).turbine), DT)


def _wake(case, wind, rotor_speed, pitches):
    """Return a ReferenceRun at fixed rotor speed: wind rises, or blade pitch changes at 2 deg/s."""
    begin = WAKE_SETTLED + STEP
    if not isinstance(wind, float):
        times = [0.0, begin, begin + 1.0, begin + 200.0]
        wind = {"kind": "series", "time": times, "speed": [wind[0], *wind, wind[1]]}
    first, last = np.radians(pitches)

    def pitch(measurement):
        travel = np.radians(2.0) * max(measurement.time - begin, 0.0)
        return 0.0, first + np.sign(last - first) * min(travel, abs(last - first))

    return _run(
        case, 120.0, before=WAKE_SETTLED, held=True, wind=wind, controlled=True,
        controller=lambda folder: pitch, initial={"RotSpeed": rotor_speed, "BldPitch1": pitches[0]},
        options={**OPTIONS, "dynamic_inflow": True, "hydrodynamics": False, "mooring": False},
    )  # fmt: skip


UNDER_ROSCO = {"controlled": True, "controller": rosco}
TURBULENT = {
    "wind": hub_wind, "sea": wave_components,
    "initial": rotor_start(7.56, 15.4), **UNDER_ROSCO,
}  # fmt: skip
RUNS = {
    run.case: run
    for run in (
        _run("static", 600.0, output_dt=0.2),
        *(
            _run(case, seconds, initial={channel: start}, output_dt=step)
            for case, (channel, start, seconds, step) in DECAYS.items()
        ),
        _run("decay_pitch_tower", 300.0, initial={Channel.PITCH: 5.0}, options=BENDING),
        _run("regwave_H4T9", 500.0, sea=WAVE),
        _run("waves_Hs7.5", 600.0, sea=wave_components, output_dt=0.2),
        _run("waves_Hs7.5_qtf", 600.0, sea=wave_components, output_dt=0.2,
             options={**OPTIONS, "second_order": "full"}),
        _run("float_steady_12mps", 600.0, wind=12.0, initial=rotor_start(7.56, 6.3), **UNDER_ROSCO),
        _run("float_steady_18mps", 600.0, wind=18.0, initial=rotor_start(7.56, 15.4), **UNDER_ROSCO),
        _run("turb_18mps_Hs7.5_uniform", 600.0, **TURBULENT),
        _run("turb_18mps_Hs7.5_uniform_tower", 600.0, **TURBULENT, options=BENDING),
        _wake("wake_pitch_step", 10.0, 7.05, (0.0, 3.0)),
        _wake("wake_pitch_step_18mps", 18.0, 7.56, (15.4, 13.4)),
        _wake("wake_wind_step_18mps", (17.0, 19.0), 7.56, (15.4, 15.4)),
        _wake("wake_wind_step_18mps_mended", (17.0, 19.0), 7.56, (15.4, 15.4)),
    )
}  # fmt: skip


def rest(study):
    """Compare the mean position in still water: surge and heave 0.02 m, platform pitch 0.02 deg.

    Means of the last 540 s (four surge periods) and of the last 50 s, in which the platform still moves.
    """
    for start, words in ((60.0, "last 540 s"), (550.0, "last 50 s")):
        for channel in Channel.PLANE:
            name, unit, _, *both = study.series("static", channel, start)
            there, here = (value.mean() for value in both)
            apart, allowed = f"{here - there:+.4f} {unit}; allowed 0.02 {unit}", 100.0 * 0.02 / abs(there)
            study.add("static", f"{name}, mean of the {words}", unit, there, here, None, allowed, apart)


def decays(study):
    """Compare free decays: period 0.5 %, logarithmic decrement 5 %, rms error 4 %."""
    for case, (channel, _, seconds, _) in DECAYS.items():
        study.add_decay(case, channel, seconds, period=0.5, decrement=5.0, rms=4.0)


# straight blade of the ElastoDyn summary file: kg, m from the root, kg m2 about the root
BLADE_MASS, BLADE_CENTRE, BLADE_SQUARE = 68507.6, 27.601, 101086645.0
GRAVITY = 9.81
AZIMUTHS = 24


def _rotor_means(scene, rotor_speed, pitch):
    """Return means over a revolution: force, moment, root moment of blade 1 (mean, cos, sin), N and N m."""
    angles = 2.0 * pi * np.arange(AZIMUTHS) / AZIMUTHS
    loads = [rotor_loads(scene, rotor_speed, pitch, azimuth) for azimuth in angles]
    force, moment = (np.mean([getattr(load, name) for load in loads], axis=0) for name in ("force", "moment"))
    flap = np.array([load.root_out_of_plane[0] for load in loads])
    waves = (1.0, 2.0 * np.cos(angles), 2.0 * np.sin(angles))
    return force, moment, [np.mean(flap * wave) for wave in waves]


def _structural_flap(rotor, rotor_speed):
    """Return (mean, cos part) of the root moment due to weight and rotation of a straight blade, N m."""
    tilt, cone = rotor.shaft_tilt, rotor.cone
    first = BLADE_MASS * BLADE_CENTRE
    # weight: g sin(tilt) along the shaft, g cos(tilt) cos(azimuth) along the radius
    mean = first * GRAVITY * np.sin(tilt) * np.cos(cone)
    cosine = -first * GRAVITY * np.cos(tilt) * np.sin(cone)
    turning = rotor_speed**2 * np.sin(cone) * np.cos(cone) * (BLADE_SQUARE + rotor.hub_radius * first)
    return mean + turning, cosine


def rotor(study):
    """Compare rotor loads and root moments on a fixed platform in steady wind: 0.5 %, in sheared wind 2 %."""
    for row in table(f"{PLATFORM}/steady.csv.gz", study.folder).to_dict("records"):
        study.say(f"rotor, {row['case']}")
        scene = build_scene(
            PLATFORM, wind={"kind": "steady", "speed": row["wind_mps"]}, fidelity="reference",
            **{**OPTIONS, "shear_exponent": row["shear_exponent"]},
        )  # fmt: skip
        speed = row["rotor_speed_rpm"] * RPM
        pitches = [np.radians(row[f"blade_pitch{k}_deg"]) for k in (1, 2, 3)]
        means = {pitch: _rotor_means(scene, speed, pitch) for pitch in dict.fromkeys(pitches)}
        force, moment = (np.mean([means[pitch][k] for pitch in pitches], axis=0) for k in (0, 1))
        plain = row["shear_exponent"] == 0.0 and row["blade_pitch1_deg"] == row["blade_pitch3_deg"]
        case = f"steady_{row['wind_mps']:g}mps" if plain else f"rotor, {row['case']}"
        allowed = 2.0 if row["shear_exponent"] else 0.5
        _hub_rows(study, case, allowed, row, force, moment)
        if not np.isfinite(row["root1_My_kNm"]):
            continue
        # out-of-plane root moments: aerodynamic, plus weight and rotation of a rigid blade
        mean, cosine = _structural_flap(scene.turbine.rotor, speed)
        flaps = [means[pitch][2] for pitch in pitches]
        for number, flap in enumerate(flaps, 1):
            there, here = row[f"root{number}_My_kNm"], 1e-3 * (flap[0] + mean)
            study.add(case, f"RootMyc{number}, mean over a revolution", "kN-m", there, here, allowed=allowed)
        for part, here in (("cos", 1e-3 * (flaps[0][1] + cosine)), ("sin", 1e-3 * flaps[0][2])):
            there, words = row[f"root1_My_kNm_{part}"], f"RootMyc1, {part} over the azimuth, of the mean"
            error = 100.0 * (here - there) / row["root1_My_kNm"]
            study.add(case, words, "kN-m", there, here, error, allowed)


def _hub_rows(study, case, allowed, row, force, moment):
    """Add rows of thrust, torque, hub moments and forces; errors are relative to a value that is not zero."""
    thrust, torque = row["aero_thrust_N"], row["aero_torque_Nm"]
    size = np.hypot(row["aero_My_Nm"], row["aero_Mz_Nm"])
    for quantity, column, here, scale in (
        ("aerodynamic thrust", "aero_thrust_N", force[0], thrust),
        ("aerodynamic torque", "aero_torque_Nm", moment[0], torque),
        # either moment may be zero; the note has the error relative to the torque
        ("tilting moment at the hub, of both moments", "aero_My_Nm", moment[1], size),
        ("yawing moment at the hub, of both moments", "aero_Mz_Nm", moment[2], size),
        ("side force at the hub, of the thrust", "aero_Fy_N", force[1], thrust),
        ("upward force at the hub, of the thrust", "aero_Fz_N", force[2], thrust),
    ):
        there, unit = row[column], "kN-m" if column.endswith("Nm") else "kN"
        note = f"{100.0 * (here - there) / torque:+.3f} % of the torque" if scale is size else ""
        error = 100.0 * (here - there) / scale
        study.add(case, quantity, unit, 1e-3 * there, 1e-3 * here, error, allowed, note)


def regular(study):
    """Compare a regular wave, H 4 m, T 9 s: first harmonics of surge, heave and platform pitch 1 %."""
    study.add_harmonics("regwave_H4T9", Channel.PLANE, WAVE["T"], WAVE_WINDOW)


def waves(study):
    """Compare motions in irregular waves, Hs 7.5 m: standard deviations after 100 s 2 %, with the QTF 5 %."""
    for case, allowed in (("waves_Hs7.5", 2.0), ("waves_Hs7.5_qtf", 5.0)):
        study.add_statistics(case, Channel.PLANE, std=allowed)


def floating(study):
    """Compare floating runs with ROSCO, 12 and 18 m/s and turbulence: standard deviations 3 %.

    Of turbulence also sway, roll and yaw, which the torque drives.
    """
    if without_rosco():  # an optional dependency of this group
        study.say("without ROSCO: its library is not installed")
        return
    channels = (*Channel.PLANE, Channel.SPEED, Channel.BLADE, Channel.POWER, Channel.THRUST)
    for case in CONTROLLED:
        lateral = Channel.LATERAL if case.startswith("turb") else ()
        study.add_statistics(case, (*channels, *lateral), note="with ROSCO", std=3.0)


def wake(study):
    """Compare dynamic inflow at steps of pitch and wind: steady loads 0.5 %, overshoot 5 %, decay time 10 %.

    AeroDyn computes time constants from the mean induction of the disk, fowt_env per element: at 0.3, an
    induction higher by 0.05 raises them by 11 %. OpenFAST v5.0.0 updates the wake with the same wind at both
    ends of a time step, so that the term 0.6 tau_1 dW/dt of the filter misses a gust: this run is only
    reported, and limits apply to a run of a corrected AeroDyn.
    """
    words = ("before the step", "long after it", "overshoot", "time of the overshoot")
    for case, judged in WAKES.items():
        limits = (0.5, 0.5, 5.0, 10.0) if judged else (np.nan,) * 4
        for channel in (Channel.THRUST, Channel.TORQUE):
            name, unit, time, *both = study.series(case, channel)
            results = zip(*(recovery(time, value, STEP, 100.0) for value in both), strict=True)
            for what, its_unit, pair, allowed in zip(
                words, (unit,) * 3 + ("s",), results, limits, strict=True
            ):
                study.add(case, f"{name}, {what}", its_unit, *pair, allowed=allowed)
            study.add_statistics(case, (channel,), ("rms",), STEP, words=" after the step")


def memory(study):
    """Compare state-space radiation with convolution, in decays and an irregular sea: rms error 1 %."""
    words = "radiation memory as states (against convolution)"
    for case in ("decay_surge", "decay_heave", "decay_pitch", "waves_Hs7.5"):
        frames = []
        for kind in ("convolution", "state_space"):
            study.say(f"{case}, radiation by {kind}")
            frames.append(RUNS[case].frame(study.folder, radiation=kind))
        for channel in Channel.PLANE if case.startswith("waves") else (DECAYS[case][0],):
            name, unit = name_and_unit(channel)
            reference, fast = (frame[channel] for frame in frames)
            quantity, error = f"{name}, rms error over the deviation, {case}", normalised_rms(fast, reference)
            study.add(words, quantity, unit, reference.std(), fast.std(), 100.0 * error, 1.0)


GROUPS = {  # name -> (function, number of runs)
    "rest": (rest, 1),
    "decays": (decays, 4),
    "regular": (regular, 1),
    "waves": (waves, 2),
    "rotor": (rotor, 8),
    "blades": (blades, 6),
    "floating": (floating, 3),
    "tower": (tower, 2),
    "wake": (wake, 4),
    "linear": (linear, 5),
    "memory": (memory, 8),
    **elastic.groups(elastic.IEA15),
}
