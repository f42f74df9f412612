"""Describes the potential-flow coefficients of a floating body and reads them from files.

All coefficients are dimensional, in SI units, about the body origin and in inertial axes, for small motions
about the undisplaced pose.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fowt_env.descriptions.array_files import read_arrays
from fowt_env.descriptions.files import raise_problems
from fowt_env.descriptions.records import Finite, Positive, Record, checked_record
from fowt_env.errors import InputError

MAX_BYTES = 200_000_000  # of a file of coefficients: a full difference-frequency QTF has about 10 MB


@dataclass(frozen=True, eq=False)
class Qtf:
    """Holds the quadratic transfer function of difference forces, Re(sum a_i a_j* Q_ij exp(i (w_i-w_j) t)).

    Or of sum forces, Re(sum a_i a_j Q_ij exp(i (w_i+w_j) t)). On a grid of frequency pairs and of pairs of
    headings; N/m2 and N m/m2.
    """

    omega: np.ndarray  # (k,) rad/s, increasing
    heading: np.ndarray  # (p, 2) rad, of the two waves
    value: np.ndarray  # (p, k, k, 6) complex, Q(w_i, w_j); nan where the file has none
    of_sums: bool = False

    def mirrored(self, value):
        """Return the values (..., k, k, 6) of the exchanged pairs of frequencies: Q(w_j, w_i)."""
        value = np.swapaxes(value, -3, -2)
        return value if self.of_sums else np.conj(value)


@dataclass(frozen=True, eq=False)
class PotentialFlow:
    """Holds the first- and second-order coefficients of a body, about the body origin, in inertial axes.

    The excitation per metre of amplitude is the force Re(X a exp(i omega t)) in the wave
    a cos(omega t - k x cos(heading) - k y sin(heading)).
    """

    omega: np.ndarray  # (n,) rad/s, increasing, 0 < omega < infinity
    added_mass: np.ndarray  # (n, 6, 6) kg, kg m, kg m2
    damping: np.ndarray  # (n, 6, 6) N/(m/s) ...
    added_mass_infinite: np.ndarray  # (6, 6)
    excitation_omega: np.ndarray  # (k,) rad/s, increasing
    heading: np.ndarray  # (m,) rad, increasing
    excitation: np.ndarray  # (k, m, 6) complex N/m, N m/m
    stiffness: np.ndarray  # (6, 6) hydrostatic, without weight, N/m ...
    volume: float  # displaced, m3
    centre_of_buoyancy: tuple[float, float]  # x, y, m
    added_mass_zero: np.ndarray | None = None  # (6, 6) at zero frequency, where it is known
    difference_qtf: Qtf | None = None
    sum_qtf: Qtf | None = None
    draft: float | None = None  # m, where it is known
    source: str = ""


class _PotentialFlowTable(Record):
    """Holds the table [potential_flow] of a platform file."""

    coefficients: str  # a .npz, or the root of WAMIT's .1, .3 and .hst; relative to the file
    displaced_volume: Positive
    centre_of_buoyancy: tuple[Finite, Finite] = (0.0, 0.0)
    length_scale: Positive = 1.0  # of WAMIT's dimensionless coefficients, m
    draft: Positive | None = None


ARRAYS = {  # of a file, name: shape, with letters for the sizes in SIZES
    "omega": "n", "added_mass": "n66", "damping": "n66", "added_mass_infinite": "66", "excitation_omega": "k",
    "heading": "m", "excitation": "km6", "stiffness": "66", "added_mass_zero": "66", "qtf_omega": "q",
    "qtf_heading": "p2", "qtf_value": "pqq6", "sum_qtf_omega": "s", "sum_qtf_heading": "t2",
    "sum_qtf_value": "tss6",
}  # fmt: skip
SIZES = {
    "n": "omega", "k": "excitation_omega", "m": "heading", "q": "qtf_omega", "p": "qtf_heading",
    "s": "sum_qtf_omega", "t": "sum_qtf_heading",
}  # fmt: skip
LOWEST = dict.fromkeys(("omega", "excitation_omega", "qtf_omega", "sum_qtf_omega"), 0.0)  # exclusive
LOWEST["heading"] = -math.inf
COMPLEX = ("excitation", "qtf_value", "sum_qtf_value")
QTF_ARRAYS = {  # field of PotentialFlow: its arrays, all or none in a file
    field: tuple(f"{start}_{name}" for name in ("omega", "heading", "value"))
    for field, start in (("difference_qtf", "qtf"), ("sum_qtf", "sum_qtf"))
}
OPTIONAL = ("added_mass_zero", *(name for names in QTF_ARRAYS.values() for name in names))


def read_potential_flow(table, folder, gravity, density):
    """Return the PotentialFlow of the table [potential_flow] of a platform file in this folder.

    gravity, density  of the water, for WAMIT's dimensionless coefficients
    Raises: InputError naming the file, the key or the array and what is allowed.
    """
    record = checked_record(_PotentialFlowTable, table, "[potential_flow]")
    path = folder / Path(record.coefficients).expanduser()
    if path.suffix == ".npz":
        body = read_coefficients(path)
    else:
        from fowt_env.descriptions.wamit import read_wamit

        body = read_wamit(path, length_scale=record.length_scale, gravity=gravity, density=density)
    return replace(
        body,
        volume=record.displaced_volume,
        centre_of_buoyancy=record.centre_of_buoyancy,
        draft=record.draft,
    )


def read_coefficients(path):
    """Return the PotentialFlow of a .npz file of coefficient_arrays, without volume, its centre and draft.

    Nothing in the file is executed: only arrays of numbers are read.
    """
    where = f"coefficients file {str(path)!r}"
    try:
        if not path.is_file():
            raise InputError(f"{where} does not exist")
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{where} has {path.stat().st_size} bytes; allowed: at most {MAX_BYTES}")
        arrays = read_arrays(path, MAX_BYTES)
    except InputError:
        raise
    except Exception as error:  # any error of zipfile, zlib and numpy for a broken file
        raise InputError(f"{where} cannot be read: {error!s:.300}") from None
    partial = {name for names in QTF_ARRAYS.values() if not arrays.keys() >= set(names) for name in names}
    used = (*(name for name in ARRAYS if name not in partial), "source")
    arrays = {name: value for name, value in arrays.items() if name in used}
    missing = [name for name in ARRAYS if name not in arrays and name not in OPTIONAL]
    if missing:
        raise InputError(f"{where}: arrays {', '.join(missing)} are missing")
    problems = _array_problems(arrays)
    raise_problems(where, problems)
    values = {
        name: np.ascontiguousarray(value, dtype=complex if name in COMPLEX else float)
        for name, value in arrays.items()
        if name != "source"
    }
    for field, names in QTF_ARRAYS.items():
        parts = [values.pop(name, None) for name in names]
        values[field] = None if parts[0] is None else Qtf(*parts, of_sums=field == "sum_qtf")
    source = str(arrays["source"]) if "source" in arrays else ""
    return PotentialFlow(**values, volume=math.nan, centre_of_buoyancy=(0.0, 0.0), source=source[:2000])


def coefficient_arrays(body):
    """Return {name: array} of a PotentialFlow for savez_compressed, single precision but for frequencies."""
    values = {name: getattr(body, name, None) for name in ARRAYS}
    for field, names in QTF_ARRAYS.items():
        if (qtf := getattr(body, field)) is not None:
            values |= dict(zip(names, (qtf.omega, qtf.heading, qtf.value), strict=True))
    kinds = dict.fromkeys(ARRAYS, np.float32) | dict.fromkeys(COMPLEX, np.complex64)
    kinds |= dict.fromkeys((*LOWEST, "qtf_heading", "sum_qtf_heading"))  # dtype unchanged
    arrays = {name: np.asarray(value, kinds[name]) for name, value in values.items() if value is not None}
    return arrays | {"source": np.array(body.source)}


def _array_problems(arrays):
    """Return the problems of the arrays of a file, one line each."""
    problems = []
    for name, value in arrays.items():
        if name == "source":
            continue
        if value.dtype.kind not in ("fiuc" if name in COMPLEX else "fiu"):
            problems.append(f"{name}: must be numbers, is {value.dtype}")
        elif not name.endswith("qtf_value") and not np.isfinite(value).all():
            problems.append(f"{name}: must be finite numbers")
    if problems:
        return problems
    sizes = {letter: len(np.atleast_1d(arrays[name])) for letter, name in SIZES.items() if name in arrays}
    for name in (name for name in ARRAYS if name in arrays):
        shape = tuple(sizes[axis] if axis in sizes else int(axis) for axis in ARRAYS[name])
        if arrays[name].shape != shape:
            problems.append(f"{name}: has the shape {arrays[name].shape}; must be {shape}")
    for name, low in LOWEST.items():
        if name in arrays and not problems:
            if not (arrays[name].size > 0 and arrays[name][0] > low and (np.diff(arrays[name]) > 0).all()):
                problems.append(f"{name}: must increase{'' if name == 'heading' else ' and be > 0'}")
    return problems
