"""Caches full-field wind boxes, which take far longer to generate than a run."""

import hashlib
import json
from contextlib import suppress

import numpy as np

from fowt_env.descriptions.platform import Platform, read_platform, turbine_of
from fowt_env.descriptions.wind import checked_keys
from fowt_env.files.atomic import replacing
from fowt_env.folders import cache_root, distrust, make_private
from fowt_env.weather.wind_field import mann_key, read_box

FORMAT = 2  # of the files; increased when mann_turbulence generates other numbers


def cached_box(spec, platform, seed, options, folder=None):
    """Return the WindBox of a specification for a platform's turbine, with turbulence kept in a folder.

    Only generated turbulence (kind "mann") is kept, before it is scaled, so that boxes of several models and
    directions share it; files and arrays are read directly. folder: None for that of the user's cache.
    """
    folder = _folder() if folder is None else folder
    if folder is None:
        return new_box(spec, platform, seed, options)

    def keep(key, make):
        path = _path(folder, key)
        # a damaged file can raise any exception: the turbulence is then generated again
        with suppress(Exception), path.open("rb") as content:
            velocity = np.load(content, allow_pickle=False)
            if velocity.shape == (key[0], key[1], key[1], 3) and velocity.dtype == np.float32:
                return velocity
        velocity = make()
        with (
            suppress(OSError),
            replacing(path) as temporary,
            temporary.open("wb") as content,
        ):  # e.g. disk full
            np.save(content, velocity)
        return velocity

    return new_box(spec, platform, seed, options, keep)


def new_box(spec, platform, seed, options, keep=None):
    """Return the WindBox of a specification for a platform's turbine; keep: as in read_box."""
    return read_box(spec, **_arguments(platform, seed, options), keep=keep)


def box_path(spec, platform, seed, options, folder):
    """Return the path of the file in which cached_box keeps the turbulence of a box of kind "mann"."""
    arguments = _arguments(platform, seed, options)
    arguments.pop("shear_exponent")
    return _path(folder, mann_key(checked_keys(spec), **arguments))


def _path(folder, key):
    """Return the path of turbulence, named after all that it depends on."""
    return folder / f"{hashlib.sha256(json.dumps([FORMAT, *key]).encode()).hexdigest()[:24]}.npy"


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
