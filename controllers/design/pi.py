"""Designs PI gains and schedule for a frequency and damping ratio, on linear models over wind speed.

As in the published design (theory.md, Eq. (A6)) the design model is the isolated rotor without aerodynamic
damping of rotor speed; the effect on the platform is computed afterwards from the complete plant.
"""

from dataclasses import dataclass

import numpy as np

from fowt_env.controllers.design.closed_loop import platform_damping
from fowt_env.controllers.pi import PISettings, schedule_gain
from fowt_env.descriptions.checks import check_number
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError, unknown
from fowt_env.plant.state import State

SCHEDULES = ("loop", "published")


@dataclass(frozen=True)
class PIDesign:
    """Holds gains on generator speed and the resulting loops: table has one row per wind above rated."""

    KP: float  # s, at zero pitch
    KI: float
    gain_schedule_pitch: float  # rad
    table: list


def check_aims(omega, zeta, schedule):
    """Check the arguments of design_pi. Raises: InputError for omega or zeta outside their ranges."""
    for key, value, high in (("omega", omega, 3.0), ("zeta", zeta, 5.0)):
        check_number(key, value, 0.0, high, low_open=True)
    if schedule not in SCHEDULES:
        raise unknown("schedule", schedule, SCHEDULES)


def design_pi(models, turbine, omega, zeta, schedule="loop"):
    """Return the PIDesign of a turbine for a rotor loop of frequency omega (rad/s) and damping ratio zeta.

    models: {wind: LinearModel}; models with the pitch at a limit are skipped. The rotor's response to blade
    pitch is fitted by s (1 + pitch/p). With schedule "loop" the small-signal gain of the scheduled law
    follows the inverse of this fit: because the schedule multiplies the integral (theory.md, Eq. (A7)),
    gain_schedule_pitch = 2 p. "published" uses p, as Jonkman, and gives a loop slower than designed.
    Raises: InputError as check_aims, and for fewer than two winds above rated.
    """
    check_aims(omega, zeta, schedule)
    ratio = turbine.drivetrain.gear_ratio
    winds, pitches, slopes = [], [], []
    for wind, model in models.items():
        if not model.pitch_rests:
            winds.append(wind)
            pitches.append(float(model.point.state[State.BLADE_PITCH]))
            slopes.append(-model.A[model.index("rotor_speed"), model.index("blade_pitch")])
    if len(winds) < 2:
        raise InputError("winds: must include at least two above rated, with the blade pitch off its limits")
    pitches, slopes = np.array(pitches), np.array(slopes)
    columns = np.column_stack([np.ones(len(winds)), pitches]) / slopes[:, None]
    at_zero, growth = np.linalg.lstsq(columns, np.ones(len(winds)), rcond=None)[0]
    doubling = at_zero / growth
    gain_schedule_pitch = float(2.0 * doubling if schedule == "loop" else doubling)
    kp, ki = (float(x / (at_zero * ratio)) for x in (2.0 * zeta * omega, omega**2))
    settings = PISettings.published(turbine, KP=kp, KI=ki, gain_schedule_pitch=gain_schedule_pitch)
    table = []
    for wind, pitch, slope in zip(winds, pitches, slopes, strict=True):
        gain = schedule_gain(pitch, gain_schedule_pitch)
        small = gain / (2.0 - gain)
        frequency = np.sqrt(slope * small * ki * ratio)
        table.append(
            {
                "wind_[m/s]": float(wind),
                "pitch_[deg]": float(pitch / DEGREE),
                "slope_[1/s2]": float(-slope),
                "KP_[s]": float(small * kp),
                "KI_[-]": float(small * ki),
                "omega_[rad/s]": float(frequency),
                "zeta_[-]": float(0.5 * slope * small * kp * ratio / frequency),
                "platform_zeta_[-]": platform_damping(models[wind], settings),
            }
        )
    return PIDesign(kp, ki, gain_schedule_pitch, table)
