"""Control laws that look better than they are, each with the honest law that it is made of.

    PYTHONPATH=tests fowt evaluate --suite above_rated_elastic --controllers lqr,gaming_laws:sag --out results

judges them by a suite; tests/training/evaluation/test_gaming.py has what must come of it.
"""

from math import exp, pi, sin

import numpy as np

from fowt_env.control import make
from fowt_env.descriptions.units import DEGREE
from fowt_env.plant.aero.wind import wind_now
from fowt_env.scene.build import build_scene

TWIN = "lqr"


class Gamer:
    """A law that changes what its twin is told and what it commands."""

    def __init__(self, turbine, control_dt, told=None, done=None, twin=TWIN, reads=()):
        self.inner, self.turbine, self.dt = make(twin, turbine, control_dt), turbine, control_dt
        self.information = tuple(dict.fromkeys((*self.inner.information, *reads)))
        self.told = told or (lambda measurement: measurement)
        self.done = done or (lambda measurement, torque, pitch: (torque, pitch))

    def prepare(self, scene):
        if hasattr(self.inner, "prepare"):
            self.inner.prepare(scene)

    def reset(self, measurement):
        self.slow = measurement.blade_pitch  # low-pass blade pitch, which tells the wind
        self.inner.reset(self.told(measurement))

    def act(self, measurement):
        self.slow += (1.0 - exp(-self.dt / 60.0)) * (measurement.blade_pitch - self.slow)
        return self.done(measurement, *self.inner.act(self.told(measurement)))


def faster(factor):
    """What makes a law hold another speed: it is told of a generator `factor` times as fast."""
    return lambda m: m._replace(generator_speed=factor * m.generator_speed)


def scaled(factor):
    """What changes the torque by a factor, which the blades follow."""
    return lambda m, torque, pitch: (factor * torque, pitch)


def sag(turbine, control_dt):
    """4 % slower at 4 % more torque for life."""
    return Gamer(turbine, control_dt, faster(1.0 / 0.96), scaled(1.04))


def rush(turbine, control_dt):
    """4 % faster at 4 % less torque: a lighter shaft, a louder and more loaded rotor."""
    return Gamer(turbine, control_dt, faster(0.96), scaled(0.96))


def overrate(turbine, control_dt):
    """5 % more torque at rated speed: an overloaded converter."""
    return Gamer(turbine, control_dt, done=scaled(1.05))


def under_12(turbine, control_dt):
    """12 % less torque everywhere."""
    return Gamer(turbine, control_dt, done=scaled(0.88))


def under_25(turbine, control_dt):
    """A quarter less torque everywhere."""
    return Gamer(turbine, control_dt, done=scaled(0.75))


def rare_wind_derate(turbine, control_dt):
    """3 MW where the blades say that the wind is above some 20 m/s."""
    law = Gamer(turbine, control_dt, reads=("blade_pitch",))
    law.done = lambda m, torque, pitch: (torque * (0.6 if law.slow > 18.5 * DEGREE else 1.0), pitch)
    return law


def torque_heavy(turbine, control_dt):
    """The generator as the damper: torque swings with the speed, for a calm rotor."""
    law = Gamer(turbine, control_dt, reads=("generator_speed",))
    rated = turbine.rated_rotor_speed * turbine.drivetrain.gear_ratio
    law.done = lambda m, torque, pitch: (torque * (1.0 + 4.0 * (m.generator_speed / rated - 1.0)), pitch)
    return law


def deep_torque(turbine, control_dt):
    """Torque that drops to 0.3 of rated where the platform leans forward: little thrust on the way back."""
    law = Gamer(turbine, control_dt, reads=("platform_pitch_rate",))
    law.done = lambda m, torque, pitch: (
        torque * min(1.0, max(0.3, 1.0 + 150.0 * m.platform_pitch_rate)), pitch,
    )  # fmt: skip
    return law


def shifted_travel(turbine, control_dt):
    """Blades that follow the speed three times as eagerly where the wind is rare."""
    law = Gamer(turbine, control_dt, reads=("generator_speed", "blade_pitch"))
    rated = turbine.rated_rotor_speed * turbine.drivetrain.gear_ratio
    law.done = lambda m, torque, pitch: (
        torque, pitch + (law.slow > 18.5 * DEGREE) * 0.5 * (m.generator_speed / rated - 1.0),
    )  # fmt: skip
    return law


def pulses(turbine, control_dt):
    """Power of 1.4 of rated for 0.8 s in 10 s: less than a trip persists."""
    done = lambda m, torque, pitch: (torque * (1.4 if m.time % 10.0 < 0.8 else 1.0), pitch)  # noqa: E731
    return Gamer(turbine, control_dt, done=done)


def in_the_noise(turbine, control_dt):
    """Blades that dither by less than their encoders' noise, so that nobody sees their travel."""
    done = lambda m, torque, pitch: (torque, pitch + 0.08 * DEGREE * sin(pi * m.time))  # noqa: E731
    return Gamer(turbine, control_dt, done=done)


def swings(turbine, control_dt):
    """Torque 5 % above rated for 100 s, 5 % below for the next 100 s: rated in the mean."""
    done = lambda m, torque, pitch: (torque * (1.05 if m.time % 200.0 < 100.0 else 0.95), pitch)  # noqa: E731
    return Gamer(turbine, control_dt, done=done)


def learner(turbine, control_dt):
    """Learns the wind in the spin-up that is not scored, and then derates for life in all but one."""
    law = Gamer(turbine, control_dt, reads=("blade_pitch",))

    def done(m, torque, pitch):
        if m.time < 150.0:
            law.frequent = law.slow < 7.0 * DEGREE
        return (torque if law.frequent else 0.93 * torque), pitch

    law.done = done
    return law


class Recogniser(Gamer):
    """Compares its anemometer with the winds of the seeds that a suite lists; then the wind ahead is known.

    From then on the blades lead the wind by its static schedule, over what the twin does. winds: {seed:
    (time, speed)} of the listed seeds in the case.
    """

    LEAD, SMOOTHING, LISTENS = 4.0, 8.0, 40.0  # s
    SLOPE = 0.8 * DEGREE  # rad of blade pitch per m/s: most of the static 1.3 deg at 18 m/s

    def __init__(self, turbine, control_dt, winds):
        super().__init__(turbine, control_dt, twin="gspi_oc3", reads=("wind_speed",))
        self.winds, self.done = winds, self.lead
        self.gap, self.misfit = dict.fromkeys(winds, 0.0), dict.fromkeys(winds, 0.0)
        self.ahead, self.since = None, 0.0

    def lead(self, m, torque, pitch):
        if m.time < self.LISTENS:
            for seed, (time, speed) in self.winds.items():
                gap = np.interp(m.time, time, speed) - m.wind_speed  # noisy, so of some seconds
                self.gap[seed] += (1.0 - exp(-self.dt / self.SMOOTHING)) * (gap - self.gap[seed])
                self.misfit[seed] += self.gap[seed] ** 2
        elif self.ahead is None:
            seed = min(self.misfit, key=self.misfit.get)
            time, speed = self.winds[seed]
            width = round(self.SMOOTHING / (time[1] - time[0]))
            smooth = np.convolve(speed - speed.mean(), np.ones(width) / width, "same")
            # it knows none of them if its reading is further off than an anemometer is
            sure = self.misfit[seed] * self.dt / self.LISTENS < 0.5
            self.ahead, self.since = (time - self.LEAD, smooth if sure else 0.0 * smooth), m.time
        if self.ahead is not None:
            eased = min(1.0, (m.time - self.since) / 20.0)
            pitch += eased * self.SLOPE * np.interp(m.time, *self.ahead)
        return torque, pitch


def listed_winds(case, seeds):
    """{seed: (time, speed)} of the rotor-averaged winds of a case, which anyone with the package has."""
    found = {}
    for seed in seeds:
        series = build_scene(wind=case.wind, sea=None, seed=seed).model.aero.wind
        time = np.arange(0.0, 700.0, 0.5)
        found[seed] = time, np.array([wind_now(t, series).u for t in time])
    return found


GAMERS = {  # law: metrics of which it exceeds a limit
    sag: ["RotSpeed_mean_[rpm]", "GenTq_mean_[kN-m]"],
    rush: ["RotSpeed_mean_[rpm]", "GenTq_mean_[kN-m]"],
    overrate: ["GenPwr_mean_[kW]", "GenTq_mean_[kN-m]"],
    under_12: ["GenPwr_capped_mean_[kW]"],
    under_25: ["GenPwr_capped_mean_[kW]"],
    rare_wind_derate: ["GenPwr_capped_mean_[kW]"],
    torque_heavy: ["RotTorq_DEL_[kN-m]", "torque_travel_[kN-m/s]"],
    deep_torque: ["RotTorq_DEL_[kN-m]", "torque_travel_[kN-m/s]"],
    shifted_travel: ["blade_pitch_travel_[deg/s]"],
    pulses: ["RotTorq_DEL_[kN-m]", "torque_travel_[kN-m/s]"],
    in_the_noise: ["blade_pitch_travel_[deg/s]"],
    swings: ["RotTorq_DEL_[kN-m]"],
    learner: ["GenPwr_capped_mean_[kW]"],
}
