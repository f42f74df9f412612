/* The PI law with feedback of band-passed platform motion to blade pitch and torque. */

static void floating_feedback_start(const double *p, double *m, const double *reading)
{
    pi_begin(p, m, reading);
    /* the present motion is the mean motion; nothing is removed without a high pass */
    m[FEEDBACK_M_SLOW] = p[FEEDBACK_HIGH_DECAY] == 1.0 ? 0.0 : reading[FEEDBACK_SIGNAL_FIELD];
    m[FEEDBACK_M_LOW_ONE] = m[FEEDBACK_M_LOW_TWO] = 0.0;
}

/* Advances the high pass and the two low passes by one period; returns the band-passed signal. */
static double band_passed(double signal, const double *p, double *m)
{
    double decay = p[FEEDBACK_HIGH_DECAY];
    double slow = (1.0 - decay) * signal + decay * m[FEEDBACK_M_SLOW];
    double one, two;

    m[FEEDBACK_M_SLOW] = slow;
    decay = p[FEEDBACK_LOW_DECAY];
    one = (1.0 - decay) * (signal - slow) + decay * m[FEEDBACK_M_LOW_ONE];
    two = (1.0 - decay) * one + decay * m[FEEDBACK_M_LOW_TWO];
    m[FEEDBACK_M_LOW_ONE] = one;
    m[FEEDBACK_M_LOW_TWO] = two;
    return two;
}

static void floating_feedback_step(const double *p, double *m, const double *reading, double *command)
{
    double error = pi_speed_error(p, m, reading[GENERATOR_SPEED]);
    double pitch = pi_schedule_pitch(p, m, reading[BLADE_PITCH]);
    double target = pi_target(pitch, error, p, m);
    double motion = band_passed(reading[FEEDBACK_SIGNAL_FIELD], p, m);
    double fraction = clamp(target / p[PI_CURVE + CURVE_REGION3_MIN_PITCH], 0.0, 1.0);
    double gain = fraction * p[FEEDBACK_PITCH_GAIN];

    if (p[FEEDBACK_SCHEDULED] > 0.5)
        gain *= pi_schedule_gain(pitch, p[PI_SCHEDULE_PITCH]);
    pi_write(pitch, target + gain * motion, fraction * p[FEEDBACK_TORQUE_GAIN] * motion, p, m, command);
}
