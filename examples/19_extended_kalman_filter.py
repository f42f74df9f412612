"""An extended Kalman filter: the wind from four sensors, by Jacobians of the plant itself."""

import numpy as np

from fowt_env.controllers import make
from fowt_env.envs import FowtEnv, PeriodJacobians

SECONDS, SETTLING = 300.0, 60.0  # of the run, of which so many do not count
WIND, SEA = 18.0, {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}  # the model is in steady wind of this speed
# state that a sensor measures: standard deviation of its error, of which the waves, which the model does not
# have, are the larger part; rad/s, rad, rad/s, rad
SENSORS = {"rotor_speed": 1e-3, "platform_pitch": 3e-3, "wy": 2e-3, "blade_pitch": 1e-3}
# standard deviation of what disturbs a state in a period of 0.1 s
DISTURBED = {"vx": 2e-3, "wy": 4e-4, "rotor_speed": 1e-4}
BEGUN = {"surge": 3.0, "vx": 0.3, "heave": 0.3, "vz": 0.2, "platform_pitch": 0.02, "wy": 0.01}  # at first
WIND_SPREAD, WIND_MEMORY = 2.0, 10.0  # m/s, s: of the wind's deviation from the mean


class Filter:
    """Estimates the states of the plant and the deviation of the wind from that of the model.

    The model is an environment in steady wind and still water. Each period it is advanced under the command
    in force, and its Jacobian advances the covariance; wind and corrections are shifts of its state. The
    effect of the wind is linear about that of the model, which biases the surge, which no sensor measures.
    """

    def __init__(self):
        self.model = PeriodJacobians(FowtEnv(wind=WIND, sea=None, action_mode="direct"))
        self.model.reset(seed=0)
        self.wind, self.names = 0.0, ()

    def advance(self, torque, blade_pitch):
        """Advance the estimate by a control period under a command, N m and rad."""
        jacobian = self.model.step_physical(torque, blade_pitch)[-1]["jacobian"]
        n, dt = len(jacobian.states), self.model.unwrapped.control_dt
        if not self.names:
            self.names = jacobian.states
            begun = [BEGUN.get(name, 1e-2) for name in self.names]
            self.spread = np.diag(np.square([*begun, WIND_SPREAD]))
            self.read = np.eye(n + 1)[[self.names.index(name) for name in SENSORS]]
            self.noise = np.diag(np.square(list(SENSORS.values())))
        keep = np.exp(-dt / WIND_MEMORY)
        disturbed = [DISTURBED.get(name, 1e-6) for name in self.names]
        disturbed = np.diag(np.square([*disturbed, WIND_SPREAD * np.sqrt(1.0 - keep**2)]))
        transition = np.block([[jacobian.state, jacobian.wind[:, None]], [np.zeros((1, n)), keep]])
        self.spread = transition @ self.spread @ transition.T + disturbed
        self.change = jacobian.wind * self.wind
        self.states = jacobian.end + self.change
        self.wind *= keep

    def correct(self, reading):
        """Correct the estimate by a Measurement."""
        values = reading.rotor_speed, reading.platform_pitch, reading.platform_pitch_rate, reading.blade_pitch
        missed = np.array(values) - self.read[:, :-1] @ self.states
        gain = np.linalg.solve(self.read @ self.spread @ self.read.T + self.noise, self.read @ self.spread).T
        correction = gain @ missed
        self.spread -= gain @ self.read @ self.spread
        self.model.shift(self.change + correction[:-1])
        self.states, self.wind = self.states + correction[:-1], self.wind + correction[-1]


def main():
    plant = FowtEnv(
        wind={"kind": "ntm", "speed": WIND, "class": "B"}, sea=SEA, sensors="standard", duration=SECONDS,
        action_mode="direct", observation=("rotor_speed", "blade_pitch"),
    )  # fmt: skip
    plant.reset(seed=1)
    controller = make("gspi_oc3", plant.scene.turbine, plant.control_dt)
    controller.reset(plant.measurement())
    known, rows, ended = Filter(), [], False
    while not ended:
        command = controller.act(plant.measurement())
        *_, terminated, truncated, _ = plant.step_physical(*command)
        known.advance(*command)
        known.correct(plant.measurement())
        rows.append((plant.true_measurement().wind_speed, WIND + known.wind))
        ended = terminated or truncated
    true, found = np.array(rows)[round(SETTLING / plant.control_dt) :].T
    error = np.sqrt(np.mean((found - true) ** 2))
    print(f"wind: deviates by {true.std():.2f} m/s, estimated within {error:.2f} m/s")


if __name__ == "__main__":
    main()
