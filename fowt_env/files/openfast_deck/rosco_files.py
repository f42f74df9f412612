"""What is taken along of ROSCO's own files: its DISCON.IN, and the table of the rotor that it names.

Both are written anew, line by line, from what can be read of them, so that a deck which names another file
does not have that file copied into a folder that is then passed on.
"""

import re
from typing import NamedTuple

from fowt_env.files.openfast_deck.parser import PartFile, number_of

DISCON = "DISCON.IN"  # names in the folder of the turbine
PERFORMANCE = "rotor_performance.txt"
_ENTRY = re.compile(r"[^!\n]*\S\s*!\s*\w+\b")
_PARTS = {  # words of a heading, and the heading as it is written
    "pitch angle vector": "# Pitch angle vector - x axis (matrix columns) (deg)",
    "tsr vector": "# TSR vector - y axis (matrix rows) (-)",
    "wind speed vector": "# Wind speed vector - z axis (m/s)",
    "power coefficient": "# Power coefficient",
    "thrust coefficient": "# Thrust coefficient",
    "torque coefficient": "# Torque coefficient",
}


class Performance(NamedTuple):
    """Table of a rotor's coefficients."""

    name: str
    text: str  # as ROSCO reads it
    largest: float | None  # power coefficient that a rotor can have


def read_performance(path):
    """Performance of a file. Raises: InputError naming the line of no such table, not its text."""
    file = PartFile(path, "rotor performance")
    values, lines, part = {heading: [] for heading in _PARTS}, [], None
    for number, line in enumerate(file.lines):
        if line.lstrip().startswith("#"):
            found = next((heading for heading in _PARTS if heading in line.lower()), None)
            part = found or part
            lines.append(_PARTS.get(found, "#"))
            continue
        words = line.split()
        numbers = [number_of(word) for word in words]
        if None in numbers or (words and part is None):
            raise file.refusal("must be numbers, below a heading such as '# Power coefficient'", number)
        if words:
            values[part] += numbers
        lines.append("   ".join(words))
    pitch, ratio, wind, *found = map(len, values.values())
    for heading, count in zip(tuple(_PARTS)[3:], found, strict=True):
        if not count or count != pitch * ratio * max(wind, 1):
            raise file.refusal(
                f"{count} numbers below {heading!r}: must be one for each of {pitch} pitch angles,"
                f" {ratio} tip-speed ratios and {wind} wind speeds"
            )
    best = max((value for value in values["power coefficient"] if value < 0.6), default=0.0)
    return Performance(file.path.name, "\n".join([*lines, ""]), best if best > 0.2 else None)


def discon_text(file, performance):
    """Text of a DISCON.IN (PartFile): its entries and comments; it names the table beside itself."""
    lines = []
    for line in file.lines:
        if not _ENTRY.match(line):
            line = line if line.startswith("!") else "!" * bool(line.strip())
        elif performance is not None:
            line = re.sub(r"^[^!]*(?=!\s*PerfFileName)", f'"{PERFORMANCE}"      ', line)
        lines.append(line)
    return "\n".join([*lines, ""])
