"""Runs the load cases of the paper: LC1 to LC12 on the 1:50 model, and full scale (Figures 13 to 16).

Rotor speed and blade pitch are prescribed at model scale, theory.md Eq. (20). A run starts at the steady
state in the mean wind; waves start at full height, as from a wave maker, so that records contain a start-up
transient. Turbulence intensity is 3 %, an assumption: the paper states "low" without a value.
"""

from functools import partial
from math import hypot, pi
from typing import NamedTuple

import numpy as np
import pandas as pd

import fowt_env
from fowt_env.analysis.trim import trim_prescribed
from fowt_env.descriptions.checks import parse_names
from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.units import DEGREE, RPM
from fowt_env.errors import InputError, unknown
from fowt_env.plant.mooring import catenary
from fowt_env.training.validation.comparison import COMBINATIONS, TIME, Channel
from fowt_env.training.validation.signal_errors import harmonics
from fowt_env.visual.time_series import spectrum
from fowt_env.weather.turbulence import turbulence

PLATFORM = "liu_1_50"
SURGE, PITCH, MOTION_CHANNELS = Channel.SURGE, Channel.PITCH, Channel.MOTIONS
DURATION = 500.0  # s at model scale, 59 min at full scale
SKIP = 100.0  # s omitted from statistics, ten surge periods
SEGMENT = 125.0  # s of a spectrum's window: 12 surge periods
STEP, OUTPUT = 0.01, 0.05  # s; 0.07 and 0.35 s at full scale
INTENSITY = 0.03  # turbulence intensity, an assumption
FULL_SCALE = "full_scale"


class LoadCase(NamedTuple):
    """Defines a load case at model scale (Table 2 of the paper); wind in m/s, None: no wind."""

    wind: float | None
    rotor_rpm: float = 0.0
    blade_pitch_deg: float = 0.0
    sea: dict | None = None


SEAS = (
    {"kind": "regular", "H": 0.06, "T": 1.07},
    {"kind": "jonswap", "Hs": 0.11, "Tp": 1.5, "gamma": 2.8},
    {"kind": "jonswap", "Hs": 0.14, "Tp": 1.7, "gamma": 3.3},
    {"kind": "jonswap", "Hs": 0.18, "Tp": 2.18, "gamma": 3.8},
)
WINDS = ((2.02, 62.8, 0.0), (3.36, 85.6, 0.0), (3.56, 85.6, 14.9), (5.93, 0.0, 90.0))
CASES = {
    f"LC{i}": LoadCase(*case)
    for i, case in enumerate(
        (
            *WINDS,
            *((None, 0.0, 0.0, sea) for sea in SEAS),
            *((*wind, sea) for wind, sea in zip(WINDS, SEAS, strict=True)),
        ),
        1,
    )
}
GROUPS = {"wind": (*CASES,)[:4], "waves": (*CASES,)[4:8], "wind and waves": (*CASES,)[8:]}


def wanted_cases(text):
    """Return the case names selected by "LC5", "LC1,LC2", "all" or "full_scale". Raises: InputError."""
    names = parse_names(text)
    if not names:
        raise InputError(f"case = {text!r}: must name at least one case, e.g. LC5, all or {FULL_SCALE}")
    chosen = []
    for name in names:
        key = name.upper() if name.upper() in CASES else name.lower()
        if key == "all":
            chosen += [*CASES]
        elif key in CASES or key == FULL_SCALE:
            chosen.append(key)
        else:
            raise unknown("case of the paper", name, (*CASES, "all", FULL_SCALE))
    return list(dict.fromkeys(chosen))


def run_load_case(name, **options):
    """Simulate a model-scale load case from its steady state; return a DataFrame. options: of build_scene.

    The wind is rotor-averaged Kaimal turbulence of low intensity.
    """
    case, platform, wind = CASES[name], read_platform(PLATFORM), None
    if case.wind is not None:
        rotor = read_turbine(platform.turbine).rotor
        period, value = turbulence(
            case.wind, INTENSITY * case.wind, height=rotor.hub_height, diameter=2.0 * rotor.tip_radius,
            period=DURATION, seed=1, shear_turbulence=False,
        )  # fmt: skip
        time = np.linspace(0.0, period, len(value))
        wind = {"kind": "series", "time": time, "speed": case.wind + value[:, 0]}
    options = {"fidelity": "standard", "integrator": "rk4", "duration": DURATION} | options
    scene = fowt_env.build_scene(platform, wind=wind, sea=case.sea, seed=1, **options)
    point = trim_prescribed(scene, case.rotor_rpm * RPM, case.blade_pitch_deg * DEGREE)
    motions = [column.split("_[")[0] for column in MOTION_CHANNELS]
    initial = {"start": "zero"} | {motion: point[motion] for motion in motions}
    initial |= {"RotSpeed": case.rotor_rpm, "BldPitch1": case.blade_pitch_deg}
    return fowt_env.simulate(
        scene, controller=None, duration=DURATION, dt=STEP, control_dt=0.1, output_dt=OUTPUT, initial=initial
    )


def settled(frame, skip=SKIP):
    """Return the rows after skip seconds."""
    return frame[frame[TIME] >= skip - 1e-6]


def statistics(runs):
    """Return a DataFrame of mean, standard deviation, extremes and quartiles of channels of {case: frame}."""
    rows = []
    for case, frame in runs.items():
        part = settled(frame)
        for channel in (*MOTION_CHANNELS, "RtFldFxh_[N]", *part.filter(regex="^FAIRTEN")):
            x = part[channel].to_numpy()
            low, q1, median, q3, high = np.percentile(x, (0.0, 25.0, 50.0, 75.0, 100.0))
            rows.append({
                "case": case, "channel": channel, "mean": x.mean(), "std": x.std(), "min": low,
                "q1": q1, "median": median, "q3": q3, "max": high,
            })  # fmt: skip
    return pd.DataFrame(rows)


def case_spectrum(frame, channel):
    """Return (frequency in Hz, power density) of a channel."""
    return spectrum(frame[TIME], frame[channel], segment=SEGMENT)


def prominence(frame, channel, frequency, width=0.1, reach=0.35):
    """Return the height of a spectral peak near a frequency (Hz) over its surroundings, above 1 for a peak.

    Largest density within width (relative) of the frequency, divided by the larger of the median densities
    on both sides, up to reach (relative). 0 if the largest is at the edge, i.e. a slope and no peak.
    """
    f, density = case_spectrum(frame, channel)
    near = np.flatnonzero(np.abs(f / frequency - 1.0) <= width)
    top = near[np.argmax(density[near])]
    if not density[top] > max(density[top - 1], density[top + 1]):
        return 0.0
    left = density[(f < f[near[0]]) & (f >= (1.0 - reach) * frequency)]
    right = density[(f > f[near[-1]]) & (f <= (1.0 + reach) * frequency)]
    return float(density[top] / max(np.median(left), np.median(right)))


PEAK = 2.0  # minimum height of a peak over its surroundings ...
VISIBLE = 1e-5  # ... and over the highest one: five decades of a logarithmic axis


class PaperClaim(NamedTuple):
    """Holds a qualitative claim of the paper, the result here, and whether the claim holds."""

    figure: str
    text: str
    found: str
    holds: bool


class PaperStudy(NamedTuple):
    """Holds the runs and claims of `fowt dev paper`."""

    runs: dict  # model-scale case -> frame
    claims: list
    full: dict  # name, or combination of wave kinematics -> frame


def natural_frequencies():
    """Return the natural frequencies {motion: Hz} of the 1:50 model."""
    scene = fowt_env.build_scene(PLATFORM, fidelity="reference")
    return {motion: 1.0 / period for motion, period in fowt_env.natural_periods(scene).items()}


def claims(runs, natural):
    """Return [PaperClaim] of section 8 for the available model-scale runs.

    natural: natural_frequencies().
    """
    available, results = set(runs), []
    wind, waves, both = GROUPS.values()
    pitch = {name: settled(frame)[PITCH].to_numpy() for name, frame in runs.items()}
    mean, std = ({name: getattr(x, of)() for name, x in pitch.items()} for of in ("mean", "std"))

    def claim(figure, text, shown, holds):
        results.append(PaperClaim(figure, text, shown, bool(holds)))

    def peaks(figure, case, channel, frequencies):
        """Add claims that the spectrum of a channel has peaks at {name of a frequency: Hz}."""
        words = {SURGE: "surge", PITCH: "pitch"}[channel]
        for where, at in frequencies.items() if case in available else ():
            height = prominence(runs[case], channel, at)
            f, density = case_spectrum(runs[case], channel)
            fraction = density[np.abs(f / at - 1.0) <= 0.1].max() / density.max()
            shown = f"at {at:.3f} Hz {height:.3g} times its surroundings, {fraction:.2g} of the highest"
            holds = height >= PEAK and fraction >= VISIBLE
            claim(figure, f"{case}: {words} spectrum peaks at {where}", shown, holds)

    if "LC1" in available:
        surge = settled(runs["LC1"])[SURGE]
        shown = f"mean {surge.mean():.4f} m, std {surge.std():.4f} m"
        claim("6", "LC1: surge is nearly steady", shown, surge.std() < 0.1 * surge.mean())
    of_pitch, wave = {"the pitch frequency": natural["platform_pitch"]}, 1.0 / SEAS[0]["T"]
    peaks("7", "LC2", SURGE, of_pitch)
    if set(wind) <= available:
        shown = ", ".join(f"{name} {mean[name]:.2f}" for name in wind) + " deg"
        claim("8", "mean pitch is largest at rated wind (LC2)", shown, max(wind, key=mean.get) == "LC2")
        falls = mean["LC2"] > mean["LC3"] > mean["LC4"]
        claim("8", "mean pitch falls above rated (LC2 > LC3 > LC4)", shown, falls)
    of_waves = {"the wave frequency": wave, "twice the wave frequency": 2.0 * wave}
    peaks("9", "LC5", SURGE, {"the surge frequency": natural["surge"], **of_pitch, **of_waves})
    if set(waves) <= available:
        spread = [std[name] for name in waves]
        shown = "std " + ", ".join(f"{name} {std[name]:.2f}" for name in waves) + " deg"
        claim("10", "LC5 to LC8: the range grows with the waves", shown, spread == sorted(spread))
        shift = max(abs(mean[name] - mean["LC5"]) for name in waves)
        text, shown = "LC5 to LC8: waves do not change the mean", f"means within {shift:.3f} deg"
        claim("10", text, shown, shift < 0.1 * std["LC8"])
    peaks("11", "LC11", PITCH, {**of_pitch, "the wave frequency": 1.0 / SEAS[2]["Tp"]})
    if {*CASES} <= available:
        triples = list(zip(both, wind, waves, strict=True))
        shift = max(abs(mean[name] - mean[alone]) for name, alone, _ in triples)
        shown = f"within {shift:.2f} deg of the mean in wind alone"
        holds = shift < 0.1 * max(mean[name] for name in wind)
        claim("12", "LC9 to LC12: wind sets the mean", shown, holds)
        shown = ", ".join(f"{name} {std[name] / std[sea]:.2f}" for name, _, sea in triples)
        nearer = all(abs(std[name] - std[sea]) < abs(std[name] - std[air]) for name, air, sea in triples[1:])
        claim("12", "LC10 to LC12: waves set the range", f"std over that in waves alone: {shown}", nearer)
    return results


def static_pull(platform, direction, offsets):
    """Return a DataFrame of restoring force and line tensions (N) at offsets (m) in a direction.

    direction: "surge" or "sway". The hull is moved without rotation, as in Fig. 5 of the paper.
    """
    way, rows = np.array({"surge": (1.0, 0.0, 0.0), "sway": (0.0, 1.0, 0.0)}[direction]), []
    for offset in offsets:
        row = {"offset_[m]": float(offset), "force_[N]": 0.0}
        for number, line in enumerate(platform.lines, 1):
            gap = np.array(line.anchor) - line.fairlead - offset * way
            span = hypot(*gap[:2])
            state = catenary(span, -gap[2], line.length, line.wet_weight, line.EA, line.seabed_friction, 0.0)
            row["force_[N]"] -= state.H * (gap @ way) / span
            row[f"tension_{number}_[N]"] = state.fairlead_tension
        rows.append(row)
    return pd.DataFrame(rows)


EXPECTED_DOUBLE = ((0.02, 0.02), (0.34, 0.34), (0.60, 0.52), (0.92, 0.83))  # %, theory.md, section 8
DECAYS = {"surge decay": ("PtfmSurge", 10.0, SURGE, 600.0), "pitch decay": ("PtfmPitch", 5.0, PITCH, 300.0)}


def decay(channel, start, duration):
    """Simulate a free decay of OC3-Hywind in still water and return its frame."""
    scene = fowt_env.build_scene("oc3_hywind", fidelity="reference")
    return fowt_env.simulate(scene, controller=None, duration=duration, dt=0.05, initial={channel: start})


def regular_wave(position, surface, stretching):
    """Simulate OC3-Hywind in the regular wave of Fig. 15 (H 3 m, T 5 s) and return the frame."""
    scene = fowt_env.build_scene(
        "oc3_hywind", sea={"kind": "regular", "H": 3.0, "T": 5.0, "ramp": 50.0}, fidelity="reference",
        kinematics_position=position, surface=surface, stretching=stretching,
    )  # fmt: skip
    return fowt_env.simulate(scene, controller=None, duration=460.0, dt=0.1)


def double_frequency(frame, start=260.0, period=5.0):
    """Return {channel: (first harmonic, second over first in %)} of surge and pitch in a regular wave."""
    part = frame[(frame[TIME] >= start) & (frame[TIME] < frame[TIME].iloc[-1] - 1e-6)]
    ratios = {}
    for channel in (SURGE, PITCH):
        series = part[TIME].to_numpy(), part[channel].to_numpy()
        first, second = np.abs(harmonics(*series, 2.0 * pi / period))
        ratios[channel] = (float(first), float(100.0 * second / first))
    return ratios


def wind_and_waves():
    """Simulate Fig. 16: 18 m/s (class B assumed), JONSWAP Hs 7.5 m, Tp 10 s, PI control; return the frame."""
    wind = {"kind": "ntm", "speed": 18.0, "class": "B"}
    scene = fowt_env.build_scene(
        "oc3_hywind", wind=wind, sea="paper_wind_wave", seed=1, fidelity="standard", duration=1000.0
    )
    return fowt_env.simulate(scene, controller="pi", duration=1000.0)


def run_paper(names, report=None):
    """Run the named cases and return their PaperStudy; report(text, done, total): called before each run."""
    models = {name: partial(run_load_case, name) for name in names if name in CASES}
    full = {}
    if FULL_SCALE in names:
        for name, (channel, start, _, duration) in DECAYS.items():
            full[name] = partial(decay, channel, start, duration)
        full |= {combination: partial(regular_wave, *combination) for combination in COMBINATIONS}
        full["wind and waves"] = wind_and_waves
    study = PaperStudy({}, [], {})
    for done, (name, run) in enumerate((models | full).items()):
        if report is not None:
            text = name if isinstance(name, str) else "regular wave: " + ", ".join(name[:2])
            report(text, done, len(models) + len(full))
        (study.runs if name in models else study.full)[name] = run()
    if models:
        study.claims.extend(claims(study.runs, natural_frequencies()))
    return study
