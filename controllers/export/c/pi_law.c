/* The PI law, once in each control period. */

static void pi_start(const double *p, double *m, const double *reading)
{
    pi_begin(p, m, reading);
}

static void pi_step(const double *p, double *m, const double *reading, double *command)
{
    pi_advance(p, m, reading[GENERATOR_SPEED], reading[BLADE_PITCH], command);
}
