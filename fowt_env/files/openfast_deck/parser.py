"""Parses OpenFAST part files by keys: "value key - comment", in any order and with any comments.

A key is the first word of a line that is not a value, after at least one value. Keys are case-insensitive;
`BldFile(1)` and `BldFile1` are the same key. Errors name the file, the line, the key and the allowed range.

A part file also stores all lines that set a key (`entries`) and the `columns` of the tables that were read,
for keys.py, which reports keys that are not used.
"""

import math
import re
from pathlib import Path

from fowt_env.descriptions.files import read_text
from fowt_env.errors import InputError

MAX_ROWS = 100_000  # of a table
_WORD = re.compile(r"""@?"[^"]*"?|@?'[^']*'?|[^\s,;]+""")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?")
_KEY = re.compile(r"[A-Za-z_]\w*(\(\d+\))?")
_TRUE, _FALSE = ("true", "t", ".true.", ".t."), ("false", "f", ".false.", ".f.")
REQUIRED = object()  # default of a required key
COMMENT = re.compile("[!#%]")  # start of a comment in NWTC_IO.f90 (ReadLine), also within quotes
COMMENTED = (  # kinds of files from which OpenFAST removes comments (ProcessComFile)
    "AeroDyn", "AeroDyn blade", "ElastoDyn blade", "HydroDyn", "InflowWind", "MoorDyn", "SeaState",
    "ServoDyn", "polar",
)  # fmt: skip
_TITLES = 2  # title lines at the top of a part file


def number_of(word):
    """Return the finite number of a Fortran word, or None."""
    if _NUMBER.fullmatch(word) is None:
        return None
    value = float(word.replace("d", "e").replace("D", "e"))
    return value if math.isfinite(value) else None


def bare(word):
    """Return a word without quotes."""
    word = word.lstrip("@")
    return word.strip("\"'").strip() if word[:1] in "\"'" else word


def same_key(key):
    """Return the normalised key for look-ups: lower case, without parentheses."""
    return key.lower().replace("(", "").replace(")", "")


def truth_of(word):
    """Return the Boolean of a word, or None; numbers give None."""
    text = word.lower()
    return True if text in _TRUE else False if text in _FALSE else None


def _is_value(word):
    return (
        word[:1] in "\"'@"
        or number_of(word) is not None
        or truth_of(word) is not None
        or word.lower() == "default"
    )


def words_of(line):
    """Split a line into words at blanks and commas; quoted words are kept whole."""
    return _WORD.findall(line)


def _key_of(words):
    """Return the index of the key in the words of a line, or None.

    The first word is always a value, because file names need not be quoted.
    """
    if not words or words[0].startswith(("---", "===", "!", "#")):
        return None
    for i, word in enumerate(words[1:], 1):
        if word in ("!", "-"):
            continue
        if not _is_value(word):
            return i if _KEY.fullmatch(word) else None
    return None


def _in_outputs(line, words, before):
    """Return whether a line belongs to a list of output channels, which ends with END."""
    if not words:
        return before
    head = bare(words[0]).lower()
    if words[0].startswith("---"):
        return "output channels" in line.lower()
    return head == "outlist" or (before and not head.startswith("end"))


def _sets(words, index):
    """Return whether a line with a key at this index sets the key, and is no column header or plain text."""
    ends = index + 1 == len(words) or words[index + 1][0] in "-\u2013!"
    return "-" not in words[:index] and (_is_value(words[0]) or (index == 1 and ends))


class PartFile:
    """Holds a part file: lines without comments, the position of each key, and the tables that were read.

    lines     texts; for the kinds in COMMENTED without comments
    places    {key: (line from 0, values)}
    entries   {key: (name as in the file, line, values)} of the lines that set a key, except output lists
    columns   {column in lower case: [(line, value)]} of the tables that were read
    """

    def __init__(self, path, kind):
        """Read and index a file. kind: "ElastoDyn" ..., for messages. Raises: InputError if unreadable."""
        self.path, self.kind = Path(path), kind
        # old files contain degree signs and superscripts in a Windows encoding
        text = read_text(self.path, kind, fallback="latin-1")
        if "\0" in text:
            raise self.refusal("is not a text file: contains a zero byte")
        self.lines = text.splitlines()
        if len(self.lines) > MAX_ROWS:
            raise self.refusal(f"has {len(self.lines)} lines; allowed: at most {MAX_ROWS}")
        if kind in COMMENTED:
            self.lines = [COMMENT.split(line, maxsplit=1)[0].rstrip() for line in self.lines]
        self.places, self.entries, self.columns = {}, {}, {}
        outputs = False
        for number, line in enumerate(self.lines):
            words = words_of(line[:2000])
            outputs = _in_outputs(line, words, outputs)
            index = _key_of(words)
            if index is None:
                continue
            values = [word for word in words[:index] if word not in ("!", "-")]
            if not values:
                continue
            key = same_key(words[index])
            self.places.setdefault(key, (number, values))
            if not outputs and number >= _TITLES and _sets(words, index):
                self.entries.setdefault(key, (words[index], number, values))

    # ------------------------------------------------------------------ messages

    def refusal(self, what, line=None, key=None):
        """Return an InputError naming this file, the line (from 0) and the key."""
        at = "" if line is None else f", line {line + 1}"
        named = "" if key is None else f"{key}: "
        return InputError(f"{self.kind} file {str(self.path)!r}{at}: {named}{what}")

    def new(self, line, known, name, what):
        """Return the name or integer of a row, which no row above may have. Raises: InputError."""
        if not isinstance(name, str):
            if name != int(name):
                raise self.refusal(f"{what} {name:g}: must be a whole number", line)
            name = int(name)
        if name in known:
            raise self.refusal(f"{what} {name}: must be in one row only", line)
        return name

    def wrong(self, key, value, allowed, *also):
        """Return an InputError for a value that is not allowed."""
        entry = self.find(key, *also)
        return self.refusal(
            f"{key} = {str(value)[:60]}: must be {allowed}", None if entry is None else entry[0]
        )

    def source(self, *keys):
        """Return "ElastoDyn: keys", the comment for a value computed from these keys."""
        return f"{self.kind}: {', '.join(keys)}"

    # ------------------------------------------------------------------ values

    def words(self, line):
        """Return the words of a line (from 0)."""
        return words_of(self.lines[line][:2000])

    def find(self, key, *also):
        """Return (line from 0, values) of a key by the first of its names in the file, or None."""
        for name in (key, *also):
            if same_key(name) in self.places:
                return self.places[same_key(name)]
        return None

    def has(self, key, *also):
        """Return whether the file has the key."""
        return self.find(key, *also) is not None

    def _one(self, key, also, default):
        entry = self.find(key, *also)
        if entry is None:
            if default is REQUIRED:
                raise self.refusal(f"{key} is missing: there must be a line 'value  {key}'")
            return None, default
        return entry[0], entry[1][0]

    def number(self, key, *also, default=REQUIRED, low=-math.inf, high=math.inf, open_low=False):
        """Return the number of a key; the default if missing or DEFAULT. also: other names of the key."""
        line, word = self._one(key, also, default)
        if line is None:
            return word
        if bare(word).lower() == "default" and default is not REQUIRED:
            return default
        value = number_of(bare(word))
        if value is None or not low <= value <= high or (open_low and value <= low):
            ends = [f"{'>' if open_low else '>='} {low:g}"] * (low > -math.inf)
            ends += [f"<= {high:g}"] * (high < math.inf)
            allowed = " ".join(["a number", " and ".join(ends)]).strip()
            raise self.refusal(f"{key} = {word[:60]}: must be {allowed}", line)
        return value

    def positive(self, key, *also, default=REQUIRED, high=math.inf):
        """Return the number > 0 of a key."""
        return self.number(key, *also, default=default, low=0.0, high=high, open_low=True)

    def whole(self, key, *also, default=REQUIRED, low=None, high=None):
        """Return the integer of a key."""
        value = self.number(key, *also, default=default)
        if not isinstance(value, float):
            return value
        if value != int(value) or (low is not None and value < low) or (high is not None and value > high):
            limits = [f"from {low}"] * (low is not None) + [f"to {high}"] * (high is not None)
            raise self.wrong(key, f"{value:g}", " ".join(["a whole number", *limits]), *also)
        return int(value)

    def one_of(self, key, choices, *also, default=REQUIRED, why=""):
        """Return the integer of a key, one of choices. why: reason for the message."""
        value = self.whole(key, *also, default=default)
        if value not in choices:
            allowed = " or ".join(str(choice) for choice in choices)
            raise self.wrong(key, value, allowed + (f" ({why})" if why else ""), *also)
        return value

    def flag(self, key, *also, default=REQUIRED):
        """Return the Boolean of a key; non-zero numbers, the switches of some versions, are true."""
        line, word = self._one(key, also, default)
        if line is None:
            return word
        text = bare(word).lower()
        if text == "default" and default is not REQUIRED:
            return default
        if truth_of(text) is not None:
            return truth_of(text)
        if number_of(text) is not None:
            return number_of(text) != 0.0
        raise self.refusal(f"{key} = {word[:60]}: must be True or False", line)

    def text(self, key, *also, default=REQUIRED):
        """Return the text of a key, without quotes."""
        line, word = self._one(key, also, default)
        return word if line is None else bare(word)

    def matrix(self, key, size=6):
        """Return size x size numbers from the row of a key and the rows below; zeros if key is missing."""
        entry = self.find(key)
        if entry is None:
            return [[0.0] * size for _ in range(size)]
        return [self._row(entry[0] + i, size, key) for i in range(size)]

    def vector(self, key, size=6):
        """Return size numbers in the row of a key, or one per row from there; zeros if the key is missing."""
        entry = self.find(key)
        if entry is None:
            return [0.0] * size
        if len(entry[1]) > 1:
            return self._row(entry[0], size, key)
        return [self._row(entry[0] + i, 1, key)[0] for i in range(size)]

    def _row(self, line, size, key):
        words = self.words(line)[:size] if line < len(self.lines) else []
        values = [number_of(word) for word in words]
        if len(values) < size or None in values:
            raise self.refusal(f"{' '.join(words)[:60]!r}: must be {size} numbers", line, key)
        return values

    # ------------------------------------------------------------------ tables

    def table(self, key, *also, default=0, texts=(), needs=(), high=MAX_ROWS):
        """Return the rows of the table below a count: a list of (line from 0, {lower-case column: number}).

        The line after the count names the columns. texts: text columns, in lower case. needs: required
        columns. A row may be followed by a comment, and needs values in all columns except the last texts.
        """
        count = self.whole(key, *also, default=default, low=0, high=high)
        if not count:
            return []
        line = self.find(key, *also)[0] + 1
        rows = self.rows_below(line, count, key, texts)
        for row in rows:
            self.need(row, *needs)
        return rows

    def headed(self, column, count, texts=()):
        """Return rows, as in table(), of the table whose first column has this name."""
        for line, text in enumerate(self.lines):
            if text.split()[:1] and text.split()[0].lower() == column.lower():
                return self.rows_below(line, count, column, texts)
        raise self.refusal(f"the table with the first column {column} is missing")

    def rows_below(self, line, count, key, texts=()):
        """Return rows, as in table(), of a table whose column names are in this line."""
        while line < len(self.lines) and not self.lines[line].strip():
            line += 1
        head = self.lines[line] if line < len(self.lines) else ""
        columns = [word.lower() for word in words_of(re.split(r"[\[!]", head)[0])]
        if not columns or number_of(columns[0]) is not None:
            raise self.refusal("the next line must name the columns of the table", line - 1, key)
        rows = []
        for number in range(line + 1, len(self.lines)):
            words = self.words(number)
            if not words or (
                not rows and words[0].startswith(("(", "[", "-")) and number_of(words[0]) is None
            ):
                continue
            cells = self._cells(number, words, columns, texts, key)
            rows.append((number, cells))
            for name, value in cells.items():
                self.columns.setdefault(name, []).append((number, value))
            if len(rows) == count:
                return rows
        raise self.refusal(f"{count} rows are declared, {len(rows)} found", line - 1, key)

    def _cells(self, number, words, columns, texts, key):
        cells = {}
        for i, name in enumerate(columns):
            word = bare(words[i]) if i < len(words) else ""
            if name in texts:
                cells[name] = word
                continue
            value = number_of(word) if truth_of(word) is None else float(truth_of(word))
            if value is None and name in OPTIONAL_COLUMNS:
                break  # the rest is a comment
            if value is None:
                raise self.refusal(f"{name} = {word[:40]!r}: must be a number", number, key)
            cells[name] = value
        return cells

    def need(self, row, *names):
        """Check that a row (line, cells) of a table has the columns. Raises: InputError."""
        for name in names:
            if name.lower() not in row[1]:
                raise self.refusal(f"the column {name} is missing", row[0] - 1)

    # ------------------------------------------------------------------ other files

    def other(self, key, *also, folders=(), default=REQUIRED):
        """Return the path of the file named by a key, or None for no file ("unused", "none", empty)."""
        name = self.text(key, *also, default=default)
        if not isinstance(name, str) or name.lower() in ("", "none", "unused", "default"):
            return None
        path = locate(name, (self.path.parent, *folders))
        if path is None:
            raise self.refusal(f"{key} = {name[:200]!r}: no such file", self.find(key, *also)[0])
        return path

    def blade(self, key, blades, folders):
        """Return the path of the file of blade 1, KEY(1), of a rotor with identical blades."""
        path = self.other(f"{key}(1)", key, folders=folders)
        if path is None:
            raise self.wrong(f"{key}(1)", "unused", "the blade file")
        for i in range(2, min(blades, 3) + 1):
            name = self.text(f"{key}({i})", default=None)
            if name not in (None, self.text(f"{key}(1)", key)):
                raise self.wrong(f"{key}({i})", name, "the file of blade 1: blades must be identical")
        return path


# columns of newer versions, to the right of the columns of all versions
OPTIONAL_COLUMNS = (
    "axfdmod", "axvncoff", "axfdlofsc", "blcb", "blcenbn", "blcenbt", "blcpn", "blcpt", "blcan", "blcat",
    "blcam", "twrti", "twrcb", "twrcp", "twrca", "simplmcf", "dpthmcf", "membermcf",
    "fdmod", "vncoffa", "vncoffb", "fdlofsca", "fdlofscb",
)  # fmt: skip


def locate(name, folders):
    """Return the path of a file named in a deck (relative, either slash, case-insensitive), or None.

    The second and further folders are also searched for the bare file name.
    """
    text = name.replace("\\", "/").strip()
    try:
        for number, folder in enumerate(folders):
            for candidate in (text, text.rsplit("/", 1)[-1])[: 1 + (number > 0)]:
                path = Path(folder) / Path(candidate)
                match = path if path.is_file() else _either_case(path)
                if match is not None:
                    return match
    except (OSError, ValueError):
        return None
    return None


def _either_case(path):
    """Return the file that matches a path case-insensitively, or None."""
    here = Path(path.anchor)
    for part in path.parts[bool(path.anchor) :]:
        if part != ".." and not (here / part).exists():
            names = sorted(entry.name for entry in here.iterdir()) if here.is_dir() else ()
            part = next((name for name in names if name.lower() == part.lower()), None)
            if part is None:
                return None
        here = here / part
    return here if here.is_file() else None
