"""Writes animations of finished runs: GIF or MP4 of one to four controllers side by side.

Needs pygame and pillow (GIF), and imageio with ffmpeg for MP4: pip install "fowt-env[render]" or "[video]".
"""

import errno
from contextlib import suppress
from itertools import chain
from pathlib import Path

import numpy as np

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing
from fowt_env.visual.rendering import (
    AT_REST,
    LOOSE,
    MOTIONS,
    RGB_COLOURS,
    TIGHT,
    TIPS,
    TRACES,
    WINDOW,
    YELLOW,
    View,
)
from fowt_env.visual.style import short_names

SUFFIXES = (".gif", ".mp4")
MOST_RUNS = 4
DRAWN = ("Time", *MOTIONS, "Azimuth", "RotSpeed")
GIF_COLOURS = 64  # size of the palette; a small palette keeps files small
CLEAR = GIF_COLOURS - 1  # palette entry of unchanged pixels
UNSEEN = 6  # of 255: smaller changes of a pixel accumulate before the pixel is redrawn
MOST_STILL = 2.0  # windows: shorter animations have a fixed time axis
# colours of small areas that the palette must contain, added to the palette's sample in SWATCH rows
SHADE = (178, 141, 30)  # shaded yellow
KEY_COLOURS = (*RGB_COLOURS, YELLOW, SHADE, LOOSE, AT_REST, TIGHT)
SWATCH = 160


def animate(scene, runs, path, *, speed=4.0, fps=20, size=(960, 540), start=0.0, progress=None):
    """Write an animation of runs {label: frame of simulate} of one scene; return its path.

    speed     seconds of the run per second of the animation
    fps       images per second; a GIF rounds the interval to hundredths of a second
    size      image size (width, height), pixels, both even
    start     time of the first image, s
    progress  called as progress(done, total)
    Raises: InputError for invalid settings, or if a library is missing.
    """
    path = animation_path(path)
    if not 1 <= len(runs) <= MOST_RUNS:
        raise InputError(f"animation: {len(runs)} runs; must be 1 to {MOST_RUNS}")
    for name, value, top in (("speed", speed, 1000.0), ("fps", fps, 60.0)):
        check_number(name, value, 0.0, top, low_open=True)
    if any(side % 2 or not 160 <= side <= 4000 for side in size):
        raise InputError(f"size = {size}: both must be even and in [160, 4000]")
    pause = max(2, round(100.0 / fps)) if path.suffix.lower() == ".gif" else 100.0 / fps  # 1/100 s
    tracks = [_Track(label, frame) for label, frame in runs.items()]
    end = max(track.time[-1] for track in tracks)
    check_number("start", start, tracks[0].time[0], end, high_open=True)
    times = np.arange(start, end, 0.01 * pause * speed)
    span = (float(start), float(end)) if end - start <= MOST_STILL * WINDOW else None
    limits = {}
    for channel in (trace.channel for trace in TRACES):
        kept = [track.values[channel][track.time >= start] for track in tracks]
        limits[channel] = min(values.min() for values in kept), max(values.max() for values in kept)
    labels = None if list(runs) == [""] else list(short_names(runs).values())
    view = View([scene] * len(tracks), labels, tuple(size), speed=speed, span=span, limits=limits)

    def pictures():
        for number, time in enumerate(times):
            view.draw([track.at(time) for track in tracks])
            if progress is not None:
                progress(number + 1, len(times))
            yield view.array()

    with replacing(path) as temporary:
        write = _write_gif if path.suffix.lower() == ".gif" else _write_mp4
        write(pictures(), temporary, pause)
    return path


def animation_path(path):
    """Return `path` as a Path. Raises: InputError for a file name extension not in SUFFIXES."""
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"animation {str(path)!r}: must end with {' or '.join(SUFFIXES)}")
    return path


class _Track:
    """Interpolates the drawn channels of one run; values stay constant after the end of the run."""

    def __init__(self, label, frame):
        channels = dict.fromkeys((*DRAWN, *(trace.channel for trace in TRACES)))
        columns = {name.partition("_[")[0]: name for name in frame.columns}
        missing = [name for name in channels if name not in columns]
        if missing or len(frame) < 2:
            raise InputError(f"run {label!r}: needs at least two rows and the channels {', '.join(channels)}")
        tips = [name for name in columns if name.startswith(TIPS)]
        self.values = {name: frame[columns[name]].to_numpy(dtype=float) for name in (*channels, *tips)}
        self.values["Azimuth"] = np.unwrap(self.values["Azimuth"], period=360.0)
        self.time = self.values["Time"]

    def at(self, time):
        """Return the row of channels at a time, interpolated linearly."""
        row = {name: float(np.interp(time, self.time, values)) for name, values in self.values.items()}
        return row | {"Time": time}


def _write_gif(pictures, path, pause):
    """Write images as a looping GIF with one palette, from the first image and KEY_COLOURS.

    Each frame contains the changed pixels; unchanged pixels are transparent and compress well.
    """
    try:
        from PIL import GifImagePlugin, Image
    except ImportError as error:
        raise InputError(f'a GIF needs pillow ({error}): pip install "fowt-env[render]"') from error
    shown = next(pictures)
    swatches = np.repeat(np.array(KEY_COLOURS, dtype=np.uint8), SWATCH // len(KEY_COLOURS), axis=0)
    sample = np.vstack([shown, np.broadcast_to(swatches[:, None], (len(swatches), shown.shape[1], 3))])
    palette = Image.fromarray(sample).quantize(CLEAR, method=Image.Quantize.MEDIANCUT)
    entries = (palette.getpalette() + [0] * 768)[:768]
    settings = {"duration": 10 * pause, "loop": 0}

    def reduced(picture):
        return np.array(Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE))

    def image(indices):
        result = Image.frombytes("P", indices.shape[::-1], indices.tobytes())
        result.putpalette(entries)
        return result

    before = reduced(shown)
    whole = image(before)
    whole.info = dict(settings)
    with open(path, "wb") as file:
        file.writelines(GifImagePlugin.getheader(whole, info=settings)[0])
        file.writelines(GifImagePlugin.getdata(whole, **settings))
        shown = shown.copy()
        for picture in pictures:
            indices = reduced(picture)
            changed = indices != before
            gap = np.abs(picture[changed].astype(np.int16) - shown[changed]).max(axis=1)
            changed[changed] = gap > UNSEEN
            before[changed], shown[changed] = indices[changed], picture[changed]
            rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
            if not rows.size:  # a frame needs at least one pixel
                rows = columns = np.zeros(1, dtype=int)
            box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
            part = image(np.where(changed, indices, CLEAR).astype(np.uint8)[box])
            look = settings | {"transparency": CLEAR, "disposal": 1}
            file.writelines(GifImagePlugin.getdata(part, (int(columns[0]), int(rows[0])), **look))
        file.write(b";")


def _write_mp4(pictures, path, pause):
    """Write images as H.264 video."""
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise InputError(f'an MP4 needs imageio-ffmpeg ({error}): pip install "fowt-env[video]"') from error
    first = next(pictures)
    height, width = first.shape[:2]
    writer = imageio_ffmpeg.write_frames(
        str(path), (width, height), fps=100.0 / pause, quality=7, macro_block_size=2, ffmpeg_log_level="error"
    )
    sent = written = 0
    try:
        writer.send(None)
        for picture in chain([first], pictures):
            sent += 1
            try:
                writer.send(picture)
            except OSError:  # ffmpeg has ended
                break
    finally:
        writer.close()
    with suppress(RuntimeError):  # the file is not a valid video
        written, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    if written < sent:  # ffmpeg reports no reason; usually a full disk
        raise OSError(errno.EIO, f"ffmpeg wrote {written} of {sent} images", str(path))
