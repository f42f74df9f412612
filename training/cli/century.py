"""Implements fowt loads --century: values of the hours of many years, and those of the extrapolation."""

from rich.markup import escape

from fowt_env.descriptions.checks import check_number, check_whole_number
from fowt_env.descriptions.files import parse_json
from fowt_env.training.cli.console import note, progress_bar, resumable, wrote
from fowt_env.training.cli.tables import out, print_table

SHOWN = ("TwrBsMyt", "TwrBsMxyt", "YawBrMyp", "RootMyc1", "RotThrust", "PtfmPitch", "PtfmOffset", "NcIMUTAxs",
         "RotSpeed", "FAIRTEN1", "FAIRTEN2", "FAIRTEN3")  # fmt: skip
PILOT = 200  # hours of plain sampling from which the states of importance sampling are chosen


def cells(frame):
    """Return the rows of a table as texts and numbers, "–" where a value is missing."""
    return frame.astype(object).where(frame.notna(), "–").values.tolist()


def show_centuries(platform, site, labels, years, period, sample, folder, settings, table, **machine):
    """Simulate the hours of some years for each controller, and print what the extrapolation makes of them.

    period: return period, years; sample: hours of importance sampling in place of all hours; settings: of
    Century; table: of the matrix of load cases in the folder. Raises: InputError.
    """
    from fowt_env.training.loads.century import FOLDER, Century
    from fowt_env.training.loads.site import read_site

    check_number("century", years, 0.0, 1e4, low_open=True, allowed="a number of years in (0, 10000]")
    check_number("return_period", period, 0.0, low_open=True, allowed="a positive number of years")
    if sample is not None:
        check_whole_number("sample", sample, 1)
    for label in labels:
        century = Century(platform, read_site(site), label, **settings)
        runs = _extrapolated_runs(platform, site, label, folder, table)
        _show_century(century, years, period, sample, folder / FOLDER / label, runs, **machine)


def _extrapolated_runs(platform, site, label, folder, table):
    """Return [(LoadCase, RunStatistics)] of DLC 1.1 in a folder, with rotor-averaged turbulence; or [].

    Without runs that a trip ended.
    """
    from fowt_env.training.loads.matrix import expanded
    from fowt_env.training.loads.run import finished_runs
    from fowt_env.training.loads.tables import joined

    manifest = folder / "manifest.json"
    if not manifest.exists():
        return []
    stored = parse_json(manifest.read_text(encoding="utf-8")).get("cases", {})
    matrix = expanded(platform, site, (label,), dlc="1.1", wind="rotor-averaged", **table)
    plain = {name for name, case in stored.items() if case.get("wind", {}).get("kind") == "ntm"}
    found = [
        run
        for case, run in finished_runs(matrix, folder)
        if case.name in plain and run.statistics is not None
    ]
    if len(found) < len(matrix.cases):
        note(f"{folder} has {len(found)} of {len(matrix.cases)} runs of DLC 1.1: nothing is compared")
        return []
    return joined(matrix.cases, {run.key: run for run in found if run.status == "ok"})[0]


def _show_century(century, years, period, sample, folder, runs, *, dry_run, **machine):
    """Simulate the hours of a Century and write century.csv in a folder; print its main loads.

    dry_run: print hours and time alone. machine: options of run_century.
    """
    from fowt_env.training.loads.century import (
        FILE,
        century_table,
        coverage_text,
        extrapolations,
        run_century,
        seconds_per_hour,
    )

    total = century.hours(years)
    stages = [(total, None)] if sample is None else [(min(PILOT, total), None), (sample, period)]
    hours = sum(each for each, _ in stages)
    with progress_bar("measuring the speed"):
        seconds = seconds_per_hour(century)
    unit = "year" if years == 1.0 else "years"
    out.print(
        f"{years:g} {unit}: {total:,} h of production ({100.0 * century.production:.1f} % of the time);"
        f" {hours:,} h are simulated at {3600.0 / seconds:,.0f} times real time:"
        f" {hours * seconds / 3600.0:.2g} core-hours, all hours {total * seconds / 3600.0:.3g}"
    )
    if dry_run:
        return
    where = f"in {folder}; the same command resumes the sample"
    with resumable("sampling", lambda done: f"{done} blocks of this stage are {where}") as update:

        def report(finished, blocks, left):
            update(finished, blocks, f"{finished} of {blocks} blocks, {left / 60.0:.0f} min left")

        found, wall, simulated = run_century(century, folder, stages, progress=report, **machine)
    note(
        f"{simulated:,} h simulated in {wall:.0f} s with {machine['jobs']} processes;"
        f" {found.hours:,} h in all, {found.lost} lost, {found.tripped} with a trip, which are left out"
    )
    with progress_bar("extrapolating") as update:
        expected = extrapolations(runs, period, century.climate, update) if runs else None
    table = century_table(found, period, expected)
    path = folder / FILE
    table.to_csv(path, index=False)
    shown = table[table["load"].isin(SHOWN) & table["value"].notna()]
    headings = (
        "load",
        "side",
        "value",
        "low",
        "high",
        "hours",
        "wind m/s",
        "Hs m",
        "extrapolated",
        "low",
        "high",
    )
    columns = ["load", "side", "value", "low", "high", "exceedances", "wind", "Hs", "extrapolated",
               "extrapolated_low", "extrapolated_high"]  # fmt: skip
    print_table(headings, cells(shown[columns]), f"once in {period:g} years", left=(0, 1))
    missing = table["value"].isna().sum()
    if missing:
        out.print(f"{missing} of {len(table)} values are beyond what {found.hours:,} h can show")
    if text := coverage_text(table):
        out.print(escape(text))
    wrote(path)
