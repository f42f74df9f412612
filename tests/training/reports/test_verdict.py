import html
import re

import pytest

from fowt_env.training.evaluation.leaderboard_file import check_leaderboard
from fowt_env.training.reports.verdict import TESTED, corrected_p, percent_text, verdict

SPEED, PITCH, TRAVEL = TESTED[:3]
POWER = "GenPwr_capped_mean_[kW]"
EVIL = "<script>alert(1)</script>"
MINUS = "\N{MINUS SIGN}"


def board(*entries, baseline="base"):
    """LeaderboardFile of (name, {metric: (percent, p)}, lost) and the baseline."""
    controllers = []
    for name, gaps, failed in [("base", {}, 0), *entries]:
        difference = {metric: {"mean": pc, "percent": pc, "p": p} for metric, (pc, p) in gaps.items()}
        controllers.append(
            {"controller": name, "runs": 8, "failed": failed, "metrics": {}, "difference": difference}
        )
    return check_leaderboard({"baseline": baseline, "controllers": controllers}, "leaderboard.json")


def words(text):
    """The text of HTML."""
    return html.unescape(re.sub("<[^>]+>", "", text)).replace("\N{NO-BREAK SPACE}", " ")


def gaps(p, *percents):
    """{metric: (percent, p)} of the first tested metrics."""
    return {name: (percent, p) for name, percent in zip(TESTED, percents, strict=False)}


def test_gains_and_costs_are_named_where_they_are_significant():
    found = {SPEED: (-45.2, 0.001), TRAVEL: (115.0, 0.002), PITCH: (-3.4, 0.4), POWER: (0.01, 0.9)}
    text = verdict(board(("mypid", found, 0)), 6, 4)
    assert f"mypid: rotor-speed std {MINUS}45 %* for pitch travel +115 %*; not significant: " in words(text)
    assert f"platform-pitch std {MINUS}3.4 %, power up to rated +0.01 %." in words(text)
    assert f'<span class="better">rotor-speed std {MINUS}45' in text
    assert '<span class="worse">pitch travel +115' in text
    assert "paired by case and seed" in text


def test_more_power_is_better_and_less_is_worse():
    text = verdict(board(("a", {POWER: (2.0, 0.001)}, 0), ("b", {POWER: (-2.0, 0.001)}, 0)), 6, 4)
    assert "power up to rated +2.0 %* (better)" in words(text)
    assert f"power up to rated {MINUS}2.0 %* (worse)" in words(text)


def test_a_p_value_counts_after_its_correction_for_the_number_of_metrics():
    """Seven at 0.03 each: none of them is significant at 0.05."""
    many = board(("mypid", gaps(0.03, -9.0, -8.0, -7.0, -6.0, -5.0, -4.0, 3.0), 0))
    assert corrected_p(many.controllers[1])[SPEED] == pytest.approx(7 * 0.03)
    assert "mypid: no significant difference (rotor-speed std" in words(verdict(many, 6, 4))
    assert "*;" not in verdict(many, 6, 4) and "better" not in verdict(many, 6, 4)


@pytest.mark.parametrize(("seeds", "count"), [(1, "A single seed"), (3, "3 seeds")])
def test_with_too_few_seeds_nothing_is_called_better(seeds, count):
    text = verdict(board(("mypid", gaps(None, -45.0, 12.0, 115.0), 0)), seeds, 4)
    assert f"{count}: no difference is tested (that needs 4 seeds)" in words(text)
    gaps_text = f"rotor-speed std {MINUS}45 %, platform-pitch std +12 %, pitch travel +115 % (not tested)"
    assert f"mypid: {gaps_text}" in words(text)
    assert "*" not in text and "better" not in text and "worse" not in text


def test_lost_runs_are_said_of_who_lost_them_and_of_the_baseline():
    text = words(verdict(board(("mypid", gaps(0.001, -45.0), 2)), 6, 4))
    assert "2 failed of 8 runs, which are not in these means" in text
    assert "The baseline itself" not in text
    text = words(verdict(board(("mypid", gaps(0.001, -45.0), 2), baseline="mypid"), 6, 4))
    assert "The baseline itself lost runs (2 failed of 8 runs); these have no differences" in text


def test_names_are_escaped_and_of_many_controllers_the_first_ones_stand_open():
    many = [(f"{EVIL}{i}", gaps(0.001, -45.0), 0) for i in range(7)]
    text = verdict(board(*many), 6, 4)
    assert "<script>" not in text and words(text).count(EVIL) == 7
    assert text.index("<details>") > text.index(html.escape(EVIL) + "4")
    assert "<summary>2 more</summary>" in text


def test_without_something_to_compare_the_verdict_says_why():
    assert "leaderboard.json" in verdict(None, 6, 4)
    assert "a single controller" in verdict(board(), 6, 4)
    lost = verdict(board(("a", {}, 1), baseline=None), 6, 4)
    assert "every controller has runs that failed or lost power" in lost
    assert "a: no difference is available" in words(verdict(board(("a", {}, 0)), 6, 4))


@pytest.mark.parametrize(
    ("percent", "text"),
    [
        (9.94, "+9.9 %"),
        (9.96, "+10 %"),
        (-0.04, f"{MINUS}0.04 %"),
        (0.004, "±0 %"),
        (-960.3, f"{MINUS}960 %"),
    ],
)
def test_percentages_have_two_digits_or_the_whole_number(percent, text):
    assert words(percent_text(percent)) == text
