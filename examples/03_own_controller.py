"""A controller of your own: constant power above rated, and a PI law on rotor speed for the blade pitch.

Any object with these two methods will do. Put the class into a module of yours, and the command line takes
it too: fowt simulate --controller mymodule:SlowPI
"""

from math import radians

import fowt_env


class SlowPI:
    """Blade pitch from the rotor-speed error, integral starting where the turbine is."""

    name = "slow_pi"
    rated_speed = 1.267109  # rad/s
    proportional = 0.5  # rad/(rad/s)
    integral = 0.06  # rad/rad
    period = 0.1  # s, the control_dt of simulate

    def reset(self, measurement):
        self.base = measurement.blade_pitch

    def act(self, measurement):  # SI units, radians
        error = measurement.rotor_speed - self.rated_speed
        self.base = min(max(self.base + self.integral * error * self.period, 0.0), radians(90.0))
        blade_pitch = min(max(self.base + self.proportional * error, 0.0), radians(90.0))
        torque = min(5.2966e6 / measurement.generator_speed, 47402.0)  # N m, high-speed shaft
        return torque, blade_pitch


if __name__ == "__main__":
    wind = {"kind": "ntm", "speed": 18.0, "class": "B"}
    sea = {"kind": "jonswap", "Hs": 6.0, "Tp": 10.0}
    scene = fowt_env.build_scene(wind=wind, sea=sea, fidelity="standard")
    for controller in ("pi", SlowPI()):
        run = fowt_env.simulate(scene, controller=controller, duration=300.0)
        print(
            f"{controller if isinstance(controller, str) else controller.name:8}"
            f" rotor speed std {run['RotSpeed_[rpm]'].std():.2f} rpm,"
            f" power std {run['GenPwr_[kW]'].std():.0f} kW,"
            f" platform pitch std {run['PtfmPitch_[deg]'].std():.2f} deg"
        )
