/* Returns the integral of the speed error after dt, within a limit; it decays below rated speed at minimum pitch. */
static double speed_integral(double integral, double error, int pitching, double dt, double limit)
{
    if (pitching || error > 0.0)
        return clamp(integral + dt * error, -limit, limit);
    return integral * (1.0 - LQR_FORGETTING * dt);
}
