"""Broken files by the thousand: each loads, or is refused with an InputError that says what is wrong.

    python tests/mutation.py --count 10000 --seed 1 --folder mutated

A worker with bounded memory makes, loads and judges the files, each within a time limit; should it crash or
hang, the file is blamed and the next worker goes on. A seed and a number always make the same file: the sound
files hold no date, and neither versions nor a hash of the sources.
"""

import argparse
import contextlib
import json
import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import sys
import time
import warnings
import zipfile
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parent.parent
SECONDS = 20  # of processor time that a file may take
WAITS = 6  # times as long may it take by the clock, on a machine that others use too
MEMORY = 1_000_000_000  # bytes that loading may take beyond what loading the sound files took
NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+(\.\d+)?([eE][-+]?\d+)?")
ODD_NUMBERS = (
    b"nan", b"NaN", b"-inf", b"Infinity", b"1e400", b"-1", b"0", b"1e300", b"1e-320", b"9" * 30, b"true",
    b"null", b'"x"', b"[]", b"{}", b"[1, 2]", b"2147483648", b"-0.0", b"1e9", b"1000000", b"",
)  # fmt: skip
ODD_COUNTS = (0, 1, 2, 255, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**16 - 2, 10**6, 10**9)
ODD_FLOATS = (float("nan"), float("inf"), -float("inf"), 0.0, -1.0, 1e300, 1e38, 1e-310, 1e-40)


# ---------------------------------------------------------------- how files are broken


def flipped(content, rng):
    """A few bits turned over."""
    changed = bytearray(content)
    for _ in range(rng.integers(1, 9)):
        changed[rng.integers(len(changed))] ^= 1 << rng.integers(8)
    return bytes(changed)


def truncated(content, rng):
    """The end cut off."""
    return content[: rng.integers(len(content))]


def inserted(content, rng):
    """Bytes put in, or a part said twice."""
    place = rng.integers(len(content))
    if rng.random() < 0.5:
        start = rng.integers(len(content))
        more = content[start : start + rng.integers(1, 200)]
    else:
        more = rng.bytes(rng.integers(1, 50))
    return content[:place] + more + content[place:]


def removed(content, rng):
    """A part taken out."""
    place = rng.integers(len(content))
    return content[:place] + content[place + rng.integers(1, 200) :]


def recounted(content, rng):
    """Another count or number in the head of a binary file."""
    form = "<" + str(rng.choice(["h", "i", "q", "f", "d"]))
    if form in "<f<d":
        with np.errstate(over="ignore"):
            value = np.array(rng.choice(ODD_FLOATS)).astype(form)
    else:
        value = np.array(rng.choice(ODD_COUNTS)).astype(np.int64).astype(form)
    place = int(rng.integers(min(len(content), 120)))
    word = value.tobytes()
    return content[:place] + word + content[place + len(word) :]


def renumbered(content, rng):
    """Other values in place of some numbers of a text."""
    found = list(NUMBER.finditer(content))
    if not found:
        return flipped(content, rng)
    for match in sorted(
        (found[rng.integers(len(found))] for _ in range(rng.integers(1, 4))), key=lambda m: -m.start()
    ):
        value = ODD_NUMBERS[rng.integers(len(ODD_NUMBERS))]
        content = content[: match.start()] + value + content[match.end() :]
    return content


def relined(content, rng):
    """Lines lost, doubled or changed places."""
    lines = content.splitlines(keepends=True)
    i, j = rng.integers(len(lines), size=2)
    what = rng.integers(3)
    if what == 0:
        del lines[i]
    elif what == 1:
        lines.insert(j, lines[i])
    else:
        lines[i], lines[j] = lines[j], lines[i]
    return b"".join(lines)


def nested(content, rng):
    """Brackets without end, or a line far too long."""
    place = rng.integers(len(content))
    bracket = [b"[", b"{", b'{"a":', b"(", b"x", b"9", b"a.", b'"'][rng.integers(8)]
    return content[:place] + bracket * int(rng.integers(100, 20_000)) + content[place:]


TEXT = (flipped, truncated, inserted, removed, renumbered, renumbered, renumbered, relined, nested)
BINARY = (flipped, truncated, inserted, removed, recounted, recounted, recounted)


# ---------------------------------------------------------------- the sound files, and how each kind is read


class Samples:
    """Sound files of every kind in a folder, and how each is loaded. kinds: {name: (file, ways, load)}."""

    GROUPS = ("descriptions", "winds", "outputs", "policies", "results")

    def __init__(self, folder, groups=GROUPS):
        self.folder = folder
        self.kinds = {}
        for group in groups:
            getattr(self, f"_{group}")()

    def add(self, name, path, ways, load):
        """Another kind of file: load() reads it where it lies."""
        self.kinds[name] = (path, ways, load)

    def _descriptions(self):
        from fowt_env.controllers.design.saved_files import load_design
        from fowt_env.descriptions.platform import read_platform
        from fowt_env.descriptions.sea_state import joint_sea_state, sea_state_of
        from fowt_env.descriptions.turbine import read_turbine
        from fowt_env.scene.build import build_scene
        from fowt_env.training.evaluation.cases import read_suite

        data, folder = ROOT / "fowt_env" / "data", self.folder
        turbine = folder / "turbine"
        shutil.copytree(data / "turbines" / "nrel5mw", turbine)
        platform = folder / "platform.toml"
        shutil.copy(data / "platforms" / "oc3_hywind.toml", platform)
        self.add("platform", platform, TEXT, lambda: build_scene(platform, fidelity="standard"))
        for name in ("turbine.toml", "blade.csv", "polars/" + sorted(os.listdir(turbine / "polars"))[0]):
            self.add(f"turbine {name}", turbine / name, TEXT, lambda: read_turbine(turbine / "turbine.toml"))
        sea = folder / "sea.toml"
        sea.write_text('kind = "jonswap"\nHs = 6.0\nTp = 10.0\ngamma = 3.3\nheading = 20.0\nname = "mine"\n')
        self.add("sea", sea, TEXT, lambda: build_scene(sea=sea_state_of(sea), fidelity="standard"))
        table = folder / "table.toml"
        rows = "wind = [5.0, 15.0, 25.0]\nHs = [1.0, 3.0, 6.0]\nTp = [6.0, 9.0, 12.0]\n"
        table.write_text('name = "site"\n' + rows)
        self.add("joint table", table, TEXT, lambda: joint_sea_state(str(table), 12.0))
        for name in ("dlc", "gusts"):
            suite = folder / f"{name}.toml"
            shutil.copy(ROOT / "training" / "evaluation" / "suites" / f"{name}.toml", suite)
            self.add(f"suite {name}", suite, TEXT, lambda suite=suite: read_suite(suite))
        reader = read_turbine(read_platform("oc3_hywind").turbine)
        design = folder / "design.json"
        design.write_text(json.dumps({
            "format": "fowt-design", "version": 2, "kind": "pi", "platform": "oc3_hywind", "command": "",
            "turbine": reader.name, "settings": {"KP": 0.006, "KI": 0.0009, "gain_schedule_pitch": 0.11},
        }, indent=1))  # fmt: skip
        self.add("design", design, TEXT, lambda: load_design(design)(reader, 0.1))
        self.turbine = reader

    def _winds(self):
        from openfast_io.turbsim_file import TurbSimFile

        from fowt_env.descriptions.wind import wind_of
        from fowt_env.weather.wind import build_wind
        from fowt_env.weather.wind_field import read_box

        rotor = {"reference_height": 90.0, "rotor_diameter": 126.0, "shear_exponent": 0.2, "seed": 0,
                 "duration": 60.0}  # fmt: skip
        box = TurbSimFile()
        rng = np.random.default_rng(0)
        box["u"] = rng.normal(10.0, 1.0, (3, 30, 8, 9))
        box["uTwr"] = rng.normal(10.0, 1.0, (3, 30, 2))
        box["y"], box["z"] = np.linspace(-70.0, 70.0, 8), np.linspace(20.0, 160.0, 9)
        box["t"] = np.arange(30) * 0.1
        path = self.folder / "box.bts"
        with contextlib.redirect_stdout(None):
            box.write(str(path))
        now = rb"on \d\d-\w{3}-\d{4} at [\d:]{8}"
        path.write_bytes(re.sub(now, b"on 01-Jan-2026 at 00:00:00", path.read_bytes()))
        self.add("bts", path, BINARY, lambda: read_box(
            {"kind": "bts", "path": path}, hub_height=90.0, rotor_diameter=126.0
        ).field())  # fmt: skip
        rows = "".join(f"{t} {12 + t / 50} {t / 20} 0.1 0 0.2 0 0\n" for t in range(0, 100, 5))
        frame = pd.DataFrame({"time": np.arange(50.0), "speed": 12.0 + np.sin(np.arange(50.0))})
        for name in ("uniform.wnd", "uniform.hh", "series.csv", "series.parquet"):
            wind = self.folder / name
            if name.endswith(".csv"):
                frame.to_csv(wind, index=False)
            elif name.endswith(".parquet"):
                frame.to_parquet(wind)
            else:
                wind.write_text("! time speed dir w hshr exp vshr gust\n" + rows)
            ways = BINARY if name.endswith(".parquet") else TEXT
            self.add(f"wind {name}", wind, ways, lambda wind=wind: build_wind(wind_of(str(wind)), **rotor))

    def _outputs(self):
        from fowt_env.files.openfast import read_outb, write_outb

        rng = np.random.default_rng(0)
        values = rng.normal(size=(40, 6))
        values[:, 0] = 0.1 * np.arange(40)
        names = ["Time_[s]", "PtfmSurge_[m]", "RotSpeed_[rpm]", "GenPwr_[kW]", "BldPitch1_[deg]", "A_[-]"]
        frame = pd.DataFrame(values, columns=names)
        for kind in (1, 2, 3, 4):
            path = self.folder / f"kind_{kind}.outb"
            if kind == 3:
                write_outb(frame, path)
            else:
                path.write_bytes(packed(frame, kind))
            self.add(f"outb {kind}", path, BINARY, lambda path=path: read_outb(path))

    def _policies(self):
        from fowt_env.controllers.policy.controller import AGENTS, PolicyController

        path = self.folder / "policy.npz"
        shutil.copy(AGENTS / "ppo_lqr.npz", path)

        def load(path=path):
            return PolicyController(path, self.turbine, 0.1, "policy")

        self.add("policy", path, BINARY, load)
        inner = self.folder / "policy_text.npz"
        shutil.copy(path, inner)
        within = tuple(inside("settings.npy", way) for way in TEXT)
        self.add("policy settings", inner, within, lambda: load(inner))
        arrays = self.folder / "policy_array.npz"
        shutil.copy(path, arrays)
        within = tuple(inside(name, way) for way in BINARY for name in ("mean.npy", "weight_0.npy"))
        self.add("policy arrays", arrays, within, lambda: load(arrays))

    def _results(self):
        from fowt_env.files.tables import read_table
        from fowt_env.training.evaluation import provenance
        from fowt_env.training.evaluation.evaluate import COLUMNS
        from fowt_env.training.evaluation.results import (
            FORMAT,
            open_results,
            read_row,
            run_content,
            write_json,
            write_run,
        )
        from fowt_env.training.reports.html_page import write_report
        from fowt_env.training.rl.train import Training, resolve

        provenance.plant_code = lambda: "0123456789abcdef"  # the same manifest in every tree
        provenance.versions = lambda: {"python": "3.11", "numpy": "2.0"}
        folder = self.folder / "results"
        row = dict.fromkeys(COLUMNS, 1.5) | {"controller": "pi", "case": "calm", "seed": 1, "status": "ok"}
        row |= {"reason": "", "events": "", "warning": ""}
        frame = pd.DataFrame({"Time_[s]": 0.1 * np.arange(30), "RotSpeed_[rpm]": 12.0 + np.zeros(30)})
        case = {"name": "calm", "wind": 16.0, "sea": None, "platform": "oc3_hywind", "duration": 3.0}
        settings = {
            "suite": {"name": "mine", "version": 1}, "options": {}, "cases": {"calm": case}, "seeds": [1],
            "controllers": {"pi": {"name": "pi", "code": "0"}},
        }  # fmt: skip
        run = folder / "runs" / "pi" / "calm_seed1.parquet"

        def reopen():
            with open_results(folder, settings, COLUMNS) as results:
                return results.table()

        def report():
            return write_report(folder, schedule=False)

        write_run(run_content(frame, row), run)
        with contextlib.suppress(Exception):
            reopen()
        (folder / "results.csv").unlink(missing_ok=True)
        run.unlink()
        reopen()
        manifest = json.loads((folder / "manifest.json").read_text())
        write_json(manifest | {"created": "2026-01-01T00:00:00+0000"}, folder / "manifest.json")
        write_run(run_content(frame, row), run)
        table = reopen()
        from fowt_env.training.evaluation.leaderboard_file import write_leaderboard

        write_leaderboard(table, folder)
        assert json.loads((folder / "manifest.json").read_text())["format"] == FORMAT
        self.add("manifest", folder / "manifest.json", TEXT, reopen)
        self.add("run", run, BINARY, lambda: (read_row(run), read_table(run)))
        self.add("results table", folder / "results.csv", TEXT, report)
        self.add("leaderboard", folder / "leaderboard.json", TEXT, report)
        self.add("manifest in a report", folder / "manifest.json", TEXT, report)
        training = self.folder / "training" / "settings.yml"
        training.parent.mkdir()
        import yaml

        training.write_text(yaml.safe_dump(resolve("ppo", "above_rated", 0, 10)))
        self.add("training settings", training, TEXT, lambda: Training(None, training.parent, resume=True))


def packed(frame, kind):
    """Content of a .outb file of kind 1, 2 or 4 with some values of 16 bits."""
    values = frame.to_numpy()
    rows, channels = values.shape[0], values.shape[1] - 1
    head = struct.pack("<h", kind) + (struct.pack("<h", 10) if kind == 4 else b"")
    head += struct.pack("<iidd", channels, rows, *((1000.0, 0.0) if kind == 1 else (0.0, 0.1)))
    head += np.full(channels, 5000.0, "<f4").tobytes() + np.zeros(channels, "<f4").tobytes()
    head += struct.pack("<i", 5) + b"a run"
    words = [column[:-1].split("_[") for column in frame.columns]
    head += "".join(w.ljust(10) for w in (*(w[0] for w in words), *(f"({w[1]})" for w in words))).encode()
    times = np.arange(rows, dtype="<i4") * 100
    return head + (times.tobytes() if kind == 1 else b"") + (values[:, 1:] * 5000).astype("<i2").tobytes()


def inside(member, way):
    """A way to break a file that breaks one member of a zip and puts it back, checksum and all."""

    def change(content, rng):
        import io

        source, target = zipfile.ZipFile(io.BytesIO(content)), io.BytesIO()
        with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as made:
            for name in source.namelist():
                data = source.read(name)
                if name == member == "settings.npy":
                    text = str(np.load(io.BytesIO(data), allow_pickle=False)).encode()
                    buffer = io.BytesIO()
                    changed = way(text, rng) if text else text
                    np.save(buffer, np.array(changed.decode("utf-8", "replace")))
                    data = buffer.getvalue()
                elif name == member and data:
                    data = way(data, rng)
                made.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)  # without the time of day
        return target.getvalue()

    change.__name__ = f"{way.__name__} {member}"
    return change


# ---------------------------------------------------------------- the worker


def broken(samples, names, seed, number):
    """(kind, way, content) of a number of a study."""
    rng = np.random.default_rng([seed, number])
    name = names[number % len(names)]
    path, ways, _ = samples.kinds[name]
    way = ways[rng.integers(len(ways))]
    content = samples.sound[name]
    for _ in range(rng.integers(1, 3)):
        content = way(content, rng) if content else content
    return name, way.__name__, content


def work(folder, seed, first, last):
    """Judge the files from first to last; print a line before and after each."""
    from fowt_env.errors import InputError, PlantWarning

    os.environ["COLUMNS"] = "200"
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", category=PlantWarning)  # of a platform that can hardly be meant
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    warnings.filterwarnings("ignore", category=ResourceWarning)
    warnings.filterwarnings("ignore", module="pydantic|typer|openfast_io|numba")
    folder.mkdir(parents=True)
    samples = Samples(folder)
    samples.sound = {name: path.read_bytes() for name, (path, _, _) in samples.kinds.items()}
    for name, (path, _, load) in samples.kinds.items():
        path.write_bytes(samples.sound[name])
        load()
        path.write_bytes(samples.sound[name])
    with open("/proc/self/statm") as file:
        size = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))

    def late(number, frame):
        raise TimeoutError(f"still at it after {SECONDS} s")

    for number in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(number, late)
    names = list(samples.kinds)
    for number in range(first, last):
        name, way, content = broken(samples, names, seed, number)
        path, _, load = samples.kinds[name]
        print(json.dumps({"begin": number, "kind": name, "way": way}), flush=True)
        path.write_bytes(content)
        signal.alarm(WAITS * SECONDS)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        begin = time.process_time()
        try:
            load()
            told = "loaded"
        except InputError as error:
            told = "refused" if len(str(error)) > 10 else f"FAILED: says nothing: {error!r}"
        except BaseException as error:
            told = f"FAILED: {type(error).__name__}: {str(error)[:300]}"
        finally:
            signal.alarm(0)
            signal.setitimer(signal.ITIMER_PROF, 0)
        path.write_bytes(samples.sound[name])
        seconds = round(time.process_time() - begin, 3)
        entry = {"end": number, "kind": name, "way": way, "told": told, "seconds": seconds}
        print(json.dumps(entry), flush=True)


# ---------------------------------------------------------------- the study


def study(folder, count, seed, first=0):
    """{"counts": {(kind, told): n}, "failures": [...], "slowest": s} of so many broken files."""
    counts, failures, slowest = Counter(), [], 0.0
    number, attempt = first, 0
    while number < first + count:
        place = folder / f"worker_{attempt}"
        command = [sys.executable, __file__, "--folder", place, "--seed", str(seed), "--from", str(number)]
        command += ["--count", str(first + count - number), "--work"]
        process = subprocess.Popen(
            [str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"},
        )  # fmt: skip
        open_file = None
        for line in process.stdout:
            entry = json.loads(line)
            if "begin" in entry:
                open_file = entry
                continue
            open_file, number = None, entry["end"] + 1
            slowest = max(slowest, entry["seconds"])
            counts[entry["kind"], entry["told"].partition(":")[0]] += 1
            if entry["told"].startswith("FAILED"):
                failures.append(entry)
        errors = process.stderr.read()
        process.wait()
        if open_file is not None:
            number = open_file["begin"] + 1
            told = f"FAILED: the process ended, {process.returncode}: {errors[-300:]}"
            failures.append(open_file | {"told": told})
        elif process.returncode != 0:
            raise RuntimeError(f"the worker ended before its files: {errors[-3000:]}")
        attempt += 1
    return {"counts": counts, "failures": failures, "slowest": slowest}


def main():
    """Run a study, or be its worker."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--work", action="store_true")
    given = parser.parse_args()
    if given.work:
        work(given.folder, given.seed, given.first, given.first + given.count)
        return
    found = study(given.folder, given.count, given.seed, given.first)
    for (kind, told), number in sorted(found["counts"].items()):
        print(f"{kind:24} {told:8} {number}")
    for entry in found["failures"]:
        print(json.dumps(entry))
    total = sum(found["counts"].values())
    print(f"{total} files, {len(found['failures'])} failures, slowest {found['slowest']} s")


if __name__ == "__main__":
    main()
