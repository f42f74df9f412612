"""Towers that bend against OpenFAST: frequency, tower-base moment by bands, motions as of rigid ones.

VolturnUS-S with the first tower modes alone, as here. OC3-Hywind with every degree of freedom of ElastoDyn:
blades, drivetrain and second tower modes bend there and not here.
"""

import numpy as np

from fowt_env.training.validation.signal_errors import band_energy, normalised_rms, ringing
from fowt_env.training.validation.validate import (
    BLADE,
    PITCH,
    POWER,
    SETTLED,
    SPEED,
    SURGE,
    TENSION_CHANNELS,
    THRUST,
    TIME,
    _name,
    _since,
    add_decay,
)

HEAVE = "PtfmHeave_[m]"
MOMENT, ROLLING = "TwrBsMyt_[kN-m]", "TwrBsMxt_[kN-m]"
FORE_AFT, SIDE_SIDE, NACELLE = "TTDspFA_[m]", "TTDspSS_[m]", "NcIMUTAxs_[m/s^2]"
# Hz: platform and wind, waves, bending of the tower with the turns of the blades
BANDS = {"slow": (0.0, 0.05), "waves": (0.05, 0.2), "tower": (0.2, 5.0)}
RINGING = (0.2, 1.0)  # Hz, in which the tower rings
RINGING_WINDOW = (2.0, 22.0)  # s of a free decay, after which it has lost half


def ringing_rows(study, case):
    """Rows of a free decay in which the tower rings: frequency 1 %, damping ratio 5 %."""
    pair = _since(study.pair(case), *RINGING_WINDOW)
    both = [ringing(f[TIME].to_numpy(), f[FORE_AFT].to_numpy(), *RINGING) for f in reversed(pair)]
    study.add(case, "tower, fore-aft frequency", "Hz", *(found[0] for found in both), allowed=1.0)
    study.add(case, "tower, damping ratio", "-", *(found[1] for found in both), allowed=5.0)


def moment_rows(study, case):
    """Rows of the tower: base moment over the wind by bands 5 %, deflection 5 %; the rest reported."""
    ours, theirs = _since(study.pair(case), SETTLED)
    time = theirs[TIME].to_numpy()
    name, unit = _name(MOMENT)
    for band, (low, high) in BANDS.items():
        both = [np.sqrt(band_energy(time, f[MOMENT].to_numpy(), low, high)) for f in (theirs, ours)]
        quantity = f"{name}, standard deviation from {low:g} to {high:g} Hz ({band})"
        study.add(case, quantity, unit, *both, allowed=5.0)
    for channel in (MOMENT, FORE_AFT, NACELLE, ROLLING, SIDE_SIDE):
        if channel not in theirs:
            continue
        name, unit = _name(channel)
        both = [frame[channel].std() for frame in (theirs, ours)]
        allowed = 5.0 if channel in (MOMENT, FORE_AFT) else float("nan")
        study.add(case, f"{name}, standard deviation", unit, *both, allowed=allowed)
        study.add(case, f"{name}, mean", unit, *(frame[channel].mean() for frame in (theirs, ours)))
        error = 100.0 * normalised_rms(ours[channel], theirs[channel])
        study.add(case, f"{name}, normalised rms error", unit, *both, error)


def motion_rows(study, case, channels):
    """Rows of motions, rotor and lines, as of the rigid turbine: deviations 3 %, rms errors reported."""
    ours, theirs = _since(study.pair(case), SETTLED)
    for channel in channels:
        name, unit = _name(channel)
        both = [frame[channel].std() for frame in (theirs, ours)]
        study.add(case, f"{name}, standard deviation", unit, *both, allowed=3.0)
        error = 100.0 * normalised_rms(ours[channel], theirs[channel])
        study.add(case, f"{name}, normalised rms error", unit, *both, error)


def volturnus(study):
    """VolturnUS-S: free decay, and 18 m/s turbulence with Hs 7.5 m under ROSCO where that is installed."""
    from fowt_env.training.validation.volturnus import without_rosco

    case = "decay_pitch_tower"
    ringing_rows(study, case)
    add_decay(study, case, PITCH, 300.0, period=0.5, decrement=5.0, rms=4.0)
    if without_rosco():
        study.say("without ROSCO: its library is not installed")
        return
    case = "turb_18mps_Hs7.5_uniform_tower"
    moment_rows(study, case)
    motion_rows(study, case, (SURGE, HEAVE, PITCH, SPEED, BLADE, POWER, THRUST))


def oc3(study):
    """OC3-Hywind against ElastoDyn with all its modes: 18 m/s turbulence with Hs 7.5 m."""
    case = "turb_18mps_Hs7.5_uniform_flex"
    moment_rows(study, case)
    motion_rows(study, case, (SURGE, HEAVE, PITCH, SPEED, BLADE, POWER, THRUST, *TENSION_CHANNELS))
