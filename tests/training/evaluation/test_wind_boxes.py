"""Turbulence that is kept: made once, and again where its file is broken."""

import numpy as np
import pytest

from fowt_env.training.evaluation import wind_boxes
from fowt_env.weather import wind_field

SPEC = {"kind": "mann", "speed": 18.0, "points": 8, "dt": 5.0}


@pytest.fixture
def made(tmp_path, monkeypatch):
    """List of the turbulence that was made; random numbers stand for hipersim's."""
    monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path))
    fields = []

    def make(n_time, n_side, *_, seed=None):
        seed = _[-1]
        fields.append(
            np.random.default_rng(seed).normal(0.0, 1.0, (n_time, n_side, n_side, 3)).astype(np.float32)
        )
        return fields[-1]

    monkeypatch.setattr(wind_field, "mann_turbulence", make)
    return fields


def box(seed=1, **keys):
    return wind_boxes.cached_box(SPEC | keys, "oc3_hywind", seed, {"duration": 700.0})


def test_turbulence_is_made_once_for_each_seed_and_read_bit_for_bit(made):
    for seed in (1, 2, 1, 2):
        new = wind_boxes.new_box(SPEC, "oc3_hywind", seed, {"duration": 700.0})
        kept = box(seed)
        np.testing.assert_array_equal(kept.velocity, new.velocity)
        assert (kept.dt, kept.speed, kept.periodic, kept.shift) == (new.dt, new.speed, True, new.shift)
    assert len(made) == 2 + 4


def test_models_classes_and_directions_share_the_turbulence_and_scale_it(made):
    normal, extreme = box(), box(model="etm", turbine_class="I")
    turned, other = box(direction=8.0), box(**{"class": "A"})
    assert len(made) == 1
    hub = np.s_[:, 4, 4, 0]
    assert extreme.velocity[hub].std() > 1.2 * normal.velocity[hub].std()
    assert other.velocity[hub].std() == pytest.approx(16.0 / 14.0 * normal.velocity[hub].std(), rel=1e-5)
    mean = turned.velocity[..., 1].mean() / turned.velocity[..., 0].mean()
    assert np.degrees(np.arctan(mean)) == pytest.approx(8.0, abs=0.2)
    box(points=9), box(dt=4.0), box(speed=17.0)
    assert len(made) == 4


@pytest.mark.parametrize("content", [b"", b"\x93NUMPY half", None])
def test_a_broken_file_is_made_again(made, tmp_path, content):
    first = box()
    (path,) = (tmp_path / "wind_boxes").iterdir()
    path.write_bytes(path.read_bytes()[:-100] if content is None else content)
    np.testing.assert_array_equal(box().velocity, first.velocity)
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
    assert not list(tmp_path.rglob("*.np?"))
