"""Every stored reference file has a maker, is what was made, and names what it was made from."""

import gzip

import pytest
from reference_sources import ROOT, hashes, maker_of, sha256, stored_files

NAMES = stored_files()
SERIES = [name for name in NAMES if name.endswith(".csv.gz")]


def head(name):
    """Lines of the comment at the top of a series."""
    with gzip.open(ROOT / name, "rt") as file:
        return [line[2:].rstrip("\n") for line in file if line.startswith("#")]


@pytest.mark.installation
def test_every_stored_file_is_listed_and_unchanged():
    """What is made anew on purpose is listed by `python tests/reference_sources.py`."""
    assert {name: sha256(name) for name in NAMES} == hashes()


def test_every_stored_file_has_one_maker_in_the_repository():
    for name in NAMES:
        _, maker, source = maker_of(name)
        assert source, name
        assert not maker or (ROOT / maker).is_file(), name
        assert maker or name.startswith("tests/reference/stability/"), name


def test_every_series_says_which_openfast_or_model_it_is_from_and_names_its_inputs_by_their_sha256():
    assert len(SERIES) > 40
    for name in SERIES:
        lines = head(name)
        assert any("OpenFAST" in line or "TurbSim" in line or "JONSWAP" in line for line in lines), name
        inputs = [line.split() for line in lines if line.startswith("sha256 ")]
        assert inputs and all(len(digest) == 64 and int(digest, 16) for _, digest, _ in inputs), name


def test_inputs_that_are_in_the_repository_are_the_ones_that_a_series_was_made_from():
    """Waves, and the excitation of the package that stands for the .3 which the OC4 deck lacks."""
    own = {
        "waves_hs7.5_tp10.csv.gz": "training/validation/reference/waves_hs7.5_tp10.csv.gz",
        "nrel5mw_oc4_semi.npz": "fowt_env/data/platforms/nrel5mw_oc4_semi.npz",
    }
    seen = set()
    for name in SERIES:
        for line in head(name):
            if line.startswith("sha256 ") and (source := own.get(line.split()[2])):
                assert line.split()[1] == sha256(source), f"{name}: made from another {source}"
                seen.add(source)
    assert seen == set(own.values())
