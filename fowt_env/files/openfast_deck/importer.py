"""Imports a deck into a folder of this project's files, and checks these by reading them back."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from fowt_env.descriptions.platform import read_platform
from fowt_env.descriptions.potential_flow import coefficient_arrays
from fowt_env.descriptions.turbine import read_turbine
from fowt_env.descriptions.wamit import read_wamit
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.files.openfast_deck.conversion import platform_rows, stations, turbine_rows
from fowt_env.files.openfast_deck.deck import read_deck
from fowt_env.files.openfast_deck.output import (
    blade_text,
    polar_text,
    structure_text,
    toml_text,
    tower_text,
)
from fowt_env.files.openfast_deck.report import make_report, markdown
from fowt_env.files.openfast_deck.rosco_files import DISCON, PERFORMANCE, discon_text

UNITS = "SI units (kg, m, s, N, rad) unless a key says otherwise (_deg, _rpm, _deg_per_s)."
COEFFICIENTS = "hydro.npz"
DISTRIBUTION = "tower.csv"


def import_deck(
    fst, folder, *, parts=None, search=(), discon=None, excitation=None, name=None, replace_files=False,
    head=(),
):  # fmt: skip
    """Write a deck as platform.toml, turbine/, hydro.npz, tower.csv and report.md; return the Report.

    fst            the .fst file, or None with parts
    folder         created if missing; existing files are kept unless replace_files
    parts          {"elastodyn": path ...} (deck.PARTS), instead of the files named in the .fst
    search         additional search folders for files named in the deck
    discon         a DISCON.IN of ROSCO instead of the deck's
    excitation     (omega, heading, force) instead of WAMIT's .3, as in descriptions.wamit.read_wamit
    name           of platform and turbine; default: name of the folder
    head           further comment lines for the files: sources, licence
    Raises: InputError naming file, line, key, value and the allowed range; the folder then is unchanged.
    """
    folder = Path(folder)
    name = name or folder.resolve().name
    if folder.exists() and not folder.is_dir():
        raise InputError(f"folder {str(folder)!r} is a file; must be a folder, or not exist")
    deck = read_deck(fst, parts, search, discon)
    body = _coefficients(deck, excitation)
    report = make_report(deck, name, body)
    texts = {"report.md": markdown(report), **_texts(deck, name, head)}
    existing = [file for file in (COEFFICIENTS, *texts) if (folder / file).exists()]
    if existing and not replace_files:
        raise InputError(f"folder {str(folder)!r} already has a {existing[-1]}: use another, or --overwrite")
    with tempfile.TemporaryDirectory(prefix="fowt-import-") as temporary:
        _write(Path(temporary), texts, body)
        try:
            read_turbine(read_platform(Path(temporary) / "platform.toml").turbine)
        except InputError as error:
            problem = str(error).replace(f"{temporary}/", "")
            what = f"deck {deck.name!r}: values cannot be used: {problem}"
            raise InputError(what) from None
        _write(folder, texts, body)
    return report


def _coefficients(deck, excitation):
    """Return the PotentialFlow of a deck, or None."""
    potential, site = deck.hydrodyn.potential, deck.site
    if potential is None:
        return None
    body = read_wamit(
        potential.root, length_scale=potential.length_scale, gravity=site.gravity, density=site.water_density,
        excitation=excitation,
    )  # fmt: skip
    return replace(body, source=f"WAMIT files {potential.root.name} of {deck.name}")


def _texts(deck, name, head):
    """Return {path in the folder: text} of all text files except the report, platform.toml last."""
    control, aero, bending = deck.control, deck.aerodyn, deck.elastodyn.bending
    files = {"OpenFAST": deck.fst, "ElastoDyn": deck.elastodyn.file, "AeroDyn": aero.file,
             "HydroDyn": deck.hydrodyn.file, "DISCON.IN": control.discon}  # fmt: skip
    named = ", ".join(f"{kind} {file.path.name}" for kind, file in files.items() if file is not None)
    title = [f"Imported from the OpenFAST deck {deck.name} by fowt import. {UNITS}",
             "Origin on the tower axis at still water; x downwind, z up, y to the left looking downwind.",
             f"Each comment names the file and the keys of the value. Files: {named}.",
             *head]  # fmt: skip
    texts = {
        f"turbine/polars/{airfoil}.csv": polar_text(
            polar, [f"{airfoil} of {aero.file.path.name}; alpha in degrees.", *head]
        )
        for airfoil, polar in aero.polars.items()
    }
    if control.performance is not None:
        texts[f"turbine/{PERFORMANCE}"] = control.performance.text
    if control.discon is not None:
        texts[f"turbine/{DISCON}"] = discon_text(control.discon, control.performance)
    if bending is not None:
        file = deck.elastodyn.file.text("TwrFile")
        title_line = f"Tower of {file}: mass density in kg/m, stiffness (EI) in N m2."
        texts[DISTRIBUTION] = tower_text(bending, [title_line, *head])
    if deck.elastodyn.structure is not None:
        file = deck.elastodyn.file.text("BldFile(1)", "BldFile").replace("\\", "/").rpartition("/")[2]
        units = "structural twist in degrees, mass density in kg/m, stiffness (EI) in N m2"
        title_line = f"Blade of {file}: {units}."
        texts["turbine/blade_structure.csv"] = structure_text(deck.elastodyn.structure, [title_line, *head])
    blade = aero.blade_file.path.name
    texts["turbine/blade.csv"] = blade_text(*stations(deck), [
        f"Nodes of blade {blade}, with the end nodes 0.05 m inside root and tip, where loads are 0.",
        "radius from the rotor centre along the pitch axis, m; twist in degrees; prebend downwind, m.", *head,
    ])  # fmt: skip
    texts["turbine/turbine.toml"] = toml_text(turbine_rows(deck, name), title)
    rows = platform_rows(deck, name, "turbine/turbine.toml", COEFFICIENTS, DISTRIBUTION)
    return texts | {"platform.toml": toml_text(rows, title)}


def _write(folder, texts, body):
    """Write all files of an import atomically, platform.toml last, which completes the folder."""
    (folder / "turbine" / "polars").mkdir(parents=True, exist_ok=True)
    if body is not None:
        with replacing(folder / COEFFICIENTS) as path, path.open("wb") as file:
            np.savez_compressed(file, **coefficient_arrays(body))
    for name, text in texts.items():
        with replacing(folder / name) as path:
            path.write_text(text, encoding="utf-8")
