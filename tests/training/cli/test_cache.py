"""fowt dev cache: what it counts and what it removes, which is nothing that this package did not make."""

import pytest
from typer.testing import CliRunner

from fowt_env.plant.compile.decorators import MARKER
from fowt_env.training.cli import health
from fowt_env.training.cli.app import app

THIS, OTHER, FOREIGN, SUBMISSION = "0" * 16, "1" * 16, "2" * 16, "b" * 24


@pytest.fixture
def root(tmp_path, monkeypatch):
    """A cache with this version, another, a submission's kernels, two boxes, and what others put there."""
    monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path))
    tmp_path.chmod(0o700)
    for name in (THIS, OTHER, FOREIGN):
        folder = tmp_path / "kernels" / name / "plant"
        folder.mkdir(parents=True)
        (folder / "kernel.nbi").write_bytes(b"0" * 1_000_000)
        if name != FOREIGN:
            (folder.parent / MARKER).touch()
    boxes = tmp_path / "wind_boxes"
    boxes.mkdir()
    for name in (f"{'a' * 24}.npz", "mine.npz"):
        (boxes / name).write_bytes(b"0" * 3_000_000)
    for name in (SUBMISSION, "mine"):
        folder = tmp_path / "submissions" / name / "kernels"
        folder.mkdir(parents=True)
        (folder / "kernel.nbi").write_bytes(b"0" * 2_000_000)
    (tmp_path / "sources").mkdir()
    for name in ("parsed.json", "mine.json"):
        (tmp_path / "sources" / name).write_bytes(b"0" * 100_000)
    for folder in (tmp_path / "kernels", boxes, tmp_path / "submissions", tmp_path / "sources"):
        folder.chmod(0o700)
    monkeypatch.setattr(health, "CACHE_FOLDER", tmp_path / "kernels" / THIS)
    return tmp_path


def fowt(*words, **options):
    return CliRunner().invoke(app, ["dev", "cache", *words], **options)


def left(root):
    """Names of what is in the cache."""
    folders = ("kernels", "wind_boxes", "submissions", "sources")
    return {path.name for folder in folders for path in (root / folder).iterdir()}


ALL = {THIS, OTHER, FOREIGN, f"{'a' * 24}.npz", "mine.npz", SUBMISSION, "mine", "parsed.json", "mine.json"}
OLD = {OTHER, SUBMISSION}


def test_it_shows_folder_versions_and_sizes(root):
    text = fowt().stdout
    assert str(root) in text.replace("\n", "")
    rows = {
        line.rsplit(None, 2)[0].strip(): line.rsplit(None, 2)[1:] for line in text.splitlines() if " " in line
    }
    assert rows["this version"] == ["1", "1.0"] and rows["other versions"] == ["1", "1.0"]
    assert rows["wind boxes"] == ["1", "3.0"] and rows["submissions"] == ["1", "2.0"]
    assert rows["hashes of sources"] == ["1", "0.1"]


@pytest.mark.parametrize(
    "words, gone",
    [
        ((), OLD),
        (("--all", "--yes"), OLD | {THIS, "parsed.json"}),
        (("--wind-boxes", "--yes"), OLD | {f"{'a' * 24}.npz"}),
    ],
)
def test_it_removes_what_is_named_and_nothing_else(root, words, gone):
    (root / "submissions" / f"{SUBMISSION}-k3_x9a2b").mkdir()  # of an interrupted judging
    assert fowt("clear", *words).exit_code == 0
    assert left(root) == ALL - gone


@pytest.mark.parametrize("words", [("--all",), ("--wind-boxes",)])
def test_it_asks_before_more_than_old_kernels_go(root, words):
    assert fowt("clear", *words, input="n\n").exit_code == 1
    assert left(root) == ALL
    assert fowt("clear", *words, input="y\n").exit_code == 0
    assert left(root) != ALL


def test_links_and_folders_that_others_can_write_are_left_alone(root, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / MARKER).touch()
    (root / "kernels" / ("3" * 16)).symlink_to(elsewhere)
    (root / "wind_boxes" / f"{'b' * 24}.npz").symlink_to(elsewhere / MARKER)
    (root / "kernels").chmod(0o777)
    assert fowt("clear", "--all", "--wind-boxes", "--yes").exit_code == 0
    assert (elsewhere / MARKER).exists() and (root / "wind_boxes" / f"{'b' * 24}.npz").is_symlink()
    assert {THIS, OTHER, FOREIGN} <= left(root)


def test_an_empty_cache_is_no_failure(tmp_path, monkeypatch):
    monkeypatch.setenv("FOWT_CACHE_DIR", str(tmp_path / "new"))
    assert fowt().exit_code == 0
    done = fowt("clear", "--all")
    assert done.exit_code == 0 and "nothing to remove" in done.stderr
