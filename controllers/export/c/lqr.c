/* State feedback of the LQG law on the estimate: the rates of torque and blade pitch. */

static void lqr_start(const double *p, double *m, const double *reading)
{
    estimator_start(p, m, reading);
}

/* Returns the rate by row 0 (torque, rated torques/s) or 1 (pitch command, rad/s) of the gain. */
static double feed_back(const double *p, int low, double fraction, const double *m, int row)
{
    double total = 0.0;
    int j;

    for (j = 0; j < LQR_N_FEEDBACK; j++)
        total -= between(p, low, fraction, LQR_B_K + row * LQR_N_FEEDBACK + j) * m[LQR_M_FED_BACK + j];
    return total;
}

static void lqr_step(const double *p, double *m, const double *reading, double *command)
{
    double dt = p[LQR_CONTROL_DT], rated = p[LQR_RATED_SPEED], ratio = p[LQR_GEAR_RATIO];
    double *fed = m + LQR_M_FED_BACK;
    double fraction, error, pitch, torque, rate, target, by_curve, blend;
    int i, low;

    estimate(p, m, reading, command);
    low = block_of(p, m, &fraction);
    error = reading[GENERATOR_SPEED] / ratio - rated;
    pitch = m[LQR_M_PITCH_COMMAND];
    torque = m[LQR_M_TORQUE_COMMAND];
    m[LQR_M_INTEGRAL] = speed_integral(m[LQR_M_INTEGRAL], error, pitch > p[LQR_HANDOVER_LOW], dt,
                                        LQR_INTEGRAL_LIMIT);

    deviate(p, low, fraction, m);
    for (i = 0; i < LQR_N_PLANT; i++)
        fed[i] = m[LQR_M_DEVIATION + i];
    fed[LQR_ROTOR] = m[LQR_ROTOR] - rated;
    fed[LQR_N_PLANT] = torque / p[LQR_RATED_TORQUE] - 1.0;
    fed[LQR_N_PLANT + 1] = pitch - between(p, low, fraction, LQR_B_PITCH);
    fed[LQR_N_PLANT + 2] = m[LQR_M_INTEGRAL];
    for (i = 0; i < LQR_MOMENT - LQR_WIND; i++)
        fed[LQR_N_PLANT + 3 + i] = m[LQR_M_DEVIATION + LQR_WIND + i];

    rate = feed_back(p, low, fraction, m, 1);
    rate = clamp(rate, -p[LQR_PITCH_RATE_LIMIT], p[LQR_PITCH_RATE_LIMIT]);
    pitch = clamp(pitch + dt * rate, p[LQR_PITCH_MINIMUM], p[LQR_PITCH_MAXIMUM]);
    target = torque + dt * p[LQR_RATED_TORQUE] * feed_back(p, low, fraction, m, 0);
    target = clamp(target, p[LQR_TORQUE_LOW], p[LQR_TORQUE_HIGH]);
    if (target * m[LQR_ROTOR] > p[LQR_POWER_HIGH])
        target = p[LQR_POWER_HIGH] / m[LQR_ROTOR];
    by_curve = curve_torque(ratio * m[LQR_ROTOR], pitch, p + LQR_CURVE);
    blend = (pitch - p[LQR_HANDOVER_LOW]) / (p[LQR_HANDOVER_HIGH] - p[LQR_HANDOVER_LOW]);
    blend = clamp(blend, 0.0, 1.0);
    target = blend * target + (1.0 - blend) * by_curve;
    command[0] = rate_limit(torque, target, dt * p[LQR_TORQUE_RATE_LIMIT]);
    command[1] = pitch;
}
