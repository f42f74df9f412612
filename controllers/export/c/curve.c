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
