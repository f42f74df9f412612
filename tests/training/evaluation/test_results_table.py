"""Tables of evaluations read back: joined, checked, and refused with what is wrong."""

import numpy as np
import pandas as pd
import pytest

from fowt_env.errors import InputError
from fowt_env.files.tables import write_table
from fowt_env.training.evaluation.evaluate import COLUMNS
from fowt_env.training.evaluation.metrics import METRICS
from fowt_env.training.evaluation.results_table import KEY, WEIGHT, case_shares, read_results


def runs(controllers=("agent", "rival"), cases=("ntm_18",), seeds=(1, 2)):
    """A table as evaluate writes it; every figure differs from every other."""
    rows = []
    for case in cases:
        for seed in seeds:
            for name in controllers:
                row = dict.fromkeys(COLUMNS, 0.0) | {"controller": name, "case": case, "seed": seed}
                row |= {"status": "ok", "reason": "", "events": "", "warning": ""}
                rows.append(row | {metric: len(rows) + 0.125 * i for i, metric in enumerate(METRICS)})
    return pd.DataFrame(rows, columns=list(COLUMNS))


def test_what_evaluate_wrote_comes_back_from_a_folder_and_from_its_file(tmp_path):
    written = runs()
    write_table(written, tmp_path / "results.csv")
    for path in (tmp_path, str(tmp_path / "results.csv"), [tmp_path]):
        table = read_results(path, METRICS)
        assert (table[KEY] == written[KEY]).all(axis=None) and table["seed"].dtype == int
        assert (table[list(METRICS)] == written[list(METRICS)]).all(axis=None)
        assert list(table["reason"]) == [""] * len(written) and "events" not in table


def test_a_figure_without_a_number_is_nan_and_a_column_of_words_is_left_out(tmp_path):
    file = tmp_path / "results.csv"
    file.write_text("controller,case,seed,status,a,b,c\npi,x,1,ok,,inf,word\npi,x,2,ok,2.5,1,word\n")
    table = read_results(tmp_path)
    assert np.isnan(table["a"][0]) and np.isnan(table["b"][0]) and list(table.loc[1, ["a", "b"]]) == [2.5, 1]
    assert "c" not in table
    with pytest.raises(InputError, match="column c must contain numbers"):
        read_results(tmp_path, ["c"])


def test_results_are_joined_and_a_run_with_two_answers_is_refused(tmp_path):
    one, two = (write_table(runs(), tmp_path / f"{name}.csv") for name in ("one", "two"))
    assert len(read_results([one, two])) == len(runs())
    write_table(runs(seeds=(3,)), two)
    assert list(read_results([one, two])["seed"]) == [1, 1, 2, 2, 3, 3]
    for column in ("RotSpeed_std_[rpm]", "overspeed_[%]"):  # any figure, whether it is scored or not
        write_table(runs().assign(**{column: -9.0}), two)
        with pytest.raises(InputError, match="agent on ntm_18, seed 1, occurs twice with"):
            read_results([one, two])


def test_a_figure_that_only_one_of_the_tables_has_is_no_other_answer(tmp_path):
    one = write_table(runs().assign(more=1.0), tmp_path / "one.csv")
    two = write_table(runs(), tmp_path / "two.csv")
    assert len(read_results([one, two])) == len(runs())


def test_cases_are_chosen_by_name_and_parked_turbines_left_out(tmp_path):
    file = write_table(runs(("pi", "parked"), ("ntm_14", "ntm_18")), tmp_path / "runs.csv")
    assert set(read_results(file)["controller"]) == {"pi", "parked"}
    assert set(read_results(file, parked=False)["controller"]) == {"pi"}
    assert set(read_results(file, cases=["ntm_14"])["case"]) == {"ntm_14"}
    with pytest.raises(InputError, match="unknown case of the evaluation 'ntm_19'"):
        read_results(file, cases=["ntm_19"])


def test_the_share_of_a_case_is_its_weight_however_many_runs_of_it_there_are():
    table = pd.concat([runs(cases=("ntm_14",), seeds=range(5)), runs(cases=("ntm_18", "eog"), seeds=(1,))])
    table[WEIGHT] = table["case"].map({"ntm_14": 0.3, "ntm_18": 0.1, "eog": 0.2})
    assert case_shares(table, ["eog", "ntm_14", "ntm_18"]) == pytest.approx([1 / 3, 1 / 2, 1 / 6])
    assert case_shares(table, ["ntm_14", "ntm_18"]) == pytest.approx([3 / 4, 1 / 4])
    for unknown in (table.drop(columns=WEIGHT), *(table.assign(**{WEIGHT: w}) for w in (np.nan, 0.0))):
        assert case_shares(unknown, ["eog", "ntm_14", "ntm_18"]) == pytest.approx([1 / 3] * 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot be read"),
        ("a,b\n1,2\n", "lacks the columns controller, case, seed, status"),
        ("controller,case,seed,status\n", "has no runs"),
        ("controller,case,seed,status\npi,a,first,ok\n", "seed must contain whole numbers"),
        ("controller,case,seed,status\npi,a,1,ok\npi,a,1,ok\n", "a controller, case and seed occur twice"),
    ],
)
def test_a_table_that_is_none_is_refused_with_its_file(tmp_path, text, message):
    (tmp_path / "results.csv").write_text(text)
    with pytest.raises(InputError, match="results.csv.*" + message):
        read_results(tmp_path)


def test_where_there_is_no_table_the_message_says_how_to_make_one(tmp_path):
    with pytest.raises(InputError, match="contains no results.csv: create it with fowt evaluate"):
        read_results(tmp_path)
    with pytest.raises(InputError, match="none' does not exist: create it with fowt evaluate"):
        read_results(tmp_path / "none")
    write_table(runs().drop(columns="overspeed_[%]"), tmp_path / "results.csv")
    with pytest.raises(InputError, match=r"lacks the columns overspeed_\[%\]"):
        read_results(tmp_path, METRICS)
