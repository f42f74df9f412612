/* Parts of the gain-scheduled PI law on rotor speed, with the torque law. p: PI_ parameters, m: PI_ memory. */

static double pi_schedule_gain(double pitch, double schedule_pitch)
{
    return 1.0 / (1.0 + pitch / schedule_pitch);
}

/* Advances the low pass of the generator speed; returns the error of the rotor speed, rad/s. */
static double pi_speed_error(const double *p, double *m, double speed)
{
    double decay = p[PI_FILTER_DECAY];

    speed = (1.0 - decay) * speed + decay * m[PI_M_FILTERED_SPEED];
    m[PI_M_FILTERED_SPEED] = speed;
    return speed / p[PI_GEAR_RATIO] - p[PI_RATED_SPEED];
}

/* Returns the blade pitch that the gains and the torque region follow. */
static double pi_schedule_pitch(const double *p, const double *m, double measured)
{
    if (p[PI_SCHEDULE_MEASURED] > 0.5)
        return clamp(measured, p[PI_PITCH_MINIMUM], p[PI_PITCH_MAXIMUM]);
    return m[PI_M_PITCH_COMMAND];
}

/* Advances the integral, whose term stays within the pitch limits; returns the blade-pitch target, rad. */
static double pi_target(double pitch, double error, const double *p, double *m)
{
    double gain = pi_schedule_gain(pitch, p[PI_SCHEDULE_PITCH]);
    double slope = gain * p[PI_INTEGRAL];
    double integral = clamp(m[PI_M_INTEGRAL] + error * p[PI_CONTROL_DT], p[PI_PITCH_MINIMUM] / slope,
                            p[PI_PITCH_MAXIMUM] / slope);

    m[PI_M_INTEGRAL] = integral;
    return gain * p[PI_PROPORTIONAL] * error + slope * integral;
}

/* Writes torque (curve and extra) and pitch within their limits of value and rate. */
static void pi_write(double pitch, double target, double extra, const double *p, double *m, double *command)
{
    const double *curve = p + PI_CURVE;
    double dt = p[PI_CONTROL_DT];
    double torque = curve_torque(m[PI_M_FILTERED_SPEED], pitch, curve);

    if (extra != 0.0)
        torque = clamp(torque + extra, 0.0, curve[CURVE_MAXIMUM_TORQUE]);
    torque = rate_limit(m[PI_M_TORQUE_COMMAND], torque, dt * p[PI_TORQUE_RATE_LIMIT]);
    target = clamp(target, p[PI_PITCH_MINIMUM], p[PI_PITCH_MAXIMUM]);
    target = rate_limit(m[PI_M_PITCH_COMMAND], target, dt * p[PI_PITCH_RATE_LIMIT]);
    m[PI_M_TORQUE_COMMAND] = command[0] = torque;
    m[PI_M_PITCH_COMMAND] = command[1] = target;
}

/* Starts filter, integral and commands such that the first command is the measured blade pitch. */
static void pi_begin(const double *p, double *m, const double *reading)
{
    double low = p[PI_PITCH_MINIMUM], high = p[PI_PITCH_MAXIMUM];
    double speed = reading[GENERATOR_SPEED], torque = reading[GENERATOR_TORQUE];
    double pitch = clamp(reading[BLADE_PITCH], low, high);
    double gain = pi_schedule_gain(pitch, p[PI_SCHEDULE_PITCH]);
    double error = speed / p[PI_GEAR_RATIO] - p[PI_RATED_SPEED];
    double term = clamp(pitch - gain * p[PI_PROPORTIONAL] * error, low, high);

    if (pitch == low || pitch == high)
        term = pitch;
    /* the first step adds the present error before it uses the integral */
    m[PI_M_INTEGRAL] = term / (gain * p[PI_INTEGRAL]) - error * p[PI_CONTROL_DT];
    m[PI_M_FILTERED_SPEED] = speed;
    m[PI_M_PITCH_COMMAND] = pitch;
    m[PI_M_TORQUE_COMMAND] = clamp(torque, 0.0, p[PI_CURVE + CURVE_MAXIMUM_TORQUE]);
}
