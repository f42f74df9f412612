"""Computes the weights of MPC's cost at each wind: those of the least sum of ratios to gspi_oc3.

On the linear loop of controllers/lqr/optimum.py with Kalman filter, standard deviations are s_i and those of
gspi_oc3 b_i. MPCSettings has the prices c_i of sum(c_i s_i/b_i), which is convex in the loop, and the limit
of blade-pitch travel, whose price follows from it. The minimum is that of the quadratic cost sum(w_i s_i^2)
with w_i = c_i/(s_i b_i), found by iteration (iteratively reweighted least squares: Daubechies et al., Comm.
Pure Appl. Math. 63, 2010). Hence no wind is without a price, whatever its fraction of the lifetime.

The weight of the speed integral I follows from a limit of the means of rotor speed over MEAN_TIME, which are
(I(t + MEAN_TIME) - I(t))/MEAN_TIME from rated: their deviation is sqrt(2) s_I/MEAN_TIME where I is forgotten
within this time. Without it, slow changes of the wind would leave the speed off rated for minutes.

The linear loop has no lulls, in which the torque must follow the available power. Near rated wind the
variance shaft_near_rated^2 is therefore added to both variances of the shaft torque, the price of travel and
the weight of the integral are those of the next higher wind, and so is the surge of gspi_oc3 where its linear
model is unstable.
"""

from math import sqrt

import numpy as np

from fowt_env.controllers.lqr.design import equivalent_wind, lowest_design_wind
from fowt_env.controllers.lqr.optimum import GAUSSIAN_MEAN, NEAR_RATED, NO_LULLS, SampledLoop

PRICED = {  # field of Deviations -> its price in MPCSettings
    "speed": "speed", "lean": "platform_pitch", "surge": "surge", "shaft": "shaft", "power": "power",
}  # fmt: skip
TRAVEL = "travel"
CHEAPEST, DEAREST = 0.1, 10.0  # range of the price of pitch travel
MEAN_TIME = 600.0  # s
# range and start of the cost of (speed integral / 5 % of rated times 10 s)^2
FREE, USUAL, STRICT = 1e-6, 0.01, 0.1
UNKNOWN = {"surge": 1.0}  # m, if gspi_oc3 is unstable in the strongest wind
SHAFT_NOISE = 1e-3  # of rated torque, smallest deviation of shaft torque: direct drives have almost none
TOLERANCE = 0.02  # of the ratios, relative
ROUNDS = 30


def weights_over(models, settings, turbine, dt):
    """Return {wind: weights (N_COST,) of the squared terms, per second} from lowest_design_wind on.

    models: DesignModels in ascending order of wind; dt: control period, s.
    """
    found, base, state = {}, UNKNOWN, None
    for model in reversed(models):  # from strong wind, where the linear model holds, down to rated
        if model.wind >= lowest_design_wind(turbine):
            loop = SampledLoop(model, turbine, dt)
            base = _deviations(loop.baseline(), model.wind, settings, turbine, base)
            found[model.wind], state = _weights(loop, base, settings, state)
    return found


def _deviations(deviations, wind, settings, turbine, instead=UNKNOWN):
    """Return {field: deviation} of PRICED with that of lulls; instead: values for those that are infinite."""
    lowest = equivalent_wind(turbine, lowest_design_wind(turbine))
    fade = np.interp(equivalent_wind(turbine, wind), (lowest, NO_LULLS), (1.0, 0.0))
    values = {name: getattr(deviations, name) for name in (*PRICED, TRAVEL)}
    values["shaft"] = float(np.hypot(values["shaft"], max(fade * settings.shaft_near_rated, SHAFT_NOISE)))
    return {name: value if np.isfinite(value) else instead[name] for name, value in values.items()}


def _weights(loop, base, settings, start):
    """Return (weights (N_COST,) per second, state of the iteration) at one wind.

    The state has {field: ratio to base, "price": of travel, "integral": cost of the speed integral};
    start: state to start from, or None.
    """
    rated, wind = loop.turbine.rated_rotor_speed, loop.model.wind
    unit, torque_rate = (0.5 * rated) ** 2, settings.torque_rate / 0.05**2
    fresh = dict.fromkeys([*PRICED, TRAVEL, "price"], 1.0) | {"integral": USUAL}
    state = fresh if start is None else start
    limited = equivalent_wind(loop.turbine, wind) >= NEAR_RATED
    prices = {name: getattr(settings, price) for name, price in PRICED.items()}
    for _ in range(ROUNDS):
        before, integral = state, state["integral"] / unit
        prices[TRAVEL] = before["price"]
        weight = {name: prices[name] / (before[name] * base[name] ** 2) for name in prices}
        reached = loop.deviations(loop.gain(weight, integral, torque_rate))
        off = sqrt(2.0) * reached.integral / (MEAN_TIME * rated)
        own = _deviations(reached, wind, settings, loop.turbine)
        state = {name: value / base[name] for name, value in own.items()}
        excess = (state[TRAVEL] / settings.travel, off / settings.mean_speed) if limited else (1.0, 1.0)
        state["price"] = min(max(before["price"] * excess[0], CHEAPEST), DEAREST)
        state["integral"] = min(max(before["integral"] * excess[1] ** 2, FREE), STRICT)
        changes = [state[name] / before[name] for name in before]
        if all(abs(change - 1.0) < TOLERANCE for change in changes):
            break
    states = [weight[name] for name in PRICED]
    return np.array([*states, integral, torque_rate, GAUSSIAN_MEAN**2 * weight[TRAVEL]]), state
