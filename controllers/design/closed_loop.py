"""Analyses the linear closed loop of a plant and the PI law, mode by mode (theory.md, section 4)."""

from math import isinf, pi

import numpy as np

from fowt_env.analysis.linear_model import LinearModel, linearize, modes
from fowt_env.analysis.reduced_model import platform_frequency
from fowt_env.analysis.trim import trim
from fowt_env.controllers.gains import with_gains
from fowt_env.controllers.pi import PISettings, schedule_gain
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.plant.drivetrain import generator_torque
from fowt_env.plant.state import State
from fowt_env.scene.build import build_scene

TORQUE_STEP = 1e-4  # rad/s of rotor speed, for the slope of the torque curve


def closed_loop_matrix(model: LinearModel, settings: PISettings):
    """Return the continuous-time (A, names) of plant states, filtered rotor speed, speed-error integral.

    The slope of the gain schedule is included: the integral term is GK(beta) times the integral, so an
    increase of beta lowers GK. With the schedule on the last command this divides every gain by 2 - GK; on
    the measured pitch it adds -(1 - GK) times this pitch to the command.
    Raises: InputError if the pitch is at a limit (below rated the loop is open).
    """
    point = model.point
    pitch = float(point.state[State.BLADE_PITCH])
    if not settings.pitch_minimum < pitch < settings.pitch_maximum:
        raise InputError(
            f"blade pitch {pitch / DEGREE:.4g} deg is at a limit, where the pitch loop is open;"
            " choose a wind above rated"
        )
    n = len(model.states)
    speed, blade = model.index("rotor_speed"), model.index("blade_pitch")
    gain = schedule_gain(pitch, settings.gain_schedule_pitch)
    proportional = gain * settings.KP * settings.gear_ratio
    integral = gain * settings.KI * settings.gear_ratio
    a, command = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    if settings.schedule_on == "measured":
        command[blade] = -(1.0 - gain)
    else:
        proportional /= 2.0 - gain
        integral /= 2.0 - gain
    a[:n, :n] = model.A
    filtered = not isinf(settings.speed_filter_corner)
    measured_speed = n if filtered else speed
    command[[measured_speed, n + 1]] = proportional, integral
    a[:n] += np.outer(model.B[:, 1], command)
    ratio = settings.gear_ratio
    centre = float(point.state[State.ROTOR_SPEED])
    torques = [
        generator_torque(ratio * (centre + s * TORQUE_STEP), pitch, settings.curve) for s in (1.0, -1.0)
    ]
    a[:n, measured_speed] += model.B[:, 0] * (torques[0] - torques[1]) / (2.0 * TORQUE_STEP)
    corner = settings.speed_filter_corner if filtered else 1.0
    a[n, speed] += corner
    a[n, n] -= corner
    a[n + 1, measured_speed] += 1.0
    return a, (*model.states, "filtered_speed", "speed_integral")


def platform_damping(model, settings):
    """Return the damping ratio of the platform-pitch mode of a LinearModel under a PI law.

    Of the modes with this name (or all modes), the one with the period nearest to the open-loop period with
    fixed blade pitch and torque is taken, because the rotor loop may have a similar period.
    """
    a, names = closed_loop_matrix(model, settings)
    computed = modes(a, names, model.cm_height, model.arm)
    pitching = [mode for mode in computed if mode.name == "platform_pitch"] or computed
    period = 2.0 * pi / platform_frequency(model)
    return min(pitching, key=lambda mode: abs(mode.period - period)).damping_ratio


def platform_pitch_damping(winds, gain_sets, platform="oc3_hywind", **options):
    """Return {gain set: [damping ratio of the platform-pitch mode at each wind]} on the floating platform.

    gain_sets: {name: changes of PISettings.published, e.g. {"gain_set": "land"}}; without viscous damping.
    """
    table = {name: [] for name in gain_sets}
    for wind in winds:
        scene = build_scene(platform, wind=float(wind), **options)
        model = linearize(scene, trim(scene))
        for name, changes in gain_sets.items():
            settings = PISettings.published(with_gains(scene), **changes)
            table[name].append(platform_damping(model, settings))
    return table
