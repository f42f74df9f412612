"""Computes the combinations of past values of Adams formulas, and the cubics through them."""

from fowt_env.plant.compile.decorators import inlined_kernel, kernel


@kernel
def bashforth(order, i, history):
    """Return the Adams-Bashforth combination of the latest derivatives of state i, history latest first."""
    if order == 1:
        return history[0, i]
    if order == 2:
        return 1.5 * history[0, i] - 0.5 * history[1, i]
    if order == 3:
        return (23.0 * history[0, i] - 16.0 * history[1, i] + 5.0 * history[2, i]) / 12.0
    return (55.0 * history[0, i] - 59.0 * history[1, i] + 37.0 * history[2, i] - 9.0 * history[3, i]) / 24.0


@kernel
def moulton(order, new, i, history):
    """Return the Adams-Moulton combination of a derivative at the end of the step and the latest ones."""
    if order == 1:
        return 0.5 * (new + history[0, i])
    if order == 2:
        return (5.0 * new + 8.0 * history[0, i] - history[1, i]) / 12.0
    return (9.0 * new + 19.0 * history[0, i] - 5.0 * history[1, i] + history[2, i]) / 24.0


@inlined_kernel
def extrapolated(order, h0, h1, h2, h3):
    """Return (c0, c1, c2, c3) of the cubic in s, 0 to 1 over a step, through `order` past values.

    Its integral over the step is that of Adams-Bashforth.
    """
    d1 = h0 - h1 if order > 1 else 0.0
    d2 = h0 - 2.0 * h1 + h2 if order > 2 else 0.0
    d3 = h0 - 3.0 * h1 + 3.0 * h2 - h3 if order > 3 else 0.0
    return h0, d1 + 0.5 * d2 + d3 / 3.0, 0.5 * (d2 + d3), d3 / 6.0


@inlined_kernel
def interpolated(order, new, h0, h1, h2):
    """Return (c0, c1, c2, c3) of the cubic through a value at the end of the step and `order` past ones.

    Its integral over the step is that of Adams-Moulton.
    """
    d2 = new - 2.0 * h0 + h1 if order > 1 else 0.0
    d3 = new - 3.0 * h0 + 3.0 * h1 - h2 if order > 2 else 0.0
    return h0, new - h0 - 0.5 * d2 - d3 / 6.0, 0.5 * d2, d3 / 6.0


@inlined_kernel
def with_integrals(begun, ended, area, moment):
    """Return (c0, c1, c2, c3) of the cubic in s with these values at 0 and 1 and integrals over the step.

    area, moment: its first and second integral from 0 to 1.
    """
    rise, area, moment = ended - begun, area - begun, moment - 0.5 * begun
    return (
        begun,
        3.0 * rise - 24.0 * area + 60.0 * moment,
        -12.0 * rise + 84.0 * area - 180.0 * moment,
        10.0 * rise - 60.0 * area + 120.0 * moment,
    )
