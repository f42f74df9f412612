"""What goes wrong in a load case: a controller whose commands are overridden from the fault on.

The model has one collective blade pitch, so every fault acts on all three blades at once.
"""

from math import radians
from typing import Literal

from fowt_env.control import CheckedController, CompiledController, check_control_dt
from fowt_env.controllers.constant import Constant
from fowt_env.descriptions.records import NonNegative, Positive, Record
from fowt_env.plant.measurement import SENSOR_FIELDS

PARKED = "parked"  # what stands for the controller of a parked turbine


class Fault(Record):
    """A fault of a load case.

    A run with a fault goes on past the turbine's overspeed, which ends any other as failed: how far a rotor
    without torque or pitch runs away is what such a case shows.

    grid_loss       the generator torque is zero from `time` on; the controller goes on pitching. With a
                    delay (s) the protection feathers the blades that long after the loss
    stuck_pitch     the blades stay from `time` on where they are then; the torque is still the controller's
    emergency_stop  the generator torque is zero and the blades feather from `time` on
    rate            deg/s of feathering; within the limit of the pitch drive
    """

    kind: Literal["grid_loss", "stuck_pitch", "emergency_stop"]
    time: NonNegative  # s
    delay: NonNegative | None = None  # s
    rate: Positive = 8.0  # deg/s

    @property
    def grid_loss(self):
        """Time (s) from which the generator is off the grid, as simulate takes it; None: it stays."""
        return None if self.kind == "stuck_pitch" else self.time


class FaultedController:
    """A controller with a Fault: the inner one's commands, from the fault on what it leaves of them."""

    def __init__(self, inner, fault, feathered, control_dt):
        self.name = f"{inner.name} with {fault.kind}"
        self.inner = inner
        self.fault = fault
        self.feathered = float(feathered)  # rad
        self.step = radians(fault.rate) * check_control_dt(control_dt)  # rad per control period
        self.stuck = self.target = None
        self.information = (
            *getattr(inner, "information", SENSOR_FIELDS),
            "blade_pitch",
        )  # where a fault finds the blades
        self.declared = getattr(inner, "declared", True)
        self.preview_times = tuple(getattr(inner, "preview_times", ()))

    def prepare(self, scene):
        """Hand the scene of the coming run to the inner controller, where it asks for it."""
        if hasattr(self.inner, "prepare"):
            self.inner.prepare(scene)

    def reset(self, measurement):
        """Start the inner controller afresh, with the fault still to come."""
        self.stuck = self.target = None
        self.inner.reset(measurement)

    def act(self, measurement):
        """(generator torque N m, blade pitch rad) after the fault."""
        torque, blade_pitch = self.inner.act(measurement)
        fault = self.fault
        late = measurement.time - fault.time
        if late < -1e-9:
            return torque, blade_pitch
        if fault.kind == "stuck_pitch":
            if self.stuck is None:
                self.stuck = measurement.blade_pitch
            return torque, self.stuck
        delay = 0.0 if fault.kind == "emergency_stop" else fault.delay
        if delay is not None and late >= delay - 1e-9:
            start = measurement.blade_pitch if self.target is None else self.target
            self.target = min(start + self.step, self.feathered)
            blade_pitch = self.target
        return 0.0, blade_pitch


def faulted(controller, fault, turbine, control_dt):
    """A controller that controllers.make has made, in a FaultedController if there is a fault."""
    if fault is None:
        return controller
    if not isinstance(controller, CompiledController | CheckedController):
        controller = CheckedController(controller)
    return FaultedController(controller, fault, turbine.pitch_drive.maximum, control_dt)


def idling(turbine):
    """Controller of a parked turbine: no generator torque, blades feathered, rotor free to turn."""
    return Constant(torque=0.0, blade_pitch=turbine.pitch_drive.maximum, name=PARKED)
