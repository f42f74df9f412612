"""Writes all results of a finished design load table: page, CSV, spreadsheets, driving runs."""

from pathlib import Path

from fowt_env.descriptions.platform import read_platform, turbine_of
from fowt_env.errors import InputError
from fowt_env.files.openfast_deck.parser import PartFile
from fowt_env.training.loads.century import coverage_remarks
from fowt_env.training.loads.decks import write_driving
from fowt_env.training.loads.page import write_load_page
from fowt_env.training.loads.run import finished_runs
from fowt_env.training.loads.site import climate_of
from fowt_env.training.loads.spreadsheet import write_spreadsheets
from fowt_env.training.loads.tables import DRIVING, load_tables, write_csv
from fowt_env.training.reports.metric_words import counted

PAGE = "loads.html"


def write_results(
    folder, matrix, controllers, site, *, baseline=None, deck=None, driving=DRIVING, years=None, progress=None
):
    """Write the results of a Matrix whose runs are in a folder; return (LoadTables, paths, remarks).

    controllers  {label: name or object}, for the driving runs
    site         SiteFile
    baseline     controller of the paired differences, None: the first
    deck         path of an .fst of the platform for the driving runs, None: no decks
    driving      number of driving runs that are written, 0: none
    years        lifetime of fatigue loads, None: 25
    remarks: what was left out for lack of a library.
    Raises: InputError if no run has statistics.
    """
    folder, say = Path(folder), progress or (lambda done, total, text: None)
    if deck is not None:
        PartFile(deck, "OpenFAST")  # fails before hours of tables if it cannot be read
    finished = {case.key: run for case, run in finished_runs(matrix, folder)}
    options = {} if years is None else {"years": years}
    description = read_platform(matrix.cases[0].case.platform)
    climate = climate_of(site, turbine_of(description))
    limits = site.design.constraint_limits
    results = load_tables(
        matrix.cases, finished, baseline=baseline, climate=climate, limits=limits, progress=say, **options
    )
    paths, remarks = list(write_csv(folder / "tables", results)), []
    name = description.name
    about = {
        "title": f"Design loads of {name} at {site.name}",
        "lead": _lead(results, matrix),
        "left_out": matrix.left_out,
        "remarks": (*matrix.remarks, *coverage_remarks(folder, results.controllers)),
        "facts": _facts(results, matrix, site),
    }
    for write in (
        lambda: [write_load_page(folder / PAGE, results, **about)],
        lambda: write_spreadsheets(folder / "tables", name, results),
    ):
        try:
            paths += write()
        except InputError as error:  # a library is missing, which the message names
            remarks.append(str(error))
    if driving:
        paths += write_driving(folder, results, controllers, deck, driving, say)
    return results, paths, remarks


def _lead(results, matrix):
    """Return the size of the table in one line."""
    seeds = len({case.seed for case in matrix.cases})
    names = {case.dlc for case in matrix.cases}
    parts = [
        ", ".join(results.controllers), counted(len(names), "load case"),
        counted(len(matrix.runs), "run"), counted(seeds, "seed"), f"{matrix.hours:.0f} h simulated",
    ]  # fmt: skip
    return " · ".join(parts)


def _facts(results, matrix, site):
    """Return {name: text} of the provenance."""
    case = matrix.cases[0].case
    return {
        "platform": str(case.platform),
        "site": f"{site.name}: {site.description}",
        "options of the scene": ", ".join(f"{key} {value}" for key, value in case.options.items()),
        "sensors": case.sensors,
        "baseline": results.baseline,
        "lifetime": f"{results.years:g} years, {results.reference_cycles:.3g} reference cycles",
        "load cases": matrix.source,
    }
