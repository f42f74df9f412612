"""Advances a damped oscillator exactly under a load that is a cubic in time, for fast elastic modes."""

from math import cos, cosh, exp, sin, sinh, sqrt

from fowt_env.plant.compile.decorators import inlined_kernel


@inlined_kernel
def swung(q, rate, c0, c1, c2, c3, after, square, decay):
    """Return (q, q') after a time, exact for q'' + 2 decay q' + square q = c0 + c1 t + c2 t2 + c3 t3."""
    p3 = c3 / square
    p2 = (c2 - 6.0 * decay * p3) / square
    p1 = (c1 - 4.0 * decay * p2 - 6.0 * p3) / square
    p0 = (c0 - 2.0 * decay * p1 - 2.0 * p2) / square
    q, rate = q - p0, rate - p1
    left, rest = exp(-decay * after), square - decay * decay
    w = sqrt(abs(rest))
    if rest > 0.0:
        c, s = cos(w * after), sin(w * after) / w
    else:
        c, s = cosh(w * after), sinh(w * after) / w if w > 0.0 else after
    p, over = p0 + after * (p1 + after * (p2 + after * p3)), rate + decay * q
    speed = p1 + after * (2.0 * p2 + 3.0 * after * p3)
    return p + left * (q * c + over * s), speed + left * (rate * c - (square * q + decay * rate) * s)
