"""Separates the differences between ROSCO with the OC3 gains and the published law with the same gains.

Changes from the published law towards ROSCO: control period, position of the gain schedule, pitch used by
the schedule. Changes from ROSCO towards the published law: set-point smoother, torque law, and gains that
compensate the position of the schedule. Cases have normal turbulence at WINDS, with validation seeds.
"""

from math import exp
from typing import Annotated

import numpy as np
import typer

from fowt_env.controllers.gspi import gspi_oc3
from fowt_env.controllers.pi import (
    PI,
    Memory,
    Parameter,
    PISettings,
    pi,
    schedule_gain,
    speed_error,
    write_commands,
)
from fowt_env.controllers.rosco import SCHEDULE, Rosco, RoscoSettings, pitch_gains
from fowt_env.descriptions.sea_state import joint_sea_state
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.design.tune import BASELINE, SEEDS
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.evaluate import evaluate, mean_ratios
from fowt_env.training.evaluation.run_case import CONTROL_DT

WINDS = (13.0, 17.0, 21.0)  # m/s
SITE = "gulf_of_maine_normal"

SHOWN = {
    "rotor speed std": "RotSpeed_std_[rpm]",
    "platform pitch std": "PtfmPitch_std_[deg]",
    "pitch travel": "blade_pitch_travel_[deg/s]",
    "overspeed": "overspeed_[%]",
    "power std": "GenPwr_std_[kW]",
    "torque travel": "torque_travel_[kN-m/s]",
    "shaft-torque DEL": "RotTorq_DEL_[kN-m]",
}


class InsideIntegral:
    """Computes the PI law with the gain schedule inside the integral, as in ROSCO: I += GK KI e dt.

    filtered: the schedule follows the filtered measured blade pitch, as in ROSCO, not the last command.
    """

    def __init__(self, settings, control_dt, filtered=False):
        self.law = PI(settings, control_dt)
        self.filtered = filtered
        self.decay = exp(-control_dt * settings.speed_filter_corner)

    def reset(self, measurement):
        """Reset as PI.reset; the integral is a blade pitch, rad."""
        self.law.reset(measurement)
        p, memory = self.law.parameters, self.law.memory
        self.pitch = memory[Memory.PITCH_COMMAND]
        gain = schedule_gain(self.pitch, p[Parameter.SCHEDULE_PITCH])
        memory[Memory.INTEGRAL] *= gain * p[Parameter.INTEGRAL]

    def act(self, measurement):
        """Return (generator torque N m, blade pitch rad) of one period."""
        p, memory = self.law.parameters, self.law.memory
        if self.filtered:
            self.pitch += (1.0 - self.decay) * (measurement.blade_pitch - self.pitch)
        else:
            self.pitch = memory[Memory.PITCH_COMMAND]
        error = speed_error(p, memory, measurement.generator_speed)
        gain = schedule_gain(self.pitch, p[Parameter.SCHEDULE_PITCH])
        integral = memory[Memory.INTEGRAL] + gain * p[Parameter.INTEGRAL] * error * p[Parameter.CONTROL_DT]
        integral = min(max(integral, p[Parameter.PITCH_MINIMUM]), p[Parameter.PITCH_MAXIMUM])
        memory[Memory.INTEGRAL] = integral
        command = np.zeros(2)
        target = gain * p[Parameter.PROPORTIONAL] * error + integral
        write_commands(self.pitch, target, 0.0, p, memory, command)
        return float(command[0]), float(command[1])


def outside_factor(blade_pitch, schedule_pitch):
    """Return the effective fraction of the gains for small changes if the schedule multiplies the integral.

    beta = GK(beta) (KP e + KI I): a change of beta moves GK too, and with the steady GK KI I = beta,
    d beta (1 + beta/(beta_K + beta)) = GK (KP de + KI e dt): theory.md (A7) over GK.
    """
    return 1.0 / (1.0 + blade_pitch / (schedule_pitch + blade_pitch))


def variants(turbine):
    """Return {change: controller}, from the published law to ROSCO."""
    published = PISettings.published(turbine)
    fraction = outside_factor(SCHEDULE, turbine.gains["oc3"].gain_schedule_pitch)
    outside = dict(zip(("PC_GS_KP", "PC_GS_KI"), fraction * np.array(pitch_gains(turbine)), strict=True))
    rosco = {
        "rosco": {}, "rosco, no set-point smoother": {"SS_Mode": 0},
        "rosco, no smoother, torque K w^2": {"SS_Mode": 0, "VS_ControlMode": 1},
        "rosco, gains of a schedule outside": outside,
        "rosco, gains outside, no smoother": {"SS_Mode": 0, **outside},
        "rosco, gains outside, no smoother, K w^2": {"SS_Mode": 0, "VS_ControlMode": 1, **outside},
    }  # fmt: skip
    return {
        BASELINE: gspi_oc3(turbine, CONTROL_DT),
        "pi: the same in periods of 0.1 s": pi(turbine, CONTROL_DT),
        "pi, schedule inside the integral": InsideIntegral(published, CONTROL_DT),
        "pi, schedule inside, by filtered pitch": InsideIntegral(published, CONTROL_DT, filtered=True),
        **{k: Rosco(RoscoSettings(), CONTROL_DT, changes=changes) for k, changes in rosco.items()},
    }


def differences(winds=WINDS, seeds=SEEDS, duration=660.0, names=None, jobs=1):
    """Return a DataFrame of SHOWN of the variants, relative to gspi_oc3, means over the cases."""
    laws = variants(read_turbine("nrel5mw"))
    if names is not None:
        laws = {name: laws[name] for name in (BASELINE, *names)}
    turbulent = {"kind": "ntm", "class": "B"}
    cases = [Case(f"ntm_{u:g}", turbulent | {"speed": u}, joint_sea_state(SITE, u)) for u in winds]
    table = evaluate(laws, cases, duration=duration, seeds=seeds, jobs=jobs, control_dt=CONTROL_DT)
    return mean_ratios(table, BASELINE, SHOWN.values()).set_axis(list(SHOWN), axis=1)


def main(jobs: Annotated[int, typer.Option(help="Processes.")] = 1):
    """Print the changes from the published law to ROSCO with its gains, one at a time."""
    print(differences(jobs=jobs).round(3).to_string())


if __name__ == "__main__":
    typer.run(main)
