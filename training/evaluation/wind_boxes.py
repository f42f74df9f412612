"""Caches full-field wind boxes, which take far longer to generate than a run."""

import hashlib
import json
from contextlib import suppress

import numpy as np

from fowt_env.descriptions.platform import Platform, read_platform, turbine_of
from fowt_env.files.atomic import replacing
from fowt_env.folders import cache_root, distrust, make_private
from fowt_env.weather.wind_field import WindBox, read_box

FORMAT = 1  # of the files; increased when read_box generates different boxes
ARRAYS, NUMBERS = ("velocity", "y", "z"), ("dt", "speed", "periodic", "shift")


def cached_box(spec, platform, seed, options, folder=None):
    """Return the WindBox of a specification for a platform's turbine, from a folder of boxes if it is there.

    Only generated boxes (kind "mann") are kept; files and arrays are read directly. folder: None for that of
    the user's cache.
    """
    if isinstance(spec, WindBox) or spec["kind"] != "mann":
        return new_box(spec, platform, seed, options)
    folder = _folder() if folder is None else folder
    if folder is None:
        return new_box(spec, platform, seed, options)
    path = box_path(spec, platform, seed, options, folder)
    # a damaged file can raise any exception: the box is then generated again
    with suppress(Exception), path.open("rb") as content, np.load(content, allow_pickle=False) as file:
        values = {key: file[key] for key in ARRAYS}
        return WindBox(**values, **{key: file[key].item() for key in NUMBERS})
    box = new_box(spec, platform, seed, options)
    with suppress(OSError), replacing(path) as temporary:  # e.g. no space on the disk
        np.savez(temporary, **{key: getattr(box, key) for key in (*ARRAYS, *NUMBERS)})
    return box


def new_box(spec, platform, seed, options):
    """Return the WindBox of a specification for a platform's turbine, read or generated."""
    return read_box(spec, **_arguments(platform, seed, options))


def box_path(spec, platform, seed, options, folder):
    """Return the path of the file in which cached_box keeps a generated box: a hash of its arguments."""
    text = json.dumps([FORMAT, spec, _arguments(platform, seed, options)], sort_keys=True)
    return folder / f"{hashlib.sha256(text.encode()).hexdigest()[:24]}.npz"


def _arguments(platform, seed, options):
    """Return the arguments of read_box for a platform's turbine."""
    description = platform if isinstance(platform, Platform) else read_platform(platform)
    rotor = turbine_of(description, options.get("turbine")).rotor
    shear = options.get("shear_exponent")
    return {
        "hub_height": rotor.hub_height,
        "rotor_diameter": 2.0 * rotor.tip_radius,
        "shear_exponent": description.environment.shear_exponent if shear is None else shear,
        "seed": seed,
        "duration": options["duration"],
    }


def _folder():
    """Return the folder of the boxes, next to that of the kernels; None without a private cache folder."""
    root = cache_root()
    if root is not None:
        with suppress(OSError):
            make_private(root / "wind_boxes")
            return None if distrust(root / "wind_boxes") else root / "wind_boxes"
    return None
