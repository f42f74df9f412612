"""What stands for the controller of a parked turbine; faults are those of fowt_env.descriptions.faults."""

from fowt_env.controllers.constant import Constant
from fowt_env.descriptions.faults import Fault

__all__ = ["PARKED", "Fault", "idling"]
PARKED = "parked"  # what stands for the controller of a parked turbine


def idling(turbine):
    """Controller of a parked turbine: no generator torque, blades feathered, rotor free to turn."""
    return Constant(torque=0.0, blade_pitch=turbine.pitch_drive.maximum, name=PARKED)
