"""Compares the OC4 semi-submersible with OpenFAST with members: decays and an irregular sea, rotor at rest.

Both models use the coefficients of the deck; the excitation, which the deck lacks, is that of the package.
In HydroDyn v5 the water in the columns rotates as a solid. The published inertia (platform file) has that
water on the column axes: 4 % less pitch inertia; the resulting period is reported.
"""

from dataclasses import replace
from math import pi

from fowt_env.descriptions.platform import read_platform
from fowt_env.training.validation.comparison import Channel
from fowt_env.training.validation.openfast_cases import ReferenceRun, wave_components
from fowt_env.training.validation.signal_errors import decay_period
from fowt_env.training.validation.volturnus import DT

PLATFORM = "nrel5mw_oc4_semi"
DECAYS = {  # case: (channel, start value, seconds, cycles counted)
    "decay_surge": (Channel.SURGE, 8.0, 250.0, 1),
    "decay_heave": (Channel.HEAVE, 3.0, 100.0, 4),
    "decay_pitch": (Channel.PITCH, 6.0, 150.0, 4),
}
# water in each of three columns: upper part and base, from the HydroDyn file of the deck
WATER = ((1025.0, 5.94, 7.83), (1025.0, 11.94, 5.05))  # density kg/m3, radius inside m, height m


def with_solid_water():
    """Return the platform with the water in the columns rotating as a solid."""
    platform = read_platform(PLATFORM)
    square = sum(3.0 * density * pi * radius**4 * height for density, radius, height in WATER)
    added = (0.25 * square, 0.25 * square, 0.5 * square)
    inertia = tuple(a + b for a, b in zip(platform.ballast.inertia, added, strict=True))
    return platform.model_copy(update={"ballast": platform.ballast.model_copy(update={"inertia": inertia})})


def _run(case, duration, **settings):
    """Return a ReferenceRun of this platform."""
    return ReferenceRun(case, duration, DT, platform=with_solid_water, place=PLATFORM, **settings)


RUNS = {
    run.case: run
    for run in (
        *(
            _run(case, seconds, initial={channel: start})
            for case, (channel, start, seconds, _) in DECAYS.items()
        ),
        _run("waves_Hs7.5", 400.0, sea=wave_components),
        _run("waves_Hs7.5_qtf", 400.0, sea=wave_components, options={"second_order": "full"}),
        _run("waves_Hs7.5_moordyn", 400.0, sea=wave_components),
    )
}


def decays(study):
    """Compare free decays with drag on members: period 0.2 %, decrement 2 %, rms error 1 %.

    HydroDyn keeps members upright: 1 - cos(6 deg) is 0.5 %. Its strips of 2 to 6 m change the drag of a
    velocity that is linear along a column by less than 1 %.
    """
    for case, (channel, _, seconds, cycles) in DECAYS.items():
        study.add_decay(case, channel, seconds, 0.2, 2.0, 1.0, cycles=cycles, counted=(1,))
    study.say(f"{case}, published inertia")  # the last case: pitch
    _, _, time, theirs, _ = study.series(case, channel)
    ours = replace(RUNS[case], platform=PLATFORM).frame(study.folder)[channel].to_numpy()
    centre = theirs[time > 0.5 * seconds].mean()
    both = [decay_period(time, value, centre, cycles) for value in (theirs, ours)]
    study.add(case, f"period, first {cycles} cycles, published inertia", "s", *both)


def waves(study):
    """Compare motions in irregular waves, Hs 7.5 m: standard deviations after 100 s 2 %, with the QTF 5 %.

    The MoorDyn run (lines with drag and inertia) is reported without limits.
    """
    for case, allowed in (("", 2.0), ("_qtf", 5.0), ("_moordyn", float("nan"))):
        study.add_statistics(f"waves_Hs7.5{case}", Channel.PLANE, std=allowed)


GROUPS = {"decays": (decays, 4), "waves": (waves, 3)}
