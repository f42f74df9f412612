"""The style that all figures share: colours, axes, writing."""

from io import BytesIO
from pathlib import Path

from fowt_env.caches import cached
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing

# Okabe and Ito's palette: told apart with any colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LINES = ("-", "--", ":", "-.")  # for each further round of colours
INK, SOFT, FAINT = "#333333", "#777777", "#D9D9D9"
UNSCORED = "#EFEFEF"
LONGEST_NAME = 28  # characters of a controller's name in a plot
SCREEN, SHARP = 96, 2  # dots per inch of a notebook's page, and pixels to each


def new_figure(width, height):
    """An empty Figure in the house style, which a notebook shows as a picture.

    Raises: InputError that names the extra to install.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f'plots need matplotlib ({error}): pip install "fowt-env[plot]"') from error
    return _shown(Figure)(figsize=(width, height), layout="constrained", facecolor="white")


@cached(1)
def _shown(figure_class):
    """Matplotlib's Figure that brings its own picture: without pyplot IPython has no way to make one."""

    class NotebookFigure(figure_class):
        def _repr_png_(self):
            """(PNG, size on the page), as IPython asks for."""
            picture = BytesIO()
            self.savefig(picture, format="png", dpi=SCREEN * SHARP)
            width, height = (round(SCREEN * side) for side in self.get_size_inches())
            return picture.getvalue(), {"width": width, "height": height}

    return NotebookFigure


def style_axes(axes):
    """Light grid, no box, quiet ticks."""
    axes.grid(True, color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(INK)
    axes.tick_params(colors=INK, labelsize=8)


def line_style(number):
    """Colour and line style of the number-th of several runs; no two of the first 28 have both."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": LINES[number // len(COLOURS) % len(LINES)],
    }


def short_names(names):
    """{name: text} for plots: without `policy:`, modules and folders, and at most LONGEST_NAME long.

    A text that two names would share is the whole name for both.
    """
    short = {name: _short(str(name)) for name in names}
    texts = list(short.values())
    return {name: text if texts.count(text) == 1 else str(name) for name, text in short.items()}


def _short(name):
    kind, colon, rest = name.partition(":")
    if colon and rest:
        name = Path(rest).stem if "/" in rest or Path(rest).suffix else rest
    if len(name) > LONGEST_NAME:
        half = LONGEST_NAME // 2
        name = f"{name[:half]}…{name[len(name) - half + 1 :]}"
    return name


def head(figure, title=None, handles=(), names=()):
    """Put the title and one legend of all panels, where it has names, above them."""
    named = [(handle, name) for handle, name in zip(handles, names, strict=True) if name]
    if not named:
        if title:
            figure.suptitle(title, fontsize=11, color=INK)
        return
    width = 72.0 * figure.get_size_inches()[0]  # points
    entry = 0.6 * 8.5 * max(len(name) for _, name in named) + 40.0
    figure.legend(
        *zip(*named, strict=True),
        loc="outside upper center",
        ncols=max(1, min(len(named), int(width // entry))),
        fontsize=8.5,
        labelcolor=INK,
        frameon=False,
        handlelength=1.8,
        title=title,  # as the legend's own: a suptitle would lie upon it
        title_fontproperties={"size": 11},
    )


def save_figure(figure, path):
    """The figure, written to `path` (format by its ending, default PNG) unless that is None."""
    if path is not None:
        path = Path(path)
        if not path.name:
            raise InputError(f"plot file {str(path)!r}: must name a file")
        if not path.suffix:
            path = path.with_suffix(".png")
        supported = figure.canvas.get_supported_filetypes()
        if path.suffix[1:].lower() not in supported:
            allowed = ", ".join(sorted(supported))
            raise InputError(f"plot file {str(path)!r}: unknown ending; allowed: {allowed}")
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=150)
    return figure
