/* The Kalman filter of the LQG law: platform, rotor-averaged wind and waves from measured channels.

   p: a head (LQR_), the torque curve, and one block of trims, models and gains for each wind (B_ offsets);
   m: the estimate, then the entries LQR_M_. */

/* Returns a block's entry, interpolated between two winds. */
static double between(const double *p, int low, double fraction, int offset)
{
    return (1.0 - fraction) * p[low + offset] + fraction * p[low + LQR_BLOCK + offset];
}

/* Fills the deviation: the estimate minus the trim of the operating wind. */
static void deviate(const double *p, int low, double fraction, double *m)
{
    int i;

    for (i = 0; i < LQR_N_STATE; i++)
        m[LQR_M_DEVIATION + i] = m[i];
    for (i = 0; i < LQR_N_PLANT; i++)
        m[LQR_M_DEVIATION + i] -= between(p, low, fraction, LQR_B_TRIM + i);
    m[LQR_M_DEVIATION + LQR_WIND] -= m[LQR_M_OPERATING_WIND];
    m[LQR_M_DEVIATION + LQR_WIND + 1] -= m[LQR_M_OPERATING_WIND];
}

/* Corrects the estimate by the readings of rotor, blades, platform and nacelle. */
static void correct(const double *p, int low, double fraction, double *m, const double *reading)
{
    double *y = m + LQR_M_INNOVATION;
    int i, j;

    y[0] = reading[GENERATOR_SPEED] / p[LQR_GEAR_RATIO] - between(p, low, fraction, LQR_B_TRIM + LQR_ROTOR);
    y[1] = reading[BLADE_PITCH] - between(p, low, fraction, LQR_B_TRIM + LQR_ROTOR + 1);
    y[2] = reading[PLATFORM_PITCH] - between(p, low, fraction, LQR_B_TRIM + 1);
    y[3] = reading[PLATFORM_PITCH_RATE];
    y[4] = reading[NACELLE_ACCELERATION];
    deviate(p, low, fraction, m);
    for (i = 0; i < LQR_N_SENSORS; i++)
        for (j = 0; j < LQR_N_STATE; j++)
            y[i] -= between(p, low, fraction, LQR_B_C + i * LQR_N_STATE + j) * m[LQR_M_DEVIATION + j];
    for (i = 0; i < LQR_N_STATE; i++)
        for (j = 0; j < LQR_N_SENSORS; j++)
            m[i] += between(p, low, fraction, LQR_B_L + i * LQR_N_SENSORS + j) * y[j];
}

/* Advances the estimate by one period under the commands. */
static void predict(const double *p, int low, double fraction, double *m, double torque, double pitch)
{
    int i, j;

    deviate(p, low, fraction, m);
    torque -= between(p, low, fraction, LQR_B_TORQUE);
    pitch -= between(p, low, fraction, LQR_B_PITCH);
    for (i = 0; i < LQR_N_STATE; i++) {
        double change = between(p, low, fraction, LQR_B_B + 2 * i) * torque
                        + between(p, low, fraction, LQR_B_B + 2 * i + 1) * pitch;
        for (j = 0; j < LQR_N_STATE; j++)
            change += between(p, low, fraction, LQR_B_A + i * LQR_N_STATE + j) * m[LQR_M_DEVIATION + j];
        m[i] += change - m[LQR_M_DEVIATION + i];
    }
}

/* Returns the offset of the block below the operating wind and fills the fraction to the next block. */
static int block_of(const double *p, const double *m, double *fraction)
{
    double first = p[LQR_FIRST_WIND], step = p[LQR_WIND_STEP];
    double index = (clamp(m[LQR_M_OPERATING_WIND], first, first + (p[LQR_WINDS] - 1.0) * step) - first) / step;
    int node = 0, last = (int)p[LQR_WINDS] - 2;

    if (index > 0.0) /* not for a NaN, whose conversion to int is undefined */
        node = index < (double)last ? (int)index : last;
    *fraction = index - node;
    return LQR_BLOCKS + node * LQR_BLOCK;
}

/* Predicts the estimate over the last period under its command, then corrects it by the reading. */
static void estimate(const double *p, double *m, const double *reading, const double *command)
{
    double fraction;
    int low;

    if (m[LQR_M_STARTED] != 0.0) {
        double decay = p[LQR_SCHEDULE_DECAY];
        low = block_of(p, m, &fraction);
        predict(p, low, fraction, m, command[0], command[1]);
        m[LQR_M_OPERATING_WIND] = decay * m[LQR_M_OPERATING_WIND] + (1.0 - decay) * m[LQR_WIND + 1];
        m[LQR_M_TORQUE_COMMAND] = command[0];
        m[LQR_M_PITCH_COMMAND] = command[1];
    }
    m[LQR_M_STARTED] = 1.0;
    low = block_of(p, m, &fraction);
    correct(p, low, fraction, m, reading);
}

/* Returns the known quantity of a trim that increases over all winds: speed below rated, pitch above. */
static double known_at(const double *p, int node)
{
    const double *trim = p + LQR_BLOCKS + node * LQR_BLOCK + LQR_B_TRIM;

    return trim[LQR_ROTOR] / p[LQR_RATED_SPEED] + trim[LQR_ROTOR + 1];
}

/* Starts the estimate at the trim with the measured pitch or, at minimum pitch, rotor speed. */
static void estimator_start(const double *p, double *m, const double *reading)
{
    int i, node = 0, count = (int)p[LQR_WINDS];
    double speed = reading[GENERATOR_SPEED] / p[LQR_GEAR_RATIO];
    double fraction = speed / p[LQR_RATED_SPEED], share = 0.0, known, wind;

    if (fraction < LQR_STARTING && reading[BLADE_PITCH] > p[LQR_HANDOVER_LOW])
        fraction = 1.0;
    known = fraction + reading[BLADE_PITCH];
    while (node < count - 2 && known >= known_at(p, node + 1))
        node++;
    if (known >= known_at(p, count - 1))
        share = 1.0;
    else if (known > known_at(p, 0))
        share = (known - known_at(p, node)) / (known_at(p, node + 1) - known_at(p, node));
    wind = p[LQR_FIRST_WIND] + (node + share) * p[LQR_WIND_STEP];
    for (i = 0; i < LQR_N_MEMORY; i++)
        m[i] = 0.0;
    for (i = 0; i < LQR_N_PLANT; i++)
        m[i] = between(p, LQR_BLOCKS + node * LQR_BLOCK, share, LQR_B_TRIM + i);
    m[1] = reading[PLATFORM_PITCH];
    m[3] = reading[PLATFORM_PITCH_RATE];
    m[LQR_ROTOR] = speed;
    m[LQR_ROTOR + 1] = reading[BLADE_PITCH];
    m[LQR_WIND] = m[LQR_WIND + 1] = m[LQR_M_OPERATING_WIND] = wind;
    m[LQR_M_PITCH_COMMAND] = clamp(reading[BLADE_PITCH], p[LQR_PITCH_MINIMUM], p[LQR_PITCH_MAXIMUM]);
    m[LQR_M_TORQUE_COMMAND] = reading[GENERATOR_TORQUE];
}
