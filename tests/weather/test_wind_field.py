"""Full-field wind: sampling of a box, its travel, its edges, its averages, and runs in it."""

import struct
import sys

import numpy as np
import pytest
from plant_helpers import random_state, rates
from scipy.interpolate import RegularGridInterpolator

import fowt_env
from fowt_env.descriptions.iec import ntm_sigma
from fowt_env.errors import InputError
from fowt_env.plant.aero.wind_field import field_at
from fowt_env.weather.turbulence import drawn_ntm_sigma
from fowt_env.weather.wind_field import (
    WindBox,
    hub_speed,
    is_field,
    mann_turbulence,
    profile_field,
    read_box,
    rotor_average,
    steady_field,
)

HUB, DIAMETER = 90.0, 126.0
Y = np.linspace(-75.0, 75.0, 11)
Z = np.linspace(10.0, 170.0, 9)


def box_of(u, **changes):
    spec = {"kind": "box", "u": u, "y": Y, "z": Z, "dt": 0.5, "speed": 12.0}
    return read_box(spec | changes, hub_height=HUB, rotor_diameter=DIAMETER)


def random_box(**changes):
    rng = np.random.default_rng(3)
    u, v, w = rng.standard_normal((3, 40, Z.size, Y.size)) + np.array([12.0, 0.0, 0.0])[:, None, None, None]
    return box_of(u, v=v, w=w, **changes)


@pytest.mark.installation
def test_sampling_is_trilinear_like_a_plain_interpolator():
    box = random_box()
    grid = (np.arange(40) * 0.5, Z, Y)
    plain = RegularGridInterpolator(grid, box.velocity.astype(float))
    rng = np.random.default_rng(4)
    n = 300
    t, X = rng.uniform(0.0, 10.0, n), rng.uniform(-20.0, 20.0, n)
    y, z = rng.uniform(-75.0, 75.0, n), rng.uniform(10.0, 170.0, n)
    wanted = plain(np.column_stack([t + box.shift - X / 12.0, z, y]))
    assert box.at(t, X, y, z) == pytest.approx(wanted, abs=1e-5)


def test_the_box_travels_unchanged_with_its_speed_and_inflowwinds_shift():
    box = random_box()
    assert box.shift == pytest.approx(75.0 / 12.0)
    here, there = box.at(3.0, 0.0, 4.0, 80.0), box.at(3.0 + 6.0 / 12.0, 6.0, 4.0, 80.0)
    assert there == pytest.approx(here, abs=1e-12)


def test_below_the_grid_the_wind_falls_linearly_to_zero_and_beside_it_the_edge_holds():
    box = random_box()
    assert box.at(1.0, 0.0, 5.0, 5.0) == pytest.approx(0.5 * box.at(1.0, 0.0, 5.0, 10.0), abs=1e-12)
    assert box.at(1.0, 0.0, 5.0, -3.0) == pytest.approx(np.zeros((1, 3)))
    assert box.at(1.0, 0.0, 90.0, 60.0) == pytest.approx(box.at(1.0, 0.0, 75.0, 60.0))
    assert box.at(1.0, 0.0, 0.0, 190.0) == pytest.approx(box.at(1.0, 0.0, 0.0, 170.0))


def test_a_periodic_box_repeats_and_another_holds_its_last_slice():
    repeating, ending = random_box(periodic=True), random_box()
    assert repeating.at(23.3, 0.0, 1.0, 90.0) == pytest.approx(repeating.at(3.3, 0.0, 1.0, 90.0), abs=1e-9)
    assert ending.at(1e4, 0.0, 1.0, 90.0) == pytest.approx(ending.at(19.5 - ending.shift, 0.0, 1.0, 90.0))
    assert repeating.usable == np.inf
    assert ending.usable == pytest.approx(19.5 - 2.0 * 75.0 / 12.0)


def test_time_that_is_not_a_number_is_answered_without_a_crash():
    assert np.isfinite(field_at(np.nan, 0.0, 0.0, 90.0, random_box().field())).all()


@pytest.mark.installation
def test_rotor_average_finds_mean_and_gradients_of_a_plane():
    y, z = np.meshgrid(Y, Z)
    plane = 12.0 + 0.02 * (z - HUB) - 0.01 * y
    box = box_of(np.repeat(plane[None], 5, axis=0))
    time, value = rotor_average(box, HUB, DIAMETER)
    assert time[0] == pytest.approx(-box.shift)
    assert value[:, 0] == pytest.approx(12.0, abs=1e-5)
    assert value[:, 3] == pytest.approx(0.02 * DIAMETER, abs=1e-5)
    assert value[:, 4] == pytest.approx(-0.01 * DIAMETER, abs=1e-5)
    assert rotor_average(box, HUB, DIAMETER, ([1.0, 63.0], [4.0, 1.0]))[1][:, 0] == pytest.approx(
        12.0, abs=1e-5
    )


def test_steady_field_is_the_mean_over_time_at_every_height():
    box = random_box()
    mean = steady_field(box.field())
    wanted = box.velocity[:, 2, 6, 0].mean()
    assert field_at(77.0, 0.0, 15.0, 50.0, mean)[0] == pytest.approx(wanted, rel=1e-5)
    assert hub_speed(box, HUB) == pytest.approx(box.velocity[:, 4, 5, :2].mean(axis=0)[0], rel=0.01)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"y": np.linspace(-50.0, 50.0, 11)}, "must contain the rotor"),
        ({"u": np.zeros((4, 3, 3))}, "from z and y"),
        ({"colour": 1}, "colour"),
        ({"dt": -1.0}, "dt"),
        ({"u": np.full((4, 9, 11), np.nan)}, "finite"),
        ({"u": "wind"}, "wind.u: must be an array of numbers with 3 axes"),
        ({"v": np.zeros((4, 9, 10))}, r"wind.v has shape \(4, 9, 10\): must be that of u"),
        ({"y": np.r_[Y[:-1], 90.0]}, "wind.y: must be at least 2 evenly increasing numbers"),
        ({"periodic": 1}, "wind.periodic = 1"),
    ],
)
def test_bad_boxes_are_refused_by_name(change, words):
    spec = {"kind": "box", "u": np.full((4, 9, 11), 12.0), "y": Y, "z": Z, "dt": 0.5, "speed": 12.0}
    with pytest.raises(InputError, match=words):
        read_box(spec | change, hub_height=HUB, rotor_diameter=DIAMETER)


def test_what_a_kind_of_box_needs_is_named_where_it_is_missing():
    with pytest.raises(InputError, match="wind.path is missing: must be a path"):
        read_box({"kind": "bts"}, hub_height=HUB, rotor_diameter=DIAMETER)
    with pytest.raises(InputError, match="wind.path = 3: must be a path"):
        read_box({"kind": "bts", "path": 3}, hub_height=HUB, rotor_diameter=DIAMETER)


@pytest.mark.parametrize(
    ("module", "spec", "extra"),
    [
        ("hipersim", {"kind": "mann", "speed": 18.0}, "mann"),
        ("openfast_io.turbsim_file", {"kind": "bts", "path": "small.bts"}, "openfast"),
    ],
)
def test_a_box_whose_library_is_missing_says_how_to_install_it(module, spec, extra, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.chdir(tmp_path)
    head = struct.pack("<h4l12fl", 7, 9, 11, 0, 4, *[1.0] * 12, 0)
    (tmp_path / "small.bts").write_bytes(head + bytes(2 * 3 * 4 * 9 * 11))
    with pytest.raises(InputError, match=rf"not installed: pip install 'fowt-env\[{extra}\]'"):
        read_box(spec, hub_height=HUB, rotor_diameter=DIAMETER, duration=60.0)


def test_a_box_says_in_words_what_it_is():
    assert repr(random_box()) == "WindBox(40 x 0.5 s, 11 x 9 points, 12 m/s)"


def test_missing_turbsim_file_is_named():
    with pytest.raises(InputError, match="nowhere.bts"):
        read_box({"kind": "bts", "path": "nowhere.bts"}, hub_height=HUB, rotor_diameter=DIAMETER)


def test_a_turbsim_file_is_read_slice_by_slice(tmp_path):
    turbsim = pytest.importorskip("openfast_io.turbsim_file")
    file = turbsim.TurbSimFile()
    box = random_box()
    file["u"] = np.transpose(box.velocity, (3, 0, 2, 1)).astype(float)
    file["y"], file["z"], file["t"] = Y, Z, 0.5 * np.arange(40)
    file["zTwr"], file["uTwr"] = np.zeros(0), np.zeros((3, 40, 0))
    file["zRef"], file["uRef"], file["ID"], file["dt"], file["info"] = 90.0, 12.0, 7, 0.5, "test"
    path = tmp_path / "small.bts"
    file.write(str(path))
    read = read_box({"kind": "bts", "path": path}, hub_height=HUB, rotor_diameter=DIAMETER)
    assert read.velocity == pytest.approx(box.velocity, abs=2e-4)  # 16-bit integers in the file
    assert (read.dt, read.speed, read.periodic) == (pytest.approx(0.5), pytest.approx(12.0), False)
    assert read.shift == pytest.approx(box.shift)
    for given in (path, str(path)):  # the path is the wind
        assert is_field(given)
        scene = fowt_env.build_scene("oc3_hywind", wind=given, rotor="table", fidelity="reference")
        np.testing.assert_array_equal(scene.wind.velocity, read.velocity)


@pytest.mark.slow
def test_a_mann_box_has_the_standards_deviation_and_the_sites_shear():
    pytest.importorskip("hipersim")
    spec = {"kind": "mann", "speed": 18.0, "class": "B", "seed": 2, "dt": 0.5}
    box = read_box(spec, hub_height=HUB, rotor_diameter=DIAMETER, shear_exponent=0.14, duration=600.0)
    hub = box.at(np.arange(0.0, 600.0, 1.0), 0.0, 0.0, HUB)
    # one point over 600 s, whose deviation varies by some 5 %
    assert hub[:, 0].std() == pytest.approx(0.14 * (0.75 * 18.0 + 5.6), rel=0.06)
    mean = box.velocity[..., 0].mean(axis=(0, 2))
    ratio = np.interp(140.0, box.z, mean) / np.interp(90.0, box.z, mean)
    assert ratio == pytest.approx((140.0 / 90.0) ** 0.14, rel=0.03)
    assert isinstance(box, WindBox) and box.periodic
    other = read_box(spec | {"sigma": "drawn"}, hub_height=HUB, rotor_diameter=DIAMETER, duration=600.0)
    deviation = other.at(np.arange(0.0, 600.0, 1.0), 0.0, 0.0, HUB)[:, 0].std()
    expected = drawn_ntm_sigma(18.0, "B", 2) / ntm_sigma(18.0, "B")
    assert deviation / hub[:, 0].std() == pytest.approx(expected, rel=1e-5)


def scenes():
    """A steady uniform wind as a box and as a series, on the same platform."""
    spec = {"kind": "box", "u": np.full((120, 9, 11), 12.0), "y": Y, "z": Z - 10.0, "dt": 0.5, "speed": 12.0}
    options = {"shear_exponent": 0.0}
    return (
        fowt_env.build_scene("oc3_hywind", wind=spec, **{"fidelity": "reference"} | options),
        fowt_env.build_scene("oc3_hywind", wind=12.0, **{"fidelity": "reference"} | options),
    )


@pytest.mark.nightly
def test_a_uniform_box_gives_the_motion_and_the_trim_of_the_same_steady_wind():
    box, steady = scenes()
    points = [fowt_env.trim(scene, platform="fixed") for scene in (box, steady)]
    assert points[0]["RtFldFxh"] == pytest.approx(points[1]["RtFldFxh"], rel=1e-9)
    rng = np.random.default_rng(8)
    for t in (0.0, 7.3, 20.0):
        x = random_state(rng, box.n_state)
        moved, wanted = (rates(scene, x, points[0].command, t) for scene in (box, steady))
        assert moved == pytest.approx(wanted, rel=1e-7, abs=1e-9)


def test_a_run_longer_than_its_box_is_refused():
    box, _ = scenes()
    with pytest.raises(InputError, match="box of wind covers"):
        fowt_env.simulate(box, duration=60.0)


def test_a_scene_with_a_box_takes_another_box_but_no_series():
    box, _ = scenes()
    other = {"kind": "box", "u": np.full((120, 9, 11), 15.0), "y": Y, "z": Z - 10.0, "dt": 0.5, "speed": 15.0}
    assert box.with_weather(other, None, 1).wind_speed == pytest.approx(15.0)
    with pytest.raises(InputError, match="full-field"):
        box.with_weather(15.0, None, 1)


def test_the_coefficient_table_gets_the_rotor_average_of_a_box():
    spec = {"kind": "box", "u": np.full((120, 9, 11), 12.0), "y": Y, "z": Z, "dt": 0.5, "speed": 12.0}
    scene = fowt_env.build_scene("oc3_hywind", wind=spec, rotor="table", fidelity="reference")
    assert scene.model.aero.field is None
    assert scene.model.aero.wind.value[:, 0] == pytest.approx(12.0, abs=1e-5)


BTS_HEAD = "<h4i12fi"
SOUND = (8, 2, 2, 0, 1, 140.0, 140.0, 0.1, 12.0, 90.0, 20.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0)


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (0, 9, "identifier 9"),
        (1, 0, "0 x 2 points"),
        (2, 2**31 - 1, "times of 2 x 2147483647 . 0 points take 25769803834 bytes; the file has 94"),
        (4, 2**31 - 1, "2147483647 times"),
        (17, -1, "-1 characters"),
        (7, float("nan"), "nan s"),
        (11, 0.0, "no scale zero"),
        (8, 1e30, "speed = 1.0*15.*must be a number in .1, 100. m"),
    ],
)
def test_a_turbsim_file_whose_head_cannot_be_is_refused_before_it_is_read(tmp_path, place, value, message):
    pytest.importorskip("openfast_io", reason="openfast_io is not installed")
    head = list(SOUND)
    head[place] = value
    path = tmp_path / "box.bts"
    path.write_bytes(struct.pack(BTS_HEAD, *head) + np.full(12, 12, "<i2").tobytes())
    with pytest.raises(InputError, match=f"box.bts.*{message}"):
        read_box({"kind": "bts", "path": path}, hub_height=90.0, rotor_diameter=126.0)


def test_a_profile_is_the_power_law_at_every_time_and_place():
    """Linear between its points, 1 m apart: within n (1 - n) / 8 (1 m / z)^2 of it, 2.1e-5 at 27 m."""
    field = profile_field(11.4, 0.14, HUB, DIAMETER)
    for z in (27.3, 60.0, HUB, 152.9, 190.0):
        for t, x, y in ((0.0, 0.0, 0.0), (500.0, 30.0, -70.0), (1e4, -30.0, 70.0)):
            law = 11.4 * (z / HUB) ** 0.14, 0.0, 0.0
            assert field_at(t, x, y, z, field) == pytest.approx(law, rel=2.1e-5)


def test_boxes_that_share_a_spectrum_are_those_made_one_by_one():
    hipersim = pytest.importorskip("hipersim")
    arguments = 64, 4, 9.0, 10.0, 33.6
    grid = {"Nxyz": (64, 4, 4), "dxyz": (9.0, 10.0, 10.0)}
    boxes = [mann_turbulence(*arguments, seed) for seed in (1, 2, 1)]
    for seed, box in zip((1, 2, 1), boxes, strict=True):
        alone = np.asarray(hipersim.MannTurbulenceField.generate(L=33.6, Gamma=3.9, **grid, seed=seed).uvw)
        assert np.array_equal(box, np.transpose(alone, (1, 3, 2, 0))[::-1].astype(np.float32))
    assert not np.array_equal(boxes[0], boxes[1])
