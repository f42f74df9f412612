"""Towers that bend against OpenFAST: frequency, tower-base moment by bands, motions as of rigid ones.

VolturnUS-S with the first tower modes alone, as here; OC3-Hywind with every degree of freedom of ElastoDyn.
"""

import numpy as np

from fowt_env.training.validation.comparison import SETTLED, Channel
from fowt_env.training.validation.openfast_cases import without_rosco
from fowt_env.training.validation.signal_errors import band_energy, ringing

MOMENT, ROLLING = "TwrBsMyt_[kN-m]", "TwrBsMxt_[kN-m]"
FORE_AFT, SIDE_SIDE, NACELLE = "TTDspFA_[m]", "TTDspSS_[m]", "NcIMUTAxs_[m/s^2]"
# Hz: platform and wind, waves, bending of the tower with the turns of the blades
BANDS = {"slow": (0.0, 0.05), "waves": (0.05, 0.2), "tower": (0.2, 5.0)}
RINGING = (0.2, 1.0)  # Hz, in which the tower rings
RINGING_WINDOW = (2.0, 22.0)  # s of a free decay, after which it has lost half
MOVING = (*Channel.PLANE, Channel.SPEED, Channel.BLADE, Channel.POWER, Channel.THRUST)


def _turbulent(study, case, channels):
    """Add the rows of a bending tower in turbulence.

    Base moment over the wind by bands 5 %, deflection 5 %; motions, rotor and lines as of the rigid turbine,
    deviations 3 %. The rest is reported.
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
    """Compare VolturnUS-S: free decay, and 18 m/s turbulence with Hs 7.5 m where ROSCO is installed.

    The tower rings in the decay: frequency 1 %, damping ratio 5 %.
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
    """Compare OC3-Hywind with ElastoDyn with all its modes: 18 m/s turbulence with Hs 7.5 m."""
    _turbulent(study, "turb_18mps_Hs7.5_uniform_flex", (*MOVING, *Channel.TENSIONS))
