"""Plain-Python PI law and torque law, written from theory.md sections 3 and 4 with its figures."""

import math


def clip(value, low, high):
    """Value within [low, high]."""
    if value < low:
        return low
    if value > high:
        return high
    return value


def oc3_torque(speed, pitch, power_law=False):
    """Torque over filtered generator speed, the table of theory.md section 3."""
    start3 = 121.6805
    top = 5296610.0 / start3 if power_law else 43093.55
    synchronous = start3 / 1.10
    s25 = top / (start3 - synchronous)
    if speed >= start3 or pitch >= 0.01745329:
        torque = 5296610.0 / speed if power_law else 43093.55
    elif speed <= 70.16224:
        torque = 0.0
    elif speed < 91.21091:
        torque = 2.332287 * 91.21091**2 / (91.21091 - 70.16224) * (speed - 70.16224)
    elif 2.332287 * speed**2 > s25 * (speed - synchronous):
        torque = 2.332287 * speed**2
    else:
        torque = s25 * (speed - synchronous)
    return min(torque, 47402.91)


class NaivePI:
    """theory.md Eq. (8), sampled: filter, torque, schedule, integral with anti-windup, limits."""

    def __init__(self, KP, KI, beta_K, control_dt, measured=False, power_law=False, corner=1.570796):
        self.G, self.G_over_tau = KP * 97.0, KI * 97.0
        self.beta_K, self.dt, self.measured, self.power_law = beta_K, control_dt, measured, power_law
        self.corner = corner
        self.w_b0 = 122.9096 / 97.0
        self.low, self.high = 0.0, 1.570796

    def GK(self, beta):
        """Gain of the schedule; beta_K None: no schedule."""
        return 1.0 if self.beta_K is None else 1.0 / (1.0 + beta / self.beta_K)

    def start(self, speed, pitch, torque):
        """Filter, commands and integral such that the first command is the measured pitch."""
        self.w_f, self.beta_c = speed, clip(pitch, self.low, self.high)
        self.torque = clip(torque, 0.0, 47402.91)
        e = speed / 97.0 - self.w_b0
        GK = self.GK(self.beta_c)
        if self.beta_c == self.low or self.beta_c == self.high:
            term = self.beta_c
        else:
            term = clip(self.beta_c - GK * self.G * e, self.low, self.high)
        self.I_e = term / GK / self.G_over_tau - e * self.dt

    def step(self, speed, pitch):
        """(torque, blade pitch) commanded for a measured generator speed and blade pitch."""
        alpha = math.exp(-self.corner * self.dt)
        self.w_f = (1.0 - alpha) * speed + alpha * self.w_f
        e = self.w_f / 97.0 - self.w_b0
        beta = clip(pitch, self.low, self.high) if self.measured else self.beta_c
        GK = self.GK(beta)
        self.I_e = self.I_e + e * self.dt
        term = clip(GK * self.G_over_tau * self.I_e, self.low, self.high)
        self.I_e = term / (GK * self.G_over_tau)
        wanted = clip(GK * self.G * e + term, self.low, self.high)
        most = 0.1396263 * self.dt
        self.beta_c = self.beta_c + clip(wanted - self.beta_c, -most, most)
        most = 15000.0 * self.dt
        wanted = oc3_torque(self.w_f, beta, self.power_law)
        self.torque = self.torque + clip(wanted - self.torque, -most, most)
        return self.torque, self.beta_c
