"""An environment's name stands for its physics and reward: a change of either needs a new -vN."""

import numpy as np
import pandas as pd
import pytest
from golden import CASES, ENVIRONMENTS, path_of, trajectory

from fowt_env import registration

pytestmark = pytest.mark.installation

# Observations are float32 (6e-8 in themselves), and libraries differ in the last bits of their sums, which
# 100 steps carry on; below this, entries near zero count by their distance.
RELATIVE, ABSOLUTE = 1e-6, 1e-7

MESSAGE = """{name}, task {task}: {column} moved by {excess:.2g} times the tolerance, at step {step}:
stored {stored!r}, now {now!r}. Published results name this environment, so what it does must not change.
If physics or reward changed on purpose, register the environment under the next version (-vN) in
fowt_env/registration.py and run `python tests/golden.py`; CONTRIBUTING.md says how."""


def compare(name, task, stored, now):
    """Raise AssertionError unless two trajectories agree."""
    assert list(stored.columns) == list(now.columns), f"{name}, task {task}: other entries than stored"
    assert len(stored) == len(now)
    for column in stored.columns:
        allowed = ABSOLUTE + RELATIVE * np.abs(stored[column].to_numpy())
        excess = np.abs(now[column] - stored[column]).to_numpy() / allowed
        worst = int(np.argmax(excess))
        assert excess[worst] <= 1.0, MESSAGE.format(
            name=name, task=task, column=column, excess=excess[worst], step=int(stored["step"][worst]),
            stored=stored[column][worst], now=now[column][worst],
        )  # fmt: skip


@pytest.mark.parametrize(("name", "task"), CASES)
def test_an_environment_does_what_its_name_stands_for(name, task):
    compare(name, task, pd.read_csv(path_of(name, task)), trajectory(name, task))


def test_a_thousandth_more_drag_does_not_pass(platform):
    hydro = platform.hydro.model_copy(update={"drag_coefficient": 1.001 * platform.hydro.drag_coefficient})
    draggy = trajectory(ENVIRONMENTS[0], "above_rated", platform=platform.model_copy(update={"hydro": hydro}))
    with pytest.raises(AssertionError, match="moved"):
        compare(ENVIRONMENTS[0], "above_rated", pd.read_csv(path_of(ENVIRONMENTS[0], "above_rated")), draggy)


def test_every_registered_environment_has_a_stored_trajectory():
    of_oc3 = {name for name, settings in registration.ENVIRONMENTS.items() if "platform" not in settings}
    assert set(ENVIRONMENTS) == of_oc3
