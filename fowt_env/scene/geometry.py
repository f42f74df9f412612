"""Checks positions in a platform file for plausibility: lines, anchors, fairleads, members."""

from math import degrees, dist, hypot

import numpy as np

from fowt_env.errors import warn_once

WIDE = 4.0  # of the hull's reach from the tower axis, where a fairlead is odd
LOW = 1.2  # of the draft
ABOVE_BED = 0.1  # of the water depth, between an anchor and the sea bed
STRAIN = 0.05  # of a line, twice what breaks chain and wire
UPRIGHT = 0.2  # horizontal over vertical span of a tendon, whose anchor may lie anywhere below


def geometry_faults(platform):
    """Return {name: sentence} of what can hardly be meant in a Platform's places; empty where nothing is."""
    return _line_faults(platform) | _member_faults(platform)


def warn_of_geometry(platform, label):
    """Warn, once per platform, of what geometry_faults finds."""
    faults = geometry_faults(platform)
    if not faults:
        return
    key = hash((repr(platform.lines), repr(platform.members), *faults))
    text = " ".join(f"{text[0].upper()}{text[1:]}." for text in faults.values())
    warn_once(key, f"platform {label!r}: {text}")


def in_radians(anchors, fairleads):
    """Azimuths, deg, of several anchors (n, 3) that look like radians taken for degrees; None otherwise."""
    if len(anchors) < 2 or any(
        dist(a[:2], f[:2]) < UPRIGHT * abs(a[2] - f[2]) for a, f in zip(anchors, fairleads, strict=True)
    ):
        return None
    azimuths = [degrees(np.arctan2(y, x)) for x, y, _ in anchors]
    small = all(abs(azimuth) <= 6.3 for azimuth in azimuths)
    return azimuths if small and max(azimuths) - min(azimuths) > 1.0 else None


def _reach(platform):
    """Return the largest distance of the hull from the tower axis, m; None where the file does not say it."""
    reach = [0.5 * diameter for diameter in platform.hull.diameter] if platform.hull is not None else []
    for member in platform.members:
        ends = zip((member.start, member.end), member.diameter, strict=True)
        reach += [dist(point[:2], (0.0, 0.0)) + 0.5 * diameter for point, diameter in ends]
    return max(reach, default=None)


def _line_faults(platform):
    """Return {name: sentence} of the first line of each fault."""
    found, depth = {}, platform.environment.water_depth
    reach, draft = _reach(platform), platform.draft
    for number, line in enumerate(platform.lines, 1):
        (x, y, z), anchor = line.fairlead, line.anchor
        out, above = hypot(x, y), anchor[2] + depth
        span, rise = dist(anchor[:2], (x, y)), z - anchor[2]
        faults = {
            "fairlead": (
                reach is not None and out > WIDE * reach,
                f"the fairlead of line {number} is {out:.4g} m from the tower axis, and the hull reaches"
                f" {reach or 0.0:.4g} m",
            ),
            "fairlead depth": (
                -z > LOW * draft,
                f"the fairlead of line {number} is at z = {z:.4g} m, below the draft of {draft:.4g} m",
            ),
            "anchor depth": (
                above > ABOVE_BED * depth,
                f"the anchor of line {number} at z = {anchor[2]:.4g} m is {above:.4g} m above the sea"
                f" bed (water_depth = {depth:g} m)",
            ),
            "anchor inside": (
                hypot(*anchor[:2]) < out and span > UPRIGHT * rise,
                f"the anchor of line {number} is nearer to the tower axis than its fairlead,"
                f" {span:.4g} m from it",
            ),
        }
        found |= {name: text for name, (wrong, text) in faults.items() if wrong and name not in found}
    return found


def _member_faults(platform):
    """Return {name: sentence} of the members."""
    found, depth = {}, platform.environment.water_depth
    for number, member in enumerate(platform.members, 1):
        low = min(member.start[2], member.end[2])
        if low < -depth:
            found.setdefault(
                "sea bed",
                f"member {number} reaches down to z = {low:.4g} m, below the sea bed at {-depth:g} m",
            )
    if platform.members and all(min(member.start[2], member.end[2]) >= 0.0 for member in platform.members):
        found["dry"] = f"all {len(platform.members)} members lie above the water, where they have no load"
    return found
