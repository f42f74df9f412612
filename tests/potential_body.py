"""A potential-flow body of made-up smooth coefficients, and seas, for tests."""

import numpy as np

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.potential_flow import PotentialFlow, Qtf
from fowt_env.descriptions.sea_state import sea_state_of
from fowt_env.training.validation.openfast_cases import table
from fowt_env.weather.waves import build_waves

SITE = dict(depth=200.0, density=1025.0, gravity=9.81)
SIZE = np.array([3e6, 3e6, 5e6, 4e7, 4e7, 6e6])


def made_up_body(headings=tuple(range(-180, 181, 30)), qtf_headings=((0, 0), (0, 60), (60, 60)), seed=0):
    """PotentialFlow with 40 frequencies from 0.1 to 4 rad/s, and a QTF with 24 from 0.2 to 2.5 rad/s."""
    rng = np.random.default_rng(seed)
    omega = np.linspace(0.1, 4.0, 40)
    heading = np.radians(np.array(headings, dtype=float))
    delay, turn = rng.uniform(-4.0, 4.0, (2, 6))
    shape = omega / (0.2 + omega**2)
    phase = omega[:, None, None] * delay + 1.0 + turn
    excitation = SIZE * shape[:, None, None] * np.exp(1j * phase)
    excitation = excitation * (1.0 + 0.5 * np.cos(heading[:, None] - turn))[None]
    stiffness = np.zeros((6, 6))
    stiffness[2:5, 2:5] = [[4.4e6, 1e5, -2e5], [1e5, 2e9, 0.0], [-2e5, 0.0, 2e9]]
    second = np.linspace(0.2, 2.5, 24)
    pairs = np.radians(np.array(qtf_headings, dtype=float))
    value = np.zeros((len(pairs), 24, 24, 6), dtype=complex)
    lag, lead = rng.uniform(-3.0, 3.0, (2, 6))
    one, other = second[:, None, None], second[None, :, None]
    for row, (first, last) in enumerate(pairs):
        smooth = 0.8 * (one + other - 1.8) + 0.3 * np.cos(first) * np.cos(last)
        value[row] = 0.02 * SIZE * smooth * np.exp(1j * (one - other) * lag + 1j * lead * (first - last))
    sums = value * np.exp(2j * other * lag)  # symmetric in the two waves
    return PotentialFlow(
        omega=omega,
        added_mass=np.tile(np.eye(6) * 1e7, (40, 1, 1)),
        damping=np.eye(6) * (2e6 * omega**2 / (1.0 + omega**2) ** 3)[:, None, None],
        added_mass_infinite=np.eye(6) * 1e7,
        excitation_omega=omega,
        heading=heading,
        excitation=excitation,
        stiffness=stiffness,
        volume=8029.0,
        centre_of_buoyancy=(0.0, 0.0),
        difference_qtf=Qtf(second, pairs, value),
        sum_qtf=Qtf(second, pairs, 3.0 * sums, of_sums=True),
        draft=120.0,
        source="a made-up body",
    )


def sea_of(spec, duration=100.0, seed=0):
    """Waves of a sea at SITE."""
    return build_waves(sea_state_of(spec), **SITE, seed=seed, duration=duration)


def reference():
    """DataFrame of the forces that OpenFAST has on VolturnUS-S in waves, every 2 s."""
    return table("iea15_volturnus_s/wave_forces.csv.gz")


def volturnus():
    """PotentialFlow of VolturnUS-S, the coefficients that OpenFAST had too."""
    return read_platform("iea15_volturnus_s").potential_flow
