"""Files of potential-flow coefficients: what is written is read, and what strangers write runs nothing."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from potential_body import made_up_body

from fowt_env.descriptions.potential_flow import coefficient_arrays, read_coefficients
from fowt_env.errors import InputError


class Bomb:
    """Leaves a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_coefficients_are_read_as_they_were_written(tmp_path):
    body, path = made_up_body(), tmp_path / "body.npz"
    np.savez_compressed(path, **coefficient_arrays(body))
    found = read_coefficients(path)
    assert np.array_equal(found.omega, body.omega)
    assert found.damping == pytest.approx(body.damping, rel=1e-6)
    assert found.excitation == pytest.approx(body.excitation, rel=1e-6, abs=1.0)
    assert found.difference_qtf.value == pytest.approx(body.difference_qtf.value, rel=1e-6, abs=1e-3)
    assert found.added_mass_zero is None and found.source == "a made-up body"


def test_pickled_arrays_are_refused_and_not_loaded(tmp_path):
    path, mark = tmp_path / "body.npz", tmp_path / "code_was_run"
    arrays = coefficient_arrays(made_up_body())
    np.savez(path, **arrays | {"omega": np.array([Bomb(mark)], dtype=object)})
    with pytest.raises(InputError, match="body.npz.*holds pickled objects, which are not loaded"):
        read_coefficients(path)
    assert not mark.exists()


def test_an_array_that_claims_more_than_the_file_holds_takes_no_memory(tmp_path):
    path = tmp_path / "body.npz"
    said = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    with zipfile.ZipFile(path, "w") as file:
        head = b"\x93NUMPY\x01\x00" + (118).to_bytes(2, "little")
        file.writestr("omega.npy", head + said.ljust(117) + b"\n" + bytes(80))
    with pytest.raises(InputError, match="omega.npy.*is not its size"):
        read_coefficients(path)


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
