"""Linearises a rotor with individual blade pitch in multi-blade coordinates.

At each azimuth the plant is differentiated by these coordinates (blade_coordinates.py) and the outputs are
transformed to them; the derivatives are averaged over the azimuth. Variations at 3P in sheared wind are
omitted.
"""

from fowt_env.analysis.linear_model import LINEAR, check_linear, differentiated, with_pitch_lag
from fowt_env.analysis.linear_plant import MOMENTS, bending_names, plant_states
from fowt_env.analysis.trim import trim
from fowt_env.errors import InputError

CYCLIC_INPUTS = ("tilt_pitch_command", "yaw_pitch_command")


def linearize_blades(scene, operating_point=None):
    """Return the LinearModel of a scene with pitch="individual" in multi-blade coordinates (azimuth mean).

    In addition to the states, inputs and outputs of linearize, the model has the states tilt_pitch and
    yaw_pitch, rad (and tilt_pitch_rate, yaw_pitch_rate for a drive with inertia), the inputs CYCLIC_INPUTS,
    rad, and the outputs MOMENTS, N m: moments at hub and yaw bearing, and mean, cosine (tilt) and sine (yaw)
    components of the blade root moments. States and inputs of linearize are collective. operating_point:
    default, the floating trim of the scene, at which all blades have the same pitch.

    Raises: InputError for a scene with collective pitch, and as linearize.
    """
    if scene.model.pitches is None:
        raise InputError(
            "linearize_blades: the scene has collective pitch; build the scene with pitch='individual'"
        )
    check_linear(scene, [name for name in LINEAR if name != "wake"])  # cyclic wake states are not implemented
    point = trim(scene) if operating_point is None else operating_point
    pitches = [name for name in ("blade_pitch", "pitch_rate") if name in plant_states(scene)[0]]
    bladed = (*pitches, *bending_names(scene))
    return with_pitch_lag(differentiated(scene, point, bladed, CYCLIC_INPUTS, MOMENTS))
