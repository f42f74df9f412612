/* Returns the integral of the speed error after dt; it decays below rated speed at minimum pitch. */
static double speed_integral(double integral, double error, int pitching, double dt)
{
    if (pitching || error > 0.0)
        return clamp(integral + dt * error, -LQR_INTEGRAL_LIMIT, LQR_INTEGRAL_LIMIT);
    return integral * (1.0 - LQR_FORGETTING * dt);
}
