import re
import struct

import numpy as np
import pytest
from doc_pages import DOCS

from fowt_env.realtime import record as records
from fowt_env.realtime.record import (
    HEADER,
    Kind,
    Malformed,
    Record,
    command_values,
    json_record,
    size_of,
    unpack,
)


def test_a_record_is_read_back_and_its_header_is_as_documented():
    values = (1.5, -2.0)
    record = Record(Kind.STATE, 7, 0.25, 2, 3, struct.pack("<2d", *values))
    data = record.pack()
    assert unpack(data) == record and record.values() == values
    assert data[:32] == b"FOWT" + struct.pack("<HHIIIId", 1, 4, 7, 2, 3, 16, 0.25)
    assert json_record(Kind.END, {"reason": "x"})[32:] == b'{"reason": "x"}'
    again = bytearray(data)
    again[:32] = bytes(32)
    record.pack_into(again)
    assert again == data


GOOD = Record(Kind.COMMAND, 1, payload=bytes(16)).pack()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"GET / HTTP/1.1\r\n", "FOWT"),
        (b"FOWX" + GOOD[4:], "FOWT"),
        (GOOD[:4] + b"\x02" + GOOD[5:], "version 2"),
        (GOOD[:6] + b"\x63" + GOOD[7:], "kind 99"),
        (GOOD[:20] + struct.pack("<I", 5000) + GOOD[24:], "5000 bytes"),
        (GOOD[:-1], "47 bytes"),
        (GOOD + b"x", "49 bytes"),
        (GOOD[:12], "12 bytes"),
        (b"", "0 bytes"),
    ],
)
def test_bytes_that_are_no_record_are_malformed(data, reason):
    with pytest.raises(Malformed, match=reason):
        unpack(data)


def test_any_bytes_are_a_record_or_malformed():
    rng = np.random.default_rng(0)
    for _ in range(2000):
        data = bytearray(GOOD)
        for at in rng.integers(0, len(data), 3):
            data[at] = rng.integers(256)
        data = bytes(data[: rng.integers(len(data) + 1)])
        try:
            record = unpack(data)
        except Malformed:
            continue
        assert record.pack()[:24] == data[:24]


def test_the_length_is_known_once_the_header_is_complete():
    assert size_of(GOOD[: HEADER.size - 1]) == 0 and size_of(GOOD[: HEADER.size]) == len(GOOD)


@pytest.mark.parametrize("payload", [b"", bytes(8), bytes(24), struct.pack("<2d", 1.0, float("nan"))])
def test_a_command_must_be_finite_and_complete(payload):
    assert command_values(unpack(GOOD), 2) == (0.0, 0.0)
    with pytest.raises(Malformed, match="command"):
        command_values(Record(Kind.COMMAND, payload=payload), 2)


TYPES = {"char[4]": "4s", "uint16": "H", "uint32": "I", "float64": "d"}


def test_the_page_describes_the_header_and_the_kinds_as_they_are():
    page = (DOCS / "guides/hardware-in-the-loop.md").read_text()
    table = [line for line in (records.__doc__ or "").splitlines() if line.startswith("|")]
    assert "\n".join(table) in page
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table[2:]]
    form = "<"
    for byte, kind, _, _ in rows:
        assert int(byte) == struct.calcsize(form)
        form += TYPES[kind]
    assert form == HEADER.format
    told = re.findall(r"^\| (\d) \| ([A-Z]+) \|", page, re.M)
    assert told == [(str(int(kind)), kind.name) for kind in Kind]
    assert f"The version is {records.VERSION}." in page
    assert [int(n) for n in re.findall(r"Flags: (\d) .*?; (\d) ", page)[0]] == list(records.Flag)
