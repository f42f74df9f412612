"""Takes the decks of this folder out of copies of their repositories, and lists them in files.csv.

    python tests/reference/decks/take.py IEA-15-240-RWT=FOLDER FAST=FOLDER ROSCO=FOLDER

Each folder is the root of a checkout; README.md names repositories and commits. Files are copied as they
are. Of WAMIT's rows those of every so many periods and of some headings are kept.
"""

import csv
import hashlib
import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SEMI, TURBINE = "OpenFAST/IEA-15-240-RWT-UMaineSemi/", "OpenFAST/IEA-15-240-RWT/"
BASELINE, ROSCO = "CertTest/5MW_Baseline/", "Examples/Test_Cases/"
POLARS = ("Cylinder1", "Cylinder2", "DU21_A17", "DU25_A17", "DU30_A17", "DU35_A17", "DU40_A17", "NACA64_A17")
FILES = {  # folder here: paths in the repository
    "IEA-15-240-RWT": [
        "LICENSE",
        *(f"{SEMI}IEA-15-240-RWT-UMaineSemi{name}" for name in (
            ".fst", "_AeroDyn15.dat", "_ElastoDyn.dat", "_ElastoDyn_tower.dat", "_HydroDyn.dat", "_MAP.dat",
            "_MoorDyn.dat", "_SeaState.dat", "_ServoDyn.dat")),
        *(f"{SEMI}HydroData/IEA-15-240-RWT-UMaineSemi.{ending}" for ending in ("1", "3", "hst", "12d")),
        *(f"{TURBINE}{name}" for name in (
            "IEA-15-240-RWT_AeroDyn15_blade.dat", "IEA-15-240-RWT_ElastoDyn_blade.dat",
            "IEA-15-240-RWT_InflowFile.dat", "Cp_Ct_Cq.IEA15MW.txt")),
        *(f"{TURBINE}Airfoils/IEA-15-240-RWT_AeroDyn15_Polar_{i:02}.dat" for i in range(50)),
    ],
    "FAST": [
        "license.txt",
        *(f"{BASELINE}NRELOffshrBsline5MW_{floater}_{part}.dat"
          for floater in ("ITIBarge4", "OC4DeepCwindSemi")
          for part in ("ElastoDyn", "ElastoDyn_Tower", "HydroDyn", "MAP", "MoorDyn", "ServoDyn")),
        *(f"{BASELINE}HydroData/barge.{ending}" for ending in ("1", "3", "hst")),
        *(f"{BASELINE}HydroData/marin_semi.{ending}" for ending in ("1", "hst", "12d")),
    ],
    "ROSCO": [
        "LICENSE",
        f"{ROSCO}IEA-15-240-RWT/IEA-15-240-RWT-UMaineSemi/IEA-15-240-RWT-UMaineSemi_DISCON.IN",
        *(f"{ROSCO}NREL-5MW/NRELOffshrBsline5MW_{name}.dat" for name in (
            "Onshore_AeroDyn15", "AeroDyn_blade", "Blade")),
        *(f"{ROSCO}NREL-5MW/Airfoils/{name}.dat" for name in POLARS),
    ],
}  # fmt: skip
PERIODS = {".1": 5, ".3": 4, ".12d": 4}  # of so many one is kept, with those of the limits (0 and below)
HEADINGS = 60.0  # deg: the multiples are kept


def thinned(content, ending):
    """The rows of WAMIT's file whose periods and headings are kept."""
    columns = 2 if ending == ".12d" else 1
    periods, rows = {}, []
    for line in content.splitlines(keepends=True):
        words = line.split()
        if not re.fullmatch(rb"[-+.\dEe]+", words[0]):
            rows.append(line)  # WAMIT's title
            continue
        kept = all(
            float(word) <= 0.0 or periods.setdefault(float(word), len(periods)) % PERIODS[ending] == 0
            for word in words[:columns]
        )
        if kept and (ending != ".3" or float(words[1]) % HEADINGS == 0.0):
            rows.append(line)
    return b"".join(rows)


def take(roots):
    """Copy all FILES, and write files.csv. roots: (name of the repository, folder)."""
    with (HERE / "files.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("file", "sha256", "sha256_of_the_source"))
        for repository, paths in FILES.items():
            for path in paths:
                places = [Path(root) / path for name, root in roots if name == repository]
                source = next((place for place in places if place.is_file()), None)
                if source is None:
                    raise SystemExit(f"{repository}: none of the folders has {path}")
                content = source.read_bytes()
                kept = thinned(content, source.suffix) if source.suffix in PERIODS else content
                target = HERE / repository / path
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(kept)
                digests = [hashlib.sha256(some).hexdigest() for some in (kept, content)]
                table.writerow((f"{repository}/{path}", *digests))


if __name__ == "__main__":
    take([root.split("=", 1) for root in sys.argv[1:]])
