"""Builds the actuators of a scene, pitch drives and generator lag, and sets their states to rest."""

from math import inf

from fowt_env.plant.drivetrain import TorqueLag
from fowt_env.plant.pitch_actuator import build_pitch_actuator
from fowt_env.plant.pitch_drive import PitchDrive
from fowt_env.plant.state import BLADES, Command


def build_actuator(pitch_drive, first_state, blades):
    """Return the actuator of a description's PitchDrive for `blades` blades, states from first_state on."""
    if pitch_drive.natural_frequency is None:
        return build_pitch_actuator(pitch_drive)
    limit = pitch_drive.acceleration_limit
    return PitchDrive(
        natural_frequency=float(pitch_drive.natural_frequency),
        damping=float(pitch_drive.damping),
        rate_limit=float(pitch_drive.rate_limit),
        acceleration_limit=inf if limit is None else float(limit),
        deadband=float(pitch_drive.deadband),
        friction=float(pitch_drive.friction),
        minimum=float(pitch_drive.minimum),
        maximum=float(pitch_drive.maximum),
        rate=first_state,
        held=first_state + blades if pitch_drive.deadband > 0.0 else None,
    )


def build_converter(drivetrain, first_state):
    """Return the TorqueLag of a description's Drivetrain, state at first_state; None without a lag."""
    if drivetrain.torque_time_constant is None:
        return None
    return TorqueLag(float(drivetrain.torque_time_constant), first_state)


def drive_states(actuator, pitches):
    """Return {name of a block: number of states} of a pitch actuator."""
    blades = 1 if pitches is None else BLADES
    moving = isinstance(actuator, PitchDrive)
    deadband = moving and actuator.held is not None
    return {"pitch_rate": blades if moving else 0, "followed_pitch": blades if deadband else 0}


def rest_actuators(model, x, u):
    """Set the actuator states in x to rest at the command u, except the blade pitches."""
    actuator, blades = model.actuator, 1 if model.pitches is None else BLADES
    if isinstance(actuator, PitchDrive):
        x[actuator.rate : actuator.rate + blades] = 0.0
        if actuator.held is not None:
            x[actuator.held : actuator.held + blades] = u[Command.BLADE_PITCH : Command.BLADE_PITCH + blades]
    if model.converter is not None:
        x[model.converter.torque] = u[Command.GENERATOR_TORQUE]


def linear_actuator(actuator):
    """Return the actuator of a linear model: without deadband and friction."""
    if not isinstance(actuator, PitchDrive):
        return actuator
    return actuator._replace(deadband=0.0, friction=0.0)
