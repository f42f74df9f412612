"""Writes a design load table as spreadsheets in the layout of IEA-22's (outputs/04_design_loads).

    <name>_DLB_directional_extreme_loads.xlsx        sensor_name, angle, sensor_unit, group, value
    <name>_DLB_directional_equivalent_loads.xlsx     sensor_name, angle, m, sensor_unit, value
    <name>_DLB_directional_extreme_loads_blade_full.xlsx   a sheet per blade root: angle, Fx ... Mz, group

Of one controller. Values are with the partial factor, as there; those of the last file are the simultaneous
loads of the driving run times its factor. Directions are those of OpenFAST's axes: at 0 deg the moment about
x, at 90 deg that about y. Needs openpyxl: pip install "fowt-env[sheets]".
"""

from pathlib import Path

from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.training.loads.extremes import extreme_table
from fowt_env.training.loads.fatigue import lifetime_table
from fowt_env.training.loads.selection import columns_of, runs_of
from fowt_env.training.loads.statistics import BLADES, EXPONENTS, direction_column, rose_of

ANGLES = tuple(range(-150, 181, 30))  # deg
FORCES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def write_spreadsheets(folder, name, results, controller=None):
    """Write the three spreadsheets of LoadTables for a controller to a folder; return their paths.

    controller: None: the baseline. The third file is left out for a rotor without loads of each blade.
    Raises: InputError for an unknown controller, or if openpyxl is missing.
    """
    workbook = _workbook()
    controller = results.baseline if controller is None else controller
    if controller not in results.controllers:
        raise InputError(f"controller = {controller!r}: must be one of {', '.join(results.controllers)}")
    runs = runs_of(results.runs, controller)
    rose = rose_of([column.partition("_[")[0] for column in columns_of(runs)])
    columns = [column for pair in rose.values() for column in _columns(pair).values()]
    extremes = {
        (row.column, row.side): row
        for row in extreme_table(runs, columns, controller, results.extrapolations)
    }
    sheets = {}
    # none of load cases for fatigue alone; DLC 1.1 alone has values of the extrapolated directions only
    directed = extremes and all(
        _at_angle(pair, angle) in extremes for pair in rose.values() for angle in ANGLES
    )
    if directed:
        sheets["extreme_loads"] = {"Sheet1": _extreme_rows(rose, extremes)}
    fatigue = lifetime_table(runs, EXPONENTS, results.years, results.reference_cycles, controller)
    if fatigue:
        sheets["equivalent_loads"] = {"Sheet1": _fatigue_rows(rose, fatigue)}
    if directed and (blades := _blade_sheets(rose, extremes)):
        sheets["extreme_loads_blade_full"] = blades
    paths = []
    for kind, tables in sheets.items():
        paths.append(Path(folder) / f"{name}_DLB_directional_{kind}.xlsx")
        book = workbook()
        book.remove(book.active)
        for title, rows in tables.items():
            sheet = book.create_sheet(title)
            for row in rows:
                sheet.append(row)
        with replacing(paths[-1]) as temporary:
            book.save(temporary)
    return paths


def _workbook():
    """Return openpyxl.Workbook. Raises: InputError naming the install command."""
    try:
        from openpyxl import Workbook
    except ImportError as error:
        raise InputError(f'spreadsheets need openpyxl ({error}): pip install "fowt-env[sheets]"') from error
    return Workbook


def _columns(pair):
    """Return {angle in [0, 180): column} of the moments of a pair of channels."""
    ends = {0: f"{pair[0]}_[kN-m]", 90: f"{pair[1]}_[kN-m]"}
    return {angle: ends.get(angle) or direction_column(pair, angle) for angle in range(0, 180, 30)}


def _at_angle(pair, angle):
    """Return (column, side) whose extreme is that of an angle in ANGLES; opposite ones are least values."""
    if 0 <= angle < 180:
        return _columns(pair)[angle], "max"
    return _columns(pair)[angle % 180], "min"


def _sensor(interface):
    """Return the name of a bending moment in IEA-22's tables; the root is node 1 of a blade."""
    return f"{interface.replace(' root', ' node 1')} bending moment"


def _extreme_rows(rose, extremes):
    """Return the rows of directional extremes; where a moment never acts in a direction the value is 0."""
    rows = [["sensor_name", "angle", "sensor_unit", "group", "value"]]
    for interface, pair in rose.items():
        for angle in ANGLES:
            row = extremes[_at_angle(pair, angle)]
            value = row.factored if row.side == "max" else -row.factored
            rows.append([_sensor(interface), angle, "kNm", _group(row), max(value, 0.0)])
    return rows


def _group(row):
    """Return the group of the driving case as there: DLC13_wsp12."""
    return f"DLC{row.dlc.replace('.', '')}_{row.name}"


def _fatigue_rows(rose, fatigue):
    """Return the rows of directional lifetime equivalent loads, the same in opposite directions."""
    found = {(row.column, row.exponent): row.value for row in fatigue}
    rows = [["sensor_name", "angle", "m", "sensor_unit", "value"]]
    for interface, pair in rose.items():
        for exponent in EXPONENTS:
            for angle in ANGLES:
                value = found[_columns(pair)[angle % 180], exponent]
                rows.append([_sensor(interface), angle, exponent, "kNm", value])
    return rows


def _blade_sheets(rose, extremes):
    """Return {sheet: rows} of the simultaneous loads of each blade root at its directional extremes."""
    sheets = {}
    for i in BLADES:
        pair = rose.get(f"Blade {i} root")
        if pair is None:
            continue
        names = [f"RootFxc{i}_[kN]", f"RootFyc{i}_[kN]", f"RootFzc{i}_[kN]"]
        names += [f"{pair[0]}_[kN-m]", f"{pair[1]}_[kN-m]", f"RootMzc{i}_[kN-m]"]
        rows = [["angle", *FORCES, "group"]]
        for angle in ANGLES:
            row = extremes[_at_angle(pair, angle)]
            values = [row.factor * row.at[name] if name in row.at else None for name in names]
            rows.append([angle, *values, _group(row)])
        sheets[f"Blade {i} node 1"] = rows
    return sheets
