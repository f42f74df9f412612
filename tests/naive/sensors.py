"""A chain of sensors one reading after another, as its description says it."""

from collections import deque
from math import exp


class NaiveSensors:
    """Readings of a SensorChain: low pass, delay, noise, quantisation; integrals of readings after these."""

    def __init__(self, chain, control_dt, noise):
        self.chain, self.dt, self.noise = chain, control_dt, iter(noise)
        self.low, self.past, self.integral = {}, {}, {}

    def read(self, true):
        """Readings {field: value} of what is true {field: value}."""
        drawn = dict(zip(true, next(self.noise), strict=True))
        shown = {"time": true["time"]}
        for name, sensor in self.chain.sensors.items():
            if name in true and sensor.integral_of is None:
                shown[name] = self.measured(name, sensor, true[name], drawn[name])
        for name, sensor in self.chain.sensors.items():
            if sensor.integral_of is not None:
                if name in self.integral:
                    kept = exp(-self.dt * sensor.high_pass) * self.integral[name]
                    self.integral[name] = kept + self.dt * shown[sensor.integral_of]
                else:
                    self.integral[name] = 0.0
                shown[name] = self.integral[name]
        return shown

    def measured(self, name, sensor, value, noise):
        if sensor.time_constant > 0.0:
            kept = exp(-self.dt / sensor.time_constant)
            value = kept * self.low.get(name, value) + (1.0 - kept) * value
            self.low[name] = value
        periods = round(sensor.delay / self.dt)
        past = self.past.setdefault(name, deque([value] * (periods + 1), maxlen=periods + 1))
        past.append(value)
        value = past[0] + noise
        return round(value / sensor.step) * sensor.step if sensor.step > 0.0 else value
