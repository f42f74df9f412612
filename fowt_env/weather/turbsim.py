"""Reads TurbSim full-field wind files (.bts) by openfast_io, after a check of the header, and writes them."""

import os
import struct

import numpy as np

from fowt_env.errors import InputError

NOT_PERIODIC, PERIODIC = 7, 8  # file identifiers
HEAD = struct.Struct("<h4i12fi")  # kind; counts; spacings, hub and scales; length of the description


def read_bts(path):
    """Return (velocity, y, z, dt, speed, periodic) of a TurbSim file.

    velocity (n_time, n_z, n_y, 3) float32 m/s; y, z (m); dt (s); speed: mean wind at the hub (m/s); periodic:
    from the file's identifier. Memory: at most some ten times the size of the file.
    Raises: InputError that names the file and the fault.
    """
    where = f"wind.path = {str(path)!r}"
    try:
        if not path.is_file():
            raise InputError(f"{where}: no such file")
        _check_head(path, where)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"wind.path = {str(path)[:200]!r}: cannot be read: {error}") from None
    try:
        from openfast_io.turbsim_file import TurbSimFile
    except ImportError:
        raise InputError(
            "TurbSim boxes need openfast_io, which is not installed: pip install 'fowt-env[openfast]'"
        ) from None
    try:
        with np.errstate(over="ignore"):
            file = TurbSimFile(str(path))
    except Exception as error:  # a broken file may raise any exception in the reader
        raise InputError(f"{where}: not a TurbSim full-field file ({error})") from None
    with np.errstate(over="ignore"):
        velocity = np.ascontiguousarray(np.transpose(file["u"], (1, 3, 2, 0)), dtype=np.float32)
    if not np.isfinite(velocity).all():
        raise InputError(f"{where}: contains wind speeds that are not finite")
    y, z = np.asarray(file["y"]), np.asarray(file["z"])
    return velocity, y, z, float(file["dt"]), float(file["uRef"]), int(file["ID"]) == PERIODIC


def _check_head(path, where):
    """Check that the header of a TurbSim file is consistent with the file size. Raises: InputError.

    The reader would trust wrong counts, and take the memory and the time that these imply.
    """
    with path.open("rb") as file:
        head = file.read(HEAD.size)
        size = os.fstat(file.fileno()).st_size
    if len(head) < HEAD.size:
        raise InputError(f"{where}: {size} bytes: a TurbSim full-field file has {HEAD.size} or more")
    kind, n_z, n_y, n_tower, n_time, *numbers, length = HEAD.unpack(head)
    if kind not in (NOT_PERIODIC, PERIODIC):
        raise InputError(f"{where}: identifier {kind}: a TurbSim full-field file has 7 or 8")
    if min(n_z, n_y) < 2 or n_time < 1 or min(n_tower, length) < 0:
        raise InputError(
            f"{where}: {n_z} x {n_y} points, {n_tower} on the tower, {n_time} times, {length} characters:"
            " must be 2 x 2, 0, 1, 0 or more"
        )
    needed = HEAD.size + length + 6 * n_time * (n_z * n_y + n_tower)
    if needed != size:
        raise InputError(
            f"{where}: {n_time} times of {n_z} x {n_y} + {n_tower} points take {needed} bytes; the file has"
            f" {size}"
        )
    dz, dy, dt, speed, *rest = numbers
    scales = rest[2::2]
    if not (np.isfinite(numbers).all() and min(dz, dy, dt, speed) > 0.0 and all(scales)):
        raise InputError(
            f"{where}: spacings {dz:g} m, {dy:g} m, {dt:g} s, wind {speed:g} m/s, scales {scales}:"
            " all numbers of the header must be finite, these positive, and no scale zero"
        )


def write_bts(path, velocity, y, z, dt, speed, hub_height, periodic, description="fowt_env"):
    """Write a box of wind as a TurbSim file, with what read_bts returns; hub_height (m) is for the header.

    Values have 16 bits: an error of at most half of 1/65534 of the span of each component. A point of the
    tower repeats the lowest row at y = 0: below it InflowWind interpolates to zero at the ground, as
    wind_field.py does, and without one it refuses a tower that reaches below the grid. path: written
    directly, not atomically. Raises: InputError for a box whose lowest point is below still water.
    """
    if z[0] < 0.0:
        raise InputError(f"wind box: its lowest point is at z = {z[0]:g} m: must be at least 0")
    low, high = (f(velocity.reshape(-1, 3), axis=0).astype(np.float64) for f in (np.min, np.max))
    span = np.where(high > low, high - low, 1.0)
    scale = (65534.0 / span).astype(np.float32)
    offset = (-32767.0 - scale * low).astype(np.float32)
    text = description.encode("ascii", "replace")
    counts = (PERIODIC if periodic else NOT_PERIODIC, len(z), len(y), 1, len(velocity))
    steps = (z[1] - z[0], y[1] - y[0], dt, speed, hub_height, z[0])
    scales = np.stack([scale, offset], axis=1).reshape(-1)
    right = int(np.clip(np.searchsorted(y, 0.0), 1, len(y) - 1))
    share = np.float32((0.0 - y[right - 1]) / (y[right] - y[right - 1]))
    with open(path, "wb") as file:
        file.write(HEAD.pack(*counts, *steps, *scales, len(text)) + text)
        for part in velocity:  # one instant at a time: less memory
            tower = part[0, right - 1] + share * (part[0, right] - part[0, right - 1])
            values = np.concatenate([part.reshape(-1, 3), tower[None]]) * scale + offset
            file.write(np.clip(np.rint(values), -32768, 32767).astype("<i2").tobytes())
