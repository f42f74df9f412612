"""The pages of the controllers against the controllers that there are."""

import re
import tomllib
from pathlib import Path

import pytest

from fowt_env import build_scene, simulate
from fowt_env.controllers import CONTROLLERS, make
from fowt_env.controllers.tuned import TUNED

DOCS = Path(__file__).resolve().parents[2] / "docs"
TEXT = (DOCS / "reference" / "controllers.md").read_text(encoding="utf-8")
RESULTS = (DOCS / "results" / "controllers.md").read_text(encoding="utf-8")


def rows(text, heading):
    """{first cell: cells} of the table below a heading."""
    part = text.split(f"\n## {heading}")[1].split("\n## ")[0]
    lines = [line.strip("| ").split(" | ") for line in part.splitlines() if line.startswith("|")]
    return {cells[0].strip("`"): cells for cells in lines[2:]}


def test_every_controller_is_documented_and_no_other():
    assert set(rows(TEXT, "The built-in ones")) == set(CONTROLLERS)


def test_the_documented_tuning_is_the_stored_one():
    held = tomllib.loads(TUNED.read_text(encoding="utf-8"))
    printed = rows(RESULTS, "Tuning")
    assert set(printed) == set(held)
    keys = ("rotor_speed_ratio", "platform_pitch_ratio", "travel_ratio", "shaft_ratio", "cost")
    for name, cells in printed.items():
        figures = [held[name]["figures"][key] for key in keys]
        assert [float(cell) for cell in cells[2:]] == pytest.approx(figures, abs=6e-4), name


def test_the_example_of_ones_own_controller_runs():
    code = re.search(r"```python\n(.*?)```", TEXT, re.DOTALL).group(1)
    names = {}
    exec(code, names)
    scene = build_scene("oc3_hywind", wind=18.0, duration=100.0, fidelity="standard")
    frame = simulate(scene, make(names["Mine"], scene.turbine, 0.1), duration=30.0)
    assert frame["RotSpeed_[rpm]"].iloc[-1] == pytest.approx(12.1, abs=0.3)
