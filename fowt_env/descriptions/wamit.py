"""Reading of WAMIT's numeric output: .1, .3, .hst and .12d of one body."""

import math
from pathlib import Path

import numpy as np

from fowt_env.descriptions.files import read_text
from fowt_env.descriptions.potential_flow import MAX_BYTES, DifferenceQtf, PotentialFlow
from fowt_env.errors import InputError

MODES = 6
NEGATIVE_DAMPING = 0.02  # fraction of a mode's largest that rounding may leave below zero on the diagonal
_LIMITS = {-1.0: "zero frequency (period < 0)", 0.0: "infinite frequency (period = 0)"}


def read_wamit(
    root: str | Path, *, length_scale: float, gravity: float, density: float, excitation: tuple | None = None
) -> PotentialFlow:
    """PotentialFlow of root.1, root.3, root.hst and, where there is one, root.12d, in SI units.

    root          path without the ending; the case of the file's name does not matter
    length_scale  WAMIT's ULEN, m; gravity (m/s2) and density (kg/m3) of the water
    excitation    (omega (k,) rad/s, heading (m,) rad, force (k, m, 6) complex N/m) in place of root.3

    The displaced volume is nan and the centre of buoyancy (0, 0): none of the files has them. A period below
    0 is the zero frequency and 0 the infinite one. Modes that a file does not list are zero.
    Raises: InputError naming file, line and figure.
    """
    root, scale = Path(root), float(length_scale)
    water = density * gravity
    omega, added, damping, zero, infinite = _read_radiation(_found(root, ".1", "added mass and damping"))
    power = scale ** _powers(3)
    place = None if excitation is not None else _found(root, ".3", "wave excitation")
    if place is None:
        excitation_omega, heading, force = (np.asarray(part) for part in excitation)
    else:
        excitation_omega, heading, force = _read_excitation(place)
        force = force * water * scale ** np.array([2.0] * 3 + [3.0] * 3)
    stiffness = _read_stiffness(_found(root, ".hst", "hydrostatic stiffness"))
    quadratic = _path(root, ".12d")
    qtf = None
    if quadratic is not None:
        qtf_omega, pairs, value = _read_qtf(quadratic)
        value = value * water * scale ** np.array([1.0] * 3 + [2.0] * 3)
        qtf = DifferenceQtf(qtf_omega, pairs, value)
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
        difference_qtf=qtf,
        source=f"WAMIT files {root.name}",
    )


def _powers(least):
    """(6, 6) powers of the length: least between forces, one more for every moment or angle."""
    turns = np.array([0.0] * 3 + [1.0] * 3)
    return least + turns[:, None] + turns


def _path(root, ending):
    """Path of root with an ending, whatever the case of its name; None where there is no such file."""
    exact = root.with_name(root.name + ending)
    try:
        if exact.is_file():
            return exact
        wanted = exact.name.lower()
        return next((path for path in sorted(exact.parent.iterdir()) if path.name.lower() == wanted), None)
    except (OSError, ValueError):
        return None


def _found(root, ending, content):
    """The same for a file that must be there. Raises: InputError."""
    path = _path(root, ending)
    if path is None:
        raise InputError(f"WAMIT file {str(root)[:200] + ending!r} ({content}) does not exist")
    return path


def _rows(path, sizes):
    """[(line number, [floats])] of a WAMIT file whose rows have one of these numbers of columns.

    Lines that begin with no number are skipped above the first row, where WAMIT writes a title.
    """
    where, rows = f"WAMIT file {str(path)!r}", []
    for number, line in enumerate(read_text(path, "WAMIT", MAX_BYTES).splitlines(), 1):
        cells = line.split()
        if not cells:
            continue
        try:
            values = [_number(cell) for cell in cells]
        except ValueError as error:
            if not rows and not cells[0][0].isdigit() and cells[0][0] not in "+-.":
                continue
            raise InputError(f"{where}: line {number}: {error}") from None
        if len(values) not in sizes:
            allowed = " or ".join(str(size) for size in sizes)
            raise InputError(f"{where}: line {number} has {len(values)} columns; expected {allowed}")
        rows.append((number, values))
    if not rows:
        raise InputError(f"{where} has no rows of numbers")
    return where, rows


def _number(cell):
    """A finite number in Fortran's or C's notation. Raises: ValueError."""
    try:
        value = float(cell) if "_" not in cell else math.nan
    except ValueError:
        try:
            value = float(cell.replace("D", "E").replace("d", "e"))
        except ValueError:
            raise ValueError(f"{cell[:40]!r} is not a number") from None
    if not math.isfinite(value):
        raise ValueError(f"{cell[:40]!r} is not a finite number")
    return value


def _mode(where, number, value):
    """Index of a mode 1 to 6. Raises: InputError, also for further bodies."""
    if value != int(value) or not 1 <= value <= MODES:
        raise InputError(
            f"{where}: line {number}: mode {value:g}: must be 1 to {MODES}; files of several bodies are not"
            " read"
        )
    return int(value) - 1


def _frequency(where, number, period):
    """2 pi / period, rad/s. Raises: InputError where that is no positive finite number."""
    omega = 2.0 * math.pi / period if period > 0.0 else 0.0
    if not 1e-6 < omega < 1e6:
        raise InputError(f"{where}: line {number}: period {period:g} s: must be 1e-5 to 1e6 s")
    return omega


def _read_radiation(path):
    """(omega, added mass, damping, that at zero and infinite frequency) of a .1 file, dimensionless."""
    where, rows = _rows(path, (4, 5))
    tables, first = {}, {}
    for number, (period, i, j, *values) in rows:
        key = -1.0 if period < 0.0 else period
        entry = (_mode(where, number, i), _mode(where, number, j))
        table = tables.setdefault(key, {})
        first.setdefault(key, number)
        if entry in table:
            raise InputError(
                f"{where}: line {number}: entry {i:g} {j:g} of period {period:g} s is there twice"
            )
        if key > 0.0 and len(values) < 2:
            raise InputError(f"{where}: line {number} has no damping: the period {period:g} s is finite")
        table[entry] = values
    if 0.0 not in tables:
        raise InputError(
            f"{where}: no rows of infinite frequency (period 0): the added mass there is needed for the"
            " equation of motion; let WAMIT compute it (a period of 0 in its .pot file)"
        )
    periods = sorted((key for key in tables if key > 0.0), reverse=True)
    if len(periods) < 3:
        raise InputError(f"{where}: {len(periods)} finite frequencies; needed: at least 3")
    entries = set().union(*tables.values())
    matrices = {}
    for key, table in tables.items():
        if missing := entries - set(table):
            i, j = sorted(missing)[0]
            name = _LIMITS.get(key, f"period {key:g} s")
            raise InputError(f"{where}: line {first[key]}: {name} has no entry {i + 1} {j + 1}, others have")
        matrix = np.zeros((2, MODES, MODES))
        for (i, j), values in table.items():
            matrix[: len(values), i, j] = values
            if (j, i) not in table:
                matrix[: len(values), j, i] = values
        matrices[key] = matrix
    omega = np.array([_frequency(where, first[period], period) for period in periods])
    both = np.array([matrices[period] for period in periods])
    _check_damping(where, omega, both[:, 1] * omega[:, None, None])
    zero = matrices[-1.0][0] if -1.0 in matrices else None
    return omega, both[:, 0].copy(), both[:, 1].copy(), zero, matrices[0.0][0]


def _check_damping(where, omega, damping):
    """Refuse a diagonal damping that is negative by more than rounding: such a body gains energy."""
    for i in range(MODES):
        values = damping[:, i, i]
        worst = int(np.argmin(values))
        if values[worst] < -NEGATIVE_DAMPING * np.abs(values).max():
            share = values[worst] / np.abs(values).max()
            raise InputError(
                f"{where}: damping {i + 1} {i + 1} at {omega[worst]:.4g} rad/s is negative: {share:.1%} of"
                f" the mode's largest; allowed: at least {-NEGATIVE_DAMPING:.0%}"
            )


def _grid(where, table, kinds):
    """Raise InputError unless the keys of a table are a whole grid of values; they are line numbers."""
    axes = [sorted({key[k] for key in table}) for k in range(len(kinds))]
    if len(table) != math.prod(len(axis) for axis in axes):
        for key in _product(axes):
            if key not in table:
                text = ", ".join(f"{kind} {value:g}" for kind, value in zip(kinds, key, strict=True))
                raise InputError(f"{where}: no row of {text}, though others have each of these")
    return axes


def _product(axes):
    """Tuples of all combinations."""
    if not axes:
        yield ()
        return
    for value in axes[0]:
        for rest in _product(axes[1:]):
            yield (value, *rest)


def _read_excitation(path):
    """(omega, heading, dimensionless force (k, m, 6)) of a .3 file; zero and infinite periods left out."""
    where, rows = _rows(path, (7,))
    table = {}
    for number, (period, heading, i, _, _, real, imaginary) in rows:
        mode = _mode(where, number, i)
        if period <= 0.0:
            continue
        if not -360.0 <= heading <= 360.0:
            raise InputError(f"{where}: line {number}: heading {heading:g} deg: must be -360 to 360")
        _frequency(where, number, period)
        key = (period, heading, mode + 1)
        if key in table:
            raise InputError(f"{where}: line {number}: period, heading and mode are there twice")
        table[key] = complex(real, imaginary)
    if not table:
        raise InputError(f"{where} has no rows of a finite frequency")
    periods, headings, modes = _grid(where, table, ("period", "heading", "mode"))
    periods = periods[::-1]
    force = np.zeros((len(periods), len(headings), MODES), dtype=complex)
    for mode in modes:
        force[:, :, mode - 1] = [[table[period, heading, mode] for heading in headings] for period in periods]
    omega = np.array([2.0 * math.pi / period for period in periods])
    return omega, np.radians(headings), force


def _read_stiffness(path):
    """Dimensionless (6, 6) of a .hst file."""
    where, rows = _rows(path, (3,))
    stiffness, seen = np.zeros((MODES, MODES)), set()
    for number, (i, j, value) in rows:
        entry = (_mode(where, number, i), _mode(where, number, j))
        if entry in seen:
            raise InputError(f"{where}: line {number}: entry {i:g} {j:g} is there twice")
        seen.add(entry)
        stiffness[entry] = value
    if missing := [(i + 1, i + 1) for i in range(2, 5) if (i, i) not in seen]:
        raise InputError(f"{where}: no entry {missing[0][0]} {missing[0][1]}")
    return stiffness


def _read_qtf(path):
    """(omega, heading pairs rad, dimensionless (p, k, k, 6)) of a .12d file; nan where it has none.

    What it has of one side of the diagonal is filled in on the other: Q(j, i) = conj Q(i, j), with the
    headings exchanged.
    """
    where, rows = _rows(path, (9,))
    periods, pairs, seen = set(), set(), {}
    for number, (first, second, one, other, i, _, _, real, imaginary) in rows:
        mode = _mode(where, number, i)
        for period in (first, second):
            _frequency(where, number, period)
        for heading in (one, other):
            if not -360.0 <= heading <= 360.0:
                raise InputError(f"{where}: line {number}: heading {heading:g} deg: must be -360 to 360")
        key = (one, other, first, second, mode)
        if key in seen:
            raise InputError(f"{where}: line {number}: periods, headings and mode are there twice")
        seen[key] = complex(real, imaginary)
        periods |= {first, second}
        pairs |= {(one, other), (other, one)}
    ordered, headings = sorted(periods, reverse=True), sorted(pairs)
    row = {period: k for k, period in enumerate(ordered)}
    place = {pair: k for k, pair in enumerate(headings)}
    size = len(headings) * len(ordered) ** 2 * MODES
    if size > 30 * len(seen) + 1_000_000:
        raise InputError(
            f"{where}: {len(seen)} rows for {len(ordered)} frequencies and {len(headings)} pairs of headings:"
            " not a grid"
        )
    value = np.full((len(headings), len(ordered), len(ordered), MODES), np.nan, dtype=complex)
    for given in (False, True):  # what the file has goes over what follows from it
        for (one, other, first, second, mode), force in seen.items():
            if given:
                value[place[one, other], row[first], row[second], mode] = force
            else:
                value[place[other, one], row[second], row[first], mode] = force.conjugate()
    omega = np.array([2.0 * math.pi / period for period in ordered])
    missing = set(range(MODES)) - {key[4] for key in seen}
    value[..., sorted(missing)] = np.where(np.isnan(value).all(axis=-1), np.nan, 0.0)[..., None]
    return omega, np.radians(np.array(headings)), value
