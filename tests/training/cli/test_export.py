"""fowt connect export writes what it names, and refuses the rest before anything is written."""

import pytest
from bladed_host import Library, needs_compiler, series
from command_line import fowt

from fowt_env.controllers.export.library import hosted
from fowt_env.descriptions.turbine import read_turbine


@needs_compiler
def test_each_output_is_written_and_the_library_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ("connect", "export", "gspi_oc3", "--dll", "libgspi.so", "--c", "plc", "--rosco", "DISCON.IN")
    _, stderr = fowt(*words, "--control-dt", "0.05")
    assert "wrote libgspi.so" in stderr and "the law runs in C" in stderr and "divides 0.05 s" in stderr
    assert "plc/law.h" in stderr and "small-signal values" in stderr and "modes that are off" in stderr
    assert "PC_GS_KP" in (tmp_path / "DISCON.IN").read_text()
    here, there = hosted("gspi_oc3", "oc3_hywind", 0.05), Library(tmp_path / "libgspi.so")
    for swap in series(read_turbine("nrel5mw"), instants=20, interval=0.05):
        assert there.call(swap) == pytest.approx(here.call(swap), rel=1e-6)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("pi",), "fowt connect export: needs --dll"),
        (("pj", "--dll", "libpi.so"), "unknown controller 'pj'"),
        (("pi", "--dll", "libpi.txt"), "must end with .so, .dll or .dylib"),
        (("pi", "--rosco", "mine.txt"), "must end with .IN"),
        (("mpc", "--c", "plc"), "has no law in C"),
        (("mpc_preview", "--dll", "libmpc.so"), "needs 'wind_preview', which the Bladed interface has not"),
        (("lqr", "--rosco", "DISCON.IN"), "only the PI laws"),
        (("pi", "--dll", "libpi.so", "--control-dt", "2"), "control_dt"),
    ],
)
def test_what_cannot_be_exported_is_refused_and_leaves_no_file(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, stderr = fowt("connect", "export", *words, code=2)
    assert message in stderr and list(tmp_path.iterdir()) == []
