"""Compares turbines whose blades and tower bend with OpenFAST: steady wind, free decays, turbulence.

Runs are at fidelity "standard" with its default step; ROSCO, which another interval makes another controller,
is called as in OpenFAST, and the step is then that interval. OpenFAST's runs and their settings:
training/validation/reference/elastic. Both codes have the same degrees of freedom: blades="modes2" and
tower="modes2" are ElastoDyn's three modes a blade and two a direction.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fowt_env.controllers.rosco import Discon, Rosco
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.plant.state import BLADES
from fowt_env.run.simulation import simulate
from fowt_env.scene.blade_beam import section_at
from fowt_env.scene.build import build_scene
from fowt_env.training.evaluation.metrics import damage_equivalent_load
from fowt_env.training.validation.comparison import SETTLED, STATISTICS, TIME, name_and_unit, phase
from fowt_env.training.validation.openfast_cases import (
    hub_wind,
    reference,
    table,
    wave_components,
    without_rosco,
)
from fowt_env.training.validation.signal_errors import normalised_rms

PLACE = "elastic"
WINDS = (8, 12, 18, 24)  # m/s
TURNS, HARMONICS = 8, 6  # last whole turns of a steady run; harmonics fitted to them
STEADY, STEADY_STEP = 100.0, 0.05  # s, duration and output step of a steady run
FREE, FREE_STEP = 60.0, 0.05  # s, duration and output step of a free decay
POLE_STEP, FIRST_SECONDS = 0.1, 12.0  # s, samples of the fit of poles; record whose rms error is computed
COMMON_STEP = 0.2  # s, of this record: multiple of the steps of both codes
TURBULENT_STEP = 0.05  # s, of the statistics; the stored series have every second row
TIP = ("OoPDefl1_[m]", "IPDefl1_[m]")
ROOT = ("RootMyb1_[kN-m]", "RootMxb1_[kN-m]", "RootMyc1_[kN-m]", "RootMxc1_[kN-m]")
GAUGES = ("Spn1MLyb1_[kN-m]", "Spn1MLxb1_[kN-m]", "Spn2MLyb1_[kN-m]", "Spn2MLxb1_[kN-m]")
ROTOR = ("RotTorq_[kN-m]", "RtFldFxh_[N]")
SHAFT = "LSSTipMya_[kN-m]"
STANDARD_DEVIATIONS = (
    "RotSpeed_[rpm]", "GenPwr_[kW]", "BldPitch1_[deg]", "PtfmSurge_[m]", "PtfmHeave_[m]", "PtfmPitch_[deg]",
    "TTDspFA_[m]", "TwrBsMyt_[kN-m]",
)  # fmt: skip
REPORTED = (*TIP, *ROOT[:2], "RotThrust_[kN]", "RotTorq_[kN-m]", SHAFT, "YawBrMyp_[kN-m]", "TwrBsMxt_[kN-m]")
EXPONENTS = {  # of damage-equivalent loads
    "RootMyb1_[kN-m]": 10, "RootMxb1_[kN-m]": 10, "TwrBsMyt_[kN-m]": 4, "RotTorq_[kN-m]": 4, SHAFT: 4,
}  # fmt: skip
FURTHER = {"RootMyc1_[kN-m]": 10, "RootMxc1_[kN-m]": 10, "Spn2MLyb1_[kN-m]": 10, "TwrBsMxt_[kN-m]": 4}
SHEAR = 0.2  # exponent, of runs with and without individual pitch control
# s between calls of a controller at each step of OpenFAST. With individual pitch, at every second step ROSCO
# would read an acceleration biased by ServoDyn's extrapolation
EACH_STEP = 0.0125
# allowed errors, %
MEAN, AMPLITUDE, FREQUENCY, DEVIATION, SPEED_RMS, DAMAGE = 1.0, 3.0, 1.0, 2.0, 6.0, 5.0
RELIEF = 2.0  # percentage points


@dataclass(frozen=True)
class Machine:
    """Holds what the runs of one turbine have in common."""

    name: str  # of the reference files
    platform: str
    operating: dict  # wind, m/s: (rotor speed rpm, blade pitch deg)
    bent: dict  # wind, m/s: first tip deflection (out of plane, in plane), m
    released: tuple  # m, tip deflection (out of plane, in plane) at the start of free decays
    gauges: tuple  # fractions of the span, of Spn1 and Spn2: the middles of ElastoDyn's elements
    control_dt: float | None  # s, between calls of the controller; None: the default step
    shaft: str  # option of the turbulent runs
    under_rosco: bool

    def start(self, rotor_speed, pitches, deflection):
        """Return initial conditions: rotor speed rpm, blade pitches (3,) deg, tip deflections (2,) m."""
        pitches = {f"BldPitch{blade}": pitch for blade, pitch in enumerate(pitches, 1)}
        tips = dict(zip(("OoPDefl", "IPDefl"), deflection, strict=True))
        return {"start": "zero", "RotSpeed": rotor_speed, **pitches, **tips}

    def controller(self, dt, individual=False):
        """Return the controller of the turbulent runs, called every dt s."""
        if not self.under_rosco:
            return "openfast_oc3"
        turbine = read_turbine(read_platform(self.platform).turbine)
        deck = Discon(turbine.discon, individual)
        return Rosco(deck, dt, individual=individual, nodding=True)


IEA15 = Machine(
    "iea15", "iea15_volturnus_s",
    {8: (5.68, 0.0), 12: (7.56, 6.3), 18: (7.56, 15.4), 24: (7.56, 21.8)},
    {8: (9.0, 0.0), 12: (10.3, -1.3), 18: (3.6, -0.9), 24: (1.0, -0.5)}, (4.0, 2.0),
    (12.5 / 50.0, 24.5 / 50.0), 0.025, "rigid", True,
)  # fmt: skip
NREL5 = Machine(
    "nrel5mw", "oc3_hywind_openfast",
    {8: (9.208, 0.0), 12: (12.1, 3.963), 18: (12.1, 14.95), 24: (12.1, 22.141)},
    {8: (3.2, -0.4), 12: (4.0, -0.6), 18: (1.2, -0.6), 24: (0.0, -0.5)}, (2.0, 1.0),
    (4.5 / 17.0, 8.5 / 17.0), None, "torsion", False,
)  # fmt: skip


def with_gauges(scene, fractions):
    """Return the scene of bending blades with the sections of Spn1 and Spn2 at fractions of the span."""
    turbine, option, aero = scene.turbine, scene.options["blades"], scene.model.aero
    inner, outer = (section_at(turbine, option, fraction, aero) for fraction in fractions)
    return scene.with_model({"blades.inner": inner, "blades.outer": outer})


def _scene(machine, wind, **options):
    """Return the scene of a turbine as in OpenFAST's runs, at fidelity "standard" with its default step."""
    options = {"blades": "modes2", "skewed_wake": True, "shear_exponent": 0.0, **options}
    scene = build_scene(machine.platform, wind=wind, **{"fidelity": "standard", **options})
    return scene if options["blades"] == "rigid" else with_gauges(scene, machine.gauges)


def _held(scene):
    """Return the scene with platform and rotor speed held."""
    return scene.with_model({"rigid_body.platform_fixed": True, "rigid_body.rotor_fixed": True})


DRY = {"hydrodynamics": False, "mooring": False}


# ------------------------------------------------------------------------------------ steady wind


STEADY_CASES = {  # case: (wind m/s, blade pitches less that of the wind, deg, options)
    **{f"steady_{wind}mps": (wind, (0.0, 0.0, 0.0), {}) for wind in WINDS},
    # the same, compared with runs in which the load of AeroDyn's node at the very tip has no length
    **{f"steady_{wind}mps_tip": (wind, (0.0, 0.0, 0.0), {}) for wind in (18, 24)},
    "steady_12mps_shear": (12, (0.0, 0.0, 0.0), {"shear_exponent": 0.14}),
    "steady_12mps_shear_pitches": (12, (2.0, -1.0, 0.0), {"shear_exponent": 0.14}),
    "steady_12mps_2modes": (12, (0.0, 0.0, 0.0), {"blades": "modes"}),
}


def turns(frame, rotor_speed):
    """Return {channel: (mean, complex first harmonic over the azimuth)} of the last turns; speed rpm."""
    kept = frame[frame[TIME] > frame[TIME].iloc[-1] - TURNS * 60.0 / rotor_speed]
    angle = np.radians(kept["Azimuth_[deg]"].to_numpy())
    waves = [f(order * angle) for order in range(1, HARMONICS + 1) for f in (np.cos, np.sin)]
    basis = np.column_stack([np.ones_like(angle), *waves])
    found = {}
    for channel in (*TIP, *ROOT, *GAUGES, *ROTOR, SHAFT):
        mean, cosine, sine, *_ = np.linalg.lstsq(basis, kept[channel].to_numpy(), rcond=None)[0]
        found[channel] = float(mean), complex(cosine, -sine)
    return found


def steady_run(machine, case, **options):
    """Return the frame of a steady case with platform, tower and rotor speed held."""
    wind, more, chosen = STEADY_CASES[case]
    rotor_speed, pitch = machine.operating[wind]
    scene = _held(_scene(machine, {"kind": "steady", "speed": float(wind)}, **DRY, **chosen, **options))
    pitches = [pitch + extra for extra in more]
    return simulate(
        scene, controller=None, duration=STEADY, control_dt=STEADY_STEP, output_dt=STEADY_STEP,
        initial=machine.start(rotor_speed, pitches, machine.bent[wind]),
    )  # fmt: skip


def bending(study, machine):
    """Compare steady wind: means 1 %, first harmonics 3 % of tip deflections, root and span moments.

    A mean is compared relative to the larger of its size and that of the first harmonic: some means are near
    zero. Torque, thrust and shaft, whose other part is zero: likewise.
    """
    stored = table(f"{PLACE}/steady.csv.gz", study.folder).set_index(["case", "channel"])
    for case, (wind, *_) in STEADY_CASES.items():
        study.say(f"{machine.name}, {case}, bending blades")
        moments, words = turns(steady_run(machine, case), machine.operating[wind][0]), f"blades, {case}"
        for channel in moments:
            (name, unit), row = name_and_unit(channel), stored.loc[f"{machine.name}/{case}", channel]
            (here, wave), there, theirs = moments[channel], row["mean"], complex(row["cos1"], -row["sin1"])
            if channel != SHAFT:
                error = 100.0 * (here - there) / max(abs(there), abs(theirs))
                study.add(words, f"{name}, mean", unit, there, here, error, MEAN)
            if channel not in ROTOR:
                sizes, note = (abs(theirs), abs(wave)), phase(wave, theirs)
                quantity = f"{name}, first harmonic over the azimuth"
                study.add(words, quantity, unit, *sizes, allowed=AMPLITUDE, note=note)


# -------------------------------------------------------------------------------------- free decays


DECAY_CASES = {  # case: (whether the rotor turns at rated speed, blade pitch deg, option blades)
    "decay_rest": (False, 0.0, "modes2"),
    "decay_rated": (True, 0.0, "modes2"),
    "decay_rated_pitch15": (True, 15.0, "modes2"),
    "decay_rated_2modes": (True, 0.0, "modes"),
}
MODES = {"modes2": ("first flap", "first edge", "second flap"), "modes": ("first flap", "first edge")}
FREE_CHANNELS = {  # column of the reference: ours
    "TipDxc1_[m]": "OoPDefl1_[m]", "TipDyc1_[m]": "IPDefl1_[m]",
    **{name: name for name in ("RootMyb1_[kN-m]", "RootMxb1_[kN-m]", "RootFzc1_[kN]")},
}  # fmt: skip


def poles(time, values):
    """Return [(frequency Hz, damping ratio)] of a free decay, second half of the record, by frequency.

    values (n, m): m independent outputs of m modes. Poles of a linear system with a constant, as in
    reference/make_elastic.py (Hua and Sarkar, IEEE Trans. Signal Process. 39, 1991).
    """
    late = values[time >= 0.5 * time[-1]][:: round(POLE_STEP / (time[1] - time[0]))]
    late = late / late.std(axis=0)
    windows = [np.lib.stride_tricks.sliding_window_view(column, len(late) // 2) for column in late.T]
    space = np.linalg.svd(np.vstack(windows), full_matrices=False)[2][: 2 * late.shape[1] + 1].T
    shift = np.linalg.lstsq(space[:-1], space[1:], rcond=None)[0]
    found = np.log(np.linalg.eigvals(shift).astype(complex)) / POLE_STEP
    found = sorted(found[found.imag > 0.1], key=abs)
    return [(abs(pole) / (2.0 * np.pi), -pole.real / abs(pole)) for pole in found]


def free_run(machine, case, **options):
    """Return the frame of a free decay without air and gravity, from bent blades."""
    rated, pitch, blades = DECAY_CASES[case]
    scene = _held(_scene(machine, None, blades=blades, **DRY, **options))
    scene = scene.with_model({"rigid_body.gravity": 0.0})
    rotor_speed = machine.operating[12][0] if rated else 0.0
    return simulate(
        scene, controller=None, duration=FREE, control_dt=FREE_STEP, output_dt=FREE_STEP,
        initial=machine.start(rotor_speed, (pitch,) * BLADES, machine.released),
    )  # fmt: skip


def _every(frame, step):
    """Return the rows of a frame, whose first column is the time, at multiples of a step, s."""
    time = frame.iloc[:, 0].to_numpy()
    return frame.iloc[:: round(step / (time[1] - time[0]))].reset_index(drop=True)


def blade_decays(study, machine):
    """Compare free decays of bent blades: frequencies 1 %; damping ratios and the first 12 s are reported."""
    stored = table(f"{PLACE}/blade_modes.csv.gz", study.folder)
    for case, (_, _, blades) in DECAY_CASES.items():
        study.say(f"{machine.name}, {case}")
        theirs = table(f"{PLACE}/{machine.name}_{case}.csv.gz", study.folder)
        ours = free_run(machine, case)
        outputs = ours[list(FREE_CHANNELS.values())[: len(MODES[blades])]]
        found = poles(ours[TIME].to_numpy(), outputs.to_numpy())
        rows = stored[stored["case"] == f"{machine.name}/{case}"].to_dict("records")
        for mode, (frequency, ratio), row in zip(MODES[blades], found, rows, strict=True):
            there = row["frequency_Hz"]
            study.add(f"blades, {case}", f"{mode}, frequency", "Hz", there, frequency, allowed=FREQUENCY)
            study.add(f"blades, {case}", f"{mode}, damping ratio", "-", row["damping_ratio"], ratio)
        early = _every(ours[ours[TIME] <= FIRST_SECONDS + 1e-6], COMMON_STEP)
        same = _every(theirs, COMMON_STEP)
        for channel, mine in FREE_CHANNELS.items():
            (name, unit), both = name_and_unit(channel), (same[channel], early[mine])
            error = 100.0 * normalised_rms(both[1], both[0])
            quantity = f"{name}, {STATISTICS['rms']} of the first {FIRST_SECONDS:g} s"
            study.add(f"blades, {case}", quantity, unit, *(values.std() for values in both), error)


# --------------------------------------------------------------------------------------- turbulence


def turbulent_wind(wind, folder=None):
    """Return the wind specification of the hub wind of a turbulent run, m/s, blown uniformly."""
    if wind == 18:
        return hub_wind(folder)
    frame = table(f"{PLACE}/wind_hub_{wind}mps.csv.gz", folder)
    return {"kind": "series", "time": frame["time_s"].to_numpy(), "speed": frame["u_mps"].to_numpy()}


def turbulent_run(machine, wind, duration, folder=None, individual=False, **options):
    """Return the frame of a turbulent run in waves under the controller of the reference."""
    options = {"tower": "modes2", "shaft": machine.shaft, **options}
    rotor_speed, pitch = machine.operating[wind]
    scene = _scene(machine, turbulent_wind(wind, folder), sea=wave_components(folder), **options)
    dt = scene.dt if machine.control_dt is None else machine.control_dt
    return simulate(
        scene, controller=machine.controller(dt, individual), duration=duration, control_dt=dt,
        output_dt=TURBULENT_STEP,
        initial=machine.start(rotor_speed, (pitch,) * BLADES, machine.bent[wind]),
    )  # fmt: skip


def _damage(frame, channel, exponent):
    """Return the damage-equivalent load at 1 Hz of a channel of a frame."""
    time = frame[TIME].to_numpy()
    return damage_equivalent_load(frame[channel].to_numpy(), time[-1] - time[0], exponent)


def compare_turbulence(study, machine, case, ours, words="elastic"):
    """Add the rows of a turbulent run, and keep its series for the plots."""
    stored = table(f"{PLACE}/{machine.name}_turbulent.csv.gz", study.folder)
    stored = stored[stored["case"] == f"{machine.name}/{case}"].set_index("channel")
    theirs = reference(f"{machine.name}_{case}", study.folder, PLACE)
    ours = ours[ours[TIME] >= SETTLED - 1e-6].reset_index(drop=True)
    coarse = ours.iloc[:: (len(ours) - 1) // (len(theirs) - 1)].reset_index(drop=True)
    words = f"{words}, {case}"
    study.runs[words] = coarse, theirs
    for channel in (*STANDARD_DEVIATIONS, *REPORTED):
        (name, unit), there, here = name_and_unit(channel), stored.loc[channel], ours[channel]
        allowed = DEVIATION if channel in STANDARD_DEVIATIONS else float("nan")
        study.add(words, f"{name}, mean", unit, there["mean"], here.mean(), note="")
        quantity = f"{name}, {STATISTICS['std']}"
        study.add(words, quantity, unit, there["std"], here.std(ddof=0), allowed=allowed)
        if channel in theirs:
            error = 100.0 * normalised_rms(coarse[channel], theirs[channel])
            allowed = SPEED_RMS if channel == STANDARD_DEVIATIONS[0] else float("nan")
            sizes = theirs[channel].std(), coarse[channel].std()
            study.add(words, f"{name}, {STATISTICS['rms']}", unit, *sizes, error, allowed)
    for channel, exponent in (EXPONENTS | FURTHER).items():
        name, unit = name_and_unit(channel)
        quantity = f"{name}, damage-equivalent load, exponent {exponent}"
        allowed = DAMAGE if channel in EXPONENTS else float("nan")
        both = stored.loc[channel, "DEL"], _damage(ours, channel, exponent)
        study.add(words, quantity, unit, *both, allowed=allowed)


def turbulence(study, machine, words="elastic", **options):
    """Compare turbulence and waves at 8 to 24 m/s: deviations 2 %, rotor speed 6 % rms, damage 5 %.

    words: before the names of the cases. options: of build_scene.
    """
    if machine.under_rosco and without_rosco():
        study.say("without ROSCO: its library is not installed")
        return
    for wind in WINDS:
        case = f"turb_{wind}mps"
        study.say(f"{machine.name}, {case}, bending blades and tower")
        frame = turbulent_run(machine, wind, 600.0, study.folder, **options)
        compare_turbulence(study, machine, case, frame, words)


def _of_each_blade(channel):
    """Return the channels of all blades like one of the first blade; others alone."""
    each = [channel.replace("1_", f"{blade}_") for blade in range(1, BLADES + 1)]
    return each if channel.startswith("Root") else [channel]


def relief(study, machine):
    """Compare what individual pitch control takes from damage-equivalent loads: within 2 points.

    Of roots this is the mean over the blades: with exponent 10 the load of one blade is that of a few cycles.
    """
    if without_rosco():
        study.say("without ROSCO: its library is not installed")
        return
    stored = table(f"{PLACE}/{machine.name}_turbulent.csv.gz", study.folder)
    stored = stored.set_index(["case", "channel"])
    cases = "turb_18mps_shear", "turb_18mps_shear_ipc"
    machine, frames = replace(machine, control_dt=EACH_STEP), []
    for case in cases:
        study.say(f"{machine.name}, {case}")
        individual = case.endswith("ipc")
        frame = turbulent_run(machine, 18, 400.0, study.folder, individual, shear_exponent=SHEAR)
        compare_turbulence(study, machine, case, frame)
        frames.append(frame[frame[TIME] >= SETTLED - 1e-6])
    words, nothing = "elastic, relief by individual pitch", float("nan")
    for channel, exponent in (EXPONENTS | FURTHER).items():
        each = _of_each_blade(channel)
        for load, key, size in (
            ("damage-equivalent load", "DEL", lambda frame, name, m=exponent: _damage(frame, name, m)),
            (STATISTICS["std"], "std", lambda frame, name: frame[name].std(ddof=0)),
        ):
            change = f"change of the {load} (error: points)"
            there = [
                _change(*(stored.loc[(f"{machine.name}/{case}", c), key] for case in cases)) for c in each
            ]
            here = [_change(*(size(frame, c) for frame in frames)) for c in each]
            for one, *both in zip(each, there, here, strict=True):
                study.add(words, f"{name_and_unit(one)[0]}, {change}", "%", *both, both[1] - both[0], nothing)
            if len(each) > 1:
                both, allowed = (np.mean(there), np.mean(here)), RELIEF if key == "DEL" else nothing
                name = f"{name_and_unit(channel)[0][:-1]}, mean over the blades, {change}"
                study.add(words, name, "%", *both, both[1] - both[0], allowed)


def _change(without, controlled):
    """Return the change by control, %."""
    return 100.0 * (controlled / without - 1.0)


def groups(machine):
    """Return the groups {name: (function, number of runs)} of a turbine."""
    found = {
        "bending": (partial(bending, machine=machine), len(STEADY_CASES)),
        "blade_decays": (partial(blade_decays, machine=machine), len(DECAY_CASES)),
        "elastic": (partial(turbulence, machine=machine), len(WINDS)),
    }
    if machine is IEA15:  # whose hull has no strips
        return found | {"relief": (partial(relief, machine=machine), 2)}
    at_each_step = replace(machine, control_dt=EACH_STEP)
    as_openfast = partial(turbulence, machine=at_each_step, words="as OpenFAST", strip_axis="undisplaced")
    return found | {"as_openfast": (as_openfast, len(WINDS))}
