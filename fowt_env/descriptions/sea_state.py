"""Describes sea states by name, mapping or file, and joint tables of sea states against wind speed."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import model_validator

from fowt_env.caches import cached
from fowt_env.descriptions.checks import check_number, is_number, parse_number, short
from fowt_env.descriptions.files import DATA, json_text, locate, read_toml
from fowt_env.descriptions.records import (
    FloatArray,
    NonNegative,
    NumberOrArray,
    Record,
    bounded,
    checked_entries,
    checked_record,
    unknown_key,
)
from fowt_env.errors import InputError

STANDARD_GRAVITY = 9.80665  # m/s2
LOWEST_WAVE = 1e-9  # m; the spectrum of a smaller non-zero height would underflow

SEA_KEYS = {  # kind: (required keys, optional keys); the common keys are allowed for every kind
    "still": ((), ()),
    "regular": (("H", "T"), ("phase",)),
    "jonswap": (("Hs", "Tp"), ("gamma",)),
    "pierson_moskowitz": (("Hs",), ("Tp",)),
    "components": (("omega", "amplitude"), ("phase",)),
}
TEXT_KEYS = {  # kind of sea in the text form KIND:NUMBER:NUMBER ...: (keys, how many are required)
    "regular": (("H", "T"), 2),
    "jonswap": (("Hs", "Tp", "gamma"), 2),
    "pierson_moskowitz": (("Hs", "Tp"), 1),
}
COMMON_SEA_KEYS = ("name", "kind", "heading", "ramp", "wind", "source", "confidence")


Period = bounded(ge=0.01, le=10_000.0)  # s; wider than any sea or tank, and sums over waves stay finite


LISTED = "fowt list seas"  # the command that prints the names
SEA_FORMS = "KIND:NUMBERS (jonswap:4:9, regular:3:5), a mapping with 'kind'"


class SeaState(Record):
    """Describes the waves of one kind; the fields of other kinds are None.

    still: none. regular: H (m, crest to trough), T (s), phase (rad, 0).
    jonswap: Hs (m), Tp (s), gamma (1 to 10; the IEC rule of iec_gamma if omitted).
    pierson_moskowitz: Hs, Tp (fully developed sea of that Hs if omitted).
    components: omega (rad/s), amplitude (m), phase (rad, 0 if omitted), of equal length; a single phase is
    expanded to an array. heading may be one number or an array.
    """

    kind: Literal["still", "regular", "jonswap", "pierson_moskowitz", "components"]
    name: str = ""
    heading: NumberOrArray = 0.0  # deg: direction of travel from +x towards +y
    ramp: NonNegative = 0.0  # s: waves grow from zero over this time
    wind: NonNegative | None = None  # m/s at hub height, associated with this sea state
    H: NonNegative | None = None
    T: Period | None = None
    phase: NumberOrArray | None = None
    Hs: NonNegative | None = None
    Tp: Period | None = None
    gamma: bounded(ge=1, le=10) | None = None
    omega: FloatArray | None = None
    amplitude: FloatArray | None = None
    source: str = ""
    confidence: str = ""

    @property
    def height(self) -> float:
        """Return the wave height, m: H or Hs, of components the largest possible sum; 0: still water."""
        if self.kind == "components":
            return 2.0 * float(np.sum(self.amplitude))
        return (self.H if self.kind == "regular" else self.Hs) or 0.0

    @model_validator(mode="before")
    @classmethod
    def _kind_keys(cls, data):
        """Check the keys against the kind and compute defaults that the kind defines by a rule."""
        if not isinstance(data, dict) or str(data.get("kind")) not in SEA_KEYS:
            return data
        kind = data["kind"]
        required, optional = SEA_KEYS[kind]
        entries = {key: value for key, value in data.items() if value is not None}
        known = (*required, *optional, *COMMON_SEA_KEYS)
        needs = f"kind {kind!r} needs {', '.join(required)}"
        problems = [unknown_key(key, key, known) + f" (kind {kind!r})" for key in entries if key not in known]
        problems += [f"{key} is missing: {needs}" for key in required if key not in entries]
        if problems:
            raise ValueError("\n".join(problems))
        if "phase" in optional:
            entries.setdefault("phase", 0.0)
        if kind == "components" and is_number(entries["phase"]):
            entries["phase"] = np.full(np.size(entries["omega"]), float(entries["phase"]))
        if kind == "jonswap" and "gamma" not in entries and _usable(entries["Hs"], entries["Tp"]):
            entries["gamma"] = iec_gamma(float(entries["Hs"]), float(entries["Tp"]))
        if kind == "pierson_moskowitz" and "Tp" not in entries and _usable(entries["Hs"]):
            entries["Tp"] = fully_developed_period(float(entries["Hs"]))
        return entries

    def _problems(self):
        if self.kind != "components":
            for name, value in (("heading", self.heading), ("phase", self.phase)):
                if isinstance(value, np.ndarray):
                    yield f"{name} = {short(value.tolist())}: must be one number for kind {self.kind!r}"
            if self.Hs is not None and 0.0 < self.Hs < LOWEST_WAVE:
                yield f"Hs = {self.Hs:g}: must be 0, or at least {LOWEST_WAVE:g} m"
            return
        sizes = {"omega": len(self.omega), "amplitude": len(self.amplitude)}
        sizes |= {key: len(getattr(self, key)) for key in ("phase", "heading") if np.ndim(getattr(self, key))}
        if len(set(sizes.values())) != 1:
            yield f"{', '.join(sizes)}: need the same length; got {', '.join(map(str, sizes.values()))}"
            return
        for name, bad, rule in (
            ("omega", self.omega <= 0.0, "a number > 0"),
            ("amplitude", self.amplitude < 0.0, "a number >= 0"),
        ):
            if bad.any():
                first = int(np.argmax(bad))
                yield f"{name}.{first + 1} = {getattr(self, name)[first]}: must be {rule}"


class JointTable(Record):
    """Holds the sea states of a site against wind speed at hub height."""

    name: str = ""
    wind: tuple[NonNegative, ...]  # m/s, increasing
    Hs: tuple[NonNegative, ...]
    Tp: tuple[Period, ...]
    source: str = ""
    confidence: str = ""

    def _problems(self):
        sizes = [len(self.wind), len(self.Hs), len(self.Tp)]
        if len(set(sizes)) != 1 or sizes[0] < 2:
            yield f"wind, Hs, Tp need the same length, at least 2; got {sizes}"
        if any(b <= a for a, b in zip(self.wind[:-1], self.wind[1:], strict=True)):
            yield f"wind = {list(self.wind)}: must increase"


def _usable(*values):
    """Return whether all values are numbers >= 0, so that a rule can be applied before they are validated."""
    return all(is_number(value) and value >= 0 for value in values)


def iec_gamma(Hs, Tp):
    """Return the JONSWAP peak enhancement gamma (-) of a sea state (Hs m, Tp s) by the rule of IEC 61400-3.

    With r = Tp/sqrt(Hs): 5 up to r = 3.6, exp(5.75 - 1.15 r) to r = 5, 1 above; 1 for Hs = 0.
    """
    if Hs <= 0.0:
        return 1.0
    ratio = Tp / math.sqrt(Hs)
    if ratio <= 3.6:
        return 5.0
    return max(1.0, math.exp(5.75 - 1.15 * ratio))


def fully_developed_period(Hs):
    """Return the peak period (s) of the one-parameter Pierson-Moskowitz sea of an Hs (m); 1 s without waves.

    S = alpha g^2 omega^-5 exp(-1.25 (omega_p/omega)^4), alpha = 0.0081: Hs = 4 sqrt(alpha/5) g/omega_p^2.
    """
    if Hs <= 0.0:
        return 1.0
    return 2.0 * math.pi * math.sqrt(Hs / (4.0 * math.sqrt(0.0081 / 5.0) * STANDARD_GRAVITY))


@cached(1)
def _sea_data():
    """Return ({name: SeaState}, {name: JointTable}) of the built-in file; table rows are states too."""
    path = DATA / "sea_states.toml"
    states, tables = {}, checked_entries(JointTable, path, "sea state", "table")
    for table in tables.values():
        for wind, Hs, Tp in zip(table.wind, table.Hs, table.Tp, strict=True):
            name = f"{table.name}_{f'{wind:g}'.replace('.', '_')}"
            states[name] = _joint_state(table, wind, Hs, Tp, name)
    return states | checked_entries(SeaState, path, "sea state", "state"), tables


def _joint_state(table, wind, Hs, Tp, name):
    origin = {"source": table.source, "confidence": table.confidence}
    return SeaState(kind="jonswap", name=name, wind=wind, Hs=Hs, Tp=Tp, **origin)


def sea_states():
    """Return {name: SeaState} of all built-in sea states, rows of the joint tables included."""
    return dict(_sea_data()[0])


def joint_tables():
    """Return {name: JointTable} of the built-in tables of sea state against wind speed."""
    return dict(_sea_data()[1])


def read_sea_state(name_or_path):
    """Return the SeaState of a built-in name (sea_states()) or of a TOML file with top-level keys."""
    if isinstance(name_or_path, str) and name_or_path in _sea_data()[0]:
        return _sea_data()[0][name_or_path]
    path = locate("sea_state", name_or_path, _sea_data()[0], listed=LISTED, also=SEA_FORMS)
    return checked_record(SeaState, read_toml(path, "sea state"), f"sea state file {str(path)!r}")


def sea_of(spec):
    """Return the sea of a text as None or a mapping; names, paths and other objects unchanged.

    "jonswap:4:9" (Hs, Tp and optionally gamma); "regular:3:5" (H, T); "pierson_moskowitz:4" (Hs and
    optionally Tp); JSON of a mapping; "none" and "still".
    Raises: InputError for a text of one of these kinds that lacks a number.
    """
    if not isinstance(spec, str):
        return spec
    text = spec.strip()
    if text.lower() in ("none", "still"):
        return None
    if text.startswith("{"):
        return json_text("sea", text)
    kind, *rest = text.split(":")
    if kind not in TEXT_KEYS:
        return spec
    keys, needed = TEXT_KEYS[kind]
    values = [parse_number(item) for item in rest]
    if None in values or not needed <= len(values) <= len(keys):
        form = ":".join((kind, *keys[:needed])) + "".join(f"[:{key}]" for key in keys[needed:])
        raise InputError(f"sea = {short(text)}: must be {form} with a number for each")
    return {"kind": kind, **dict(zip(keys, values, strict=False))}


def sea_state_of(spec):
    """Return the SeaState of None (still water), a name, path, text (sea_of), mapping or SeaState."""
    spec = sea_of(spec)
    if spec is None:
        return SeaState(kind="still")
    if isinstance(spec, SeaState):
        return spec
    if isinstance(spec, Mapping):
        return checked_record(SeaState, dict(spec), "sea state")
    if isinstance(spec, (str, Path)):
        return read_sea_state(spec)
    raise InputError(
        f"sea state = {short(spec)}: must be None, a name ({LISTED}), {SEA_FORMS}, a path or a SeaState"
    )


def joint_sea_state(table, wind_speed):
    """Return the JONSWAP SeaState of a joint table at a hub wind speed (m/s), linear between its rows.

    table: a built-in name (names("joint_tables")), a user's TOML file with wind, Hs, Tp, or a JointTable.
    """
    if isinstance(table, str) and table in _sea_data()[1]:
        table = _sea_data()[1][table]
    elif not isinstance(table, JointTable):
        path = locate("joint_table", table, _sea_data()[1])
        table = checked_record(JointTable, read_toml(path, "joint table"), f"joint table file {str(path)!r}")
    low, high = table.wind[0], table.wind[-1]
    allowed = f">= {low:g} and <= {high:g} m/s (table {table.name!r})"
    speed = check_number("wind_speed", wind_speed, low, high, allowed=allowed)
    Hs = float(np.interp(speed, table.wind, table.Hs))
    Tp = float(np.interp(speed, table.wind, table.Tp))
    return _joint_state(table, speed, Hs, Tp, f"{table.name} at {speed:g} m/s")
