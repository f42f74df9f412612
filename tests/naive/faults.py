"""Faults and stops as a wrapper around a controller: its commands, overridden from the fault on."""

from math import radians

from fowt_env.control import CheckedController, CompiledController
from fowt_env.plant.measurement import SENSOR_FIELDS


class Overridden:
    """A controller with a Fault of the grid or of all blades, read through exact sensors.

    feathered: rad, where feathering ends; rate: deg/s of it, from where the blades are measured.
    """

    def __init__(self, inner, fault, feathered, control_dt, rate=8.0):
        if not isinstance(inner, CompiledController | CheckedController):
            inner = CheckedController(inner)
        self.name = f"{inner.name} with {fault.kind}"
        self.inner, self.fault = inner, fault
        self.feathered = float(feathered)
        self.step = radians(rate if fault.rate is None else fault.rate) * control_dt
        self.stuck = self.target = None
        self.information = (*getattr(inner, "information", SENSOR_FIELDS), "blade_pitch")
        self.preview_times = tuple(getattr(inner, "preview_times", ()))

    def prepare(self, scene):
        if hasattr(self.inner, "prepare"):
            self.inner.prepare(scene)

    def reset(self, measurement):
        self.stuck = self.target = None
        self.inner.reset(measurement)

    def act(self, measurement):
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


class Started:
    """A controller in a start-up, read through exact sensors, from a parked turbine.

    limits: (feathered, fine: rad, rate: deg/s, connect: rad/s of the rotor, fast: rad/s of the generator,
    above which, as below the blade pitch flat, rad, and `longest` (s) after the connection, it is over);
    curve(generator speed, rad/s): N m, the most until then.
    """

    def __init__(self, inner, time, limits, curve, control_dt, longest=60.0):
        self.inner, self.time, self.curve, self.longest = inner, time, curve, longest
        self.feathered, self.fine, rate, self.connect, self.fast, self.flat = limits
        self.step = radians(rate) * control_dt
        self.target, self.connected, self.loaded = self.feathered, None, False
        read = ("rotor_speed", "blade_pitch", "generator_speed", "generator_torque")
        self.information = (*inner.information, *read)

    def prepare(self, scene):
        self.inner.prepare(scene)

    def reset(self, measurement):
        self.inner.reset(measurement)

    def act(self, m):
        if self.connected is None:
            # the command of the period before decides whether it is the run-up
            running_up = m.time > self.time + 1e-9
            if running_up and m.rotor_speed >= self.connect:
                self.connected = m.time
                self.inner.reset(m)
                self.inner.command[1] = self.target
            elif m.time >= self.time - 1e-9:
                self.target = max(self.target - self.step, self.fine)
        if self.connected is None:
            return 0.0, self.target
        self.inner.command[0] = m.generator_torque  # in force, below the command
        torque, pitch = self.inner.act(m)
        if self.connected < m.time:
            done = m.generator_speed >= self.fast or m.blade_pitch < self.flat
            self.loaded = self.loaded or done or m.time - self.connected >= self.longest - 1e-9
        return (torque if self.loaded else min(torque, self.curve(m.generator_speed))), pitch
