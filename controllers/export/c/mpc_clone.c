/* The clone of mpc: its estimate, limits and low-wind curve, and a network that decides the rates.

   p: the entries CLONE_, torque curve, network and parameters of the estimator; m: the entries CLONE_M_, of
   which the last is the memory of the estimator. */

static void mpc_clone_start(const double *p, double *m, const double *reading)
{
    int i;

    for (i = 0; i < CLONE_M_ESTIMATE; i++)
        m[i] = 0.0;
    estimator_start(p + CLONE_ESTIMATOR, m + CLONE_M_ESTIMATE, reading);
    m[CLONE_M_OPERATING_WIND] = m[CLONE_M_ESTIMATE + LQR_WIND + 1];
}

/* Fills the inputs of the network: the state from which mpc plans, operating wind, lower limit of torque. */
static void clone_inputs(const double *p, double *m, const double *command)
{
    const double *e = p + CLONE_ESTIMATOR, *estimated = m + CLONE_M_ESTIMATE;
    double *x = m + CLONE_M_INPUTS, first = e[LQR_FIRST_WIND];
    double wind = clamp(m[CLONE_M_OPERATING_WIND], first, first + e[LQR_WINDS] - 1.0);
    double index = wind - first, fraction;
    int i, low, node = 0, last = (int)e[LQR_WINDS] - 2;

    if (index > 0.0) /* not for a NaN, whose conversion to int is undefined */
        node = index < (double)last ? (int)index : last;
    low = LQR_BLOCKS + node * LQR_BLOCK;
    fraction = index - node;
    for (i = 0; i < LQR_N_PLANT; i++)
        x[i] = estimated[i] - between(e, low, fraction, LQR_B_TRIM + i);
    x[CLONE_X_TORQUE] = (command[0] - between(e, low, fraction, LQR_B_TORQUE)) / p[CLONE_RATED_TORQUE];
    x[CLONE_X_PITCH] = command[1] - between(e, low, fraction, LQR_B_PITCH);
    x[CLONE_X_INTEGRAL] = m[CLONE_M_INTEGRAL];
    for (i = 0; i < LQR_MOMENT - LQR_WIND; i++)
        x[CLONE_X_FILTER + i] = estimated[LQR_WIND + i];
    x[CLONE_X_FILTER] -= wind;
    x[CLONE_X_FILTER + 1] -= wind;
    x[CLONE_N_INPUTS - 2] = wind;
    x[CLONE_N_INPUTS - 1] = m[CLONE_M_LOW_TORQUE] / p[CLONE_RATED_TORQUE];
}

/* Fills count weighted sums of a layer. */
static void clone_layer(const double *weight, const double *bias, const double *x, int size, double *y, int count)
{
    int i, j;

    for (i = 0; i < count; i++) {
        double total = bias[i];
        for (j = 0; j < size; j++)
            total += weight[i * size + j] * x[j];
        y[i] = total;
    }
}

/* Sets the rates from the inputs: outputs of the network over the limits of the rates. */
static void clone_decide(const double *p, double *m)
{
    double *x = m + CLONE_M_INPUTS, *first = m + CLONE_M_FIRST, *second = m + CLONE_M_SECOND;
    int i;

    for (i = 0; i < CLONE_N_INPUTS; i++)
        x[i] = (x[i] - p[CLONE_MEAN + i]) / p[CLONE_SCALE + i];
    clone_layer(p + CLONE_WEIGHT_0, p + CLONE_BIAS_0, x, CLONE_N_INPUTS, first, CLONE_HIDDEN);
    for (i = 0; i < CLONE_HIDDEN; i++)
        first[i] = tanh(first[i]);
    clone_layer(p + CLONE_WEIGHT_1, p + CLONE_BIAS_1, first, CLONE_HIDDEN, second, CLONE_HIDDEN);
    for (i = 0; i < CLONE_HIDDEN; i++)
        second[i] = tanh(second[i]);
    clone_layer(p + CLONE_WEIGHT_2, p + CLONE_BIAS_2, second, CLONE_HIDDEN, x, 2);
    m[CLONE_M_TORQUE_RATE] = p[CLONE_TORQUE_RATE_LIMIT] * clamp(x[0], -1.0, 1.0);
    m[CLONE_M_PITCH_RATE] = p[CLONE_PITCH_RATE_LIMIT] * clamp(x[1], -1.0, 1.0);
}

/* Integrates the command with the rates in force, within limits; in low wind torque follows the curve. */
static void clone_move(const double *p, double *m, double *command)
{
    const double *estimated = m + CLONE_M_ESTIMATE, *curve = p + CLONE_CURVE;
    double dt = p[CLONE_CONTROL_DT], before = command[1], torque, wind, blend;
    double pitch = before + dt * m[CLONE_M_PITCH_RATE];

    command[1] = clamp(pitch, p[CLONE_PITCH_MINIMUM], p[CLONE_PITCH_MAXIMUM]);
    torque = command[0] + dt * m[CLONE_M_TORQUE_RATE];
    torque = clamp(torque, m[CLONE_M_LOW_TORQUE], p[CLONE_TORQUE_HIGH]);
    if (torque * estimated[LQR_ROTOR] > p[CLONE_POWER_HIGH])
        torque = p[CLONE_POWER_HIGH] / estimated[LQR_ROTOR];
    wind = m[CLONE_M_OPERATING_WIND];
    if (estimated[LQR_WIND + 1] > wind)
        wind = estimated[LQR_WIND + 1];
    blend = clamp((wind - p[CLONE_CURVE_BELOW]) / (p[CLONE_PLAN_ABOVE] - p[CLONE_CURVE_BELOW]), 0.0, 1.0);
    if (blend < 1.0) {
        double rested = rate_limit(before, p[CLONE_PITCH_MINIMUM], dt * p[CLONE_PITCH_RATE_LIMIT]);
        double by_curve;
        command[1] = blend * command[1] + (1.0 - blend) * rested;
        by_curve = curve_torque(p[CLONE_GEAR_RATIO] * estimated[LQR_ROTOR], command[1], curve);
        torque = blend * torque + (1.0 - blend) * by_curve;
    }
    command[0] = rate_limit(command[0], torque, dt * p[CLONE_TORQUE_RATE_LIMIT]);
}

static void mpc_clone_step(const double *p, double *m, const double *reading, double *command)
{
    double *estimated = m + CLONE_M_ESTIMATE;
    double decay = p[CLONE_DECAY], error = reading[GENERATOR_SPEED] / p[CLONE_GEAR_RATIO] - p[CLONE_RATED_SPEED];

    estimate(p + CLONE_ESTIMATOR, estimated, reading, command);
    m[CLONE_M_OPERATING_WIND] = decay * m[CLONE_M_OPERATING_WIND] + (1.0 - decay) * estimated[LQR_WIND + 1];
    m[CLONE_M_INTEGRAL] =
        speed_integral(m[CLONE_M_INTEGRAL], error, command[1] > CLONE_RESTING, p[CLONE_CONTROL_DT],
                       p[CLONE_INTEGRAL_LIMIT]);
    if (m[CLONE_M_CALLS] == 0.0) {
        double low = curve_torque(p[CLONE_GEAR_RATIO] * estimated[LQR_ROTOR], 0.0, p + CLONE_CURVE);
        m[CLONE_M_LOW_TORQUE] = p[CLONE_TORQUE_LOW] < low ? p[CLONE_TORQUE_LOW] : low;
        clone_inputs(p, m, command);
        clone_decide(p, m);
    }
    m[CLONE_M_CALLS] = m[CLONE_M_CALLS] + 1.0 < p[CLONE_EVERY] ? m[CLONE_M_CALLS] + 1.0 : 0.0;
    clone_move(p, m, command);
}
