/* One period of the gain-scheduled PI law. */

static void pi_advance(const double *p, double *m, double speed, double measured_pitch, double *command)
{
    double error = pi_speed_error(p, m, speed);
    double pitch = pi_schedule_pitch(p, m, measured_pitch);

    pi_write(pitch, pi_target(pitch, error, p, m), 0.0, p, m, command);
}
