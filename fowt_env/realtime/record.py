"""Defines the records that server and client exchange: a header of 32 bytes and a payload, little-endian.

| byte | type    | field    | meaning                                                        |
|------|---------|----------|----------------------------------------------------------------|
| 0    | char[4] | magic    | "FOWT"                                                         |
| 4    | uint16  | version  | VERSION of the format                                          |
| 6    | uint16  | kind     | Kind of the record                                             |
| 8    | uint32  | sequence | number of the control period, from 0                           |
| 12   | uint32  | flags    | Flag bits, of a STATE                                          |
| 16   | uint32  | missed   | control periods so far without a command in time, of a STATE   |
| 20   | uint32  | size     | bytes of the payload                                           |
| 24   | float64 | time     | s since the start of the run, of a STATE                       |

The payload of STATE and COMMAND is float64 values in the order and units of the DESCRIPTION; that of
DESCRIPTION, END and REFUSED is JSON; the other kinds have none.
"""

import json
import struct
from enum import IntEnum, IntFlag
from math import isfinite
from typing import NamedTuple

MAGIC, VERSION = b"FOWT", 1
HEADER = struct.Struct("<4sHHIIIId")
LARGEST = 4096  # bytes of payload that a server accepts


class Kind(IntEnum):
    """Enumerates the kinds of records, with their sender."""

    HELLO = 1  # client: asks for a DESCRIPTION
    DESCRIPTION = 2  # server: JSON of channels, commands and timing
    READY = 3  # client: starts the run, or continues it after a reconnection
    STATE = 4  # server: channels at a control instant
    COMMAND = 5  # client: answers the STATE of the same sequence
    STOP = 6  # client: ends the run
    END = 7  # server: JSON with the reason and the statistics
    REFUSED = 8  # server: JSON with the reason


class Flag(IntFlag):
    """Enumerates the bits of the flags of a STATE."""

    STOPPING = 1  # a trip, a fault or silence of the client is stopping the turbine: commands are ignored
    HELD = 2  # no command arrived in time for the period before, whose command was the one before it


class Record(NamedTuple):
    """Holds a record; payload: bytes."""

    kind: Kind
    sequence: int = 0
    time: float = 0.0
    flags: int = 0
    missed: int = 0
    payload: bytes = b""

    def pack(self) -> bytes:
        """Return the bytes of the record."""
        return HEADER.pack(*self._head(len(self.payload))) + self.payload

    def pack_into(self, data: bytearray) -> None:
        """Fill the header of a record whose payload is in data already."""
        HEADER.pack_into(data, 0, *self._head(len(data) - HEADER.size))

    def _head(self, size):
        head = (MAGIC, VERSION, self.kind, self.sequence, self.flags, self.missed, size)
        return (*head, self.time)

    def json(self) -> dict:
        """Return the mapping in a JSON payload."""
        return json.loads(self.payload)

    def values(self) -> tuple[float, ...]:
        """Return the numbers in a payload of float64."""
        return struct.unpack(f"<{len(self.payload) // 8}d", self.payload)


class Malformed(Exception):
    """Reports bytes that are no record of this format and version; str() is the reason."""


def json_record(kind: Kind, content: dict, sequence: int = 0) -> bytes:
    """Return the bytes of a record with a mapping as JSON payload."""
    return Record(kind, sequence, payload=json.dumps(content).encode()).pack()


def size_of(data: bytes | bytearray, largest: int = LARGEST) -> int:
    """Return the length of the record that begins with these bytes, 0 if its header is not complete.

    Raises: Malformed for another magic, version or kind, or a payload of more than `largest` bytes.
    """
    if MAGIC[: len(data)] != data[: len(MAGIC)]:
        raise Malformed("does not begin with FOWT")
    if len(data) < HEADER.size:
        return 0
    _, version, kind, *_, size, _ = HEADER.unpack_from(data)
    if version != VERSION:
        raise Malformed(f"version {version}: must be {VERSION}")
    if kind not in Kind._value2member_map_:
        raise Malformed(f"kind {kind}: unknown")
    if size > largest:
        raise Malformed(f"payload of {size} bytes: at most {largest} are accepted")
    return HEADER.size + size


def unpack(data: bytes | bytearray, largest: int = LARGEST) -> Record:
    """Return the Record of exactly these bytes. Raises: Malformed."""
    length = size_of(data, largest)
    if not length or length != len(data):
        raise Malformed(f"{len(data)} bytes: the header and its size need {length or HEADER.size}")
    _, _, kind, sequence, flags, missed, _, time = HEADER.unpack_from(data)
    return Record(Kind(kind), sequence, time, flags, missed, bytes(data[HEADER.size :]))


def command_values(record: Record, count: int) -> tuple[float, ...]:
    """Return the values of a COMMAND. Raises: Malformed unless they are `count` finite numbers."""
    if len(record.payload) != 8 * count:
        raise Malformed(f"command of {len(record.payload)} bytes: must be {count} float64")
    values = record.values()
    if not all(map(isfinite, values)):
        raise Malformed("command with a number that is not finite")
    return values
