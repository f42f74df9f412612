"""Boxes of wind that are kept: made once, and again where their file is broken."""

import numpy as np
import pytest

from fowt_env.training.evaluation import wind_boxes
from fowt_env.weather.wind_field import WindBox

SPEC = {"kind": "mann", "speed": 18.0}


@pytest.fixture
def made(tmp_path, monkeypatch):
    """List of the boxes that were made; a small one stands for hipersim's."""
    monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path))
    boxes = []

    def make(spec, *, seed, **arguments):
        velocity = np.random.default_rng(seed).normal(18.0, 1.0, (4, 2, 2, 3)).astype(np.float32)
        line = np.array([-70.0, 70.0])
        boxes.append(WindBox(velocity, line, line + 90.0, 0.2, 18.0, True, 3.5))
        return boxes[-1]

    monkeypatch.setattr(wind_boxes, "read_box", make)
    return boxes


def box(seed=1):
    return wind_boxes.cached_box(SPEC, "oc3_hywind", seed, {"duration": 700.0})


def test_a_box_is_made_once_for_each_seed_and_read_bit_for_bit(made):
    for seed in (1, 2, 1, 2):
        kept = box(seed)
        np.testing.assert_array_equal(kept.velocity, made[seed - 1].velocity)
        assert (kept.dt, kept.speed, kept.periodic, kept.shift) == (0.2, 18.0, True, 3.5)
    assert len(made) == 2


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 half", None])
def test_a_broken_file_is_made_again(made, tmp_path, content):
    box()
    (path,) = (tmp_path / "wind_boxes").iterdir()
    path.write_bytes(path.read_bytes()[:-100] if content is None else content)
    np.testing.assert_array_equal(box().velocity, made[0].velocity)
    box()
    assert len(made) == 2


@pytest.mark.parametrize("given", ["a file", "open to all", "nowhere"])
def test_without_a_folder_of_ones_own_boxes_are_made_each_time(given, made, tmp_path, monkeypatch):
    if given == "a file":
        (tmp_path / "file").write_text("")
        monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path / "file"))
    elif given == "open to all":
        (tmp_path / "wind_boxes").mkdir()
        (tmp_path / "wind_boxes").chmod(0o777)
    else:
        monkeypatch.setattr(wind_boxes, "cache_root", lambda: None)
    box(), box()
    assert len(made) == 2
    assert not list(tmp_path.rglob("*.npz"))
