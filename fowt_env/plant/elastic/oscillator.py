"""Advances a damped oscillator exactly under a load that is a cubic in time, for fast elastic modes."""

from math import cos, cosh, exp, sin, sinh, sqrt

from fowt_env.plant.compile.decorators import inlined_kernel


@inlined_kernel
def turn_in(after, square, decay):
    """Return what a free oscillation does in a time (s): decay factor, cosine, sine over the frequency."""
    rest = square - decay * decay
    w = sqrt(abs(rest))
    if rest > 0.0:
        return exp(-decay * after), cos(w * after), sin(w * after) / w
    return exp(-decay * after), cosh(w * after), sinh(w * after) / w if w > 0.0 else after


@inlined_kernel
def swung_by(q, rate, c0, c1, c2, c3, after, square, decay, left, c, s):
    """Return (q, q') of `swung` with the results (left, c, s) of turn_in."""
    p3 = c3 / square
    p2 = (c2 - 6.0 * decay * p3) / square
    p1 = (c1 - 4.0 * decay * p2 - 6.0 * p3) / square
    p0 = (c0 - 2.0 * decay * p1 - 2.0 * p2) / square
    q, rate = q - p0, rate - p1
    p, over = p0 + after * (p1 + after * (p2 + after * p3)), rate + decay * q
    speed = p1 + after * (2.0 * p2 + 3.0 * after * p3)
    return p + left * (q * c + over * s), speed + left * (rate * c - (square * q + decay * rate) * s)


@inlined_kernel
def swung(q, rate, c0, c1, c2, c3, after, square, decay):
    """Return (q, q') after a time, exact for q'' + 2 decay q' + square q = c0 + c1 t + c2 t2 + c3 t3."""
    left, c, s = turn_in(after, square, decay)
    return swung_by(q, rate, c0, c1, c2, c3, after, square, decay, left, c, s)
