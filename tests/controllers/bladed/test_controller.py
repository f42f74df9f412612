"""Libraries with the Bladed interface as controllers: commands, messages, and the ways in which one fails."""

import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from bladed_library import built, needs_gcc, needs_gfortran

from fowt_env import build_scene, simulate
from fowt_env.control import make
from fowt_env.control.views import whole_view
from fowt_env.controllers import controller_names
from fowt_env.controllers.bladed.controller import BladedLibrary, named_library
from fowt_env.controllers.bladed.library import MEMORY_SIZE
from fowt_env.controllers.bladed.records import INDEX, START, STEP
from fowt_env.controllers.bladed.swap import Swap
from fowt_env.controllers.rosco import find_library
from fowt_env.errors import ControllerError, InputError
from fowt_env.plant.measurement import BladeMeasurement, Measurement
from fowt_env.training.evaluation.cases import Case
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.provenance import controller_code

pytestmark = needs_gcc
needs_rosco = pytest.mark.skipif(find_spec("rosco") is None, reason="needs pip install --no-deps rosco")
RATED = Measurement(*[0.0] * len(Measurement._fields))._replace(
    rotor_speed=1.267109,
    generator_speed=122.9096,
    generator_torque=43093.55,
    wind_speed=18.0,
    blade_pitch=0.26,
)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return built(tmp_path_factory.mktemp("c"))


@pytest.fixture(scope="module")
def scene():
    return build_scene("oc3_hywind", wind=18.0, duration=100.0, fidelity="standard")


@pytest.fixture
def started(turbine, library, tmp_path):
    """Function that starts the library in a mode, with further words of its name."""

    def start(mode="law", *words, path=None):
        (tmp_path / f"{mode}.IN").write_text(mode)
        name = ",".join([f"dll:{path or library}", str(tmp_path / f"{mode}.IN"), *words])
        controller = make(name, turbine, 0.1)
        controller.reset(RATED)
        return controller

    return start


def answers(controller, speeds, first=0):
    return [
        controller.act(RATED._replace(time=0.1 * (first + k), generator_speed=speed))
        for k, speed in enumerate(speeds)
    ]


def law(speeds):
    """Plain twin of the law of the C library, in float32 as there."""
    integral, pitches = np.float32(0.26), []
    for k, speed in enumerate(speeds):
        error = np.float32(speed) - np.float32(122.9096)
        integral = integral + np.float32(1e-3) * np.float32(0.1) * error * np.float32(k > 0)
        pitches.append(float(integral))
    return pitches


def failure(controller):
    """The message with which a controller fails within two seconds of simulated time."""
    with pytest.raises(ControllerError) as caught:
        answers(controller, [123.0] * 20)
    return str(caught.value)


def test_commands_are_those_of_the_library(started):
    speeds = 123.0 + np.linspace(0.0, 8.0, 40)
    commands = answers(started(), speeds)
    assert [pitch for _, pitch in commands] == law(speeds)
    assert {torque for torque, _ in commands} == {float(np.float32(43093.55))}


def test_a_first_command_at_a_later_time_is_a_call_of_its_own(started):
    (_, pitch), *_ = answers(started(), [131.0], first=1)
    assert pitch == law([131.0, 131.0])[1] > law([131.0])[0]


def test_several_libraries_at_once_share_no_state(started):
    up, down = 123.0 + np.linspace(0.0, 8.0, 30), 123.0 - np.linspace(0.0, 8.0, 30)
    first, second = started(), started()
    together = []
    for k in range(30):
        together += answers(second, down[k : k + 1], k) and answers(first, up[k : k + 1], k)
    assert [pitch for _, pitch in together] == law(up)


def test_a_second_reset_starts_afresh_and_so_does_a_pickled_copy(started):
    speeds = 123.0 + np.linspace(0.0, 5.0, 15)
    controller = started()
    before = answers(controller, speeds)
    copy = pickle.loads(pickle.dumps(controller))
    for one in (controller, copy):
        one.reset(RATED)
        assert answers(one, speeds) == before


def test_each_blade_gets_its_demand_with_individual_pitch(started):
    controller = started("law", "pitch=individual")
    assert controller.individual
    _, *pitches = answers(controller, [122.9096])[0]
    assert np.diff(pitches) == pytest.approx([0.001, 0.001], rel=1e-4)


def test_the_last_call_has_status_minus_one_and_the_output_is_kept(started):
    controller = started()
    answers(controller, [123.0] * 5)
    controller.finish()
    assert controller.console_output == "6 calls, last at 0.4 s"
    assert controller.controller._process is None


def test_a_message_is_kept_once_and_a_failure_in_the_last_call_too(started):
    controller = started("warn")
    answers(controller, [123.0] * 20)
    controller.finish()
    assert controller.console_output.startswith("t = 1.000 s: vane is noisy")
    assert controller.console_output.count("noisy") == 1
    controller = started("bad_end")
    controller.finish()
    assert "last call: code -3: cannot close" in controller.console_output


@pytest.mark.parametrize(
    ("mode", "part"),
    [
        ("crash", "by SIGSEGV (Segmentation fault); its output: about to crash"),
        ("exit", "with exit code 3 (exit, or STOP in Fortran); its output: bad input, stopping"),
        ("fail", "its code is -7: no wind vane"),
        ("yaw", "demands a yaw rate: the nacelle does not yaw (record 48, yaw_rate_demand = 0.01)"),
        ("yaw_torque", "demands a yaw torque: the nacelle does not yaw (record 102"),
        ("brake", "demands the shaft brake, which the plant does not have (record 36, shaft_brake = 1)"),
        ("override", "record 55"),
        ("contactor", "generator contactor (record 35) to 2"),
        ("many_logs", "301 values for logging (record 65): must be at most 300"),
        ("nan", "nan"),
    ],
)
def test_a_library_that_fails_fails_the_call_with_the_reason(started, mode, part):
    text = failure(started(mode))
    assert part in text and "t = 1.000 s" in text


def test_an_endless_loop_ends_at_the_time_limit_with_its_process(started):
    controller = started("hang", "limit=0.5")
    process = controller.controller._process._process
    began = time.monotonic()
    assert "a call took longer than 0.5 s" in failure(controller)
    assert time.monotonic() - began < 5.0 and process.poll() == -signal.SIGKILL


def test_a_generator_taken_off_has_no_torque(started):
    torques = [torque for torque, _ in answers(started("generator_off"), [123.0] * 12)]
    assert torques[9] > 0.0 and torques[10:] == [0.0, 0.0]


def test_values_for_logging_and_their_names_are_ignored(started):
    speeds = 123.0 + np.linspace(0.0, 5.0, 15)
    assert answers(started("logs"), speeds) == answers(started(), speeds)


def test_the_root_name_of_outputs_is_a_folder_of_the_run(started):
    controller = started("outname")
    folder = controller.controller._process.folder
    controller.finish()
    name, length, size, capacity = controller.console_output.splitlines()[0].split()
    assert Path(name).parent == folder and Path(name).suffix == ".SrvD" and not folder.exists()
    assert int(size) == int(length) + 1 and int(capacity) == 300 * 2 * 21 + 1


def test_readings_that_there_are_not_are_records_of_zero_and_blades_have_theirs(turbine, library):
    controller = make(BladedLibrary(str(library)), turbine, 0.1)
    nothing = RATED._replace(wind_speed=float("nan"), yaw=0.2, nacelle_acceleration=-0.3)
    controller.reset(nothing)
    records = controller.controller._swap.records
    assert records[26] == 0.0 and records[23] == -records[36] == np.float32(-0.2)
    assert records[52] == np.float32(-0.3)
    assert records[3] == records[32] == records[33] == np.float32(0.26)
    blades = np.arange(1.0, len(BladeMeasurement._fields) + 1)
    controller.reset(whole_view([*RATED, *np.full(len(blades), np.nan)]))
    records = controller.controller._swap.records
    assert records[3] == records[33] == np.float32(0.26) and not np.isnan(records).any()
    controller.reset(whole_view([*RATED, *blades]))
    records = controller.controller._swap.records
    names = BladeMeasurement._fields
    assert records[59] == 1.0 + names.index("azimuth")
    assert records[33] == 1.0 + names.index("blade_pitch_3")
    assert list(records[29:32]) == [1.0 + names.index(f"root_out_of_plane_{blade}") for blade in (1, 2, 3)]
    assert list(records[68:71]) == [1.0 + names.index(f"root_in_plane_{blade}") for blade in (1, 2, 3)]
    assert records[74] == 1.0 + names.index("hub_tilt_moment")
    assert records[77] == 1.0 + names.index("yaw_bearing_yaw_moment")


@pytest.mark.slow
def test_the_process_ends_with_the_simulator(library, tmp_path):
    """Also where the library never returns."""
    (tmp_path / "hang.IN").write_text("hang")
    code = (
        "import os, pathlib, threading\n"
        "from fowt_env.controllers.bladed import library, process\n"
        f"p = process.LibraryProcess(pathlib.Path({str(library)!r}), 'DISCON', '.', 60.0)\n"
        f"library.put_text(p.memory, library.INPUT_FILE_AT, 1000, b{str(tmp_path / 'hang.IN')!r})\n"
        "p.call(9.0); p.memory[0:8] = b'\\0\\0\\x80\\x3f\\0\\0\\x80\\x3f'  # status and time 1\n"
        "print(p._process.pid, flush=True); threading.Timer(0.3, os._exit, (0,)).start(); p.call(99.0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    pid = int(done.stdout)
    for _ in range(50):
        if not Path(f"/proc/{pid}").exists():
            return
        time.sleep(0.1)
    os.kill(pid, signal.SIGKILL)
    pytest.fail("the process of the library survives the simulator")


class Ordinary:
    """A controller whose attributes happen to be called finish and console_output."""

    finish, console_output = 600.0, 3

    def reset(self, measurement):
        self.command = measurement.generator_torque, measurement.blade_pitch

    def act(self, measurement):
        return self.command


def test_other_controllers_have_no_output(scene):
    assert "controller_output" not in simulate(scene, Ordinary, duration=1.0).attrs


def test_a_run_has_the_output_of_its_library_and_a_failure_is_that_of_the_run(scene, library, tmp_path):
    (tmp_path / "exit.IN").write_text("exit")
    frame = simulate(scene, f"dll:{library}", duration=5.0)
    assert frame.attrs["controller_output"] == "51 calls, last at 4.9 s"
    assert frame["BldPitch1_[deg]"].iloc[-1] != frame["BldPitch1_[deg]"].iloc[0]
    with pytest.raises(ControllerError, match="bad input, stopping"):
        simulate(scene, f"dll:{library},{tmp_path / 'exit.IN'}", duration=5.0)


@needs_gfortran
def test_a_library_from_fortran_has_the_same_commands_and_its_stop_is_a_failure(started, tmp_path):
    path = built(tmp_path, "discon.f90", "gfortran")
    speeds = 123.0 + np.linspace(0.0, 8.0, 9)
    controller = started("law", path=path)
    assert [pitch for _, pitch in answers(controller, speeds)] == pytest.approx(law(speeds), rel=1e-6)
    assert controller.console_output == "t = 0.000 s: started in mode law"
    text = failure(started("stop", path=path))
    assert "exit code 0" in text and "no more wind" in text
    text = failure(started("abort", path=path))
    assert "by SIGABRT" in text and "about to abort" in text


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("dll:", "must be dll:PATH[,INPUT_FILE][,KEY=VALUE...]"),
        ("dll:none.so", "'none.so': there is no such file"),
        ("dll:.", "is a folder"),
        ("dll:{library},no.IN", "input file 'no.IN'"),
        ("dll:{library},a.IN,b.IN", "must be dll:PATH"),
        ("dll:{library},speed=3", "unknown key"),
        ("dll:{library},limit=fast", "limit = 'fast': must be a positive number of seconds"),
        ("dll:{library},limit=0", "limit = 0.0: must be a positive number of seconds"),
        ("dll:{library},pitch=both", "pitch = 'both': must be one of collective, individual"),
        (
            "dll:{library},symbol=discon",
            "no function 'discon'; it exports 'DISCON': use symbol=DISCON",
        ),
        ("dll:{library},symbol=run", "exports no function 'run'; it exports DISCON"),
        ("dll:{text}", "is no shared library (ELF)"),
        ("dll:{windows}", "is a Windows DLL"),
        ("dll:{small}", "is a 32-bit or big-endian library"),
        ("dll:{other}", "is built for machine 9999"),
        ("dll:{program}", "is no shared library"),
    ],
)
def test_an_unusable_name_or_file_is_refused_before_anything_runs(turbine, library, tmp_path, name, part):
    content = bytearray(library.read_bytes())
    files = {"text": b"no library", "windows": b"MZ" + bytes(100)}
    small, other, program = bytearray(content), bytearray(content), bytearray(content)
    small[4], other[18:20], program[16] = 1, (9999).to_bytes(2, "little"), 2
    files |= {"small": small, "other": other, "program": program}
    for key, value in files.items():
        (tmp_path / key).write_bytes(value)
    with pytest.raises(InputError) as caught:
        make(name.format(library=library, **{key: tmp_path / key for key in files}), turbine, 0.1)
    assert part in str(caught.value)


def test_a_library_that_lacks_another_is_refused_when_it_is_loaded(turbine, library, tmp_path):
    path = tmp_path / "lacking.so"
    built(tmp_path).rename(tmp_path / "libneeded.so")
    words = ["gcc", "-shared", "-fPIC", "-Wl,--no-as-needed", "-o", str(path), f"-L{tmp_path}", "-lneeded"]
    source = tmp_path / "calls.c"
    source.write_text("void DISCON(void) {}\n")
    subprocess.run([*words[:4], str(source), *words[4:]], check=True)
    with pytest.raises(ControllerError, match="cannot be loaded: libneeded.so"):
        make(f"dll:{path}", turbine, 0.1).reset(RATED)
    origin = [*words[:4], str(source), *words[4:], "-Wl,-rpath,$ORIGIN"]
    subprocess.run(origin, check=True)  # beside it, where its copy does not find it
    controller = make(f"dll:{path}", turbine, 0.1)
    controller.reset(RATED)
    assert controller.act(RATED) == (0.0, 0.0)


def test_a_comma_separated_list_keeps_input_file_and_keys_with_their_library():
    names = ["pi", "dll:a.so,b.IN,limit=2", "gspi_oc3", "dll:c.so,pitch=individual", "policy:ppo_lqr"]
    names += ["mine:Law", "dll:d.so"]
    assert controller_names(",".join(names)) == names


def test_the_files_of_a_library_are_those_that_its_name_has(library, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.IN").write_text("law")
    assert named_library(f"dll:{library},a.IN").files == [library, tmp_path / "a.IN"]


@pytest.mark.slow
def test_a_crash_is_a_failed_run_of_an_evaluation_and_the_others_go_on(library, tmp_path):
    for mode in ("crash", "hang"):
        (tmp_path / f"{mode}.IN").write_text(mode)
    names = f"dll:{library},{tmp_path}/crash.IN,dll:{library},{tmp_path}/hang.IN,limit=0.3,pi,dll:{library}"
    case = Case("steady", wind=18.0, sea=None, platform="oc3_hywind")
    table = evaluate(names, [case], duration=4.0, skip=1.0, reference=False).set_index("controller")
    assert list(table["status"]) == ["failed", "failed", "ok", "ok"]
    crashed, hanging = table["reason"].iloc[:2]
    assert "SIGSEGV" in crashed and "took longer than 0.3 s" in hanging


@pytest.mark.slow
def test_results_are_out_of_date_with_another_library_or_input_file(library, tmp_path):
    mine, file = tmp_path / "mine.so", tmp_path / "a.IN"
    mine.write_bytes(library.read_bytes())
    file.write_text("law")
    first = controller_code(f"dll:{mine},{file}")["code"]
    file.write_text("law 2")
    second = controller_code(f"dll:{mine},{file}")["code"]
    mine.write_bytes(library.read_bytes() + b"\0")
    assert len({first, second, controller_code(f"dll:{mine},{file}")["code"]}) == 3


@needs_rosco
def test_rosco_by_its_path_has_the_bits_of_rosco(scene, turbine, tmp_path):
    rosco = make("rosco", turbine, 0.1)
    rosco.prepare(scene)
    for name in ("DISCON.IN", "rotor.txt"):
        shutil.copyfile(Path(rosco.controller._files, name), tmp_path / name)
    deck = tmp_path / "DISCON.IN"  # at level 2, as in public decks, it opens two files of the root name
    deck.write_text(re.sub(r"^\d+(\s+! LoggingLevel)", r"2\1", deck.read_text(), flags=re.M))
    assert re.search(r"^2\s+! LoggingLevel", deck.read_text(), flags=re.M)
    path = find_library()[0]  # it needs libraries beside it
    frames = [simulate(scene, name, duration=30.0) for name in ("rosco", f"dll:{path},{deck}")]
    assert np.array_equal(*(frame.to_numpy() for frame in frames))


DISCON_OC3 = os.environ.get("FOWT_DISCON_OC3", "")


@pytest.mark.slow
@pytest.mark.skipif(not DISCON_OC3, reason="needs FOWT_DISCON_OC3, the path of DISCON_OC3Hywind of OpenFAST")
def test_openfasts_own_controller_of_the_spar_has_the_commands_of_openfast_oc3():
    """On one series of readings; the law here has OpenFAST's delay of one call, and float64."""
    scene = build_scene("oc3_hywind", wind="ntm:18:B", sea="jonswap:7.5:10:3.3", duration=100.0)

    class Both:
        declared = False
        information = named_library(f"dll:{DISCON_OC3}")(scene.turbine, 0.1).information

        def __init__(self, turbine, control_dt):
            self.ours = make("openfast_oc3", turbine, control_dt)
            self.theirs = named_library(f"dll:{DISCON_OC3}")(turbine, control_dt)

        def reset(self, measurement):
            self.ours.reset(measurement)
            self.theirs.reset(measurement)
            self.last = None

        def act(self, measurement):
            ours, theirs = self.ours.act(measurement), self.theirs.act(measurement)
            if self.last is not None:
                assert ours == pytest.approx(self.last, rel=2e-5)
            self.last = theirs
            return ours

        def finish(self):
            self.theirs.finish()

    simulate(scene, Both, duration=100.0)


def test_without_an_accelerometer_of_rotation_a_library_reads_the_slope_of_the_platform_s_pitch_rate(scene):
    """As ROSCO inside the loop: with 0 there its floating feedback does nothing, and nobody sees why."""
    swap = Swap(bytearray(MEMORY_SIZE), scene.turbine, 0.1)
    record = INDEX["nacelle_nodding_acceleration"]
    for status, rate, given, expected in (
        (START, 0.02, np.nan, 0.0), (STEP, 0.03, np.nan, 0.1), (STEP, 0.01, np.nan, -0.2),
        (STEP, 0.05, 0.7, 0.7), (STEP, 0.06, np.nan, 0.1),
    ):  # fmt: skip
        values = dict.fromkeys(Measurement._fields, 0.0)
        values |= {"platform_pitch_rate": rate, "nacelle_pitch_acceleration": given}
        swap.fill(status, Measurement(**values))
        assert swap.records[record] == pytest.approx(expected, rel=1e-5)
