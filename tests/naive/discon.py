"""The published DISCON control flow for the OC3-Hywind, line by line, with its own clocks."""

import math


class Discon:
    """Call with (time, generator speed, measured pitch); returns (torque, pitch) commanded by this call."""

    corner = 1.570796
    KI, KP, KK = 0.0008965149, 0.006275604, 0.1099965
    max_pitch, min_pitch, max_rate = math.pi / 2.0, 0.0, math.radians(8.0)
    cut_in, max_torque_rate, max_torque = 70.16224, 15000.0, 47402.91
    k2, start2, region3_pitch, rated, slip = 2.332287, 91.21091, 0.01745329, 121.6805, 10.0

    def __init__(self, reference=122.9096, power=5296610.0):
        """Set-point of the generator speed (rad/s) and rated power (W), which round differently elsewhere."""
        self.reference, self.power = reference, power
        self.synchronous = self.rated / (1.0 + 0.01 * self.slip)
        self.slope15 = self.k2 * self.start2 * self.start2 / (self.start2 - self.cut_in)
        self.slope25 = (self.power / self.reference) / (self.rated - self.synchronous)
        self.transition = (
            self.slope25 - math.sqrt(self.slope25 * (self.slope25 - 4.0 * self.k2 * self.synchronous))
        ) / (2.0 * self.k2)
        self.started = False

    def __call__(self, time, speed, measured):
        if not self.started:
            self.filtered, self.pitch = speed, measured
            gain = 1.0 / (1.0 + self.pitch / self.KK)
            self.integral = self.pitch / (gain * self.KI)
            self.last_time = self.last_torque_time = self.last_pitch_time = time
        alpha = math.exp((self.last_time - time) * self.corner)
        self.filtered = (1.0 - alpha) * speed + alpha * self.filtered
        # torque
        elapsed = time - self.last_torque_time
        if self.filtered >= self.rated or self.pitch >= self.region3_pitch:
            torque = self.power / self.reference
        elif self.filtered <= self.cut_in:
            torque = 0.0
        elif self.filtered < self.start2:
            torque = self.slope15 * (self.filtered - self.cut_in)
        elif self.filtered < self.transition:
            torque = self.k2 * self.filtered * self.filtered
        else:
            torque = self.slope25 * (self.filtered - self.synchronous)
        torque = min(torque, self.max_torque)
        if self.started:
            rate = (torque - self.last_torque) / elapsed
            torque = self.last_torque + min(max(rate, -self.max_torque_rate), self.max_torque_rate) * elapsed
        self.last_torque, self.last_torque_time = torque, time
        # pitch
        elapsed = time - self.last_pitch_time
        if self.started:
            gain = 1.0 / (1.0 + self.pitch / self.KK)
            error = self.filtered - self.reference
            self.integral += error * elapsed
            self.integral = min(
                max(self.integral, self.min_pitch / (gain * self.KI)), self.max_pitch / (gain * self.KI)
            )
            wanted = gain * self.KP * error + gain * self.KI * self.integral
            wanted = min(max(wanted, self.min_pitch), self.max_pitch)
            rate = min(max((wanted - measured) / elapsed, -self.max_rate), self.max_rate)
            self.pitch = min(max(measured + rate * elapsed, self.min_pitch), self.max_pitch)
        self.last_time = self.last_pitch_time = time
        self.started = True
        return torque, self.pitch
