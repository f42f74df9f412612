/* The law with the limits of generator and pitch drives. */

static int usable(const double *values, int count)
{
    int i;

    for (i = 0; i < count; i++)
        if (!isfinite(values[i]))
            return 0;
    return 1;
}

int controller_start(controller_type *law, const double *reading)
{
    int i;

    if (!usable(reading, N_FIELDS))
        return 1;
    start_law(law->memory, reading);
    law->force[0] = clamp(reading[GENERATOR_TORQUE], 0.0, LIMIT_TORQUE);
    for (i = 0; i < 3; i++) {
        law->force[1 + i] = reading[FIRST_PITCH + i * INDIVIDUAL];
        law->pitch[i] = clamp(law->force[1 + i], LIMIT_PITCH_MINIMUM, LIMIT_PITCH_MAXIMUM);
    }
    return 0;
}

int controller_step(controller_type *law, const double *reading, double *command)
{
    double next[4];
    int i;

    if (!usable(reading, N_FIELDS))
        return 1;
    for (i = 0; i < 4; i++)
        next[i] = law->force[i];
    step_law(law->memory, reading, next);
    if (!INDIVIDUAL)
        next[2] = next[3] = next[1];
    if (!usable(next, 4))
        return 2;
    next[0] = clamp(next[0], 0.0, LIMIT_TORQUE);
    law->force[0] = command[0] = followed(law->force[0], next[0], LIMIT_TORQUE_RATE * LIMIT_DT);
    for (i = 0; i < 3; i++) {
        double target = clamp(next[1 + i], LIMIT_PITCH_MINIMUM, LIMIT_PITCH_MAXIMUM);
        law->force[1 + i] = next[1 + i];
        law->pitch[i] = command[1 + i] = followed(law->pitch[i], target, LIMIT_PITCH_RATE * LIMIT_DT);
    }
    return 0;
}
