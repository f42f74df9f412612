"""Defines model predictive control of torque and blade pitch on the estimate of lqr's Kalman filter.

Every period the law predicts a horizon of half a minute: platform and waves by the linear models of
controllers/lqr/design.py, rotor loads by a coefficient table, the wind by its filter. An exact preview
replaces the predicted wind, the readings of a lidar improve the prediction (ahead.py). One Newton step
(plan.py) improves the plan of torque and blade-pitch rates; if this step violates a limit, OSQP computes the
step. The rates are constant until the next period. An integral of the speed error removes the offset.
"""

import ctypes
from enum import IntEnum
from math import exp, nan

import numpy as np

from fowt_env.analysis.threads import one_thread
from fowt_env.caches import Cache
from fowt_env.control import USUAL_LIDAR, check_control_dt, wind_ahead
from fowt_env.control.views import LidarReading
from fowt_env.controllers.bladed.law import call_at
from fowt_env.controllers.lqr.design import MOMENT, N_FEEDBACK, N_PLANT, design_models, lowest_design_wind
from fowt_env.controllers.lqr.design import WIND as ESTIMATED_WIND
from fowt_env.controllers.lqr.estimator import N_MEMORY, ROTOR, estimate
from fowt_env.controllers.lqr.law import LQR, WindEstimator, limits_of, speed_integral
from fowt_env.controllers.mpc.ahead import Foresight, fusion
from fowt_env.controllers.mpc.model import (
    COMMAND,
    INTEGRAL,
    LEAN_RATE,
    N_COST,
    SPEED,
    SURGE_RATE,
    TORQUE,
    WindModel,
    wind_model,
)
from fowt_env.controllers.mpc.plan import FILTER, grid_of, newton_step, shifted, work_of
from fowt_env.controllers.mpc.rotor_table import rotor_table
from fowt_env.controllers.mpc.settings import MPCSettings
from fowt_env.controllers.mpc.solver import Program, load
from fowt_env.controllers.mpc.weights import weights_over
from fowt_env.controllers.pi import curve_at
from fowt_env.descriptions.lidar import read_lidar
from fowt_env.descriptions.nrel5mw import RATED_WIND
from fowt_env.descriptions.units import DEGREE
from fowt_env.errors import InputError
from fowt_env.plant.compile.decorators import control_kernel, kernel
from fowt_env.plant.drivetrain import TorqueCurve, build_torque_curve, clamp, generator_torque, rate_limit
from fowt_env.plant.measurement import N_MEASUREMENTS, Measure

PERIOD = 0.5  # s between plans
RESTING = 0.01745  # rad of pitch command, below which the speed integral decays at low rotor speed
WINDUP = 7.5  # s times rated speed, limit of the speed integral: 5 % of rated for 150 s
CURVE_WINDS = (8.5, 9.5)  # m/s, of the NREL 5 MW turbine: torque curve and minimum pitch below, plan above


class Entry(IntEnum):
    """Enumerates the parameter array, which begins with entries of Head."""

    CONTROL_DT = 0
    RATED_SPEED = 1
    RATED_TORQUE = 2
    GEAR_RATIO = 3
    PITCH_MINIMUM = 4
    PITCH_MAXIMUM = 5
    PITCH_RATE_LIMIT = 6
    TORQUE_RATE_LIMIT = 7
    TORQUE_LOW = 8
    TORQUE_HIGH = 9
    DECAY = 10
    CURVE_BELOW = 11  # m/s
    PLAN_ABOVE = 12
    POWER_HIGH = 13  # of torque and rotor speed, W
    INTEGRAL_LIMIT = 14  # of the speed integral, rad


class Memory(IntEnum):
    """Enumerates the entries of the memory array."""

    OPERATING_WIND = 0
    INTEGRAL = 1
    BIAS = 2  # of the estimated wind over the preview, m/s
    TORQUE_RATE = 3  # of the present period, N m/s
    PITCH_RATE = 4


class LoopMemory(IntEnum):
    """Enumerates the entries of the law's memory array that follow those of Memory."""

    LOW_TORQUE = len(Memory)  # N m, lower limit until the next plan
    CALLS = LOW_TORQUE + 1  # control periods since the last plan
    PLANNER = CALLS + 1  # address of the function that plans; below 2^53 and thus exact
    PLANNED = PLANNER + 1  # 1 once it has returned
    COMMAND = PLANNED + 1  # torque and pitch, the law's own: those in force may have been limited
    ESTIMATE = COMMAND + 2  # memory of the estimator
    AHEAD = ESTIMATE + N_MEMORY  # wind ahead, or speeds and freshness of a lidar; to the end


# the parameter array of the law in the loop: Entry, torque curve, control periods between plans, estimator
CURVE = len(Entry)
EVERY = CURVE + len(TorqueCurve._fields)
ESTIMATOR = EVERY + 1
PLANNER = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


@kernel
def observe(estimator, estimated, measurement, command, p, memory):
    """Update the estimate, the operating wind and the speed integral to the present instant."""
    estimate(estimator, estimated, measurement, command)
    decay, dt, limit = p[Entry.DECAY], p[Entry.CONTROL_DT], p[Entry.INTEGRAL_LIMIT]
    wind = estimated[ESTIMATED_WIND + 1]
    memory[Memory.OPERATING_WIND] = decay * memory[Memory.OPERATING_WIND] + (1.0 - decay) * wind
    error = measurement[Measure.GENERATOR_SPEED] / p[Entry.GEAR_RATIO] - p[Entry.RATED_SPEED]
    memory[Memory.INTEGRAL] = speed_integral(memory[Memory.INTEGRAL], error, command[1] > RESTING, dt, limit)


@kernel
def lowest_torque(estimated, p, curve):
    """Return the lower limit of torque, N m: that of the settings, or of the turbine's curve in a lull."""
    return min(p[Entry.TORQUE_LOW], generator_torque(p[Entry.GEAR_RATIO] * estimated[ROTOR], 0.0, curve))


@kernel
def move(estimated, p, memory, curve, low_torque, command):
    """Integrate the command with the rates in force, within limits.

    If both the present and the operating wind are low, torque follows the turbine's curve at minimum pitch.
    """
    dt = p[Entry.CONTROL_DT]
    before = command[1]
    pitch = before + dt * memory[Memory.PITCH_RATE]
    command[1] = clamp(pitch, p[Entry.PITCH_MINIMUM], p[Entry.PITCH_MAXIMUM])
    torque = command[0] + dt * memory[Memory.TORQUE_RATE]
    torque = clamp(torque, low_torque, p[Entry.TORQUE_HIGH])
    if torque * estimated[ROTOR] > p[Entry.POWER_HIGH]:
        torque = p[Entry.POWER_HIGH] / estimated[ROTOR]
    low, high = p[Entry.CURVE_BELOW], p[Entry.PLAN_ABOVE]
    wind = max(memory[Memory.OPERATING_WIND], estimated[ESTIMATED_WIND + 1])
    blend = clamp((wind - low) / (high - low), 0.0, 1.0)
    if blend < 1.0:
        rested = rate_limit(before, p[Entry.PITCH_MINIMUM], dt * p[Entry.PITCH_RATE_LIMIT])
        command[1] = blend * command[1] + (1.0 - blend) * rested
        by_curve = generator_torque(p[Entry.GEAR_RATIO] * estimated[ROTOR], command[1], curve)
        torque = blend * torque + (1.0 - blend) * by_curve
    command[0] = rate_limit(command[0], torque, dt * p[Entry.TORQUE_RATE_LIMIT])


@control_kernel
def planned_law(p, memory, measurement, command):
    """Do what MPC.act does in the compiled loop, with Python for a plan alone; NaN if that fails."""
    estimated, own = memory[LoopMemory.ESTIMATE :], memory[LoopMemory.COMMAND :]
    curve = curve_at(p, CURVE)
    for i in range(memory.shape[0] - LoopMemory.AHEAD):
        memory[LoopMemory.AHEAD + i] = measurement[N_MEASUREMENTS + i]
    observe(p[ESTIMATOR:], estimated, measurement, own, p, memory)
    if memory[LoopMemory.CALLS] == 0.0:
        memory[LoopMemory.LOW_TORQUE] = lowest_torque(estimated, p, curve)
        memory[LoopMemory.PLANNED] = 0.0
        call_at(int(memory[LoopMemory.PLANNER]), (0,))
        if memory[LoopMemory.PLANNED] == 0.0:
            command[:] = nan
            return
    calls = memory[LoopMemory.CALLS] + 1.0
    memory[LoopMemory.CALLS] = calls if calls < p[EVERY] else 0.0
    move(estimated, p, memory, curve, memory[LoopMemory.LOW_TORQUE], own)
    command[0], command[1] = own[0], own[1]


LIDAR_TIME = 20.0  # s, longest look-ahead time of the wind predicted with a lidar
_MODELS = Cache(16)  # inputs -> (design models, table, (first wind, WindModel of all winds))


class MPC:
    """Implements model predictive control with MPCSettings; call prepare(scene) before reset.

    preview: use an exact wind preview. lidar: predict the wind from the readings of a lidar, too.
    nonlinear: rotor loads from the table, else linear about the operating wind. constrained: plans satisfy
    limits; applied commands always do.
    Attribute unsolved: number of plans since reset without a solution of OSQP, replaced by LQ feedback.
    """

    def __init__(
        self, turbine, control_dt, settings=None, name="mpc", preview=False, nonlinear=True, constrained=True,
        lidar=False,
    ):  # fmt: skip
        self.name, self.turbine, self.control_dt = name, turbine, check_control_dt(control_dt)
        self.settings = MPCSettings() if settings is None else settings
        self.nonlinear, self.constrained, self.lidar = nonlinear, constrained, lidar
        self.information = LQR.information
        self.every = max(1, round(PERIOD / self.control_dt))
        self.preview_times = ()
        if preview:
            self.information = (*LQR.information, "wind_preview")
            periods = int(self.settings.preview_time / self.period + 1e-9)
            self.preview_times = tuple(self.period * i for i in range(periods + 1))
        if lidar:
            self.information = (*LQR.information, "lidar")
        self.estimator = WindEstimator(turbine, self.control_dt)
        self.curve = build_torque_curve(turbine.torque_law)
        self.grid = grid_of(self.settings, self.period)
        self.parameters = self._parameters()
        self.table = self.program = self.made = None
        self._state = self._planner = self._error = None
        self.unsolved = 0

    @property
    def period(self):
        """Return the time between plans, s: a whole number of control periods."""
        return self.every * self.control_dt

    @property
    def memory(self):
        """Return the entries of Memory."""
        return self._state[: len(Memory)]

    @property
    def low_torque(self):
        """Return the lower limit of torque until the next plan, N m."""
        return self._state[LoopMemory.LOW_TORQUE]

    @property
    def command(self):
        """Return the command of the last period: torque (N m) and blade pitch (rad)."""
        return self._state[LoopMemory.COMMAND : LoopMemory.ESTIMATE]

    @property
    def estimated(self):
        """Return the memory of the estimator in this run, which begins with the estimate."""
        return self._state[LoopMemory.ESTIMATE : LoopMemory.AHEAD]

    def _parameters(self):
        turbine, law, settings = self.turbine, self.turbine.torque_law, self.settings
        values = {
            **limits_of(turbine, self.control_dt),
            Entry.TORQUE_LOW: settings.torque_low * law.rated_torque,
            Entry.TORQUE_HIGH: min(settings.torque_high * law.rated_torque, law.max_torque),
            Entry.DECAY: exp(-self.control_dt / settings.schedule_time),
            Entry.CURVE_BELOW: CURVE_WINDS[0] + (turbine.rated_wind_speed - RATED_WIND),
            Entry.PLAN_ABOVE: CURVE_WINDS[1] + (turbine.rated_wind_speed - RATED_WIND),
            Entry.POWER_HIGH: settings.power_limit * law.rated_torque * turbine.rated_rotor_speed,
            Entry.INTEGRAL_LIMIT: WINDUP * turbine.rated_rotor_speed,
        }
        return np.array([values[entry] for entry in Entry], dtype=np.float64)

    @one_thread
    def prepare(self, scene):
        """Compute the models of the scene's plant over the winds (cached per plant).

        Raises: InputError for a scene without wind, and if OSQP is not installed.
        """
        load()
        if scene.model.aero is None:
            raise InputError(f"controller {self.name!r}: needs a scene with wind to predict")
        self.estimator.prepare(scene)
        models, density = design_models(scene), scene.platform.environment.air_density
        self.table = rotor_table(scene.turbine, density)
        known = (id(models), id(self.table), self.turbine.torque_law.rated_torque, self.settings, self.period)

        def make():  # returned with the inputs, so that their ids stay valid
            lowest = next(m for m in models if m.wind >= lowest_design_wind(self.turbine))
            weights = weights_over(models, self.settings, self.estimator.turbine, self.control_dt)
            same = (self.turbine, self.table, self.period)
            pairs = [(m, m if m.wind >= lowest.wind else lowest) for m in models]
            wind_models = [wind_model(m, other, weights[other.wind], *same) for m, other in pairs]
            rows = WindModel(*(np.array(rows) for rows in zip(*wind_models, strict=True)))
            return models, self.table, (models[0].wind, rows)

        self.first_wind, self.models = _MODELS.get(known, make)[2]
        if self.lidar:
            lidar = read_lidar(scene.lidar or USUAL_LIDAR)
            self.gates = len(lidar.distances)
            self.made = fusion(scene, lidar, self.period, round(LIDAR_TIME / self.period))
        leads = 2 * self.gates if self.lidar else len(self.preview_times)
        self._state = np.zeros(LoopMemory.AHEAD + leads)

    def reset(self, measurement):
        """Start at the trim with the measured pitch (or, at minimum pitch, rotor speed) and an empty plan.

        Raises: InputError if prepare() was not called.
        """
        if self.table is None:
            raise InputError(f"controller {self.name!r}: call prepare(scene) before reset(measurement)")
        self.estimator.reset(measurement)
        planner = self._state[LoopMemory.PLANNER]
        self._state[:] = 0.0  # in place: the compiled loop holds this array
        self._state[LoopMemory.PLANNER] = planner
        self.estimated[:] = self.estimator.memory
        self.memory[Memory.OPERATING_WIND] = self.estimated[ESTIMATED_WIND + 1]
        drive = self.turbine.pitch_drive
        pitch = min(max(measurement.blade_pitch, drive.minimum), drive.maximum)
        torque = measurement.generator_torque
        if not np.isfinite(torque):
            torque = self.turbine.torque_law.rated_torque
        self.command[:] = torque, pitch
        self.plan = np.zeros(2 * len(self.grid.ends))
        self.work = work_of(self.grid)
        self.foresight = Foresight(self.made, self.gates, self.period, self._slow) if self.lidar else None
        self.unsolved, self._error = 0, None

    def act(self, measurement):
        """Return (generator torque, blade pitch) for a Measurement."""
        state, values = self._state, np.array(measurement, dtype=np.float64)
        if len(state) > LoopMemory.AHEAD:
            state[LoopMemory.AHEAD :] = wind_ahead(measurement)
        estimated, command = self.estimated, self.command
        observe(self.estimator.parameters, estimated, values, command, self.parameters, state)
        if state[LoopMemory.CALLS] == 0.0:
            state[LoopMemory.LOW_TORQUE] = lowest_torque(estimated, self.parameters, self.curve)
            self._replan(self._ahead())
        state[LoopMemory.CALLS] = (state[LoopMemory.CALLS] + 1.0) % self.every
        move(estimated, self.parameters, state, self.curve, self.low_torque, command)
        return float(command[0]), float(command[1])

    @property
    def in_loop(self):
        """Return (law, parameters, memory) for the compiled loop, with the effect of act(), once prepared."""
        self._planner = PLANNER(self._plan)
        self._state[LoopMemory.PLANNER] = ctypes.cast(self._planner, ctypes.c_void_p).value
        parts = self.parameters, [*self.curve], [self.every], self.estimator.parameters
        return planned_law, np.concatenate(parts, dtype=np.float64), self._state

    def _plan(self, _):
        """Replan for planned_law; an error is kept, as none can pass through the compiled loop."""
        try:
            self._replan(self._ahead())
            self._state[LoopMemory.PLANNED] = 1.0
        except BaseException as error:
            self._error = error

    def failure(self, time):
        """Return the error of a plan in the compiled loop at a time, s; None if the last one did not fail."""
        if self._state[LoopMemory.PLANNED] == 1.0:
            return None
        # without an error a signal has ended the call before its first line
        return KeyboardInterrupt() if self._error is None else self._error

    @property
    def _slow(self):
        """Return the forgetting factor per period of the mean difference of preview or lidar."""
        return exp(-self.period / self.settings.schedule_time)

    def _ahead(self):
        """Return expected states (n, 2) of the wind filter minus the operating wind; n = 0: no preview."""
        if not self.preview_times and not self.lidar:
            return np.zeros((0, 2))
        seen, now = self._state[LoopMemory.AHEAD :].copy(), self.estimated[ESTIMATED_WIND + 1]
        model, wind = self._model()
        if self.lidar:
            moving = -model.motion @ self.estimated[[SURGE_RATE, LEAN_RATE]]
            mean = self.memory[Memory.OPERATING_WIND]
            reading = LidarReading(seen[: self.gates], seen[self.gates :])
            expected = self.foresight.foresee(mean, now, moving, reading)
        else:
            decay = self._slow
            bias = decay * self.memory[Memory.BIAS] + (1.0 - decay) * (now - seen[0])
            self.memory[Memory.BIAS] = bias
            expected = seen + bias
        ahead, a = expected - wind, model.A[FILTER : FILTER + 2, FILTER : FILTER + 2]
        ahead = np.r_[ahead, (a[0, 0] + a[1, 1]) * ahead[-1] - a[0, 0] * a[1, 1] * ahead[-2]]
        # the first filter state follows from each pair of successive winds
        return np.column_stack([(ahead[1:] - a[1, 1] * ahead[:-1]) / a[1, 0], ahead[:-1]])

    def _model(self):
        """Return (WindModel, wind m/s) at the operating wind, limited to the range of the models."""
        count = len(self.models.trim)
        index = min(max(self.memory[Memory.OPERATING_WIND] - self.first_wind, 0.0), count - 1.0)
        node = min(int(index), count - 2)
        f = index - node
        model = WindModel(*((1.0 - f) * part[node] + f * part[node + 1] for part in self.models))
        return model, self.first_wind + index

    def _replan(self, ahead):
        """Improve the plan and set the rates to its first move."""
        model, wind = self._model()
        turbine, settings = self.turbine, self.settings
        rated, torque, drive = turbine.rated_rotor_speed, turbine.torque_law.rated_torque, turbine.pitch_drive
        estimated, work = self.estimated, self.work
        x = work.states[0]
        x[:N_PLANT] = estimated[:N_PLANT] - model.trim[:N_PLANT]
        x[TORQUE] = self.command[0] / torque - model.trim[TORQUE]
        x[COMMAND] = self.command[1] - model.trim[COMMAND]
        x[INTEGRAL] = self.memory[Memory.INTEGRAL]
        x[FILTER:] = estimated[ESTIMATED_WIND:MOMENT]
        x[FILTER : FILTER + 2] -= wind
        references, end = np.zeros(N_COST), np.zeros(N_FEEDBACK)
        references[0] = end[SPEED] = rated - model.trim[SPEED]
        rate = turbine.torque_law.max_torque_rate / torque
        torques = np.array([self.low_torque, self.parameters[Entry.TORQUE_HIGH]])
        torques = torques / torque - model.trim[TORQUE]
        pitches = np.array([drive.minimum, drive.maximum]) - model.trim[COMMAND]
        speeds = (-rated, settings.speed_limit * rated - model.trim[SPEED])
        powers = (0.0, settings.power_limit * rated)
        rates = (-rate, rate, -drive.rate_limit, drive.rate_limit)
        limits = np.array([*rates, *torques, *pitches, *speeds, *powers])
        units = np.array([0.05, 0.2 * DEGREE, 0.05, DEGREE, 0.05 * rated, 0.05 * rated])
        old = np.zeros_like(self.plan)
        shifted(self.plan, self.grid, old)
        step = np.zeros_like(old)
        gain = model.K.copy()
        if len(ahead):  # only the plan, not the feedback, responds to the previewed wind
            gain[:, FILTER : FILTER + 2] = 0.0
        kept = newton_step(
            model, gain, wind, self.table, self.nonlinear, references, end, ahead, limits, units, self.grid,
            old, work, step,
        )  # fmt: skip
        if self.constrained and not kept:
            if self.program is None:
                self.program = Program(len(old), len(work.low))
            step = self.program.solve(work.H, work.g, work.C, work.low, work.high, step)
        if step is None:
            self.unsolved += 1
            self.plan = np.zeros_like(old)
        else:
            self.plan = old + step
        u = self.plan[:2] - gain @ x
        self.memory[Memory.TORQUE_RATE] = min(max(u[0], -rate), rate) * torque
        self.memory[Memory.PITCH_RATE] = min(max(u[1], -drive.rate_limit), drive.rate_limit)

    def __getstate__(self):
        """Return the state without the solver, which is recreated: each solution has an explicit start."""
        return self.__dict__ | {"program": None, "_planner": None}


def mpc(turbine, control_dt):
    """Apply model predictive control on lqr's estimate, with limits and nonlinear rotor loads."""
    return MPC(turbine, control_dt)


def mpc_preview(turbine, control_dt):
    """Apply mpc with a preview of the rotor-averaged wind of the next seconds."""
    return MPC(turbine, control_dt, name="mpc_preview", preview=True)


def mpc_lidar(turbine, control_dt):
    """Apply mpc with the wind predicted from the estimate and from the raw readings of a nacelle lidar."""
    return MPC(turbine, control_dt, name="mpc_lidar", lidar=True)


def lq_preview(turbine, control_dt):
    """Apply linear-quadratic preview control: mpc_preview with linear loads and without limits."""
    return MPC(turbine, control_dt, None, "lq_preview", preview=True, nonlinear=False, constrained=False)
