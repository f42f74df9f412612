"""The laws in C against the compiled laws of the package, and their code against compilers and sanitizers."""

import ctypes
import json
import re
import shutil
import subprocess
from functools import cache

import numpy as np
import pytest
from bladed_host import Library, changed, needs_compiler, series

from fowt_env.control import make
from fowt_env.controllers.bladed.records import INDEX
from fowt_env.controllers.export.hosted import Hosted, fields_of
from fowt_env.controllers.export.library import SHARED, compile_c, export_sources, prepared
from fowt_env.controllers.export.native import native_law
from fowt_env.controllers.pi import PI, PISettings
from fowt_env.controllers.policy.controller import AGENTS
from fowt_env.descriptions.turbine import read_turbine

pytestmark = needs_compiler
TURBINE = read_turbine("nrel5mw")
POLICY = "policy:ppo_lqr"
LAWS = (
    "pi", "pi_land_power", "pi_unscheduled", "gspi_oc3", "floating_feedback", "ipc", "ipc_constrained",
    "ipc_floating", "lqr", "mpc_clone", POLICY,
)  # fmt: skip
MODES = ("direct", "setpoint", "residual")  # of policies
SCALE = np.array([TURBINE.torque_law.rated_torque, 1.0, 1.0, 1.0])  # of torque and pitch, N m and rad
DT = 0.1
STRICT = ("-pedantic", "-Wconversion", "-Werror")


@cache
def built(name, folder):
    """Return (library, paths of the sources) of a law, compiled without a warning."""
    stem = re.sub(r"\W", "_", name.removesuffix(".npz"))[-20:]
    sources = export_sources(name, folder / stem, control_dt=DT)
    path = folder / f"lib{stem}.so"
    assert compile_c(sources[1:], path, (*SHARED, *STRICT)) == ""
    compile_c(sources[1:], folder / "plc.o", ("-c", "-DFOWT_WITHOUT_DISCON", *STRICT))
    return path, sources


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("laws")


class Reading(Hosted):
    """Keeps the readings of the last control instant."""

    def _reading(self, swap, first):
        self.last = super()._reading(swap, first)
        return self.last


@pytest.fixture(scope="module")
def other_policies(folder):
    """Names of policies in the other action modes, without estimator, washout and authority."""
    with np.load(AGENTS / "ppo_lqr.npz") as shipped:
        arrays = dict(shipped)
    settings = json.loads(str(arrays["settings"]))
    channels = ["rotor_speed", "blade_pitch", "generator_torque", "previous_action"]
    settings |= {"observation": channels, "baseline": "gspi_oc3", "squash": "tanh", "activation": "relu"}
    arrays["weight_0"] = arrays["weight_0"][:, :10]
    arrays |= {"mean": arrays["mean"][:10], "scale": arrays["scale"][:10] + 0.1}
    for mode in MODES:
        decisions = {"hold": 2, "smoothing": 0.3, "history": 1}
        arrays["settings"] = np.array(json.dumps(settings | {"action_mode": mode, "decisions": decisions}))
        np.savez(folder / f"{mode}.npz", **arrays)
    channels[2] = "wind_preview"
    settings |= {"wind_preview": [2.0], "action_mode": "residual", "decisions": decisions}
    np.savez(folder / "looking ahead.npz", **arrays | {"settings": np.array(json.dumps(settings))})
    return {mode: f"policy:{folder / mode}.npz" for mode in (*MODES, "looking ahead")}


@pytest.mark.parametrize("mode", MODES)
def test_a_policy_of_another_mode_commands_in_c_what_it_does_here(mode, other_policies, folder):
    check_law(other_policies[mode], folder)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.nightly) if name in ("mpc_clone", "ipc_floating") else name
        for name in LAWS
    ],
)
def test_a_law_in_c_commands_what_the_compiled_law_commands(name, folder):
    check_law(name, folder)


def check_law(name, folder):
    """Compare the commands of a law in C, by records and by its functions, with those of the package."""
    controller, turbine = prepared(name, "oc3_hywind", DT)
    if name.startswith("policy"):  # layers in double precision, as in C
        network = controller.controller.network
        network.weights = [weight.astype(np.float64) for weight in network.weights]
    here, there = Reading(controller, turbine, DT), Library(built(name, folder)[0])
    law, command = ctypes.create_string_buffer(100_000), (ctypes.c_double * 4)()
    travelled = []
    again = series(turbine, controller.individual, instants=40, seed=1)
    slow = series(turbine, controller.individual, instants=10, seed=2)
    slow[0][INDEX["generator_speed"]] *= 0.5
    for blade in (1, 2, 3):  # further runs, from the lower limit of the pitch and from a start-up
        again[0][INDEX[f"blade_pitch_{blade}"]] = 0.0
        slow[0][INDEX[f"blade_pitch_{blade}"]] = 0.25
    for swap in series(turbine, controller.individual) + again + slow:
        ours, theirs = np.array(here.call(swap)), np.array(there.call(swap))
        np.testing.assert_allclose(theirs / SCALE, ours / SCALE, rtol=1.2e-7, atol=1e-9)  # records: float32
        reading = (ctypes.c_double * len(here.last))(*here.last.values())
        assert tuple(here.last) == fields_of(controller)
        if swap[0] == 0.0:
            assert there.library.law_start(law, reading) == 0
        assert there.library.law_step(law, reading, command) == 0
        np.testing.assert_allclose(np.array(command) / SCALE, ours / SCALE, rtol=0.0, atol=1e-9)
        travelled.append(ours)
    assert np.ptp(travelled, axis=0).min() > 0.01  # neither command is at a limit throughout


def test_a_law_of_the_user_is_not_mistaken_for_the_one_that_it_changes():
    class Stepwise(PI):
        def reset(self, measurement):
            super().reset(measurement)
            self.memory[:] = 0.0

    settings = PISettings.published(TURBINE)
    assert native_law(PI(settings, DT)) and not native_law(Stepwise(settings, DT))
    assert not native_law(make("constant", TURBINE, DT)) and not native_law(make("mpc", TURBINE, DT))


def test_a_policy_that_looks_ahead_is_not_offered_in_c(other_policies):
    assert native_law(make(other_policies["residual"], TURBINE, DT))
    assert not native_law(make(other_policies["looking ahead"], TURBINE, DT))


def test_a_policy_s_single_precision_in_python_is_within_a_millionth(folder):
    controller, turbine = prepared(POLICY, "oc3_hywind", DT)
    path = shutil.copy(built(POLICY, folder)[0], folder / "again.so")
    here, there = Hosted(controller, turbine, DT), Library(path)
    arrays = series(turbine, seed=1)
    ours, theirs = (np.array([one.call(swap) for swap in arrays]) for one in (here, there))
    np.testing.assert_allclose(theirs / SCALE, ours / SCALE, rtol=0.0, atol=1e-6)


def test_the_code_allocates_nothing_and_calls_only_mathematics(folder):
    if shutil.which("nm") is None:
        pytest.skip("nm is not installed")
    listed = subprocess.check_output(["nm", "-D", "-u", built("ipc", folder)[0]], text=True)
    called = {line.split()[-1].partition("@")[0] for line in listed.splitlines()}
    called = {name for name in called if not name.startswith("_")}
    mathematics = {"cos", "floor", "hypot", "sin", "sincos", "tan"}
    assert called <= {*mathematics, "memcpy", "memset", "strlen", "strncat"}


HARNESS = r"""
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "law.h"

void DISCON(float *swap, int *fail, const char *infile, const char *outname, char *message);

/* Arrays of a host with hostile values, each on the heap with the size that the host gives. */
int main(void)
{
    static const float odd[] = {
        0.0f, -0.0f, 1.0f, -1.0f, 3.4e38f, -3.4e38f, 1e-45f, NAN, INFINITY, -INFINITY, 1e9f, 0.1f
    };
    unsigned state = 1;
    double checksum = 0.0;
    long call, failures = 0;
    float *good = malloc(3300 * sizeof(float)), *swap = malloc(3300 * sizeof(float));
    char message[60];
    law_type law;
    double reading[LAW_READINGS], command[4];

    if (fread(good, sizeof(float), 3300, stdin) != 3300)
        return 2;
    memset(&law, 0, sizeof law);
    for (call = 0; call < 60000; call++) {
        int i, hits, fail = 0;
        memcpy(swap, good, 3300 * sizeof(float));
        swap[0] = call % 50 == 0 ? 0.0f : 1.0f;
        swap[1] = 0.1f * (float)(call % 50);
        for (i = 3; i < 131; i++) {
            state = state * 1664525u + 1013904223u;
            swap[i] *= 0.5f + (float)(state >> 8) / 16777216.0f;
        }
        swap[48] = (float)sizeof message;
        swap[60] = 3.0f;
        swap[9] = 0.0f;
        swap[27] = good[27];
        swap[128] = 3300.0f;
        state = state * 1664525u + 1013904223u;
        hits = call % 3 == 0 ? (int)(state >> 28) : 0;
        for (i = 0; i < hits; i++) {
            int at, what;
            state = state * 1664525u + 1013904223u;
            at = (int)(state >> 8) % 131;
            state = state * 1664525u + 1013904223u;
            what = (int)(state >> 8) % 12;
            if (at != 48) /* the size of the host's own buffer */
                swap[at] = odd[what];
        }
        memset(message, 'x', sizeof message);
        DISCON(swap, &fail, "", "", message);
        failures += fail != 0;
        if (swap[0] == -1.0f) /* the last call, which commands nothing */
            continue;
        if (fail == 0 && !(swap[46] >= 0.0f && swap[46] <= 47403.0f))
            return 3;
        if (fail == 0 && !(swap[44] >= 0.0f && swap[44] <= 1.5708f))
            return 3;
        checksum += fail == 0 ? swap[46] + swap[44] : 1.0;
        for (i = 0; i < LAW_READINGS; i++) {
            state = state * 1664525u + 1013904223u;
            reading[i] = call % 7 == 0 ? odd[(state >> 8) % 12] : (double)(state >> 8) / 1e7;
        }
        if (call % 40 == 0)
            law_start(&law, reading);
        if (law_step(&law, reading, command) == 0)
            for (i = 0; i < 4; i++)
                if (!isfinite(command[i]))
                    return 4;
    }
    free(good);
    free(swap);
    printf("%ld %.17g\n", failures, checksum);
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ("gspi_oc3", "floating_feedback", "ipc", POLICY))
def test_hostile_records_neither_crash_a_law_nor_reach_its_commands(name, folder):
    """Under the address and undefined-behaviour sanitizers; the same twice, so deterministic."""
    _, sources = built(name, folder)
    harness = folder / "harness.c"
    harness.write_text(HARNESS)
    program = folder / f"fuzz_{name.replace(':', '_')}"
    options = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", f"-I{sources[0].parent}")
    compile_c([harness, sources[1]], program, options)
    array = series(TURBINE, name == "ipc", instants=1)[0].tobytes()
    first, second = (
        subprocess.run([program], input=array, capture_output=True, check=False) for _ in range(2)
    )
    assert first.returncode == 0, first.stderr.decode()[-2000:]
    assert first.stdout == second.stdout
    failures = int(first.stdout.split()[0])
    assert 3000 < failures < 50_000  # hostile arrays are refused, others are answered


def test_a_law_that_overflows_says_so_until_it_is_started_again(folder):
    law, command = ctypes.create_string_buffer(100_000), (ctypes.c_double * 4)()
    functions = ctypes.CDLL(str(built("lqr", folder)[0]))
    good = (ctypes.c_double * 6)(122.9, 0.2, 43e3, 0.05, 0.0, 0.1)
    for bad, code in ((np.nan, 1), (-np.inf, 1), (1e308, 2)):
        assert functions.law_start(law, good) == 0 and functions.law_step(law, good, command) == 0
        expected = list(command)
        assert functions.law_step(law, (ctypes.c_double * 6)(*good[:4], bad, bad), command) == code
        assert list(command) == expected  # nothing is commanded
        assert functions.law_step(law, good, command) == (0 if code == 1 else 2)
    assert functions.law_start(law, (ctypes.c_double * 6)(*good[:5], np.nan)) == 1


# ------------------------------------------------------------------ the interface


@pytest.fixture
def library(folder, tmp_path):
    """Return a function that loads a fresh copy of a law."""
    loaded = []

    def load(name):
        path = shutil.copy(built(name, folder)[0], tmp_path / f"{len(loaded)}.so")
        loaded.append(Library(path))
        return loaded[-1]

    yield load
    for one in loaded:
        one.close()


def refusals(name):
    """Yield (number of good calls before, changes of the next array, words of the message)."""
    yield 0, {"status": 1}, "the first call must have 0"
    yield 0, {"communication_interval": 0.03}, "does not divide the control period"
    yield 0, {"communication_interval": 0.2}, "does not divide the control period"
    yield 0, {"communication_interval": 0.0}, "does not divide the control period"
    yield 0, {"pitch_actuator": 1.0}, "pitch rates"
    yield 0, {"blades": 2}, "number of blades"
    yield 3, {"generator_speed": np.nan}, "not a finite number"
    yield 3, {"time": 0.05}, "goes back"
    yield 3, {"status": -8}, "storing and restoring"
    if name == "lqr":
        yield 0, {"extended_version": 0.0}, "platform_pitch, record 1005, is not sent"
        yield 0, {"size": 131}, "platform_pitch, record 1005, is not sent"
    if name == "ipc":
        yield 0, {"pitch_control": 0}, "set Ptch_Cntrl to 1"


@pytest.mark.parametrize("name", ("gspi_oc3", "ipc", "lqr"))
def test_a_host_that_cannot_run_a_law_is_refused_by_name_and_the_law_can_start_again(name, library):
    arrays, law = series(TURBINE, name == "ipc", instants=5), library(name)
    expected = [law.call(swap) for swap in arrays]
    for before, changes, words in refusals(name):
        fresh = library(name)
        for swap in arrays[:before]:
            fresh.call(swap)
        with pytest.raises(RuntimeError, match=words):
            fresh.call(changed(arrays[before], **changes))
        with pytest.raises(RuntimeError, match="the first call must have 0"):
            fresh.call(arrays[4])
        assert [fresh.call(swap) for swap in arrays] == expected


def test_a_message_fits_the_buffer_of_the_host(library):
    law = library("gspi_oc3")
    ctypes.memset(law.message, ord("x"), 400)
    with pytest.raises(RuntimeError):
        law.call(changed(series(TURBINE, instants=1)[0], status=1, message_size=12))
    assert law.message.raw[:13] == b"Controller \0x"
    with pytest.raises(RuntimeError):
        law.call(changed(series(TURBINE, instants=1)[0], status=1, message_size=np.nan))


def test_commands_are_held_between_control_instants_and_at_repeated_calls(library):
    law, arrays = library("gspi_oc3"), series(TURBINE, instants=41, interval=0.025)
    commands = [law.call(swap) for swap in arrays]
    every = [commands[k] for k in range(0, 41, 4)]
    assert commands == [every[k // 4] for k in range(41)] and len(set(every)) == len(every)
    assert law.call(arrays[-1]) == commands[-1]  # a host that repeats a step
    slow = library("gspi_oc3")
    assert [slow.call(changed(swap, communication_interval=0.1)) for swap in arrays[::4]] == every


def test_the_last_call_changes_nothing_and_every_demand_of_a_host_is_set(library):
    law, array = library("gspi_oc3"), series(TURBINE, instants=1)[0]
    dirty = array.copy()
    dirty[34:82] = np.where(dirty[34:82] == 0.0, 5.0, dirty[34:82])
    law.call(dirty)
    assert law.swap[INDEX["generator_contactor"]] == 1.0
    assert law.swap[INDEX["collective_pitch_demand"]] == law.swap[INDEX["pitch_demand_1"]]
    for name in ("shaft_brake", "yaw_rate_demand", "pitch_override", "torque_override", "logs"):
        assert law.swap[INDEX[name]] == 0.0
    end = changed(array, status=-1)
    law.call(end)
    np.testing.assert_array_equal(law.swap, end)


def test_a_torque_that_the_host_has_not_measured_starts_on_the_curve(library):
    array = changed(series(TURBINE, instants=1)[0], generator_torque=0.0, generator_speed=100.0)
    for blade in (1, 2, 3):
        array[INDEX[f"blade_pitch_{blade}"]] = 0.0
    torque = library("gspi_oc3").call(array)[0]
    assert torque == pytest.approx(2.332287 * 100.0**2, rel=1e-5)  # region 2 of the NREL 5 MW turbine
