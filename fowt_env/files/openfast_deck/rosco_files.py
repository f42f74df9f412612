"""Copies ROSCO's files: DISCON.IN, and the rotor performance table named there.

Both files are rewritten line by line from parsed entries, so that a deck cannot copy an arbitrary file into
a folder that is later shared.
"""

import re
from typing import NamedTuple

from fowt_env.files.openfast_deck.parser import PartFile, number_of

DISCON = "DISCON.IN"  # names in the folder of the turbine
PERFORMANCE = "rotor_performance.txt"
_ENTRY = re.compile(r"[^!\n]*\S\s*!\s*\w+\b")
_PARTS = {  # words of a heading: heading as written
    "pitch angle vector": "# Pitch angle vector - x axis (matrix columns) (deg)",
    "tsr vector": "# TSR vector - y axis (matrix rows) (-)",
    "wind speed vector": "# Wind speed vector - z axis (m/s)",
    "power coefficient": "# Power coefficient",
    "thrust coefficient": "# Thrust coefficient",
    "torque coefficient": "# Torque coefficient",
}


class Performance(NamedTuple):
    """Holds the performance table of a rotor."""

    name: str
    text: str  # in ROSCO's format
    largest: float | None  # largest plausible power coefficient


def read_performance(path):
    """Read the Performance of a file. Raises: InputError naming an invalid line, without the line's text."""
    file = PartFile(path, "rotor performance")
    values, lines, part = {heading: [] for heading in _PARTS}, [], None
    for number, line in enumerate(file.lines):
        if line.lstrip().startswith("#"):
            title = next((heading for heading in _PARTS if heading in line.lower()), None)
            part = title or part
            lines.append(_PARTS.get(title, "#"))
            continue
        words = line.split()
        numbers = [number_of(word) for word in words]
        if None in numbers or (words and part is None):
            raise file.refusal("must be numbers, below a heading such as '# Power coefficient'", number)
        if words:
            values[part] += numbers
        lines.append("   ".join(words))
    pitch, ratio, wind, *counts = map(len, values.values())
    for heading, count in zip(tuple(_PARTS)[3:], counts, strict=True):
        if not count or count != pitch * ratio * max(wind, 1):
            raise file.refusal(
                f"{count} numbers below {heading!r}: must be one for each of {pitch} pitch angles,"
                f" {ratio} tip-speed ratios and {wind} wind speeds"
            )
    best = max((value for value in values["power coefficient"] if value < 0.6), default=0.0)
    return Performance(file.path.name, "\n".join([*lines, ""]), best if best > 0.2 else None)


def discon_text(file, performance):
    """Return the text of a DISCON.IN (PartFile) with entries and comments only, and PerfFileName adapted."""
    lines = []
    for line in file.lines:
        if not _ENTRY.match(line):
            line = line if line.startswith("!") else "!" * bool(line.strip())
        elif performance is not None:
            line = re.sub(r"^[^!]*(?=!\s*PerfFileName)", f'"{PERFORMANCE}"      ', line)
        lines.append(line)
    return "\n".join([*lines, ""])
