"""Files of potential-flow coefficients: what is written is read, and what does not fit is named."""

import numpy as np
import pytest
from potential_body import made_up_body

from fowt_env.descriptions.potential_flow import coefficient_arrays, read_coefficients
from fowt_env.errors import InputError


def test_coefficients_are_read_as_they_were_written(tmp_path):
    body, path = made_up_body(), tmp_path / "body.npz"
    np.savez_compressed(path, **coefficient_arrays(body))
    found = read_coefficients(path)
    assert np.array_equal(found.omega, body.omega)
    assert found.damping == pytest.approx(body.damping, rel=1e-6)
    assert found.excitation == pytest.approx(body.excitation, rel=1e-6, abs=1.0)
    assert found.difference_qtf.value == pytest.approx(body.difference_qtf.value, rel=1e-6, abs=1e-3)
    assert found.added_mass_zero is None and found.source == "a made-up body"


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("omega", np.array([0.3, 0.2]), "omega|damping"),
        ("heading", np.zeros(13), "heading: must increase"),
        ("stiffness", np.full((6, 6), np.nan), "stiffness: must be finite numbers"),
        ("damping", np.array(["a"]), "damping: must be numbers"),
    ],
)
def test_arrays_that_do_not_fit_are_named(tmp_path, name, value, words):
    path = tmp_path / "body.npz"
    np.savez(path, **coefficient_arrays(made_up_body()) | {name: value})
    with pytest.raises(InputError, match=words):
        read_coefficients(path)
