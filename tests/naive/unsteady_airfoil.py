"""The Beddoes-Leishman model with four states of Hansen, Gaunaa and Madsen, as differential equations."""

import numpy as np
from scipy.integrate import solve_ivp


def separated(polar, slope, zero, low, high):
    """(separation function, separated lift), each (m,), of a polar (m, 3+); low, high: linear range, rad."""
    point, lift = np.zeros(len(polar)), np.zeros(len(polar))
    for i, (alpha, cl) in enumerate(polar[:, :2]):
        attached = slope * (alpha - zero)
        f = (2.0 * np.sqrt(max(cl / attached, 0.0)) - 1.0) ** 2 if attached else 1.0
        point[i], lift[i] = (f, (cl - attached * f) / (1.0 - f)) if f < 1.0 else (1.0, 0.5 * cl)
    below = [i for i in range(len(polar)) if polar[i, 0] < low]
    above = [i for i in range(len(polar)) if polar[i, 0] > high]
    for i in (*below[: 1 + max(i for i in below if point[i] == point[below].min())],
              *above[min(k for k, i in enumerate(above) if point[i] == point[above].min()) :]):  # fmt: skip
        lift[i] = polar[i, 1]
    for i, (alpha, cl) in enumerate(polar[:, :2]):
        span = slope * (alpha - zero) - lift[i]
        point[i] = min(max((cl - lift[i]) / span, 0.0), 1.0) if span else 1.0
    return point, lift


def response(times, angle, speed, chord, polar, constants, ends):
    """((n,), (n,)) lift and drag coefficients at times; angle and speed: functions of time (rad, m/s).

    polar: (m, 3+) rad; constants: AirfoilDynamics; ends: linear range, rad. At rest before the first time.
    """
    c = constants
    point, apart = separated(polar, c.lift_slope, c.zero_lift, *ends)
    attached = c.lift_slope * (polar[:, 0] - c.zero_lift)

    def at(alpha, values):
        return np.interp(alpha, polar[:, 0], values)

    def effective(x, alpha):
        return alpha * (1.0 - c.A1 - c.A2) + x[0] + x[1]

    def rates(t, x):
        alpha, time = angle(t), 0.5 * chord / speed(t)
        lag = effective(x, alpha)
        return [
            c.b1 / time * (c.A1 * alpha - x[0]),
            c.b2 / time * (c.A2 * alpha - x[1]),
            (lag - x[2]) / (c.T_p * time),
            (at(x[2], point) - x[3]) / (c.T_f0 * time),
        ]

    start = angle(times[0])
    x = solve_ivp(
        rates, (times[0], times[-1]), [c.A1 * start, c.A2 * start, start, at(start, point)], t_eval=times,
        rtol=1e-9, atol=1e-11, method="LSODA",
    ).y  # fmt: skip
    lift, drag = [], []
    for t, state in zip(times, x.T, strict=True):
        alpha = angle(t)
        lag = effective(state, alpha)
        static = at(lag, point)
        cl = at(lag, polar[:, 1]) + (state[3] - static) * at(lag, attached - apart)
        cd = at(lag, polar[:, 2])
        roots = np.sqrt(static) - np.sqrt(state[3])
        cd += (alpha - lag) * cl + (cd - c.drag) * (0.5 * roots - 0.25 * (static - state[3]))
        lift.append(cl)
        drag.append(cd)
    return np.array(lift), np.array(drag)
