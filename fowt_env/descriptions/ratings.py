"""Computes the ratings of a turbine in the units of output channels, for plots and pictures."""

from fowt_env.descriptions.units import RPM

RATED_SPEED, OVERSPEED, RATED_POWER, RATED_WIND = (
    "rated_rotor_speed_[rpm]",
    "overspeed_[rpm]",
    "rated_power_[kW]",
    "rated_wind_speed_[m/s]",
)


def ratings(turbine):
    """Return {name: float} of a Turbine: rated rotor speed, overspeed (rpm), power (kW), wind (m/s)."""
    drive = turbine.drivetrain
    return {
        RATED_SPEED: turbine.rated_rotor_speed / RPM,
        OVERSPEED: turbine.overspeed / RPM,
        RATED_POWER: 1e-3 * drive.generator_efficiency * turbine.torque_law.rated_power,
        RATED_WIND: turbine.rated_wind_speed,
    }
