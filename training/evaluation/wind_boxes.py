"""Boxes of full-field wind, made once and kept: a box takes far longer to make than a run in it."""

import hashlib
import json
from contextlib import suppress

import numpy as np

from fowt_env.descriptions.platform import Platform, read_platform
from fowt_env.descriptions.turbine import Turbine, read_turbine
from fowt_env.files.atomic import replacing
from fowt_env.folders import cache_root, distrust, make_private
from fowt_env.weather.wind_field import WindBox, read_box

FORMAT = 1  # of the files; raised when read_box makes other boxes of the same specification
ARRAYS, NUMBERS = ("velocity", "y", "z"), ("dt", "speed", "periodic", "shift")


def cached_box(spec, platform, seed, options):
    """WindBox of a specification for a platform's turbine, from the user's cache folder where it is there.

    Only generated boxes (kind "mann") are kept; files and arrays are read as they are.
    """
    description = platform if isinstance(platform, Platform) else read_platform(platform)
    turbine = options.get("turbine") or description.turbine
    rotor = (turbine if isinstance(turbine, Turbine) else read_turbine(turbine)).rotor
    shear = options.get("shear_exponent")
    arguments = {
        "hub_height": rotor.hub_height,
        "rotor_diameter": 2.0 * rotor.tip_radius,
        "shear_exponent": description.environment.shear_exponent if shear is None else shear,
        "seed": seed,
        "duration": options["duration"],
    }
    if isinstance(spec, WindBox) or spec["kind"] != "mann":
        return read_box(spec, **arguments)
    text = json.dumps([FORMAT, spec, arguments], sort_keys=True)
    name = hashlib.sha256(text.encode()).hexdigest()[:24]
    folder = _folder()
    if folder is None:
        return read_box(spec, **arguments)
    path = folder / f"{name}.npz"
    if path.exists():
        try:
            with path.open("rb") as content, np.load(content, allow_pickle=False) as file:
                values = {key: file[key] for key in ARRAYS}
                return WindBox(**values, **{key: file[key].item() for key in NUMBERS})
        except Exception:  # whatever a broken file makes numpy raise: it is made again
            pass
    box = read_box(spec, **arguments)
    with suppress(OSError), replacing(path) as temporary:  # without space it is made again the next time
        np.savez(temporary, **{key: getattr(box, key) for key in (*ARRAYS, *NUMBERS)})
    return box


def _folder():
    """Folder for boxes, beside that of the kernels; None where there can be none of this user's own."""
    root = cache_root()
    if root is None:
        return None
    folder = root / "wind_boxes"
    try:
        make_private(folder)
        return None if distrust(folder) else folder
    except OSError:
        return None
