"""Memory of radiated waves as mass and damping: exact at its frequency, on a model with known states."""

from dataclasses import replace

import numpy as np
import pytest

from fowt_env import build_scene, linearize
from fowt_env.analysis.reduced_model import platform_frequency, residualised
from fowt_env.errors import InputError


@pytest.fixture(scope="module")
def model():
    return linearize(build_scene("oc3_hywind", wind=18.0, fidelity="standard"))


@pytest.fixture(scope="module")
def remembering(model):
    """The model with a memory of two states that vx and wy move and that push back on the hull."""
    n = len(model.states)
    a = np.zeros((n + 2, n + 2))
    a[:n, :n] = model.A
    a[n:, n:] = [[-0.3, 0.6], [-0.6, -0.3]]
    a[n, model.index("vx")], a[n + 1, model.index("wy")] = 1.0, 30.0
    force = np.zeros((6, 2))
    force[0, 0], force[4, 1] = -2e5, -4e7
    a[:n, n:] = model.E @ force
    return replace(
        model,
        A=a,
        B=np.vstack([model.B, np.zeros((2, model.B.shape[1]))]),
        C=np.hstack([model.C, model.F @ force]),
        E=np.vstack([model.E, np.zeros((2, 6))]),
        states=(*model.states, "radiation_1", "radiation_2"),
    )


@pytest.mark.parametrize("omega", [0.05, 0.22, 0.7])
def test_the_response_at_the_frequency_is_exact(remembering, omega):
    reduced = residualised(remembering, omega)
    assert len(reduced.states) == 14
    assert reduced.response(omega) == pytest.approx(remembering.response(omega), rel=1e-9)


def test_about_the_platforms_frequency_the_response_is_near(model, remembering):
    reduced = residualised(remembering)
    row = remembering.output_index("platform_pitch")
    for omega in np.array([0.8, 1.2]) * platform_frequency(remembering):
        exact = remembering.response(omega)[0, row]
        assert reduced.response(omega)[0, row] == pytest.approx(exact, rel=0.1)
        # and this is worth having: without any memory it is further off
        assert (
            np.abs(model.response(omega)[0, row] - exact).max()
            > np.abs(reduced.response(omega)[0, row] - exact).max()
        )


def test_a_residualised_model_is_left_as_it_is(model):
    assert residualised(model) is model


@pytest.mark.parametrize("rate", [0.0, 0.01])
def test_a_state_that_does_not_come_to_rest_by_itself_is_named(model, rate):
    n = len(model.states)
    a = np.zeros((n + 1, n + 1))
    a[:n, :n], a[n, n], a[n, 0] = model.A, rate, 1.0
    more = {name: np.pad(getattr(model, name), ((0, 1), (0, 0))) for name in ("B", "E")}
    grown = replace(model, A=a, C=np.pad(model.C, ((0, 0), (0, 1))), states=(*model.states, "wake_1"), **more)
    with pytest.raises(InputError, match="state 'wake_1' is not asymptotically stable"):
        residualised(grown)
