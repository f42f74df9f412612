/* Reading and writing the array of the Bladed interface. */

static double record(const float *swap, int number)
{
    return swap[number - 1];
}

/* Returns a whole number from a record, or a fallback for what is not within the limits. */
static int whole(const float *swap, int number, int low, int high, int fallback)
{
    double value = record(swap, number);

    return value >= low && value <= high ? (int)(value + (value < 0.0 ? -0.5 : 0.5)) : fallback;
}

/* Writes the message of a call, cut to the buffer of the host, and the status: below 0 ends the run. */
static void report(const float *swap, int *fail, char *message, int status, const char *text)
{
    int i, size = whole(swap, RECORD_MESSAGE_SIZE, 1, 1000000, 0);

    *fail = status;
    if (message == NULL || size == 0)
        return;
    for (i = 0; i < size - 1 && text[i] != '\0'; i++)
        message[i] = text[i];
    message[i] = '\0';
}

/* Returns whether the host sends the platform's motion (extended interface, as of OpenFAST 5). */
static int is_extended(const float *swap)
{
    return record(swap, RECORD_SIZE) >= LAST_EXTENDED && record(swap, RECORD_EXTENDED_VERSION) >= 1.0;
}

/* Writes the command and what a host expects of a library that commands nothing else. */
static void demand(float *swap, const double *command)
{
    static const int zero[] = {
        RECORD_SHAFT_BRAKE, RECORD_YAW_TORQUE_DEMAND, RECORD_COLLECTIVE_PITCH_RATE_DEMAND,
        RECORD_YAW_RATE_DEMAND, RECORD_PITCH_OVERRIDE, RECORD_TORQUE_OVERRIDE, RECORD_LOGS,
        RECORD_START_UP_RESISTANCE, RECORD_LOAD_REQUEST, RECORD_SLIP_CURRENT, RECORD_SLIP_CURRENT_DEMAND,
        RECORD_YAW_CONTROL_FLAG, RECORD_BRAKE_TORQUE_DEMAND
    };
    int i;

    for (i = 0; i < (int)(sizeof zero / sizeof zero[0]); i++)
        swap[zero[i] - 1] = 0.0f;
    swap[RECORD_GENERATOR_CONTACTOR - 1] = 1.0f;
    swap[RECORD_GENERATOR_TORQUE_DEMAND - 1] = (float)command[0];
    swap[RECORD_COLLECTIVE_PITCH_DEMAND - 1] = (float)command[1];
    for (i = 0; i < 3; i++)
        swap[RECORD_PITCH_DEMAND_1 - 1 + i] = (float)command[1 + i];
}
