/* Individual pitch control: the PI law for torque and mean pitch, cyclic pitch against loads at 1P. */

#define TURN 6.283185307179586

/* Fills (b0, b1, b2, a1, a2) of a notch at a frequency (rad/s). */
static void notch(double frequency, double damping, double dt, double *c)
{
    double half = frequency * dt < IPC_HIGHEST_ANGLE ? frequency * dt : IPC_HIGHEST_ANGLE;
    double k = tan(0.5 * half);
    double scale = 1.0 / (1.0 + 2.0 * damping * k + k * k);

    c[0] = c[2] = (1.0 + k * k) * scale;
    c[1] = c[3] = 2.0 * (k * k - 1.0) * scale;
    c[4] = (1.0 - 2.0 * damping * k + k * k) * scale;
}

/* Advances a second-order filter with two states by one period; an unstarted one begins in steady state. */
static double filtered(double value, const double *c, double *state, int started)
{
    double result;

    if (!started) {
        state[1] = (c[2] - c[4]) * value;
        state[0] = (c[1] - c[3]) * value + state[1];
    }
    result = c[0] * value + state[0];
    state[0] = c[1] * value - c[3] * result + state[1];
    state[1] = c[2] * value - c[4] * result;
    return result;
}

/* Returns the largest permitted cyclic pitch (rad) at a mean pitch (rad) and rotor speed (rad/s). */
static double greatest_amplitude(double mean, double rotor_speed, const double *p)
{
    double room = mean - p[PI_PITCH_MINIMUM], above = p[PI_PITCH_MAXIMUM] - mean;

    room = above < room ? above : room;
    room = p[IPC_AMPLITUDE] < room ? p[IPC_AMPLITUDE] : room;
    if (rotor_speed > 0.0 && p[IPC_RATE] / rotor_speed < room)
        room = p[IPC_RATE] / rotor_speed;
    return room < 0.0 ? 0.0 : room;
}

static void ipc_start(const double *p, double *m, const double *reading)
{
    int i;

    pi_begin(p, m, reading);
    for (i = IPC_M_STARTED; i < IPC_N_MEMORY; i++)
        m[i] = 0.0;
    for (i = 0; i < 3; i++)
        m[IPC_M_BLADES + i] = reading[BLADE_PITCH_1 + i];
}

static void ipc_step(const double *p, double *m, const double *reading, double *command)
{
    double dt = p[PI_CONTROL_DT], mean, rotor_speed, slope, along, across, tilt = 0.0, yaw = 0.0;
    double third[5], decay, share, follow, limit, amplitude, magnitude;
    int i, started = m[IPC_M_STARTED] > 0.5;

    pi_advance(p, m, reading[GENERATOR_SPEED], reading[BLADE_PITCH], command);
    mean = command[1];
    rotor_speed = m[PI_M_FILTERED_SPEED] / p[PI_GEAR_RATIO];
    for (i = 0; i < 3; i++) {
        double psi = reading[AZIMUTH] + TURN * i / 3;
        double moment = reading[ROOT_OUT_OF_PLANE_1 + i], pitch = reading[BLADE_PITCH_1 + i];
        if (p[IPC_FLAPWISE] > 0.5)
            moment = moment * cos(pitch) + reading[IPC_IN_PLANE + i] * sin(pitch);
        tilt += 2.0 / 3 * moment * cos(psi);
        yaw += 2.0 / 3 * moment * sin(psi);
    }
    slope = p[IPC_SLOPE] * (1.0 + mean / p[IPC_DOUBLING]);
    along = m[IPC_M_TILT];
    across = m[IPC_M_YAW];
    m[IPC_M_STARTED] = 1.0;
    notch(3 * fabs(rotor_speed), p[IPC_NOTCH_DAMPING], dt, third);
    tilt = filtered(tilt - slope * along, third, m + IPC_M_FILTERS, started);
    yaw = filtered(yaw - slope * across, third, m + IPC_M_FILTERS + 2, started);
    for (i = 0; i < IPC_TILT_NOTCHES; i++)
        tilt = filtered(tilt, p + IPC_NOTCHES + 5 * i, m + IPC_M_FILTERS + 2 * (2 + i), started);
    decay = p[IPC_YAW_DECAY];
    yaw = (1.0 - decay) * yaw + decay * m[IPC_M_SLOW_YAW];
    m[IPC_M_SLOW_YAW] = yaw;

    magnitude = hypot(tilt, yaw);
    share = magnitude <= p[IPC_BOUND] ? 0.0 : 1.0 - p[IPC_BOUND] / magnitude;
    follow = 1.0 - p[IPC_DECAY];
    along += follow * (-share * tilt / slope - along);
    across += follow * (-share * yaw / slope - across);
    limit = greatest_amplitude(mean, rotor_speed, p);
    amplitude = hypot(along, across);
    if (amplitude > limit) {
        along = along * limit / amplitude;
        across = across * limit / amplitude;
    }
    m[IPC_M_TILT] = along;
    m[IPC_M_YAW] = across;
    for (i = 0; i < 3; i++) {
        double psi = reading[AZIMUTH] + TURN * i / 3 + rotor_speed * p[IPC_LEAD_TIME];
        double target = mean + along * cos(psi) + across * sin(psi);
        target = clamp(target, p[PI_PITCH_MINIMUM], p[PI_PITCH_MAXIMUM]);
        command[1 + i] = rate_limit(m[IPC_M_BLADES + i], target, dt * p[PI_PITCH_RATE_LIMIT]);
        m[IPC_M_BLADES + i] = command[1 + i];
    }
}
