/* Returns the target, or the value moved towards it by at most a step. */
static double rate_limit(double value, double target, double step)
{
    return value + clamp(target - value, -step, step);
}
