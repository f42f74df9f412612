"""Computes the weights of MPC's cost at each wind: those of the least sum of ratios to gspi_oc3.

On the linear loop of controllers/lqr/optimum.py with Kalman filter, standard deviations are s_i and those of
gspi_oc3 b_i. MPCSettings has the prices c_i of sum(c_i s_i/b_i), which is convex in the loop, and the limit
of blade-pitch travel, whose price follows from it. The minimum is that of the quadratic cost sum(w_i s_i^2)
with w_i = c_i/(s_i b_i), found by iteration (iteratively reweighted least squares: Daubechies et al., Comm.
Pure Appl. Math. 63, 2010). Hence no wind is without a price, whatever its fraction of the lifetime.

The linear loop has no lulls, in which the torque must follow the available power. Near rated wind the
variance shaft_near_rated^2 is therefore added to both variances of the shaft torque, the price of travel is
that of the next higher wind, and so are the deviations of gspi_oc3 where its linear model is unstable.
"""

import numpy as np

from fowt_env.controllers.lqr.design import equivalent_wind, lowest_design_wind
from fowt_env.controllers.lqr.optimum import GAUSSIAN_MEAN, NEAR_RATED, NO_LULLS, SampledLoop
from fowt_env.descriptions.units import DEGREE

PRICED = {  # field of Deviations -> its price in MPCSettings
    "speed": "speed", "lean": "platform_pitch", "surge": "surge", "shaft": "shaft", "power": "power",
}  # fmt: skip
TRAVEL = "travel"
CHEAPEST, DEAREST = 0.1, 10.0  # range of the price of pitch travel
UNKNOWN = {TRAVEL: 0.14 * DEGREE, "surge": 1.0}  # rad/s, m: if gspi_oc3 is unstable in the strongest wind
SHAFT_NOISE = 1e-3  # of rated torque, smallest deviation of shaft torque: direct drives have almost none
TOLERANCE = 0.02  # of the ratios, relative
ROUNDS = 30


def weights_over(models, settings, turbine, dt):
    """Return {wind: weights (N_COST,) of the squared terms, per second} from lowest_design_wind on.

    models: DesignModels in ascending order of wind; dt: control period, s.
    """
    found, base, ratios = {}, UNKNOWN, None
    for model in reversed(models):  # from strong wind, where the linear model holds, down to rated
        if model.wind >= lowest_design_wind(turbine):
            loop = SampledLoop(model, turbine, dt)
            base = _deviations(loop.baseline(), model.wind, settings, turbine, base)
            found[model.wind], ratios = _weights(loop, base, settings, ratios)
    return found


def _deviations(deviations, wind, settings, turbine, instead=UNKNOWN):
    """Return {field: deviation} of PRICED with that of lulls; instead: values for those that are infinite."""
    lowest = equivalent_wind(turbine, lowest_design_wind(turbine))
    fade = np.interp(equivalent_wind(turbine, wind), (lowest, NO_LULLS), (1.0, 0.0))
    values = {name: getattr(deviations, name) for name in (*PRICED, TRAVEL)}
    values["shaft"] = float(np.hypot(values["shaft"], max(fade * settings.shaft_near_rated, SHAFT_NOISE)))
    return {name: value if np.isfinite(value) else instead[name] for name, value in values.items()}


def _weights(loop, base, settings, start):
    """Return (weights (N_COST,) per second, {field: ratio to base, "price": of travel}) at one wind.

    start: ratios and price to start from, or None.
    """
    rated, wind = loop.turbine.rated_rotor_speed, loop.model.wind
    integral, torque_rate = settings.speed_integral / (0.5 * rated) ** 2, settings.torque_rate / 0.05**2
    ratios = dict.fromkeys([*PRICED, TRAVEL], 1.0) if start is None else start
    limited = equivalent_wind(loop.turbine, wind) >= NEAR_RATED
    prices = {name: getattr(settings, price) for name, price in PRICED.items()}
    price = 1.0 if start is None else start["price"]
    for _ in range(ROUNDS):
        before = ratios
        prices[TRAVEL] = price
        weight = {name: prices[name] / (before[name] * base[name] ** 2) for name in prices}
        reached = loop.deviations(loop.gain(weight, integral, torque_rate))
        reached = _deviations(reached, wind, settings, loop.turbine)
        ratios = {name: value / base[name] for name, value in reached.items()}
        excess = ratios[TRAVEL] / settings.travel if limited else 1.0
        price = min(max(price * excess, CHEAPEST), DEAREST)
        changes = [excess, *(ratios[name] / before[name] for name in prices)]
        if all(abs(change - 1.0) < TOLERANCE for change in changes):
            break
    states = [weight[name] for name in PRICED]
    weights = np.array([*states, integral, torque_rate, GAUSSIAN_MEAN**2 * weight[TRAVEL]])
    return weights, ratios | {"price": price}
