"""The slope of torque over speed, on made-up runs."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.descriptions.turbine import read_turbine
from fowt_env.training.studies.torque_slope import slope


@pytest.mark.parametrize("expected", [-1.0, 0.0, 2.5])
def test_the_slope_is_that_over_rated_values_after_the_start(expected):
    turbine = read_turbine("nrel5mw")
    time = np.arange(0.0, 400.0)
    speed = 1.0 + 0.05 * np.sin(0.1 * time)
    torque = np.where(time < 200.0, 3.0, 1.0 + expected * (speed - 1.0))
    frame = pd.DataFrame(
        {"Time_[s]": time, "RotSpeed_[rpm]": 12.1 * speed, "GenTq_[kN-m]": 43.09355 * torque}
    )
    assert slope(frame, turbine, 200.0) == pytest.approx(expected, abs=1e-3)
