"""Engines: the same outcomes wherever the tasks run, and a dead worker costs a retry."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from fowt_env.controllers import make
from fowt_env.errors import InputError
from fowt_env.training.evaluation import engines
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.engines import outcomes, session
from fowt_env.training.evaluation.evaluate import evaluate

GUSTY = Case(
    "gusty",
    {"kind": "ntm", "speed": 18.0, "class": "B"},
    {"kind": "jonswap", "Hs": 3.0, "Tp": 9.0, "gamma": 2.0},
)
CALM = Case("calm", 16.0)
SHORT = {"duration": 20.0, "skip": 5.0}


def square(task):
    return task * task


def dies_once(task):
    """The task's name; the first worker that gets it dies as if it had been killed."""
    mark = Path(task)
    if mark.suffix == ".dies" and not mark.exists():
        mark.write_text("")
        os._exit(9)
    return mark.name


def dies_on_odd(task):
    """The square of an even task; a worker that gets an odd one ends."""
    return square(task) if task % 2 == 0 else os._exit(9)


def test_every_engine_refuses_what_it_cannot_do():
    for arguments, message in (
        ({"engine": "raz"}, "'ray'"),
        ({"jobs": 0}, "jobs = 0"),
        ({"address": "auto"}, "address = 'auto'"),
        ({"jobs": 2, "tasks": [lambda: None] * 3}, "jobs = 2"),
    ):
        with pytest.raises(InputError, match=message):
            list(outcomes(square, arguments.pop("tasks", [1, 2]), **arguments))
    assert list(outcomes(square, [], jobs=3)) == []


@pytest.mark.nightly
@pytest.mark.parametrize("engine", ["processes", pytest.param("ray", marks=pytest.mark.nightly)])
def test_a_killed_worker_process_costs_its_task_a_retry(tmp_path, engine):
    if engine == "ray":
        pytest.importorskip("ray", reason="Ray is not installed: pip install 'fowt-env[ray]'")
    names = [str(tmp_path / name) for name in ("a", "b.dies", "c", "d.dies", "e")]
    expected = dict(enumerate(["a", "b.dies", "c", "d.dies", "e"]))
    assert dict(outcomes(dies_once, names, jobs=2, engine=engine)) == expected


@pytest.mark.nightly
def test_a_task_on_which_workers_always_die_is_given_up_alone_and_with_its_exit_code():
    with pytest.raises(RuntimeError, match="ended 3 times, the last time alone, with exit code 9"):
        list(outcomes(dies_on_odd, [1, 2], jobs=2))
    found = dict(outcomes(dies_on_odd, [1, 2, 3, 4], jobs=2, lost=lambda task, reason: (task, reason[-11:])))
    assert found == {0: (1, "exit code 9"), 1: 4, 2: (3, "exit code 9"), 3: 16}


# ------------------------------------------------------------------ Ray


@pytest.mark.parametrize(
    ("address", "what"), [(None, "Ray does not start"), ("10.0.0.1:6379", "no cluster at '10.0.0.1:6379'")]
)
def test_a_ray_that_does_not_start_is_one_line_with_its_reason(address, what, monkeypatch):
    said = "The current node timed out during startup.\n\nThis could happen because " + 99 * "of GCS "
    ended = []

    def init(**options):
        raise Exception(said)  # as Ray does

    ray = SimpleNamespace(is_initialized=lambda: False, init=init, shutdown=lambda: ended.append(1))
    monkeypatch.setitem(sys.modules, "ray", ray)
    with pytest.raises(InputError, match=what) as caught, session("ray", 1, address):
        pass
    message = str(caught.value)
    assert "timed out during startup. This could" in message and "engine 'processes'" in message
    assert "\n" not in message and len(message) < 400 and ended == [1]
    assert caught.value.__suppress_context__


@pytest.fixture(scope="module")
def cluster():
    """A local Ray cluster of two workers."""
    ray = pytest.importorskip("ray", reason="Ray is not installed: pip install 'fowt-env[ray]'")
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
    yield ray
    ray.shutdown()


@pytest.mark.nightly
def test_ray_gives_the_bits_of_the_serial_evaluation(cluster, tmp_path):
    arguments = ("pi,pi_land", [GUSTY, CALM])
    serial = evaluate(*arguments, seeds=(3, 4), folder=tmp_path / "serial", **SHORT)
    spread = evaluate(*arguments, seeds=(3, 4), folder=tmp_path / "ray", engine="ray", jobs=2, **SHORT)
    pd.testing.assert_frame_equal(serial, spread, check_exact=True)
    for path in (tmp_path / "serial" / "runs").rglob("*.parquet"):
        other = tmp_path / "ray" / path.relative_to(tmp_path / "serial")
        np.testing.assert_array_equal(pd.read_parquet(path), pd.read_parquet(other))


@pytest.mark.slow
def test_ray_takes_controllers_of_every_kind(cluster, turbine):
    """Compiled ones write into arrays of theirs, which must not arrive read-only."""
    laws = {"name": "pi", "compiled": make("pi", turbine, 0.1)}
    if find_spec("rosco") is not None:
        laws["library"] = make("rosco_float", turbine, 0.1)
    table = evaluate(laws, [CALM], engine="ray", jobs=2, **SHORT).set_index("controller")
    assert table["reason"].tolist() == [""] * len(laws)
    assert table.loc["compiled", "BldPitch1_mean_[deg]"] == table.loc["name", "BldPitch1_mean_[deg]"]


def test_an_exit_code_that_another_thread_is_reading_is_waited_for():
    """On a busy machine it can be missing after the worker has ended: what reads it would raise."""

    class Ended:
        read = 0

        @property
        def exitcode(self):
            self.read += 1
            return None if self.read < 4 else 3

        def join(self, timeout):
            """Return at once, as of a process whose end somebody else has seen."""

        def kill(self):
            """Return at once."""

    class Pool:
        _processes = {1: Ended()}

        def shutdown(self, **_):
            """Return at once."""

    assert engines._end(Pool(), 0.0) == [3]
