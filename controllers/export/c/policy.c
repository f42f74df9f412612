/* A trained network: observation, history, decisions and actions as in its training.

   m: the entries POLICY_M_, then the memory of the estimator and that of the baseline law. Observations are
   of single precision, as in training; the layers are summed in double precision. */

static double scaled(double value, double low, double high)
{
    return clamp(2.0 * (value - low) / (high - low) - 1.0, -1.0, 1.0);
}

static double unscaled(double action, double low, double high)
{
    return low + 0.5 * (action + 1.0) * (high - low);
}

/* Fills the newest observation; an entry that is not finite keeps its last value. */
static void observe(const double *reading, double *m)
{
    const double *estimated = m + POLICY_M_ESTIMATOR;
    int i;

    for (i = 0; i < POLICY_CHANNELS; i++) {
        int signal = POLICY_SIGNAL[i];
        double value;
        if (signal >= POLICY_ESTIMATES)
            value = estimated[signal - POLICY_ESTIMATES];
        else if (signal >= POLICY_FIRST_ACTION)
            value = m[POLICY_M_ACCEPTED + signal - POLICY_FIRST_ACTION];
        else
            value = reading[signal];
        value = (value - POLICY_CENTRE[i]) / POLICY_SCALE[i];
        if (isfinite(value))
            m[POLICY_M_NEWEST + i] = (float)clamp(value, POLICY_LOW[i], POLICY_HIGH[i]);
    }
}

/* Moves the history by one instant and updates mean and variance of the estimated wind. */
static void remember(double *m, int first)
{
    double *history = m + POLICY_M_HISTORY, wind, deviation;
    int i;

    for (i = POLICY_INSTANTS * POLICY_CHANNELS - 1; i >= 0; i--)
        if (i < POLICY_CHANNELS || first)
            history[i] = m[POLICY_M_NEWEST + i % POLICY_CHANNELS];
        else
            history[i] = history[i - POLICY_CHANNELS];
    if (POLICY_WIND_ENTRY < 0)
        return;
    wind = POLICY_WIND_CENTRE + POLICY_WIND_SCALE * history[POLICY_WIND_ENTRY < 0 ? 0 : POLICY_WIND_ENTRY];
    if (first) {
        m[POLICY_M_MEAN] = wind;
        return;
    }
    deviation = wind - m[POLICY_M_MEAN];
    m[POLICY_M_MEAN] += POLICY_LASTING * deviation;
    m[POLICY_M_VARIANCE] += POLICY_LASTING * (deviation * deviation - m[POLICY_M_VARIANCE]);
}

/* Evaluates the network on the newest observation and the changes before it; fills the decision. */
static void decide(double *m)
{
    const double *history = m + POLICY_M_HISTORY;
    const float *weight = POLICY_WEIGHTS;
    double x[POLICY_WIDEST], y[POLICY_WIDEST];
    int i, j, layer;

    for (i = 0; i < POLICY_INSTANTS * POLICY_CHANNELS; i++) {
        double feature = history[i];
        if (i >= POLICY_CHANNELS)
            feature = (float)history[i - POLICY_CHANNELS] - (float)history[i];
        x[i] = (float)clamp((feature - POLICY_MEAN[i]) / POLICY_DEVIATION[i], -POLICY_CLIP, POLICY_CLIP);
    }
    for (layer = 0; layer < POLICY_LAYERS; layer++) {
        int rows = POLICY_SIZES[layer + 1], columns = POLICY_SIZES[layer];
        for (i = 0; i < rows; i++) {
            double total = weight[rows * columns + i];
            for (j = 0; j < columns; j++)
                total += (double)weight[i * columns + j] * x[j];
            if (layer < POLICY_LAYERS - 1)
                total = POLICY_TANH ? tanh(total) : (total < 0.0 ? 0.0 : total);
            y[i] = total;
        }
        weight += rows * columns + rows;
        for (i = 0; i < rows; i++)
            x[i] = y[i];
    }
    for (i = 0; i < 2; i++)
        m[POLICY_M_DECISION + i] = POLICY_SQUASH_TANH ? tanh(x[i]) : clamp(x[i], -1.0, 1.0);
}

/* Smooths the decision into the accepted action. */
static void smooth(double *m)
{
    double *action = m + POLICY_M_ACTION, *lasting = m + POLICY_M_LASTING, *slow = m + POLICY_M_SMOOTHED;
    double weight = 1.0;
    int i;

    if (POLICY_WIND_ENTRY >= 0) {
        weight = (sqrt(m[POLICY_M_VARIANCE]) - POLICY_AUTHORITY_LOW) / POLICY_AUTHORITY_RANGE;
        weight = clamp(weight, 0.0, 1.0);
    }
    for (i = 0; i < 2; i++) {
        slow[i] += POLICY_FRACTION * (m[POLICY_M_DECISION + i] - slow[i]);
        if (POLICY_SHAPED) {
            action[i] = clamp(weight * slow[i] - lasting[i], -1.0, 1.0);
            lasting[i] += POLICY_PASSING * action[i];
        } else {
            action[i] = slow[i];
        }
        m[POLICY_M_ACCEPTED + i] = clamp(action[i], -1.0, 1.0);
    }
}

static void policy_start(double *m, const double *reading)
{
    double *accepted = m + POLICY_M_ACCEPTED;
    int i;

    for (i = 0; i < POLICY_M_ESTIMATOR; i++)
        m[i] = 0.0;
    if (POLICY_MODE == POLICY_SETPOINT)
        m[POLICY_M_TRACKING] = clamp(reading[GENERATOR_TORQUE], 0.0, LIMIT_TORQUE);
    policy_start_parts(m, reading);
    if (POLICY_MODE != POLICY_RESIDUAL) {
        double first = POLICY_MODE == POLICY_SETPOINT ? reading[ROTOR_SPEED] : reading[GENERATOR_TORQUE];
        accepted[0] = scaled(first, POLICY_ACTION_LOW, POLICY_ACTION_HIGH);
        accepted[1] = scaled(reading[BLADE_PITCH], POLICY_PITCH_LOW, POLICY_PITCH_HIGH);
    }
}

static void policy_step(double *m, const double *reading, double *command)
{
    const double *action = m + POLICY_M_ACCEPTED;
    int i, first = m[POLICY_M_CALLS] == 0.0;

    if (!first)
        policy_estimate(m, reading, command);
    if (m[POLICY_M_PERIOD] == 0.0) {
        observe(reading, m);
        remember(m, first);
        if (first)
            for (i = 0; i < 2; i++)
                m[POLICY_M_SMOOTHED + i] = m[POLICY_M_ACTION + i] = m[POLICY_M_ACCEPTED + i];
        decide(m);
    }
    m[POLICY_M_CALLS] = 1.0;
    m[POLICY_M_PERIOD] = m[POLICY_M_PERIOD] + 1.0 < POLICY_HOLD ? m[POLICY_M_PERIOD] + 1.0 : 0.0;
    smooth(m);
    if (POLICY_MODE == POLICY_RESIDUAL) {
        policy_baseline(m, reading, command);
        command[0] += action[0] * POLICY_RESIDUAL_TORQUE;
        command[1] += action[1] * POLICY_RESIDUAL_PITCH;
        return;
    }
    command[0] = unscaled(action[0], POLICY_ACTION_LOW, POLICY_ACTION_HIGH);
    command[1] = unscaled(action[1], POLICY_PITCH_LOW, POLICY_PITCH_HIGH);
    if (POLICY_MODE == POLICY_SETPOINT) { /* PI control of rotor speed by torque */
        double error = reading[ROTOR_SPEED] - command[0], integral = m[POLICY_M_TRACKING];
        integral = clamp(integral + POLICY_TRACKING_RATE * error * LIMIT_DT, 0.0, LIMIT_TORQUE);
        m[POLICY_M_TRACKING] = integral;
        command[0] = clamp(POLICY_TRACKING_GAIN * error + integral, 0.0, LIMIT_TORQUE);
    }
}
