"""What a notebook shows of objects: tables in HTML, with names that cannot become code."""

from fowt_env import build_scene, trim
from fowt_env.display import html_table
from fowt_env.envs.tasks import TASKS
from fowt_env.training.evaluation.evaluate import evaluate
from fowt_env.training.evaluation.leaderboard import leaderboard


def test_a_table_escapes_what_it_is_given_and_rounds_numbers():
    text = html_table("<b>t</b>", ("<i>",), [("<script>", 1.23456789), (True, 7)])
    assert "<script>" not in text and "&lt;script&gt;" in text and "&lt;b&gt;t" in text and "<i>" not in text
    assert ">1.235<" in text and ">7<" in text and ">True<" in text


def test_a_scene_shows_its_weather_and_the_options_that_were_chosen():
    scene = build_scene(wind=18.0, fidelity="standard", planar=True)
    text = scene._repr_html_()
    assert "oc3_hywind" in text and "18.0" in text and "still water" in text
    assert ">planar<" in text and ">tower<" not in text  # which is as by default


def test_a_task_shows_every_weather_and_only_weights_that_count():
    text = TASKS["above_rated_mixture"]._repr_html_()
    assert text.count(">weather ") == len(TASKS["above_rated_mixture"].weathers)
    assert "72 pitch_travel" in text and "standstill" not in text


def test_a_leaderboard_shows_differences_of_all_but_the_baseline():
    table = evaluate("pi,constant", cases="steady_16", duration=20.0, skip=5.0)
    text = leaderboard(table, baseline="pi")._repr_html_()
    rows = text.split("<tr>")[2:]
    assert len(rows) == 2 and "differences from pi" in text
    assert [("%)" in row, ">pi<" in row) for row in rows] in (
        [(True, False), (False, True)],
        [(False, True), (True, False)],
    )


def test_an_operating_point_shows_values_with_units_and_meanings():
    point = trim(build_scene(wind=18.0, fidelity="standard"))
    text = point._repr_html_()
    assert "Operating point at 18 m/s, platform floating" in text
    row = next(row for row in text.split("<tr>") if ">RotSpeed<" in row)
    assert any(">FAIRTEN1<" in row and ">kN<" in row for row in text.split("<tr>"))
    assert ">12.1<" in row and ">rpm<" in row and ">rotor speed<" in row
