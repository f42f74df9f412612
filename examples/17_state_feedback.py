"""A linear-quadratic regulator of python-control: linear model, design, margins, and a run in turbulence."""

import importlib.util

import numpy as np

import fowt_env
from fowt_env.analysis.margins import LinearLaw, margins

INPUTS = ("generator_torque", "blade_pitch_command")
# state of the design: deviation that weighs as much as 1 of any other; inf: not weighted
SIZES = {
    "surge": np.inf, "platform_pitch": 0.02, "vx": np.inf, "wy": 0.004, "rotor_speed": 0.05,
    "blade_pitch": np.inf, "integral": 0.5,
}  # fmt: skip
STATES = tuple(SIZES)[:-1]  # the last one is the integral of the rotor speed's error, rad
INPUT_SIZES = (2000.0, 0.05)  # N m, rad
PERIOD = 0.1  # s, the control_dt of simulate


def design(model):
    """(2, 7) gain of u = -K x for the six STATES of the plant and the integral."""
    import control

    rows = [model.index(name) for name in STATES]
    plant = model.to_statespace(waves=False, inputs=INPUTS)
    speed = np.eye(len(STATES))[STATES.index("rotor_speed")]
    a = np.block([[plant.A[np.ix_(rows, rows)], np.zeros((len(rows), 1))], [speed, 0.0]])
    b = np.vstack([plant.B[rows], np.zeros(2)])
    q = np.diag([size**-2.0 for size in SIZES.values()])
    r = np.diag([size**-2.0 for size in INPUT_SIZES])
    return np.asarray(control.lqr(a, b, q, r)[0])


class StateFeedback:
    """The gain as a controller: torque and blade pitch from what is measured now."""

    name = "state_feedback"

    def __init__(self, model, gain):
        self.model, self.gain = model, gain
        self.rows = [model.index(name) for name in STATES]
        self.rest = model.equilibrium_inputs[list(INPUTS)].to_numpy()
        self.information = model.fields  # what model.state() reads

    def reset(self, measurement):
        self.integral = 0.0

    def act(self, measurement):
        deviation = self.model.state(measurement)[self.rows]
        self.integral += deviation[STATES.index("rotor_speed")] * PERIOD
        torque, blade_pitch = self.rest - self.gain @ np.append(deviation, self.integral)
        return torque, max(blade_pitch, 0.0)


def main():
    if importlib.util.find_spec("control") is None:
        print('python-control is missing: pip install "fowt-env[design]"')
        return
    sea = {"kind": "jonswap", "Hs": 4.0, "Tp": 9.0}
    scene = fowt_env.build_scene(
        wind={"kind": "ntm", "speed": 18.0, "class": "B"}, sea=sea, fidelity="standard"
    )
    model = fowt_env.linearize(scene)
    gain = design(model)

    # the same law on the whole model, all 14 states of it
    speed = np.eye(len(STATES))[[STATES.index("rotor_speed")]]
    law = LinearLaw(np.zeros((1, 1)), speed, -gain[:, -1:], -gain[:, :-1], STATES, INPUTS)
    found = margins(model, law)
    print(f"stable: {found.stable}, sensitivity peak {found.sensitivity_peak:.2f}")
    for name, loop in found.loops.items():
        print(f"    {name:20} phase margin {loop.phase:.0f} deg, delay margin {loop.delay:.2f} s")

    for controller in ("gspi_oc3", StateFeedback(model, gain)):
        run = fowt_env.simulate(scene, controller, duration=600.0).iloc[600:]  # after the first minute
        travel = np.abs(np.diff(run["BldPitch1_[deg]"])).mean() / PERIOD
        print(
            f"{getattr(controller, 'name', controller):14}"
            f" rotor speed std {run['RotSpeed_[rpm]'].std():.3f} rpm,"
            f" platform pitch std {run['PtfmPitch_[deg]'].std():.3f} deg, pitch rate {travel:.3f} deg/s"
        )


if __name__ == "__main__":
    main()
