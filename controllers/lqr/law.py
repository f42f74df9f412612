"""Defines LQG control of torque and blade pitch with a wind-speed estimator, scheduled over the wind.

A Kalman filter on measured channels estimates platform, rotor-averaged wind and waves; state feedback on
the estimates sets the rates of both commands, so that limits cause no windup. Models, trims and gains of
controllers/lqr/design.py are interpolated in a slow mean of the estimated wind. Near the minimum pitch the
torque law of theory.md, section 3, is applied.

Filter and feedback start from the applied command: an addition in the environment's residual mode remains in
the next command and is therefore an addition to the rates.
"""

from math import exp

import numpy as np

from fowt_env.analysis.threads import one_thread
from fowt_env.caches import Cache
from fowt_env.control import CompiledController, check_control_dt
from fowt_env.controllers.gains import with_gains
from fowt_env.controllers.lqr import design
from fowt_env.controllers.lqr.design import MOMENT, N_FEEDBACK, N_PLANT, WAVE, WIND, LQGSettings
from fowt_env.controllers.lqr.estimator import (
    BLOCK,
    BLOCKS,
    DEVIATION,
    FED_BACK,
    INTEGRAL,
    N_MEMORY,
    OPERATING_WIND,
    PITCH,
    PITCH_COMMAND,
    ROTOR,
    TORQUE,
    TORQUE_COMMAND,
    TRIM,
    Head,
    K,
    between,
    block_of,
    deviate,
    estimate,
    estimator_law,
)
from fowt_env.controllers.lqr.optimum import optimal_gains
from fowt_env.controllers.pi import curve_at
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.drivetrain import build_torque_curve, clamp, generator_torque, rate_limit
from fowt_env.plant.measurement import Measure

HANDOVER = (0.01745, 0.05236)  # rad of pitch command: torque from the curve below, from feedback above
TORQUE_RANGE = (0.5, 1.1)  # of rated, for the feedback's torque
POWER_LIMIT = 1.15  # of rated, for the product of the feedback's torque and the estimated rotor speed
INTEGRAL_LIMIT = 1.0  # rad, of the speed integral
FORGETTING = 0.1  # 1/s, decay rate of the speed integral at minimum pitch
STARTING = 0.7  # of rated speed, below which a rotor with pitched blades speeds up from a stop


@kernel
def feed_back(p, low, fraction, memory, row):
    """Return the rate by row 0 (torque, rated torques/s) or 1 (pitch command, rad/s) of the gain."""
    total = 0.0
    for j in range(N_FEEDBACK):
        total -= between(p, low, fraction, K + row * N_FEEDBACK + j) * memory[FED_BACK + j]
    return total


@kernel
def speed_integral(integral, error, pitching, dt, limit):
    """Return the integral of the speed error (rad/s) after dt (s), within a limit (rad).

    It decays below rated speed at minimum pitch, where no blade pitch could correct the error.
    """
    if pitching or error > 0.0:
        return clamp(integral + dt * error, -limit, limit)
    return integral * (1.0 - FORGETTING * dt)


@control_kernel
def lqr_law(p, memory, measurement, command):
    """Advance the sampled law by one period."""
    dt, rated = p[Head.CONTROL_DT], p[Head.RATED_SPEED]
    estimate(p, memory, measurement, command)
    low, fraction = block_of(p, memory)

    speed_error = measurement[Measure.GENERATOR_SPEED] / p[Head.GEAR_RATIO] - rated
    pitch, torque = memory[PITCH_COMMAND], memory[TORQUE_COMMAND]
    pitching = pitch > p[Head.HANDOVER_LOW]
    memory[INTEGRAL] = speed_integral(memory[INTEGRAL], speed_error, pitching, dt, INTEGRAL_LIMIT)

    deviate(p, low, fraction, memory)
    for i in range(N_PLANT):
        memory[FED_BACK + i] = memory[DEVIATION + i]
    memory[FED_BACK + ROTOR] = memory[ROTOR] - rated
    memory[FED_BACK + N_PLANT] = torque / p[Head.RATED_TORQUE] - 1.0
    memory[FED_BACK + N_PLANT + 1] = pitch - between(p, low, fraction, PITCH)
    memory[FED_BACK + N_PLANT + 2] = memory[INTEGRAL]
    for i in range(MOMENT - WIND):
        memory[FED_BACK + N_PLANT + 3 + i] = memory[DEVIATION + WIND + i]

    rate = clamp(feed_back(p, low, fraction, memory, 1), -p[Head.PITCH_RATE_LIMIT], p[Head.PITCH_RATE_LIMIT])
    pitch = clamp(pitch + dt * rate, p[Head.PITCH_MINIMUM], p[Head.PITCH_MAXIMUM])
    target = torque + dt * p[Head.RATED_TORQUE] * feed_back(p, low, fraction, memory, 0)
    target = clamp(target, p[Head.TORQUE_LOW], p[Head.TORQUE_HIGH])
    if target * memory[ROTOR] > p[Head.POWER_HIGH]:
        target = p[Head.POWER_HIGH] / memory[ROTOR]
    by_curve = generator_torque(p[Head.GEAR_RATIO] * memory[ROTOR], pitch, curve_at(p, Head.CURVE))
    blend = clamp((pitch - p[Head.HANDOVER_LOW]) / (p[Head.HANDOVER_HIGH] - p[Head.HANDOVER_LOW]), 0.0, 1.0)
    target = blend * target + (1.0 - blend) * by_curve
    command[0], command[1] = rate_limit(torque, target, dt * p[Head.TORQUE_RATE_LIMIT]), pitch


def blocks(models, settings, turbine, dt):
    """Return (n, BLOCK) trims, estimators and feedback gains of each wind, sampled every dt."""
    rows = []
    for model, gain in zip(models, optimal_gains(models, settings, turbine, dt), strict=True):
        a, b = design.sampled(model.A, model.B, dt)
        estimator = design.estimator_gain(model, dt, design.moment_scale(turbine))
        parts = (model.trim, model.torque, model.pitch, a, b, model.C, estimator, gain)
        rows.append(np.concatenate([np.ravel(part) for part in parts]))
    return np.array(rows)


_BLOCKS = Cache(32)  # (id of models, settings, control period) -> (models, their blocks)


def limits_of(turbine, control_dt):
    """Return {entry: value} of the first entries of Head, which mpc also uses."""
    law, drive = turbine.torque_law, turbine.pitch_drive
    return {
        Head.CONTROL_DT: control_dt,
        Head.RATED_SPEED: turbine.rated_rotor_speed,
        Head.RATED_TORQUE: law.rated_torque,
        Head.GEAR_RATIO: turbine.drivetrain.gear_ratio,
        Head.PITCH_MINIMUM: drive.minimum,
        Head.PITCH_MAXIMUM: drive.maximum,
        Head.PITCH_RATE_LIMIT: drive.rate_limit,
        Head.TORQUE_RATE_LIMIT: law.max_torque_rate,
    }


class LQR(CompiledController):
    """Implements the LQG law of LQGSettings, designed on the scene's platform by prepare() or on models."""

    kernel = staticmethod(lqr_law)
    information = (
        "generator_speed", "blade_pitch", "generator_torque", "nacelle_acceleration", "platform_pitch",
        "platform_pitch_rate", "plant_model",
    )  # fmt: skip

    def __init__(self, turbine, control_dt, settings=None, name="lqr", models=None):
        super().__init__(name, np.zeros(BLOCKS), N_MEMORY)
        self.turbine, self.control_dt = turbine, check_control_dt(control_dt)
        self.settings = LQGSettings() if settings is None else settings
        self.prepared = False
        self._plant = None  # models of the last design in prepare
        self.designed = models is not None
        if self.designed:
            self.take(models)

    @one_thread
    def prepare(self, scene):
        """Linearise the scene's platform over the winds and design the gains (cached per platform).

        Models passed to the constructor are kept: such a controller ignores the scene's plant.
        Raises: InputError for a scene without wind.
        """
        if scene.model.aero is None:
            raise InputError(f"controller {self.name!r}: needs a scene with wind to linearise")
        if self.designed:
            return
        models = design.design_models(scene)
        if models is not self._plant:
            self.turbine = with_gains(scene)  # gains of the reference law of the design
            self._plant = models
            self.take(models)

    @one_thread
    def take(self, models):
        """Design and install the gains for DesignModels of winds 1 m/s apart."""
        known = (id(models), self.settings, self.control_dt)

        def make():  # the models are kept with their blocks, so that their id stays valid
            return models, blocks(models, self.settings, self.turbine, self.control_dt)

        self.install(models[0].wind, _BLOCKS.get(known, make)[1])

    def install(self, first_wind, table):
        """Set the parameters from the blocks of winds 1 m/s apart."""
        turbine, law = self.turbine, self.turbine.torque_law
        values = {
            **limits_of(turbine, self.control_dt),
            Head.FIRST_WIND: first_wind,
            Head.WIND_STEP: 1.0,
            Head.WINDS: len(table),
            Head.SCHEDULE_DECAY: exp(-self.control_dt / self.settings.schedule_time),
            Head.TORQUE_LOW: TORQUE_RANGE[0] * law.rated_torque,
            Head.TORQUE_HIGH: min(TORQUE_RANGE[1] * law.rated_torque, law.max_torque),
            Head.HANDOVER_LOW: HANDOVER[0],
            Head.HANDOVER_HIGH: HANDOVER[1],
            Head.POWER_HIGH: POWER_LIMIT * law.rated_torque * turbine.rated_rotor_speed,
        }
        self.parameters = np.concatenate([[*values.values(), *build_torque_curve(law)], np.ravel(table)])
        self.prepared = True

    def reset(self, measurement):
        """Start the estimate at the trim with the measured pitch (or, at minimum pitch, rotor speed).

        Raises: InputError if prepare() was not called.
        """
        if not self.prepared:
            raise InputError(f"controller {self.name!r}: call prepare(scene) before reset(measurement)")
        p, memory = self.parameters, self.memory
        table = p[BLOCKS:].reshape(-1, BLOCK)
        winds = p[Head.FIRST_WIND] + p[Head.WIND_STEP] * np.arange(len(table))
        speed = measurement.generator_speed / p[Head.GEAR_RATIO]
        # speed plus pitch increases over all winds: speed below rated, pitch above
        known = table[:, TRIM + ROTOR] / p[Head.RATED_SPEED] + table[:, TRIM + ROTOR + 1]
        fraction = speed / p[Head.RATED_SPEED]
        if fraction < STARTING and measurement.blade_pitch > HANDOVER[0]:
            fraction = 1.0  # the pitch alone tells the wind: in a lull blades would be at the minimum
        wind = np.interp(fraction + measurement.blade_pitch, known, winds)
        memory[:] = 0.0
        for i in range(N_PLANT):
            memory[i] = np.interp(wind, winds, table[:, TRIM + i])
        memory[1], memory[3] = measurement.platform_pitch, measurement.platform_pitch_rate
        memory[ROTOR], memory[ROTOR + 1] = speed, measurement.blade_pitch
        memory[WIND:WAVE] = memory[OPERATING_WIND] = wind
        low, high = p[Head.PITCH_MINIMUM], p[Head.PITCH_MAXIMUM]
        memory[PITCH_COMMAND] = min(max(measurement.blade_pitch, low), high)
        torque = measurement.generator_torque
        if not np.isfinite(torque):
            torque = np.interp(wind, winds, table[:, TORQUE])
        memory[TORQUE_COMMAND] = torque


class WindEstimator(LQR):
    """Runs the Kalman filter of LQR without feedback, with the commands in force as inputs.

    memory begins with the estimates, in the order of ESTIMATED of fowt_env/envs/observations.py.
    """

    kernel = staticmethod(estimator_law)

    def __init__(self, turbine, control_dt, name="estimator"):
        super().__init__(turbine, control_dt, name=name)


def lqr(turbine, control_dt):
    """Apply LQG control of torque and blade pitch with estimated wind, tuned on training seeds."""
    return LQR(turbine, control_dt)
