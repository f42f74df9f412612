"""Compares flexible towers with OpenFAST: frequency, tower-base moment by bands, and motions.

In OpenFAST, VolturnUS-S has the first tower modes only, as here; OC3-Hywind all modes of ElastoDyn.
"""

import numpy as np

from fowt_env.training.validation.comparison import SETTLED, Channel
from fowt_env.training.validation.openfast_cases import without_rosco
from fowt_env.training.validation.signal_errors import band_energy, ringing

MOMENT, ROLLING = "TwrBsMyt_[kN-m]", "TwrBsMxt_[kN-m]"
FORE_AFT, SIDE_SIDE, NACELLE = "TTDspFA_[m]", "TTDspSS_[m]", "NcIMUTAxs_[m/s^2]"
# Hz: platform motion and wind; waves; tower bending and blade passing
BANDS = {"slow": (0.0, 0.05), "waves": (0.05, 0.2), "tower": (0.2, 5.0)}
RINGING = (0.2, 1.0)  # Hz, range of the tower frequency
RINGING_WINDOW = (2.0, 22.0)  # s of a free decay, in which the oscillation halves
MOVING = (*Channel.PLANE, Channel.SPEED, Channel.BLADE, Channel.POWER, Channel.THRUST)


def _turbulent(study, case, channels):
    """Add the rows of a flexible tower in turbulence.

    Standard deviations: fore-aft base moment (also by bands) and deflection 5 %; motions, rotor and lines
    3 %, as for the rigid turbine. The rest is reported.
    """
    name, unit, time, *both = study.series(case, MOMENT, SETTLED)
    for band, (low, high) in BANDS.items():
        sizes = [np.sqrt(band_energy(time, value, low, high)) for value in both]
        quantity = f"{name}, standard deviation from {low:g} to {high:g} Hz ({band})"
        study.add(case, quantity, unit, *sizes, allowed=5.0)
    for channel in (MOMENT, FORE_AFT, NACELLE, ROLLING, SIDE_SIDE):
        if channel in study.pair(case)[1]:
            allowed = 5.0 if channel in (MOMENT, FORE_AFT) else float("nan")
            study.add_statistics(case, (channel,), std=allowed)
    study.add_statistics(case, channels, ("std", "rms"), std=3.0)


def volturnus(study):
    """Compare VolturnUS-S in a free decay and, if ROSCO is installed, 18 m/s turbulence with Hs 7.5 m.

    Tower oscillation in the decay: frequency 1 %, damping ratio 5 %.
    """
    case = "decay_pitch_tower"
    _, _, time, *both = study.series(case, FORE_AFT, *RINGING_WINDOW)
    frequencies, ratios = zip(*(ringing(time, value, *RINGING) for value in both), strict=True)
    study.add(case, "tower, fore-aft frequency", "Hz", *frequencies, allowed=1.0)
    study.add(case, "tower, damping ratio", "-", *ratios, allowed=5.0)
    study.add_decay(case, Channel.PITCH, 300.0, period=0.5, decrement=5.0, rms=4.0)
    if without_rosco():
        study.say("without ROSCO: its library is not installed")
        return
    _turbulent(study, "turb_18mps_Hs7.5_uniform_tower", MOVING)


def oc3(study):
    """Compare OC3-Hywind in 18 m/s turbulence with Hs 7.5 m with ElastoDyn with all modes."""
    _turbulent(study, "turb_18mps_Hs7.5_uniform_flex", (*MOVING, *Channel.TENSIONS))
