"""What tests/conftest.py says of the test files is true of them."""

from pathlib import Path

from tests.conftest import KIND_OF, KINDS

ROOT = Path(__file__).resolve().parents[2]


def test_files_that_share_a_kind_of_scene_exist_and_are_named_once():
    named = [file for files in KINDS.values() for file in files]
    assert len(set(named)) == len(named) == len(KIND_OF)
    for file in named:
        assert (ROOT / file).is_file(), f"{file} was moved or renamed: tests/conftest.py names it in KINDS"


def test_a_kind_has_tests_that_prove_an_installation():
    for kind, files in KINDS.items():
        assert any("pytest.mark.installation" in (ROOT / file).read_text() for file in files), kind
