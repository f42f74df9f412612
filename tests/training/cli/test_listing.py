"""fowt list: tables of names, each with what it means, and none left out."""

import json

import pytest
from command_line import fowt
from typer.testing import CliRunner

from fowt_env.descriptions import sea_state, wind
from fowt_env.envs import tasks
from fowt_env.plant.channels import BLADE_CHANNELS, FIXED_CHANNELS, TOWER_CHANNELS
from fowt_env.scene import options
from fowt_env.training.cli import listing
from fowt_env.training.cli.app import app
from fowt_env.training.evaluation.cases import read_suite
from fowt_env.training.evaluation.metrics import METRICS, TABLE


def rows(*words):
    return json.loads(fowt("list", *words, "--json")[0])


def test_what_is_described_here_is_what_there_is():
    assert {row["kind"] for row in rows("winds")} - {"uniform"} == set(wind.ALL_KINDS)
    assert all(option.summary for option in options.OPTIONS.values())
    assert all(task.summary for task in tasks.TASKS.values())
    assert len(rows("metrics")) == len(METRICS) and all(metric.meaning for metric in TABLE.values())


def test_every_channel_has_a_meaning():
    found = {row["name"]: row for row in rows("channels")}
    for channel in (*FIXED_CHANNELS, *TOWER_CHANNELS, *BLADE_CHANNELS):
        assert found[channel.name]["unit"] == channel.unit and len(found[channel.name]["meaning"]) > 6
    assert found["RootMyc2"]["meaning"].startswith("blade-root moment out of the rotor plane, blade 2")


def test_a_sea_has_its_height_period_wind_and_source():
    found = {row["name"]: row for row in rows("seas")}
    assert set(found) == set(sea_state.sea_states())
    row = found["paper_wind_wave"]
    assert (row["kind"], row["Hs or H m"], row["Tp or T s"], row["wind m/s"]) == (
        "jonswap",
        "7.5",
        "10",
        "18",
    )
    assert "the paper" in row["source"] and found["paper_regular"]["Tp or T s"] == "5"


def test_a_case_has_its_wind_sea_and_duration_and_a_text_chooses_rows():
    found = rows("cases", "grid_loss")
    assert found and all("grid_loss" in row["name"] or "grid loss" in row["wind"] for row in found)
    row = next(row for row in rows("cases", "above_rated") if row["name"] == "ntm_18")
    assert row["wind"] == "ntm 18 m/s, class B, sigma drawn" and row["sea"] == "JONSWAP Hs 1.86 m, Tp 7.94 s"
    assert row["s"] == f"{read_suite('above_rated').duration:g}"


def test_controllers_that_nobody_should_choose_stand_last():
    names = [row["name"] for row in rows("controllers")]
    assert names.index("rosco_ipc") < names.index("preview") < names.index("eq8_literal")
    assert set(names[-4:]) == {"constant", "eq8_literal", "gspi_land", "pi_land"}


@pytest.mark.parametrize("kind", [*listing.KINDS, ""])
def test_a_table_fits_80_columns_and_loses_nothing(kind):
    words = ["list", kind] if kind else ["list"]
    result = CliRunner().invoke(app, words, env={"COLUMNS": "80", "NO_COLOR": "1"})
    assert result.exit_code == 0 and "…" not in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 80
    whole = "".join(result.stdout.split())
    for row in rows(*words[1:]):
        first = next(iter(row.values()))
        assert "".join(first.split()) in whole


def test_a_misspelt_kind_is_suggested_and_a_text_that_is_nowhere_is_said():
    assert "Did you mean 'seas'" in fowt("list", "seastates", code=2)[1]
    assert "no seas with 'atlantis'" in fowt("list", "seas", "atlantis", code=2)[1]
