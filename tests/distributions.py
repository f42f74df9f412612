"""The forms in which people get this package, made from the working copy, and wheels of them."""

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FORMS = ("clone", "tar", "zip", "sdist")  # all of them sources; pip makes a wheel of each


def run(*command, **options):
    """Return what a command printed; it must end well."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout


def installed(folder, *words):
    """Return the Python of a new environment in a folder with what `pip install` is given.

    Where pip fetches not even a package that every index has, the test is skipped: nothing else excuses it.
    """
    run(sys.executable, "-m", "venv", folder / "venv")
    python = folder / "venv" / "bin" / "python"
    pip = [python, "-m", "pip"]
    done = subprocess.run([*pip, "install", "--quiet", *words], capture_output=True, text=True)
    if done.returncode:
        probe = [*pip, "download", "--quiet", "--no-deps", "--dest", folder / "probe", "pip"]
        if subprocess.run(probe, capture_output=True).returncode:
            pytest.skip("no package index: pip finds no version of itself there either")
    assert done.returncode == 0, done.stderr[-3000:]
    return python


def repository(folder):
    """Return a folder with a repository whose one commit is the working copy as it is now."""
    names = run("git", "-C", ROOT, "ls-files", "--cached", "--others", "--exclude-standard", "-z").split("\0")
    for name in filter(None, names):
        if (ROOT / name).exists() and not name.startswith(("tests/", "docs/results/")):  # large, in no wheel
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name, follow_symlinks=False)
    git = ("git", "-C", folder, "-c", "user.name=nobody", "-c", "user.email=nobody@localhost")
    run(*git, "init", "--quiet")
    run(*git, "add", "--all")
    run(*git, "commit", "--quiet", "--no-gpg-sign", "--message", "all")
    return folder


def sources(form, origin, folder):
    """Return what pip is given, of a form of FORMS: a folder of sources, or an sdist; made inside a folder.

    origin: a repository. The ZIP is unpacked by Python, which makes a text file of a symbolic link.
    """
    place = folder / form
    if form == "clone":
        run("git", "clone", "--quiet", origin, place)
    elif form == "sdist":
        clone = sources("clone", origin, folder / "for the sdist")
        run(sys.executable, "-m", "build", "--no-isolation", "--sdist", "--outdir", place, clone)
        (place,) = place.glob("*.tar.gz")
    else:
        archive = folder / f"archive.{form}"
        run("git", "-C", origin, "archive", f"--format={form}", f"--output={archive}", "HEAD")
        if form == "zip":
            zipfile.ZipFile(archive).extractall(place)
        else:
            tarfile.open(archive).extractall(place, filter="data")
    return place


def wheel_of(place, folder):
    """Return the wheel that pip builds of sources, put into a folder."""
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    run(*pip, "--wheel-dir", folder, place)
    (wheel,) = folder.glob("*.whl")
    return wheel
