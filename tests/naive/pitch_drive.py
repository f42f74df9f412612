"""Pitch drive of second order by many short steps of Euler's method: every law as it is written."""

from math import inf


class NaiveDrive:
    """One blade with its drive; advance() holds a command for a while."""

    def __init__(
        self, w, zeta, rate=inf, acceleration=inf, deadband=0.0, friction=0.0, low=-inf, high=inf, pitch=0.0
    ):
        self.w, self.zeta, self.rate_limit, self.acceleration = w, zeta, rate, acceleration
        self.deadband, self.friction, self.low, self.high = deadband, friction, low, high
        self.pitch, self.rate, self.held = pitch, 0.0, pitch

    def advance(self, command, duration, steps):
        if abs(command - self.held) > self.deadband:
            self.held = command
        target = min(max(self.held, self.low), self.high)
        h = duration / steps
        w2, damping, breakaway = self.w**2, 2.0 * self.zeta * self.w, self.w**2 * self.friction
        pitch, rate = self.pitch, self.rate
        for _ in range(steps):
            pull = w2 * (target - pitch)
            if rate == 0.0 and abs(pull) <= breakaway:
                continue
            way = (1.0 if rate > 0.0 else -1.0) if rate != 0.0 else (1.0 if pull > 0.0 else -1.0)
            gain = pull - damping * rate - way * breakaway
            gain = min(max(gain, -self.acceleration), self.acceleration)
            new = min(max(rate + h * gain, -self.rate_limit), self.rate_limit)
            if breakaway > 0.0 and new * rate < 0.0:  # friction brings it to rest before it turns
                new = 0.0
            pitch += 0.5 * h * (rate + new)
            rate = new
            if not self.low <= pitch <= self.high:
                pitch, rate = min(max(pitch, self.low), self.high), 0.0
        self.pitch, self.rate = pitch, rate


def play(commands, half_width, pitch=0.0):
    """What a play of that half width makes of commands: it is pushed, and stays where it was left."""
    result = []
    for command in commands:
        pitch = min(max(pitch, command - half_width), command + half_width)
        result.append(pitch)
    return result
