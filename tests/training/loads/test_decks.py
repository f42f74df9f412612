"""Driving runs for a check in OpenFAST: series, wind, sea and the user's deck with these."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from fowt_env.controllers.rosco import find_library
from fowt_env.descriptions.wind_files import read_uniform_wind
from fowt_env.errors import InputError
from fowt_env.files.openfast import read_outb
from fowt_env.files.openfast_deck.parser import PartFile
from fowt_env.plant.compile.decorators import entry
from fowt_env.plant.hydro.waves import elevation
from fowt_env.run.simulation import simulate
from fowt_env.scene.build import build_scene
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.loads.decks import (
    EditedPart,
    rosco_of,
    write_deck,
    write_driving,
    write_waves,
    write_wind,
)
from fowt_env.training.loads.records import FinishedRun, LoadCase
from fowt_env.training.loads.statistics import run_statistics
from fowt_env.training.loads.tables import load_tables
from fowt_env.weather.turbsim import HEAD, read_bts, write_bts
from fowt_env.weather.wind_field import WindBox, read_box

DECKS = Path(__file__).parents[2] / "reference" / "decks" / "IEA-15-240-RWT" / "OpenFAST"
FST = DECKS / "IEA-15-240-RWT-UMaineSemi" / "IEA-15-240-RWT-UMaineSemi.fst"
CASE = Case("dlc1.3_u18", wind=18.0, sea={"kind": "jonswap", "Hs": 4.0, "Tp": 9.0})
LOAD = LoadCase(
    "1.3", "dlc1.3_u18", "test", CASE, "pi", 1, 30.0, 10.0, "ultimate", "normal", 1.35, "test",
    wind_speed=18.0, Hs=4.0, Tp=9.0, wave_direction=30.0,
)  # fmt: skip


@entry
def call_elevation(time, waves):
    """Return the elevation at the origin."""
    return elevation(time, 0.0, 0.0, waves)


@pytest.fixture(scope="module")
def run():
    scene = build_scene("oc3_hywind", wind=18.0, sea=CASE.sea, seed=1, duration=30.0, fidelity="standard")
    return scene, simulate(scene, "pi", duration=30.0)


def box():
    """Return a small box of wind around the rotor."""
    random = np.random.default_rng(2)
    velocity = random.normal(size=(20, 4, 3, 3)).astype(np.float32)
    velocity[..., 0] += 18.0
    return WindBox(
        velocity, np.array([-80.0, 0.0, 80.0]), np.array([10.0, 65.0, 120.0, 175.0]), 0.5, 18.0, True, 4.0
    )


def test_a_box_written_for_turbsim_is_read_back(tmp_path):
    own = box()
    write_bts(tmp_path / "w.bts", own.velocity, own.y, own.z, own.dt, own.speed, 90.0, own.periodic)
    velocity, y, z, dt, speed, periodic = read_bts(tmp_path / "w.bts")
    span = np.ptp(own.velocity.reshape(-1, 3), axis=0)
    assert (np.abs(velocity - own.velocity).reshape(-1, 3) <= 0.51 * span / 65534.0 + 2e-6).all()
    np.testing.assert_allclose(y, own.y, atol=1e-4)
    np.testing.assert_allclose(z, own.z, atol=1e-4)
    assert (dt, speed, periodic) == (0.5, 18.0, True)
    content = (tmp_path / "w.bts").read_bytes()
    *_, u, u0, v, v0, w, w0, length = HEAD.unpack(content[: HEAD.size])
    stored = np.frombuffer(content[HEAD.size + length :], "<i2").reshape(20, -1, 3)
    tower = (stored[:, -1] - [u0, v0, w0]) / [u, v, w]  # where InflowWind has it: the lowest row at y = 0
    np.testing.assert_allclose(tower, own.velocity[:, 0, 1], atol=1e-3)
    write_bts(tmp_path / "v.bts", own.velocity, own.y, own.z, own.dt, own.speed, 90.0, False)
    assert read_bts(tmp_path / "v.bts")[5] is False
    for name, shift in (("w.bts", 0.0), ("v.bts", 80.0 / 18.0)):  # of InflowWind: periodic or not
        spec = {"kind": "bts", "path": str(tmp_path / name)}
        assert read_box(spec, hub_height=90.0, rotor_diameter=126.0).shift == pytest.approx(shift)
    with pytest.raises(InputError, match="lowest point is at z = -1 m"):
        write_bts(tmp_path / "u.bts", own.velocity, own.y, own.z - 11.0, own.dt, 18.0, 90.0, True)


def test_the_wind_of_a_scene_is_written_as_its_kind(run, tmp_path):
    scene, frame = run
    assert write_wind(tmp_path, scene, frame) == (2, "wind.wnd")
    again = read_uniform_wind(tmp_path / "wind.wnd")
    series = scene.model.aero.wind
    np.testing.assert_allclose(again["speed"], series.value[:, 0], rtol=1e-6)
    assert again["shear_exponent"] == pytest.approx(series.shear_exponent)
    sheared = series._replace(
        time=np.array([0.0, 10.0]), value=np.array([[10.0, 0.0, 0.5, 2.0, -1.0], [12.0, 0.0, 0.0, 3.0, 1.0]])
    )
    model = scene.model._replace(aero=scene.model.aero._replace(wind=sheared))
    write_wind(tmp_path, replace(scene, model=model), frame)
    again = read_uniform_wind(tmp_path / "wind.wnd")
    for column, key in enumerate(("speed", "v", "w", "vertical_shear", "horizontal_shear")):
        np.testing.assert_allclose(again[key], sheared.value[:, column], atol=1e-6)
    turned = sheared._replace(value=np.array([[10.0, 3.0, 0.0, 0.0, 0.0], [12.0, -1.0, 0.0, 0.0, 0.0]]))
    model = scene.model._replace(aero=scene.model.aero._replace(wind=turned))
    write_wind(tmp_path, replace(scene, model=model), frame)
    rows = np.loadtxt(tmp_path / "wind.wnd", comments="!")
    # clockwise seen from above: wind towards +y has a negative direction
    np.testing.assert_allclose(rows[:, 2], -np.degrees(np.arctan2([3.0, -1.0], [10.0, 12.0])), rtol=1e-6)
    own = replace(box(), shift=80.0 / 18.0)  # half of its width
    assert write_wind(tmp_path, replace(scene, wind=own), frame) == (3, "wind.bts")
    again = read_box(
        {"kind": "bts", "path": str(tmp_path / "wind.bts")}, hub_height=90.0, rotor_diameter=126.0
    )
    assert not again.periodic and again.usable >= 30.0  # InflowWind starts a periodic file at the hub
    at = np.linspace(0.0, 30.0, 61), 5.0, -20.0, 100.0
    np.testing.assert_allclose(again.at(*at), own.at(*at), atol=2e-3)


@pytest.mark.parametrize("periodic", [True, False])
def test_a_box_is_widened_to_the_motion_of_the_run_by_its_edges(run, tmp_path, periodic):
    """As this package continues it; InflowWind stops beside or above the box."""
    scene, frame = run
    moved = frame.assign(**{
        "PtfmSway_[m]": np.linspace(0.0, -60.0, len(frame)),
        "PtfmRoll_[deg]": np.linspace(0.0, 10.0, len(frame)),  # towards -y, as the sway
        "PtfmHeave_[m]": 8.0,
    })  # fmt: skip
    velocity = np.repeat(box().velocity, 5, axis=0)
    own = replace(box(), velocity=velocity, periodic=periodic, speed=17.3, shift=80.0 / 17.3)
    write_wind(tmp_path, replace(scene, wind=own), moved)
    again = read_box(
        {"kind": "bts", "path": str(tmp_path / "wind.bts")}, hub_height=90.0, rotor_diameter=126.0
    )
    side, top = 63.0 + 60.0 + 90.0 * np.sin(np.radians(10.0)), 90.0 + 63.0 + 8.0
    assert -again.y[0] == again.y[-1] > side and again.z[-1] > top
    late = again.shift - own.shift - 0.5 * round((again.shift - own.shift) / 0.5)
    assert 0.0 < abs(late) < 0.1 * own.dt
    time = np.linspace(0.0, 30.0, 61)
    for y, z in ((5.0, 100.0), (-20.0, top), (side, 60.0), (-side, top)):
        np.testing.assert_allclose(again.at(time, 0.0, y, z), own.at(time + late, 0.0, y, z), atol=2e-3)


def test_the_elevation_is_that_of_the_run_goes_on_and_fades_without_a_mean(run, tmp_path):
    """A record that ends at once moves the body before its end, and a mean would be taken away."""
    scene, frame = run
    end = write_waves(tmp_path, scene, frame)
    rows = np.loadtxt(tmp_path / "waves.Elev", skiprows=1)
    assert end == rows[-1, 0] == pytest.approx(90.0) and abs(rows[-1, 1]) < 1e-12
    during = rows[rows[:, 0] <= 30.0]
    np.testing.assert_allclose(during[:, 1], frame["Wave1Elev_[m]"].to_numpy()[::2], rtol=1e-6, atol=1e-9)
    after = rows[(rows[:, 0] > 30.0) & (rows[:, 0] < 60.0)]
    beyond = [call_elevation(t, scene.model.hydro.waves) for t in after[:, 0]]
    np.testing.assert_allclose(after[:, 1], beyond, rtol=1e-6, atol=1e-6)
    assert abs(rows[:-1, 1].mean()) < 1e-6 and np.abs(rows[:, 1]).max() < 6.0


def test_the_deck_has_the_case_and_all_else_of_the_users(run, tmp_path):
    scene, frame = run
    wind, end = write_wind(tmp_path, scene, frame), write_waves(tmp_path, scene, frame)
    main = PartFile(write_deck(tmp_path, FST, LOAD, scene, frame, wind, end), "OpenFAST")
    old = PartFile(FST, "OpenFAST")
    assert main.number("TMax") == 30.0 and main.whole("CompInflow") == 1
    for key in ("DT", "Gravity", "WtrDpth", "CompMooring"):
        assert main.number(key) == old.number(key)
    # files that do not change are those of the deck, by relative paths
    for key in ("AeroFile", "ServoFile", "HydroFile", "MooringFile"):
        assert not Path(main.text(key)).is_absolute()
        assert main.other(key).resolve() == old.other(key).resolve()
    elastodyn = PartFile(main.other("EDFile"), "ElastoDyn")
    for key, channel in (
        ("PtfmSurge", "PtfmSurge_[m]"),
        ("RotSpeed", "RotSpeed_[rpm]"),
        ("PtfmPitch", "PtfmPitch_[deg]"),
    ):
        assert elastodyn.number(key) == pytest.approx(frame[channel].iloc[0], rel=1e-6)
    assert elastodyn.number("BlPitch(2)") == pytest.approx(frame["BldPitch1_[deg]"].iloc[0], rel=1e-6)
    assert elastodyn.other("TwrFile").is_file() and elastodyn.blade("BldFile", 3, ()).is_file()
    mass = PartFile(old.other("EDFile"), "ElastoDyn")
    assert elastodyn.number("HubMass") == mass.number("HubMass")
    inflow = PartFile(main.other("InflowFile"), "InflowWind")
    assert inflow.whole("WindType") == 2 and inflow.number("RefLength") == 126.0
    assert inflow.other("Filename_Uni").name == "wind.wnd" and inflow.number("RefHt_Uni") == 90.0
    sea = PartFile(main.other("SeaStFile"), "SeaState")
    assert sea.whole("WaveMod") == 5 and sea.number("WaveTMax") == 90.0 and sea.number("WaveDT") == 0.2
    assert sea.number("WaveDir") == 30.0 and sea.text("WvKinFile") == "waves"
    write_deck(tmp_path, FST, LOAD, scene, frame, (3, "wind.bts"), end)
    assert PartFile(tmp_path / inflow.path.name, "InflowWind").text("FileName_BTS") == "wind.bts"


def test_a_parked_deck_idles_and_has_the_current_of_its_storm(run, tmp_path):
    scene, frame = run
    frame = frame.assign(**{"BldPitch1_[deg]": 90.0, "RotSpeed_[rpm]": 0.0})
    options = LOAD.case.options | {"current": {"speed": 1.2, "heading": 30.0, "exponent": 1.0 / 7.0}}
    parked = replace(LOAD, case=replace(LOAD.case, parked=True, options=options))
    weather, held = ((2, "wind.wnd"), 90.0), tmp_path / "held"  # a deck whose rotor cannot turn on its own
    held.mkdir()
    fst = write_deck(held, FST, LOAD, scene, frame, *weather)
    elastodyn = EditedPart(PartFile(fst, "OpenFAST").other("EDFile"), "ElastoDyn")
    elastodyn.put(False, "GenDOF")
    elastodyn.put(2.2, "NcIMUzn")  # and an accelerometer elsewhere than that of the run
    elastodyn.write(elastodyn.file.path)
    main = PartFile(write_deck(tmp_path, fst, parked, scene, frame, *weather), "OpenFAST")
    servo, elastodyn = (
        PartFile(main.other(key), kind) for key, kind in (("ServoFile", "ServoDyn"), ("EDFile", "ElastoDyn"))
    )
    assert servo.path.parent == elastodyn.path.parent == tmp_path
    assert servo.whole("PCMode") == servo.whole("VSContrl") == 0 and servo.number("TimGenOn") > 9000.0
    assert elastodyn.text("GenDOF").lower() == "true" and elastodyn.number("BlPitch(3)") == 90.0
    assert elastodyn.number("NcIMUzn") == 0.0
    sea = PartFile(main.other("SeaStFile"), "SeaState")
    assert sea.whole("CurrMod") == 1 and sea.number("CurrSSV0") == 1.2 and sea.number("CurrDIV") == 0.0
    assert sea.number("CurrSSDir") == 30.0 and sea.number("CurrNSV0") == 0.0
    uniform = replace(parked, case=replace(parked.case, options=options | {"current": {"speed": 0.4}}))
    main = PartFile(write_deck(tmp_path, FST, uniform, scene, frame, *weather), "OpenFAST")
    sea = PartFile(main.other("SeaStFile"), "SeaState")
    assert sea.number("CurrDIV") == 0.4 and sea.number("CurrSSV0") == 0.0


@pytest.mark.skipif(find_spec("rosco") is None, reason="needs pip install --no-deps rosco")
def test_a_deck_with_rosco_has_the_input_file_of_the_run(run, tmp_path):
    scene, frame = run
    rosco = rosco_of("rosco", scene)
    arguments = (FST, LOAD, scene, frame, (2, "wind.wnd"), 90.0)
    main = PartFile(write_deck(tmp_path, *arguments, rosco), "OpenFAST")
    servo = PartFile(main.other("ServoFile"), "ServoDyn")
    assert servo.whole("PCMode") == servo.whole("VSContrl") == 5
    assert servo.text("DLL_DT") == "default"
    assert Path(servo.text("DLL_FileName")) == find_library()[0]
    assert servo.other("DLL_InFile").resolve() == (tmp_path / "DISCON.IN").resolve()
    for name, text in rosco.inputs(scene).items():
        assert (tmp_path / name).read_text() == text
    assert rosco_of("pi", scene) is rosco_of(None, scene) is None


def test_an_edit_keeps_comments_and_names_a_missing_key(tmp_path):
    path = tmp_path / "part.dat"
    path.write_text(
        "title\ntitle\n  0.5   0.6, 1.0   WindVxiList  - a list of RefHt values\n 90.0\tRefHt  - m\n"
    )
    part = EditedPart(path, "InflowWind")
    part.put(120, "RefHt")
    part.put("1 2", "WindVxiList")
    part.write(tmp_path / "new.dat")
    lines = (tmp_path / "new.dat").read_text().splitlines()
    assert lines[3].split() == ["120", "RefHt", "-", "m"]
    assert lines[2] == "1 2    WindVxiList  - a list of RefHt values"
    with pytest.raises(InputError, match="InflowWind file .*WindType is missing"):
        part.put(1, "WindType")


def test_driving_runs_are_those_of_the_table(run, tmp_path):
    scene, frame = run
    finished = {LOAD.key: FinishedRun(*LOAD.key, "ok", statistics=run_statistics(frame, scene, 10.0))}
    results = load_tables([LOAD], finished)
    (folder,) = write_driving(tmp_path, results, {"pi": "pi"}, FST, 1)
    assert sorted(path.name for path in folder.iterdir()) == [
        "IEA-15-240-RWT-UMaineSemi_ElastoDyn.dat", "IEA-15-240-RWT-UMaineSemi_SeaState.dat",
        "IEA-15-240-RWT_InflowFile.dat", "README.md", "model.fst", "run.outb", "waves.Elev", "wind.wnd",
    ]  # fmt: skip
    series = read_outb(folder / "run.outb")
    np.testing.assert_array_equal(series["TwrBsMyt_[kN-m]"], frame["TwrBsMyt_[kN-m]"])
    assert "DLC 1.3" in (folder / "README.md").read_text()
    other = run_statistics(frame * 1.01, scene, 10.0)
    results = load_tables([LOAD], {LOAD.key: FinishedRun(*LOAD.key, "ok", statistics=other)})
    with pytest.raises(InputError, match="was made by other sources or on another machine"):
        write_driving(tmp_path, results, {"pi": "pi"}, None, 1)
