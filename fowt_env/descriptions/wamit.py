"""Reads WAMIT's numeric output of one body: files .1, .3, .hst, .12d and .12s."""

import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from fowt_env.descriptions.files import read_text
from fowt_env.descriptions.potential_flow import MAX_BYTES, PotentialFlow, Qtf
from fowt_env.errors import InputError

MODES = 6
NEGATIVE_DAMPING = 0.02  # largest negative diagonal damping due to rounding, fraction of the mode's maximum
_LIMITS = {-1.0: "zero frequency (period < 0)", 0.0: "infinite frequency (period = 0)"}


def read_wamit(
    root: str | Path, *, length_scale: float, gravity: float, density: float, excitation: tuple | None = None
) -> PotentialFlow:
    """Return the PotentialFlow of root.1, root.3, root.hst and, if present, root.12d and root.12s, in SI.

    root          path without the extension; the case of file names is ignored
    length_scale  WAMIT's ULEN, m; gravity (m/s2) and density (kg/m3) of the water
    excitation    (omega (k,) rad/s, heading (m,) rad, force (k, m, 6) complex N/m) in place of root.3

    The displaced volume is nan and the centre of buoyancy (0, 0), as no file contains them. A period < 0
    means zero frequency, a period of 0 infinite frequency. Modes that a file does not list are zero.
    Raises: InputError naming file, line and value.
    """
    root, scale = Path(root), float(length_scale)
    water = density * gravity
    omega, added, damping, zero, infinite = _read_radiation(_path(root, ".1", "added mass and damping"))
    power = scale ** _powers(3)
    if excitation is not None:
        excitation_omega, heading, force = (np.asarray(part) for part in excitation)
    else:
        excitation_omega, heading, force = _read_excitation(_path(root, ".3", "wave excitation"))
        force = force * water * scale ** np.array([2.0] * 3 + [3.0] * 3)
    stiffness = _read_stiffness(_path(root, ".hst", "hydrostatic stiffness"))
    qtfs = {}
    for field, ending in (("difference_qtf", ".12d"), ("sum_qtf", ".12s")):
        if (quadratic := _path(root, ending)) is not None:
            qtf = _read_qtf(quadratic, of_sums=field == "sum_qtf")
            dimension = water * scale ** np.array([1.0] * 3 + [2.0] * 3)
            qtfs[field] = replace(qtf, value=qtf.value * dimension)
    return PotentialFlow(
        omega=omega,
        added_mass=added * density * power,
        damping=damping * density * power * omega[:, None, None],
        added_mass_infinite=infinite * density * power,
        added_mass_zero=None if zero is None else zero * density * power,
        excitation_omega=excitation_omega,
        heading=heading,
        excitation=np.ascontiguousarray(force, dtype=complex),
        stiffness=stiffness * water * scale ** _powers(2),
        volume=math.nan,
        centre_of_buoyancy=(0.0, 0.0),
        **qtfs,
        source=f"WAMIT files {root.name}",
    )


def _powers(least):
    """Return (6, 6) powers of the length: least between forces, one more for every moment or angle."""
    turns = np.array([0.0] * 3 + [1.0] * 3)
    return least + turns[:, None] + turns


def _path(root, ending, needed=None):
    """Return the path of root with an extension, ignoring case; None if there is no such file.

    needed: contents of a required file, for the message. Raises: InputError.
    """
    exact, match = root.with_name(root.name + ending), None
    try:
        if exact.is_file():
            return exact
        same = (path for path in sorted(exact.parent.iterdir()) if path.name.lower() == exact.name.lower())
        match = next(same, None)
    except (OSError, ValueError):
        pass
    if match is None and needed is not None:
        raise InputError(f"WAMIT file {str(root)[:200] + ending!r} ({needed}) does not exist")
    return match


class _Rows:
    """Holds the rows [(line number, [floats])] of a WAMIT file with one of the allowed column counts.

    Lines above the first row that do not begin with a number are skipped: WAMIT writes a title there.
    """

    def __init__(self, path, *sizes):
        self.path, self.rows = path, []
        for number, line in enumerate(read_text(path, "WAMIT", MAX_BYTES).splitlines(), 1):
            cells = line.split()
            if not cells:
                continue
            try:
                values = [_number(cell) for cell in cells]
            except ValueError as error:
                if not self.rows and not cells[0][0].isdigit() and cells[0][0] not in "+-.":
                    continue
                raise self.refusal(str(error), number) from None
            if len(values) not in sizes:
                expected = " or ".join(map(str, sizes))
                raise self.refusal(f"has {len(values)} columns; expected {expected}", number, "")
            self.rows.append((number, values))
        if not self.rows:
            raise self.refusal("has no rows of numbers", mark="")

    def refusal(self, what, line=None, mark=":"):
        """Return the InputError about the file and, optionally, a line number."""
        where = f"WAMIT file {str(self.path)!r}"
        return InputError(f"{where}{mark} {what}" if line is None else f"{where}: line {line}{mark} {what}")

    def mode(self, line, value):
        """Return the index of a mode 1 to 6. Raises: InputError, also for modes of further bodies."""
        if value != int(value) or not 1 <= value <= MODES:
            allowed = "must be 1 to 6; files of several bodies are not read"
            raise self.refusal(f"mode {value:g}: {allowed}", line)
        return int(value) - 1

    def frequency(self, line, period):
        """Return 2 pi / period, rad/s. Raises: InputError for a period out of range."""
        omega = 2.0 * math.pi / period if period > 0.0 else 0.0
        if not 1e-6 < omega < 1e6:
            raise self.refusal(f"period {period:g} s: must be 1e-5 to 1e6 s", line)
        return omega

    def heading(self, line, value):
        """Return a heading, deg. Raises: InputError for a heading out of range."""
        if not -360.0 <= value <= 360.0:
            raise self.refusal(f"heading {value:g} deg: must be -360 to 360", line)
        return value

    def put(self, table, key, value, line, what):
        """Add a row to a table. Raises: InputError if the table has the key already."""
        if key in table:
            raise self.refusal(f"{what} listed twice", line)
        table[key] = value


def _number(cell):
    """Return a finite number in Fortran or C notation. Raises: ValueError."""
    try:
        value = float(cell.replace("D", "E").replace("d", "e")) if "_" not in cell else math.nan
    except ValueError:
        raise ValueError(f"{cell[:40]!r} is not a number") from None
    if not math.isfinite(value):
        raise ValueError(f"{cell[:40]!r} is not a finite number")
    return value


def _read_radiation(path):
    """Return (omega, added mass, damping, added mass at zero, at infinite frequency), dimensionless."""
    file = _Rows(path, 4, 5)
    tables, first = {}, {}
    for line, (period, i, j, *values) in file.rows:
        key = -1.0 if period < 0.0 else period
        entry = (file.mode(line, i), file.mode(line, j))
        first.setdefault(key, line)
        what = f"entry {i:g} {j:g} of period {period:g} s is"
        file.put(tables.setdefault(key, {}), entry, values, line, what)
        if key > 0.0 and len(values) < 2:
            raise file.refusal(f"has no damping: the period {period:g} s is finite", line, "")
    if 0.0 not in tables:
        raise file.refusal(
            "no rows of infinite frequency (period 0): the added mass there is needed for the"
            " equation of motion; let WAMIT compute it (a period of 0 in its .pot file)"
        )
    periods = sorted((key for key in tables if key > 0.0), reverse=True)
    if len(periods) < 3:
        raise file.refusal(f"{len(periods)} finite frequencies; needed: at least 3")
    entries = set().union(*tables.values())
    matrices = {}
    for key, table in tables.items():
        if missing := entries - set(table):
            i, j = sorted(missing)[0]
            name = _LIMITS.get(key, f"period {key:g} s")
            raise file.refusal(f"{name} has no entry {i + 1} {j + 1}, others have", first[key])
        matrices[key] = matrix = np.zeros((2, MODES, MODES))
        for (i, j), values in table.items():
            matrix[: len(values), i, j] = values
            if (j, i) not in table:
                matrix[: len(values), j, i] = values
    omega = np.array([file.frequency(first[period], period) for period in periods])
    both = np.array([matrices[period] for period in periods])
    for i in range(MODES):  # with negative damping larger than rounding a body gains energy
        values = both[:, 1, i, i] * omega
        worst, largest = int(np.argmin(values)), np.abs(values).max()
        if values[worst] < -NEGATIVE_DAMPING * largest:
            fraction = f"{values[worst] / largest:.1%} of the mode's largest"
            raise file.refusal(
                f"damping {i + 1} {i + 1} at {omega[worst]:.4g} rad/s is negative: {fraction};"
                f" allowed: at least {-NEGATIVE_DAMPING:.0%}"
            )
    zero = matrices[-1.0][0] if -1.0 in matrices else None
    return omega, both[:, 0].copy(), both[:, 1].copy(), zero, matrices[0.0][0]


def _read_excitation(path):
    """Return (omega, heading, dimensionless force (k, m, 6)) of a .3 file without zero, infinite periods."""
    file, table = _Rows(path, 7), {}
    for line, (period, heading, i, _, _, real, imaginary) in file.rows:
        mode = file.mode(line, i)
        if period <= 0.0:
            continue
        key = period, file.heading(line, heading), mode + 1
        file.frequency(line, period)
        file.put(table, key, complex(real, imaginary), line, "period, heading and mode are")
    if not table:
        raise file.refusal("has no rows of a finite frequency", mark="")
    periods, headings, modes = (sorted(set(axis)) for axis in zip(*table, strict=True))
    for key in product(periods, headings, modes):
        if key not in table:
            text = "period {:g}, heading {:g}, mode {:g}".format(*key)
            raise file.refusal(f"no row of {text}, although other rows have each of these values")
    periods = periods[::-1]
    force = np.zeros((len(periods), len(headings), MODES), dtype=complex)
    for mode in modes:
        force[:, :, mode - 1] = [[table[period, heading, mode] for heading in headings] for period in periods]
    omega = np.array([2.0 * math.pi / period for period in periods])
    return omega, np.radians(headings), force


def _read_stiffness(path):
    """Return the dimensionless stiffness (6, 6) of a .hst file."""
    file, table = _Rows(path, 3), {}
    for line, (i, j, value) in file.rows:
        entry = file.mode(line, i), file.mode(line, j)
        file.put(table, entry, value, line, f"entry {i:g} {j:g} is")
    if missing := [i + 1 for i in range(2, 5) if (i, i) not in table]:
        raise file.refusal(f"no entry {missing[0]} {missing[0]}")
    stiffness = np.zeros((MODES, MODES))
    for entry, value in table.items():
        stiffness[entry] = value
    return stiffness


def _read_qtf(path, of_sums):
    """Return the dimensionless Qtf of a .12d or .12s file (of_sums); nan for missing entries.

    Entries on one side of the diagonal are copied to the other, with the headings exchanged: Q(j, i) is the
    conjugate of Q(i, j) for differences, and equal to it for sums.
    """
    file, table = _Rows(path, 9), {}
    for line, (first, second, one, other, i, _, _, real, imaginary) in file.rows:
        mode = file.mode(line, i)
        for period in (first, second):
            file.frequency(line, period)
        key = file.heading(line, one), file.heading(line, other), first, second, mode
        file.put(table, key, complex(real, imaginary), line, "periods, headings and mode are")
    periods = sorted({period for key in table for period in key[2:4]}, reverse=True)
    headings = sorted({pair for one, other, *_ in table for pair in ((one, other), (other, one))})
    row = {period: k for k, period in enumerate(periods)}
    column = {pair: k for k, pair in enumerate(headings)}
    if len(headings) * len(periods) ** 2 * MODES > 30 * len(table) + 1_000_000:
        what = f"{len(table)} rows for {len(periods)} frequencies and {len(headings)} pairs of headings"
        raise file.refusal(f"{what}: not a grid")
    value = np.full((len(headings), len(periods), len(periods), MODES), np.nan, dtype=complex)
    for (one, other, first, second, mode), force in table.items():
        value[column[other, one], row[second], row[first], mode] = force if of_sums else force.conjugate()
    for (one, other, first, second, mode), force in table.items():  # overwrites copied entries
        value[column[one, other], row[first], row[second], mode] = force
    omega = np.array([2.0 * math.pi / period for period in periods])
    missing = set(range(MODES)) - {key[4] for key in table}
    value[..., sorted(missing)] = np.where(np.isnan(value).all(axis=-1), np.nan, 0.0)[..., None]
    return Qtf(omega, np.radians(np.array(headings)), value, of_sums)
