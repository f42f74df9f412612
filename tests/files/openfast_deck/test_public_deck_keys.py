"""Every key of the public decks, changed one at a time: files or report change, or the import is refused."""

import shutil
from pathlib import Path

import pytest
from small_deck import set_key

from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.conversion import platform_rows, stations, turbine_rows
from fowt_env.files.openfast_deck.deck import read_deck
from fowt_env.files.openfast_deck.keys import KEYS, UNKNOWN, known
from fowt_env.files.openfast_deck.parser import PartFile, bare, number_of, same_key, truth_of
from fowt_env.files.openfast_deck.report import make_report, markdown

DECKS = Path(__file__).parents[2] / "reference" / "decks"


def public_decks(root=DECKS):
    """{name: arguments of read_deck} of the public decks, in a folder."""
    iea = root / "IEA-15-240-RWT" / "OpenFAST" / "IEA-15-240-RWT-UMaineSemi"
    rosco, fast = root / "ROSCO" / "Examples" / "Test_Cases", root / "FAST" / "CertTest" / "5MW_Baseline"
    discon = rosco / iea.name.replace("-UMaineSemi", "") / iea.name / f"{iea.name}_DISCON.IN"
    found = {"iea": {"fst": iea / f"{iea.name}.fst", "discon": discon}}
    for floater, mooring in (("OC4DeepCwindSemi", "MAP"), ("ITIBarge4", "MoorDyn")):
        kinds = {"elastodyn": "ElastoDyn", "hydrodyn": "HydroDyn", "servodyn": "ServoDyn", "mooring": mooring}
        parts = {part: fast / f"NRELOffshrBsline5MW_{floater}_{kind}.dat" for part, kind in kinds.items()}
        parts["aerodyn"] = rosco / "NREL-5MW" / "NRELOffshrBsline5MW_Onshore_AeroDyn15.dat"
        found[floater] = {"parts": parts, "folders": (rosco / "NREL-5MW",)}
    return found


def outcome(arguments):
    """All that an import of a deck says and writes, but for WAMIT's coefficients; or the refusal."""
    try:
        deck = read_deck(**arguments)
        rows = platform_rows(deck, "x", "x", "x", "x"), turbine_rows(deck, "x"), stations(deck)
        rows = *rows, {name: polar.tolist() for name, polar in deck.aerodyn.polars.items()}
        return str(rows) + markdown(make_report(deck, "x"))
    except InputError as error:
        return str(error)


def test_no_key_of_a_public_deck_is_unknown():
    for arguments in public_decks().values():
        assert UNKNOWN not in outcome(arguments)


def others(values):
    """Other values for a key."""
    text = bare(values[0])
    if truth_of(text) is not None:
        return [str(not truth_of(text))]
    value = number_of(text)
    if value is None:
        return ['"nowhere"', "False", "3"]
    return [
        f"{number:.12g}"
        for number in (value * 1.03 + 0.001, value + 1, 0, 1, 2, 3, 50, 1e-3)
        if number != value
    ]


_CURRENT = "CurrSSV0 CurrSSDir CurrNSRef CurrNSV0 CurrNSDir CurrDIV CurrDIDir"
WITHOUT_EFFECT = {  # what is read and changes nothing in these decks: why, and the keys of each kind of file
    "a rotor of three blades": {"ElastoDyn": "TeetDOF UndSling"},
    "no current (CurrMod 0)": {"HydroDyn": _CURRENT, "SeaState": _CURRENT},
    "no members that waves must reach": {"SeaState": "X_HalfWidth Y_HalfWidth Z_Depth"},
    "steady wind (WindType 1)": {"InflowWind": "Filename_Uni RefHt_Uni"},
    "a part file in place of that of the .fst": {"OpenFAST": "AeroFile"},
    "torque of a library (VSContrl 5)": {"ServoDyn": "VS_RtGnSp VS_RtTq VS_Rgn2K VS_SlPc"},
    "a DISCON.IN in place of the deck's, or none": {
        "ServoDyn": "DLL_InFile PitManRat1 PitManRat2 PitManRat3"
    },
    "polars of one table": {"polar": "Re"},
}


@pytest.mark.nightly
def test_every_key_of_the_public_decks_changes_the_files_or_the_report_or_is_refused(tmp_path, monkeypatch):
    """All but those that are listed as without effect, each in at least one of the decks that have it."""
    moved, still = set(), set()
    shutil.copytree(DECKS, tmp_path / "decks")
    decks = public_decks(tmp_path / "decks")
    # of two rotors with the same keys the one of fewer polars
    decks["iea"]["parts"] = {"aerodyn": decks["ITIBarge4"]["parts"]["aerodyn"]}
    decks["iea"]["folders"] = decks["ITIBarge4"]["folders"]
    for arguments in decks.values():
        files = {}
        original = PartFile.__init__

        def opened(self, path, kind, original=original, files=files):
            original(self, path, kind)
            files.setdefault(Path(path), (kind, self))

        with monkeypatch.context() as context:
            context.setattr(PartFile, "__init__", opened)
            before = outcome(arguments)
        for path, (kind, file) in files.items():
            if kind not in KEYS or (kind == "polar" and ("polar", "numalf") in moved):
                continue
            table = KEYS[kind]
            for key, (written, _, values) in file.entries.items():
                without_effect = isinstance(table.get(known(table, key)), str)
                if (kind, key) in moved or without_effect:
                    continue
                copy = shutil.copy(path, tmp_path / "kept")
                try:
                    for value in others(values):
                        set_key(path, kind, written, value)
                        after = outcome(arguments)
                        shutil.copy(copy, path)
                        if after != before:
                            moved.add((kind, key))
                            break
                    else:
                        still.add((kind, key))
                finally:
                    shutil.copy(copy, path)
    expected = {(kind, same_key(key)) for keys in WITHOUT_EFFECT.values()
                for kind, names in keys.items() for key in names.split()}  # fmt: skip
    assert still - moved == expected
    assert len(moved) > 200
