"""Why ROSCO with the published gains is not the published law: the place of the gain schedule."""

from importlib.util import find_spec

import numpy as np
import pytest

from fowt_env.controllers.pi import PISettings
from fowt_env.controllers.pi import pi as make_pi
from fowt_env.plant.measurement import Measurement
from fowt_env.training.studies.rosco_differences import InsideIntegral, differences, outside_factor

RATED = Measurement(*[0.0] * len(Measurement._fields))._replace(
    rotor_speed=1.267109, generator_speed=122.9096, generator_torque=43093.55, blade_pitch=0.25
)
BETA_K = 0.1099965


def moved(law, error=0.05, periods=600):
    """How far the blades go in 60 s of a small constant speed error (rad/s, generator), rad."""
    law.reset(RATED)
    for k in range(periods):
        pitch = law.act(RATED._replace(time=0.1 * k, generator_speed=122.9096 + error))[1]
    return pitch - 0.25


def test_a_schedule_outside_the_integral_weakens_the_loop_by_its_own_slope(turbine):
    outside = moved(make_pi(turbine, 0.1))
    inside = moved(InsideIntegral(PISettings.published(turbine), 0.1))
    # to first order in the change of pitch
    assert outside / inside == pytest.approx(outside_factor(0.25, BETA_K), rel=0.01)
    assert outside_factor(0.0, BETA_K) == 1.0
    assert outside_factor(0.25, BETA_K) == pytest.approx(0.590, abs=1e-3)


def test_both_start_without_a_bump(turbine):
    for filtered in (False, True):
        law = InsideIntegral(PISettings.published(turbine), 0.1, filtered)
        law.reset(RATED)
        np.testing.assert_allclose(law.act(RATED), (43093.55, 0.25), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.skipif(find_spec("rosco") is None, reason="needs the ROSCO library: pip install --no-deps rosco")
def test_the_place_of_the_schedule_explains_rosco_in_turbulence():
    names = ("pi, schedule inside the integral", "rosco", "rosco, gains of a schedule outside")
    table = differences(winds=(17.0,), seeds=(1001,), names=names)
    inside, rosco, undone = (table.loc[name] for name in names)
    for figure in ("rotor speed std", "platform pitch std", "pitch travel"):
        assert rosco[figure] == pytest.approx(inside[figure], abs=0.05)
        assert undone[figure] == pytest.approx(1.0, abs=0.05)
    assert rosco["pitch travel"] > 1.2 and rosco["rotor speed std"] < 0.9
