"""The parser of part files: values by their keys, whatever the layout, and errors that say where."""

import pytest

from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.parser import PartFile, locate, number_of


def part(folder, text):
    """PartFile of a text."""
    path = folder / "part.dat"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return PartFile(path, "ElastoDyn")


def test_values_stand_before_their_keys_in_any_order_and_layout(tmp_path):
    file = part(
        tmp_path,
        "------ HEADING Mass --- [unused]\n"
        '   1.5D+02, Mass - of the thing (kg)\r\n\t.FALSE.   Flag\n"a, name"  File(1)  - quoted\n'
        "3.0 ! KEY - behind a mark\nDEFAULT Other - (-)\nplain.dat Bare\n",
    )
    assert file.number("mass") == 150.0
    assert file.flag("Flag") is False
    assert file.text("File1") == "a, name"
    assert file.number("key") == 3.0
    assert file.number("Other", default=7.0) == 7.0
    assert file.text("Bare") == "plain.dat"
    assert file.number("NewName", "Mass") == 150.0


def test_fortran_numbers_are_read_and_no_others():
    assert number_of("-1.d-3") == -1e-3
    assert number_of(".5") == 0.5
    assert [number_of(word) for word in ("nan", "inf", "1_000", "1e999", "0x10", "")] == [None] * 6


def test_an_error_names_file_line_key_value_and_what_is_allowed(tmp_path):
    file = part(tmp_path, "heading\n1e3 Mass - kg\nx Flag\n")
    for call, parts in (
        (lambda: file.number("Mass", high=10.0), ("part.dat", "line 2", "Mass = 1e3", "<= 10")),
        (lambda: file.flag("Flag"), ("line 3", "Flag = x", "True or False")),
        (lambda: file.number("Gone"), ("part.dat", "Gone is missing")),
        (lambda: file.one_of("Mass", (1, 2)), ("Mass = 1000", "1 or 2")),
    ):
        with pytest.raises(InputError) as caught:
            call()
        for text in parts:
            assert text in str(caught.value)


def test_a_table_is_read_by_the_names_of_its_columns(tmp_path):
    file = part(
        tmp_path,
        "2 NThings - number\n\nID  Name  Size  [comment]\n(-) (-) (m)\n 1 one 2.0 ! comment\n\n 2 two 3.0\n",
    )
    rows = file.table("NThings", texts=("name",))
    assert [cells for _, cells in rows] == [
        {"id": 1.0, "name": "one", "size": 2.0},
        {"id": 2.0, "name": "two", "size": 3.0},
    ]
    assert [line for line, _ in rows] == [4, 6]
    with pytest.raises(InputError, match="3 rows are declared, 2 found"):
        part(tmp_path, "3 NThings\nID Name Size\n(-) (-) (m)\n1 a 1\n2 b 2\n").table(
            "NThings", texts=("name",)
        )


def test_matrices_and_vectors_go_over_several_lines(tmp_path):
    file = part(
        tmp_path, "1 Load - first\n2\n3\n1 2 3 Rows - of a matrix\n4 5 6\n7 8 9 stray words\n1 2 3 Across\n"
    )
    assert file.vector("Load", 3) == [1.0, 2.0, 3.0]
    assert file.vector("Across", 3) == [1.0, 2.0, 3.0]
    assert file.matrix("Rows", 3) == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]
    assert file.matrix("Missing", 2) == [[0.0, 0.0], [0.0, 0.0]]


def test_files_are_found_with_either_slash_in_either_case_and_by_name_in_further_folders(tmp_path):
    (tmp_path / "Sub").mkdir()
    path = tmp_path / "Sub" / "Blade.dat"
    path.write_text("x")
    assert locate("sub\\blade.DAT", [tmp_path]) == path
    assert locate("../elsewhere/Blade.dat", [tmp_path, tmp_path / "Sub"]) == path
    assert locate("none.dat", [tmp_path]) is None


def test_old_encodings_are_read_and_binary_files_refused(tmp_path):
    assert part(tmp_path, b"2.0 Angle - \xb0\n").number("Angle") == 2.0
    with pytest.raises(InputError, match="not a text file"):
        part(tmp_path, b"2.0 Angle\0")
