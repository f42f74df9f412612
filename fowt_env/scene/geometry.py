"""Checks positions in a platform file for plausibility: lines, anchors, fairleads, members."""

from math import degrees, dist, hypot

import numpy as np

from fowt_env.errors import warn_once

WIDE = 4.0  # fairlead radius over the hull's reach, both from the tower axis, above which to warn
LOW = 1.2  # fairlead depth over draft, above which to warn
ABOVE_BED = 0.1  # height of an anchor above the sea bed over water depth, above which to warn
UPRIGHT = 0.2  # largest horizontal over vertical span of a tendon, whose anchor may be anywhere below


def geometry_faults(platform):
    """Return {name: sentence} of the implausible positions of a Platform; empty if there are none."""
    return _line_faults(platform) | _member_faults(platform)


def warn_of_geometry(platform, label):
    """Warn, once per platform, of the faults of geometry_faults."""
    faults = geometry_faults(platform)
    if not faults:
        return
    key = hash((repr(platform.lines), repr(platform.members), *faults))
    text = " ".join(f"{text[0].upper()}{text[1:]}." for text in faults.values())
    warn_once(key, f"platform {label!r}: {text}")


def in_radians(anchors, fairleads):
    """Return the azimuths (deg) of anchors (n, 3) that look like radians read as degrees; None otherwise."""
    if len(anchors) < 2 or any(
        dist(a[:2], f[:2]) < UPRIGHT * abs(a[2] - f[2]) for a, f in zip(anchors, fairleads, strict=True)
    ):
        return None
    azimuths = [degrees(np.arctan2(y, x)) for x, y, _ in anchors]
    small = all(abs(azimuth) <= 6.3 for azimuth in azimuths)
    return azimuths if small and max(azimuths) - min(azimuths) > 1.0 else None


def _reach(platform):
    """Return the largest distance of the hull from the tower axis, m; None if the file does not define it."""
    reach = [0.5 * diameter for diameter in platform.hull.diameter] if platform.hull is not None else []
    for member in platform.members:
        ends = zip((member.start, member.end), member.diameter, strict=True)
        reach += [dist(point[:2], (0.0, 0.0)) + 0.5 * diameter for point, diameter in ends]
    return max(reach, default=None)


def _line_faults(platform):
    """Return {name: sentence} of the faults of mooring lines, each for its first line."""
    sentences, depth = {}, platform.environment.water_depth
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
                f"the anchor of line {number} is closer to the tower axis than its fairlead,"
                f" {span:.4g} m from it",
            ),
        }
        sentences |= {name: text for name, (wrong, text) in faults.items() if wrong and name not in sentences}
    return sentences


def _member_faults(platform):
    """Return {name: sentence} of the faults of members."""
    sentences, depth = {}, platform.environment.water_depth
    for number, member in enumerate(platform.members, 1):
        low = min(member.start[2], member.end[2])
        if low < -depth:
            sentences.setdefault(
                "sea bed",
                f"member {number} reaches down to z = {low:.4g} m, below the sea bed at {-depth:g} m",
            )
    if platform.members and all(min(member.start[2], member.end[2]) >= 0.0 for member in platform.members):
        sentences["dry"] = f"all {len(platform.members)} members lie above the water, where they have no load"
    return sentences
