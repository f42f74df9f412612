/* Limits and the torque curve, used by every law. A NaN passes through all of them. */

static double clamp(double value, double low, double high)
{
    if (low > value)
        value = low;
    if (high < value)
        value = high;
    return value;
}

/* Returns the target, or the value moved towards it by at most a step. */
static double rate_limit(double value, double target, double step)
{
    return value + clamp(target - value, -step, step);
}

/* Returns the generator torque (N m) of the static curve at a generator speed (rad/s) and blade pitch (rad). */
static double curve_torque(double speed, double pitch, const double *curve)
{
    double torque;

    if (!(speed > 0.0))
        return 0.0;
    if (speed >= curve[CURVE_REGION3_START_SPEED] || pitch >= curve[CURVE_REGION3_MIN_PITCH])
        torque = curve[CURVE_REGION3_TORQUE] + curve[CURVE_REGION3_POWER] / speed;
    else if (speed <= curve[CURVE_CUT_IN_SPEED])
        torque = 0.0;
    else if (speed < curve[CURVE_REGION2_START_SPEED])
        torque = curve[CURVE_REGION15_SLOPE] * (speed - curve[CURVE_CUT_IN_SPEED]);
    else if (speed < curve[CURVE_REGION25_START_SPEED])
        torque = curve[CURVE_REGION2_CONSTANT] * (speed * speed);
    else
        torque = curve[CURVE_REGION25_SLOPE] * (speed - curve[CURVE_SYNCHRONOUS_SPEED]);
    return curve[CURVE_MAXIMUM_TORQUE] < torque ? curve[CURVE_MAXIMUM_TORQUE] : torque;
}

/* Returns the target if it lies within a step, else the value moved by the step: no rounding at the target. */
static double followed(double value, double target, double step)
{
    double change = target - value;

    if (fabs(change) <= step * (1.0 + 1e-9))
        return target;
    return change > 0.0 ? value + step : value - step;
}
