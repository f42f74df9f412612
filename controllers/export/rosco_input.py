"""Writes a PI law of this package as DISCON.IN, the input file of the ROSCO library.

ROSCO integrates gain times error, the law here multiplies the integral by its gain GK. A law here has the
small-signal gains of ROSCO's at every blade pitch if ROSCO's schedule is 1/(1 + 2 pitch/p) where that of GK
is 1/(1 + pitch/p), p = gain_schedule_pitch (theory.md, Eq. (A7)); the file has this schedule. ROSCO's follows
a low pass of the pitch commands, here the last command; its low pass of the generator speed is discretised by
Tustin's rule; between rated torque and the parabola of region 2, and below region 2, a PI law on speed
controls the torque, here lines of the torque curve.
"""

import numpy as np

from fowt_env.controllers.export.native import family
from fowt_env.controllers.floating_feedback import FloatingFeedback
from fowt_env.controllers.pi import PI
from fowt_env.controllers.rosco import SCHEDULE, RoscoSettings, deck, deck_text, rotor_table, steady_states
from fowt_env.errors import InputError

FADE = 1.0  # m/s above rated wind over which the feedback of the platform's motion fades in
ACCEPTED = "the PI laws (pi, gspi_oc3, floating_feedback, design:FILE of kind pi)"
ALWAYS = (
    "The gains have the small-signal values of the law at each pitch, since ROSCO integrates gain x error.",
    "They follow a low pass of the pitch commands; below rated, PI control of the speed replaces two lines of"
    " the torque curve.",
    "Entries of modes that are off are left out; ROSCO names each in a warning at its start.",
)


def rosco_values(controller, turbine, density):
    """Return {name: value} of DISCON.IN for a prepared PI law; density: of the air, kg/m3.

    Raises: InputError for a law or a setting that ROSCO does not have.
    """
    name = f"export {controller.name!r} to ROSCO"
    if not isinstance(controller, PI) or family(controller) not in ("pi", "gspi", "floating_feedback"):
        raise InputError(f"{name}: only {ACCEPTED} have a counterpart there")
    settings, feedback = controller.settings, RoscoSettings()
    if not np.isfinite(settings.speed_filter_corner):
        raise InputError(f"{name}: speed_filter_corner = inf: ROSCO needs a filter of the generator speed")
    if isinstance(controller, FloatingFeedback):
        feedback = _feedback(controller.feedback, name)
    table = rotor_table(turbine, density)
    values = deck(turbine, density, table, feedback)
    if feedback.mode:
        values |= _scheduled(feedback.gain, settings, turbine, density, table)
    schedule = 1.0 / (1.0 + 2.0 * SCHEDULE / settings.gain_schedule_pitch)
    curve, rated = settings.curve, settings.rated_speed * settings.gear_ratio
    return values | {
        "PC_GS_KP": -settings.KP * schedule,
        "PC_GS_KI": -settings.KI * schedule,
        "PC_MinPit": settings.pitch_minimum,
        "PC_FinePit": settings.pitch_minimum,
        "PC_MaxPit": settings.pitch_maximum,
        "PC_MaxRat": settings.pitch_rate_limit,
        "PC_MinRat": -settings.pitch_rate_limit,
        "PC_RefSpd": rated,
        "PC_Switch": curve.region3_min_pitch - settings.pitch_minimum,
        "F_LPFType": 1,
        "F_LPFCornerFreq": settings.speed_filter_corner,
        "VS_ControlMode": 1,  # torque by the square of the speed, as the torque curve here
        "VS_ConstPower": int(curve.region3_power > 0.0),
        "VS_MaxRat": settings.torque_rate_limit,
        "VS_MaxTq": curve.maximum_torque,
        "VS_Rgn2K": curve.region2_constant,
        "VS_MinOMSpd": 0.5 * (curve.cut_in_speed + curve.region2_start_speed),  # mid of region 1.5
        "VS_RefSpd": rated,
        "SS_Mode": 0,
        "WE_Mode": 0,  # no wind estimate is needed
        "PerfFileName": '"unused"',
    }


def _feedback(feedback, name):
    """Return the RoscoSettings of a FeedbackSettings."""
    for key, wanted in (("signal", "nacelle_velocity"), ("scheduled", False)):
        if getattr(feedback, key) != wanted:
            raise InputError(f"{name}: {key} = {getattr(feedback, key)!r}: must be {wanted!r}")
    return RoscoSettings(
        mode=1, gain=-feedback.pitch_gain, low_pass=feedback.low_pass, high_pass=feedback.high_pass
    )


def _scheduled(gain, settings, turbine, density, table):
    """Return the {name: value} of the feedback's gain over the wind.

    Below rated wind it is zero, as in the law at minimum pitch. Above, the gain schedule of the law, which
    follows the whole command, reduces a change of the feedback by (p + pitch)/(p + 2 pitch), p =
    gain_schedule_pitch.
    """
    winds = np.arange(turbine.rated_wind_speed, turbine.cut_out_wind_speed + FADE, FADE)
    _, pitch = steady_states(turbine, density, table, winds)
    # so written, 1 without a schedule
    share = (1.0 + pitch / settings.gain_schedule_pitch) / (1.0 + 2.0 * pitch / settings.gain_schedule_pitch)
    return {"Fl_n": len(winds), "Fl_U": winds, "Fl_Kp": gain * np.where(winds > winds[0], share, 0.0)}


def differences(controller):
    """Return sentences on what ROSCO does differently from a PI law, as the module's description."""
    sentences = list(ALWAYS)
    if isinstance(controller, FloatingFeedback):
        sentences.append("The feedback of the platform's motion fades in over the wind, not over the pitch.")
        if controller.feedback.torque_gain:
            sentences.append(
                f"torque_gain = {controller.feedback.torque_gain:g} N m per m/s is left out: ROSCO's feedback"
                " acts on the blade pitch alone."
            )
    return sentences


def rosco_text(controller, turbine, density, title):
    """Return the text of DISCON.IN of a prepared PI law, with a title and the differences of the law."""
    values = rosco_values(controller, turbine, density)
    return deck_text(values, "\n".join((title, *differences(controller))))
