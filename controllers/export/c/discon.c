/* The Bladed interface: readings from the records of the host, the law at its control instants. */

static struct {
    controller_type law;
    double start, interval; /* s: time of the first call, and between two calls */
    double velocity;        /* m/s, of the nacelle */
    double command[4];
    int running, periods, call; /* periods: calls in one control period; call: number of the last one */
} host;

static double mean_pitch(const float *swap)
{
    double sum = record(swap, RECORD_BLADE_PITCH_1) + record(swap, RECORD_BLADE_PITCH_2);

    return (sum + record(swap, RECORD_BLADE_PITCH_3)) / 3.0;
}

/* Fills the readings of a control instant; returns NULL or the field that the host does not send. */
static const char *read_records(const float *swap, double *reading, int first)
{
    int i;

    for (i = 0; i < N_FIELDS; i++) {
        if (READ[i].record == MEAN_PITCH) {
            reading[i] = mean_pitch(swap);
        } else if (READ[i].record == NACELLE_VELOCITY_INTEGRAL) {
            double acceleration = record(swap, RECORD_TOWER_TOP_FORE_AFT_ACCELERATION);
            host.velocity = first ? 0.0 : VELOCITY_LEFT * host.velocity + LIMIT_DT * acceleration;
            reading[i] = host.velocity;
        } else if (READ[i].record > LAST_STANDARD && !is_extended(swap)) {
            return READ[i].lacking;
        } else {
            reading[i] = record(swap, READ[i].record);
        }
    }
    if (first && reading[GENERATOR_TORQUE] == 0.0) /* the host has not measured it yet */
        reading[GENERATOR_TORQUE] = curve_torque(record(swap, RECORD_GENERATOR_SPEED), mean_pitch(swap), CURVE);
    return NULL;
}

/* Checks the host and prepares its first control instant; returns NULL or what is wrong. */
static const char *begin(const float *swap)
{
    double ratio;

    host.running = 0;
    host.start = record(swap, RECORD_TIME);
    host.interval = record(swap, RECORD_COMMUNICATION_INTERVAL);
    ratio = host.interval > 0.0 ? LIMIT_DT / host.interval : 0.0;
    if (!(ratio >= 0.999 && ratio <= 1e6 && fabs(ratio - floor(ratio + 0.5)) <= 1e-4 * ratio))
        return "record 3, the time between two calls, does not divide the control period";
    if (record(swap, RECORD_PITCH_ACTUATOR) != 0.0)
        return "record 10 asks for pitch rates: only pitch angles are commanded";
    if (record(swap, RECORD_BLADES) != 3.0)
        return "record 61, the number of blades, is not 3";
    if (INDIVIDUAL && record(swap, RECORD_PITCH_CONTROL) != 1.0)
        return "record 28: this law commands each blade: set Ptch_Cntrl to 1";
    host.periods = (int)(ratio + 0.5);
    host.call = 0;
    return NULL;
}

/* Runs the law if this call is a control instant; returns NULL or what is wrong. */
static const char *run(const float *swap, int first)
{
    double reading[N_FIELDS], passed = record(swap, RECORD_TIME) - host.start;
    const char *lacking;
    int call, status;

    passed = floor(passed / host.interval + 0.5);
    if (!(passed >= host.call && passed < 2e9))
        return "record 2, the time, is not a number or goes back";
    call = (int)passed;
    if (!first && call / host.periods == host.call / host.periods) {
        host.call = call;
        return NULL;
    }
    host.call = call;
    lacking = read_records(swap, reading, first);
    if (lacking != NULL)
        return lacking;
    status = first ? controller_start(&host.law, reading) : 0;
    if (status == 0)
        status = controller_step(&host.law, reading, host.command);
    if (status == 1)
        return "a record that the law reads is not a finite number";
    return status == 0 ? NULL : "the law commands a number that is not finite";
}

EXPORTED void DISCON(float *swap, int *fail, const char *infile, const char *outname, char *message)
{
    int status = whole(swap, RECORD_STATUS, -100, 100, -100);
    const char *wrong = NULL;

    (void)infile; /* all settings are in this library */
    (void)outname;
    *fail = 0;
    if (status == -1)
        return;
    if (status == 0)
        wrong = begin(swap);
    else if (status < 0)
        wrong = "record 1: storing and restoring a run is not supported";
    else if (!host.running)
        wrong = "record 1: the first call must have 0";
    if (wrong == NULL)
        wrong = run(swap, status == 0);
    host.running = wrong == NULL;
    if (wrong == NULL) {
        demand(swap, host.command);
    } else {
        char text[300] = LIBRARY ": ";
        strncat(text, wrong, sizeof text - strlen(text) - 1);
        report(swap, fail, message, -1, text);
    }
}
