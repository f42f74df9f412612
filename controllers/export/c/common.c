/* Limits, used by every law. A NaN passes through all of them. */

static double clamp(double value, double low, double high)
{
    if (low > value)
        value = low;
    if (high < value)
        value = high;
    return value;
}

/* Returns the target if it lies within a step, else the value moved by the step: no rounding at the target. */
static double followed(double value, double target, double step)
{
    double change = target - value;

    if (fabs(change) <= step * (1.0 + 1e-9))
        return target;
    return change > 0.0 ? value + step : value - step;
}
