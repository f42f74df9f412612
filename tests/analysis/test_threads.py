"""Linear algebra of designs on one thread, and on as many as before after them."""

import pytest

from fowt_env.analysis.threads import _libraries, one_thread
from fowt_env.controllers import make
from fowt_env.errors import InputError


def threads():
    """Numbers of threads of the loaded BLAS libraries."""
    return {library["num_threads"] for library in _libraries().info() if library["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads():
    with _libraries().limit(limits=2, user_api="blas"):
        yield


def test_a_function_has_one_thread_and_leaves_those_of_its_caller():
    assert threads() == {2} and one_thread(threads)() == {1} and threads() == {2}
    with pytest.raises(ZeroDivisionError):
        one_thread(lambda: 1 / 0)()
    assert threads() == {2}


@pytest.mark.parametrize(
    ("name", "step"), [("lqr", "lqr.design.design_models"), ("mpc", "mpc.law.rotor_table")]
)
def test_a_law_is_designed_on_one_thread(name, step, storm_scene, monkeypatch):
    seen = []

    def stop(*arguments):
        seen.append(threads())
        raise InputError("enough")

    monkeypatch.setattr(f"fowt_env.controllers.{step}", stop)
    with pytest.raises(InputError, match="enough"):
        make(name, storm_scene.turbine, 0.1).prepare(storm_scene)
    assert seen == [{1}]
