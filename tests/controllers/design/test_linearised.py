"""The linear loop of a sampled law: its poles and margins, against closed forms and definitions."""

import numpy as np
import pytest

import fowt_env
from fowt_env.analysis.linear_model import linearize
from fowt_env.analysis.trim import trim
from fowt_env.control import make
from fowt_env.control.information import known_scene
from fowt_env.controllers.design.closed_loop import closed_loop_matrix
from fowt_env.controllers.design.linearised import bilinear, sampled_loop
from fowt_env.controllers.pi import PISettings
from fowt_env.errors import InputError

DT = 0.1


@pytest.fixture(scope="module")
def model():
    scene = fowt_env.build_scene("oc3_hywind", wind=16.0)
    return linearize(scene, trim(scene))


@pytest.fixture(scope="module")
def loops(model):
    found = {}
    for name in ("pi", "floating_feedback", "lqr"):
        controller = make(name, model.scene.turbine, DT)
        controller.prepare(known_scene(model.scene, controller))
        found[name] = sampled_loop(model, controller, DT)
    return found


def test_the_poles_of_the_sampled_pi_are_those_of_its_closed_form_to_the_order_of_the_period(model, loops):
    """Sampling delays the loop by up to one period, which moves a pole p by about |p|^2 dt: twice that."""
    a, _ = closed_loop_matrix(model, PISettings.published(model.scene.turbine))
    exact = np.linalg.eigvals(a)
    exact = exact[(np.abs(exact) < 1.0) & (np.abs(exact) > 0.03)]
    assert len(exact) >= 12
    poles = loops["pi"].poles()
    for pole in exact:
        assert np.abs(poles - pole).min() < 2.0 * abs(pole) ** 2 * DT


@pytest.mark.parametrize("name", ["pi", "floating_feedback", "lqr"])
def test_a_loop_gain_at_its_margin_puts_a_pole_on_the_unit_circle(name, loops):
    loop = loops[name]
    found = loop.margins()
    assert found.stable and np.abs(np.linalg.eigvals(loop.matrix())).max() < 1.0
    (a, b, c, _), (al, bl, cl, dl) = loop.plant, loop.law
    factor = np.array([[1.0], [found.loops["blade_pitch_command"].gain]])  # of the second command alone
    scaled = np.block([[a + b @ (factor * dl) @ c, b @ (factor * cl)], [bl @ c, al]])
    assert np.abs(np.linalg.eigvals(scaled)).max() == pytest.approx(1.0, abs=2e-6)


def test_the_phase_margin_is_that_of_the_loop_at_its_frequency(loops):
    """With L = -K(z) G(z) on the unit circle, at z = exp(i w dt) of the transformed frequency."""
    loop = loops["pi"]
    margin = loop.margins().loops["blade_pitch_command"]
    z = np.exp(2j * np.arctan(0.5 * margin.phase_frequency * DT))

    def response(matrices):
        a, b, c, d = matrices
        return c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d

    transfer = -(response(loop.law) @ response(loop.plant))[1, 1]
    assert abs(transfer) == pytest.approx(1.0, rel=1e-6)
    lag = abs((np.degrees(np.angle(transfer)) + 180.0 + 180.0) % 360.0 - 180.0)
    assert lag == pytest.approx(margin.phase, abs=1e-3)


def test_the_law_reads_what_it_declares_and_nothing_else(loops):
    assert loops["pi"].outputs == ("generator_speed",)
    assert set(loops["floating_feedback"].outputs) == {"generator_speed", "nacelle_velocity"}
    assert "nacelle_acceleration" in loops["lqr"].outputs


def test_the_bilinear_transform_maps_z_to_the_frequency_of_its_tangent():
    a, b, c, d = (np.array([[value]]) for value in (0.7, 0.3, 1.2, 0.4))
    w = 2.0
    s, z = 2j / DT * np.tan(0.5 * w * DT), np.exp(1j * w * DT)
    ac, bc, cc, dc = bilinear((a, b, c, d), DT)
    assert (cc / (s - ac) * bc + dc)[0, 0] == pytest.approx((c / (z - a) * b + d)[0, 0], rel=1e-12)


def test_a_law_that_is_not_compiled_is_refused_by_name(model):
    with pytest.raises(InputError, match="'ordinary'.*only a compiled law"):
        sampled_loop(model, type("Ordinary", (), {"name": "ordinary", "act": None})(), DT)
