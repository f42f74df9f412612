"""Runs a controller of this package on the records of a simulator with the Bladed interface.

The host calls at its own interval, the controller acts at its control instants and its command is held in
between. The controller reads what it declares, in the units and directions of `Measurement`; commands stay
within the limits of generator and pitch drives, which in a host with other drives would not exist. The C code
of exported laws (c/discon.c, c/step.c) does the same.
"""

from math import exp, floor

import numpy as np

from fowt_env.control import CompiledController, check_control_dt, view_of
from fowt_env.controllers.bladed.records import (
    BLADES,
    EXTENDED_VERSION,
    INDEX,
    NUMBER,
    PLATFORM_START,
    START,
)
from fowt_env.controllers.bladed.swap import BLADE_READINGS, READINGS
from fowt_env.descriptions.sensors import built_in_chains
from fowt_env.errors import ControllerError, InputError
from fowt_env.plant.drivetrain import (
    SLACK,
    build_torque_curve,
    build_torque_limits,
    clamp,
    followed_torque,
    generator_torque,
)
from fowt_env.plant.measurement import BLADES_MEASURED, MEASURED, BladeMeasurement, Measurement

MEAN_PITCH, VELOCITY = 0, -1  # in place of a record's number: mean over the blades, integrated acceleration
PITCHES = [INDEX[f"blade_pitch_{blade + 1}"] for blade in range(BLADES)]
LAST_STANDARD = NUMBER["size"]  # record that is read of every host; those above are extended ones
RECORD_OF = {  # field of a measurement -> number of the record that a host sends of it; the first one counts
    **{field.name.lower(): NUMBER[name] for name, (field, sign) in reversed(READINGS.items()) if sign > 0.0},
    **{field.name.lower(): NUMBER[name] for name, field in BLADE_READINGS.items()},
    "blade_pitch": MEAN_PITCH,
    "nacelle_velocity": VELOCITY,
}
LAST_EXTENDED = max(RECORD_OF.values())


def fields_of(controller):
    """Return the declared fields of Measurement and BladeMeasurement of a controller, in their order.

    Raises: InputError for information that no host with the Bladed interface sends.
    """
    known = ("time", "plant_model", *RECORD_OF)
    declared = controller.information
    if getattr(controller, "declared", True):
        for name in declared:
            if name not in known:
                raise InputError(
                    f"controller {controller.name!r}: needs {name!r}, which the Bladed interface has not"
                )
    return tuple(name for name in (*MEASURED, *BLADES_MEASURED) if name in declared and name in known)


def velocity_decay(control_dt):
    """Return the fraction of the integrated nacelle velocity that its high pass keeps over a period (s)."""
    return exp(-control_dt * built_in_chains()["standard"].sensors["nacelle_velocity"].high_pass)


class Hosted:
    """Runs a prepared controller in a host; turbine: its limits; control_dt: its period, s."""

    def __init__(self, controller, turbine, control_dt):
        self.controller, self.control_dt = controller, check_control_dt(control_dt)
        self.fields, self.drive = fields_of(controller), turbine.pitch_drive
        self.individual = bool(controller.individual)
        self.limits, self.curve = (f(turbine.torque_law) for f in (build_torque_limits, build_torque_curve))
        self._decay = velocity_decay(self.control_dt)
        self._call = None

    def call(self, swap):
        """Return (generator torque, pitch of each blade) for the records of a call, an array from record 1.

        Raises: InputError for a host that the controller cannot run in, ControllerError for its failures.
        """
        first = int(round(float(swap[INDEX["status"]]))) == START
        if first:
            self._begin(swap)
        elif self._call is None:
            raise InputError("record 1: the first call must have 0")
        passed = floor((float(swap[INDEX["time"]]) - self._start) / self._interval + 0.5)
        if passed < self._call:
            raise InputError("record 2, the time, goes back")
        instant = first or passed // self._periods > self._call // self._periods
        self._call = passed
        if instant:
            self._output = self._act(swap, first)
        return self._output

    def _begin(self, swap):
        """Check the host at its first call."""
        self._start, self._interval = float(swap[INDEX["time"]]), float(swap[INDEX["communication_interval"]])
        ratio = self.control_dt / self._interval if self._interval > 0.0 else 0.0
        if ratio < 0.999 or abs(ratio - round(ratio)) > 1e-4 * ratio:
            raise InputError(
                f"record 3, the time between two calls, is {self._interval:g} s: it must divide the control"
                f" period of {self.control_dt:g} s"
            )
        if swap[INDEX["pitch_actuator"]] != 0.0:
            raise InputError("record 10 asks for pitch rates: only pitch angles are commanded")
        if swap[INDEX["blades"]] != BLADES:
            raise InputError(f"record 61, the number of blades, is {swap[INDEX['blades']]:g}: must be 3")
        if self.individual and swap[INDEX["pitch_control"]] != 1.0:
            raise InputError("record 28: this law commands each blade: set Ptch_Cntrl to 1")
        extended = (
            swap[INDEX["size"]] >= LAST_EXTENDED and swap[INDEX["extended_version"]] >= EXTENDED_VERSION
        )
        lacking = [f for f in self.fields if RECORD_OF[f] >= PLATFORM_START and not extended]
        if lacking and getattr(self.controller, "declared", True):
            raise InputError(
                f"{lacking[0]}, record {RECORD_OF[lacking[0]]}, is not sent: it needs the extended interface,"
                " as of OpenFAST 5"
            )
        if lacking:  # of a controller that declares nothing: reading them raises an error
            information = self.controller.information
            self.controller.information = tuple(name for name in information if name not in lacking)
        self._read = tuple(field for field in self.fields if field not in lacking)
        self._view, self._periods, self._call, self._velocity = None, round(ratio), 0, 0.0

    def _reading(self, swap, first):
        """Return {field: value} of the fields that the host sends."""
        pitches = [float(swap[i]) for i in PITCHES]
        reading = {}
        for field in self._read:
            number = RECORD_OF[field]
            if number == MEAN_PITCH:
                value = sum(pitches) / BLADES
            elif number == VELOCITY:
                acceleration = float(swap[INDEX["tower_top_fore_aft_acceleration"]])
                value = 0.0 if first else self._decay * self._velocity + self.control_dt * acceleration
                self._velocity = value
            else:
                value = float(swap[number - 1])
            reading[field] = value
        if not all(np.isfinite(list(reading.values()))):
            name = next(name for name, value in reading.items() if not np.isfinite(value))
            raise InputError(f"the record of {name} is not a finite number")
        return reading

    def _act(self, swap, first):
        """Return the limited command at a control instant."""
        reading, blades = self._reading(swap, first), [float(swap[i]) for i in PITCHES]
        if first:
            torque = float(swap[INDEX["generator_torque"]])
            if torque == 0.0:  # the host has not measured it yet
                speed = float(swap[INDEX["generator_speed"]])
                torque = generator_torque(speed, sum(blades) / BLADES, self.curve)
            self._torque = clamp(torque, 0.0, self.limits.maximum)
            self._force = blades if self.individual else [sum(blades) / BLADES] * BLADES
            self._pitch = [clamp(pitch, self.drive.minimum, self.drive.maximum) for pitch in self._force]
            if "generator_torque" in reading:
                reading["generator_torque"] = torque
        view = self._measurement(reading, float(swap[INDEX["time"]]))
        if first:
            self.controller.reset(view)
        compiled = isinstance(self.controller, CompiledController)
        if compiled:  # its law receives the command in force
            self.controller.command[:] = [self._torque, *self._force][: self.controller.command.size]
        command = self.controller.act(view)
        if not np.isfinite(command).all():
            raise ControllerError(
                f"controller {self.controller.name!r} commands {command}: must be finite",
                controller=self.controller.name, time=float(view.time), returned=command,
            )  # fmt: skip
        pitches = list(command[1:]) if self.individual else [command[1]] * BLADES
        self._torque = float(followed_torque(self._torque, command[0], self.control_dt, self.limits))
        self._force = pitches
        low, high, step = self.drive.minimum, self.drive.maximum, self.drive.rate_limit * self.control_dt
        targets = [clamp(pitch, low, high) for pitch in pitches]
        self._pitch = [_followed(*pair, step) for pair in zip(self._pitch, targets, strict=True)]
        return self._torque, *self._pitch

    def _measurement(self, reading, time):
        """Return the controller's view of a measurement; fields that are not read are NaN."""
        values = [reading.get(name, np.nan) for name in Measurement._fields]
        values[0] = time
        if not set(BladeMeasurement._fields).isdisjoint(self.fields) or self.individual:
            values += [reading.get(name, np.nan) for name in BladeMeasurement._fields]
        if self._view is None:
            self._view = view_of(self.controller)
        return self._view(values)


def _followed(value, target, step):
    """Return the target, or the value moved towards it by a step."""
    change = target - value
    if abs(change) <= step * (1.0 + SLACK):
        return float(target)
    return float(value + step if change > 0.0 else value - step)
