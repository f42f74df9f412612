/* The PI law at its published sampling: several periods in each control period, with interpolated speed. */

static void gspi_start(const double *p, double *m, const double *reading)
{
    pi_begin(p, m, reading);
    m[GSPI_M_LAST_SPEED] = NAN; /* no call yet */
}

static void gspi_step(const double *p, double *m, const double *reading, double *command)
{
    double speed = reading[GENERATOR_SPEED], last = m[GSPI_M_LAST_SPEED];
    int k, periods = (int)p[GSPI_PERIODS];

    if (isnan(last)) { /* no time has elapsed */
        periods = 1;
        last = speed;
    }
    for (k = 1; k <= periods; k++) {
        double fraction = (double)k / periods;
        pi_advance(p, m, (1.0 - fraction) * last + fraction * speed, reading[BLADE_PITCH], command);
    }
    m[GSPI_M_LAST_SPEED] = speed;
}
