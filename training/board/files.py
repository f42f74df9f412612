"""The files of a submission: list, hash and copy."""

import hashlib
import shutil
from pathlib import Path

from fowt_env.errors import InputError

LARGEST_FOLDER = 50e6  # bytes
COMPILED = "__pycache__"  # neither hashed nor copied


def files_of(folder: Path | str) -> list[Path]:
    """Return the sorted files of a submission's folder. Raises: InputError for links and large folders."""
    folder, found = Path(folder), []
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise InputError(f"submission {str(folder)!r}: {str(path)!r} is a link or no plain file")
        if path.is_file() and COMPILED not in path.relative_to(folder).parts:
            found.append(path)
    size = sum(path.stat().st_size for path in found)
    if size > LARGEST_FOLDER:
        raise InputError(
            f"submission {str(folder)!r}: {size / 1e6:.0f} MB: must be at most {LARGEST_FOLDER / 1e6:.0f} MB"
        )
    return found


def digest_of(folder: Path | str) -> str:
    """Return the SHA-256 of the names, lengths and contents of a submission's files."""
    digest = hashlib.sha256()
    for path in files_of(folder):
        content = path.read_bytes()
        name = path.relative_to(folder).as_posix().encode("utf-8", "surrogateescape")
        digest.update(b"%d %d " % (len(name), len(content)) + name + content)
    return digest.hexdigest()


def copy_files(folder: Path | str, place: Path | str) -> None:
    """Copy a submission's folder to a new folder; links stay links."""
    shutil.copytree(folder, place, symlinks=True, ignore=shutil.ignore_patterns(COMPILED))
