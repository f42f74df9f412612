"""Computes the discrete model of each wind, the LQ feedback and the terminal cost of the prediction.

States are those of feedback_plant in controllers/lqr/design.py relative to the trim at the wind: platform,
rotor and blades, torque (rated torques), pitch command, integral of the rotor-speed error, wind filter and
waves. Inputs are the rates of torque and pitch command, constant over a period.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from fowt_env.controllers.lqr.design import (
    N_FEEDBACK,
    N_PLANT,
    PLANT,
    feedback_plant,
    sampled,
)
from fowt_env.controllers.lqr.optimum import generator_inertia
from fowt_env.controllers.mpc.rotor_table import rotor_loads
from fowt_env.plant.compile.decorators import entry

SURGE, SURGE_RATE, SPEED, LEAN, LEAN_RATE, BLADE = (
    PLANT.index(name) for name in ("surge", "vx", "rotor_speed", "platform_pitch", "wy", "blade_pitch")
)
TORQUE, COMMAND, INTEGRAL = N_PLANT, N_PLANT + 1, N_PLANT + 2
FILTER, WIND = N_PLANT + 3, N_PLANT + 4
N_COST = 8  # squared terms: speed, platform pitch, surge, shaft, power, integral, rates of both commands


class WindModel(NamedTuple):
    """Holds the prediction model at one wind; only arrays, which can be interpolated between winds."""

    trim: np.ndarray  # (8,) PLANT, torque in rated torques, pitch command
    loads: np.ndarray  # (8,) rotor_loads at the trim
    motion: np.ndarray  # (2,) wind at the rotor per surge rate and platform pitch rate
    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, 2)
    G: np.ndarray  # (n, 2) input of nonlinear thrust (N) and torque (N m), constant over a period
    K: np.ndarray  # (2, n) LQ gain
    P: np.ndarray  # (n, n) cost to go
    rows: np.ndarray  # (N_COST, n) of states in the squared terms; rows of the two rates are zero
    weights: np.ndarray  # (N_COST,) of the squared terms over a period


def cost_rows(a, rated_speed, inertia):
    """Return the rows (N_COST, n) of states in the squared terms; rows of the two rates are zero.

    Shaft torque: that of the generator and of its acceleration, by a of feedback_plant; inertia: of
    generator_inertia. Shaft torque and power are over their rated values.
    """
    rows = np.zeros((N_COST, N_FEEDBACK))
    for row, state in enumerate((SPEED, LEAN, SURGE)):
        rows[row, state] = 1.0
    rows[3] = inertia * a[SPEED]
    rows[3, TORQUE] += 1.0
    rows[4, SPEED], rows[4, TORQUE] = 1.0 / rated_speed, 1.0
    rows[5, INTEGRAL] = 1.0
    return rows


@entry
def _loads_at(wind, rotor_speed, blade_pitch, table, loads):
    rotor_loads(wind, rotor_speed, blade_pitch, table, loads)


def wind_model(model, feedback, weights, turbine, table, period):
    """Return the WindModel of a DesignModel, with cost, gain and cost to go of the DesignModel `feedback`.

    weights: (N_COST,) of the squared terms, per second; period: s.
    """
    rated, law = turbine.rated_rotor_speed, turbine.torque_law
    a, b = _plant(model, turbine)
    loads = np.empty(8)
    _loads_at(model.wind, model.trim[SPEED], model.trim[BLADE], table, loads)
    # state derivatives per N of thrust and per N m of torque, from the linear response to wind
    g = np.zeros((N_FEEDBACK, 2))
    moved = [SURGE_RATE, LEAN_RATE]
    g[moved, 0] = a[moved, WIND] / loads[1]
    g[SPEED, 1] = a[SPEED, WIND] / loads[5]
    motion = a[SPEED, moved] / a[SPEED, WIND]
    weights, plant = period * weights, _plant(feedback, turbine)
    rows = cost_rows(plant[0], rated, generator_inertia(turbine, law.rated_torque))
    k, p = lq(*plant, rows, weights, period)
    ad, bd = sampled(a, b, period)
    _, gd = sampled(a, g, period)
    trim = np.array([*model.trim, model.torque / law.rated_torque, model.pitch])
    parts = (trim, loads, motion, ad, bd, gd, k, p, rows, weights)
    return WindModel(*(np.ascontiguousarray(part) for part in parts))


def _plant(model, turbine):
    """Return (A, B) of feedback_plant with torque normalised by rated torque at every wind."""
    a, b, _ = feedback_plant(model, turbine.rated_rotor_speed)
    a[:N_PLANT, TORQUE] *= turbine.torque_law.rated_torque / model.torque
    return a, b


def lq(a, b, rows, weights, period):
    """Return (K, P) of the discrete LQ problem with weighted squares of rows at each period's start."""
    ad, bd = sampled(a, b, period)
    q, r = rows.T @ (weights[:, None] * rows), np.diag(weights[-2:])
    p = solve_discrete_are(ad, bd, q, r)
    return np.linalg.solve(r + bd.T @ p @ bd, bd.T @ p @ ad), p
