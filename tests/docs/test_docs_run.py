"""The programs and commands of getting-started.md and extending.md do what the pages say."""

import contextlib
import io
import re
import shlex
import shutil
import subprocess
import sys
import tomllib

import pandas as pd
import pytest
from bladed_host import needs_compiler
from doc_pages import DOCS, NUMBER, assert_printed, blocks, fowt

EXTRAS = tomllib.loads((DOCS.parent / "pyproject.toml").read_text())["project"]["optional-dependencies"]
RUN = ("python", "bash", "text")
SETUP = re.compile(r"(python3 -m venv|\. \.venv|pip install)\b")


def run_blocks(page_blocks, folder):
    """Run blocks in order in a folder; text is what the block before it must have printed.

    Files are saved, programs share one namespace.
    """
    names, printed = {"__name__": "__main__"}, ""
    for block in page_blocks:
        if block.file:
            (folder / block.file).write_text(block.text)
        elif block.language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(block.text, f"<{block.heading}>", "exec"), names)
            printed = out.getvalue()
        elif block.language == "bash":
            printed = "".join(fowt(line) for line in commands(block, folder))
        elif block.language == "text":
            assert_printed(printed, block.text)
        else:
            raise AssertionError(f"a block of {block.language!r} that nobody runs")
    return names


def commands(block, folder):
    """Commands of fowt in a block; those of a compiler are run on the way, those of installing left out."""
    for line in block.text.splitlines():
        if line.startswith("gcc "):
            subprocess.run(shlex.split(line), cwd=folder, check=True)
        elif not SETUP.match(line):
            yield line


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Working folder of the programs, forgotten with what they imported from it."""
    monkeypatch.chdir(tmp_path)
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        if getattr(sys.modules[name], "__file__", None) and str(tmp_path) in sys.modules[name].__file__:
            del sys.modules[name]


def test_every_block_of_getting_started_runs(folder):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed: the extra `plot` is missing")
    run_blocks(blocks("tutorials/getting-started.md"), folder)
    assert (folder / "run.csv").stat().st_size > 1e5 and (folder / "run.png").stat().st_size > 1e4
    assert (folder / "results" / "first" / "leaderboard.json").exists()


@pytest.mark.nightly
def test_every_block_of_extending_runs(folder):
    run_blocks(blocks("guides/extending.md"), folder)
    table = pd.read_csv(folder / "results" / "damper" / "results.csv").set_index("controller")
    assert (table["status"] == "ok").all()
    swing = table["PtfmPitch_std_[deg]"]
    assert swing["damper:Damper"] < 0.95 * swing["pi"]  # it damps


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc, which builds the library of the page")
def test_every_block_of_your_dll_runs(folder):
    run_blocks([block for block in blocks("guides/your-dll.md") if block.language], folder)
    table = pd.read_csv(folder / "results" / "dll" / "results.csv").set_index("controller")
    assert (table["status"] == "ok").all()
    power = table["GenPwr_mean_[kW]"]
    assert power["dll:libmine.so"] == pytest.approx(power["pi"], rel=0.02)


def test_the_statistics_that_the_readme_shows_are_those_of_its_program():
    program, shown = [block for block in blocks("../README.md") if block.heading == "Ten lines"][:2]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(program.text, "<README.md>", "exec"), {})
    printed = out.getvalue()
    again = f"README.md must show\n{printed}"
    assert NUMBER.sub("#", printed).split() == NUMBER.sub("#", shown.text).split(), again
    for a, b in zip(NUMBER.findall(printed), NUMBER.findall(shown.text), strict=True):
        # another machine's last bits may turn over the last digit that is shown
        assert abs(float(a) - float(b)) < 1.5 * 10.0 ** -len(b.partition(".")[2]), again


@pytest.mark.nightly
@needs_compiler
def test_every_block_of_export_runs_in_this_package_as_host(folder):
    run_blocks([block for block in blocks("guides/export.md") if block.language in RUN], folder)
    for name in ("plc/law.h", "plc/law.c", "DISCON.IN", "float_DISCON.IN"):
        assert (folder / name).stat().st_size > 1000


WHOLE = ("index.md", "reference/environment.md")
PROGRAMS = (
    "guides/faults.md", "guides/from-control-design.md", "guides/from-gymnasium.md",
    "guides/hardware-in-the-loop.md", "tutorials/first-agent.md",
)  # fmt: skip


@pytest.mark.parametrize("page", WHOLE + PROGRAMS)
def test_every_program_of_a_page_runs(folder, page):
    """And the commands of some; those of others train agents and evaluate, which others test."""
    if page == "guides/from-control-design.md":
        pytest.importorskip("control", reason="the extra `design` is missing")
    chosen = [block for block in blocks(page) if page in WHOLE or block.language in ("python", "text")]
    assert chosen
    run_blocks(chosen, folder)


@pytest.mark.parametrize("page", ["tutorials/getting-started.md", "guides/faq.md", "index.md"])
def test_extras_that_a_page_installs_exist(page):
    named = re.findall(r"pip install [^\n`]*?\[([\w,]+)\]", (DOCS / page).read_text())
    assert {extra for group in named for extra in group.split(",")} <= set(EXTRAS)
