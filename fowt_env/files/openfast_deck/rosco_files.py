"""What is taken along of ROSCO's own files: its DISCON.IN, and the table of the rotor that it names.

Both are written anew, line by line, from what can be read of them, so that a deck which names another file
does not have that file copied into a folder that is then passed on.
"""

import re

from fowt_env.files.openfast_deck.parser import PartFile, number_of

DISCON = "DISCON.IN"  # names in the folder of the turbine
PERFORMANCE = "rotor_performance.txt"
_ENTRY = re.compile(r"[^!\n]*\S\s*!\s*\w+\b")
_PARTS = (  # words of a heading, and the heading as it is written
    ("pitch angle vector", "# Pitch angle vector - x axis (matrix columns) (deg)"),
    ("tsr vector", "# TSR vector - y axis (matrix rows) (-)"),
    ("wind speed vector", "# Wind speed vector - z axis (m/s)"),
    ("power coefficient", "# Power coefficient"),
    ("thrust coefficient", "# Thrust coefficient"),
    ("torque coefficient", "# Torque coefficient"),
)


class Performance:
    """Table of a rotor's coefficients: `values` under each of its six headings, `text` as ROSCO reads it."""

    def __init__(self, path):
        """path: the file. Raises: InputError naming the line of what is no such table; never what it says."""
        file = PartFile(path, "rotor performance")
        self.values, lines, part = {heading: [] for heading, _ in _PARTS}, [], None
        for number, line in enumerate(file.lines):
            if line.lstrip().startswith("#"):
                found = [pair for pair in _PARTS if pair[0] in line.lower()]
                part = found[0][0] if found else part
                lines.append(found[0][1] if found else "#")
                continue
            words = line.split()
            values = [number_of(word) for word in words]
            if None in values or (words and part is None):
                raise file.refusal("must be numbers, below a heading such as '# Power coefficient'", number)
            if words:
                self.values[part] += values
            lines.append("   ".join(words))
        pitch, ratio, wind = (len(self.values[heading]) for heading, _ in _PARTS[:3])
        for heading, _ in _PARTS[3:]:
            found = len(self.values[heading])
            if not found or found != pitch * ratio * max(wind, 1):
                raise file.refusal(
                    f"{found} numbers below {heading!r}: must be one for each of {pitch} pitch angles,"
                    f" {ratio} tip-speed ratios and {wind} wind speeds"
                )
        self.name = file.path.name
        self.text = "\n".join([*lines, ""])

    @property
    def largest_power_coefficient(self):
        """Largest value that a rotor can have, or None."""
        best = max((value for value in self.values["power coefficient"] if value < 0.6), default=0.0)
        return best if best > 0.2 else None


def discon_text(file, performance):
    """Text of a DISCON.IN (PartFile): its entries and comments; it names the table beside itself."""
    lines = []
    for line in file.lines:
        if _ENTRY.match(line):
            if performance is not None:
                line = re.sub(r"^[^!]*(?=!\s*PerfFileName)", f'"{PERFORMANCE}"      ', line)
            lines.append(line)
        else:
            lines.append(line if line.startswith("!") else "!" * bool(line.strip()))
    return "\n".join([*lines, ""])
