"""Defines the common style of all figures: colours, axes, text."""

from io import BytesIO
from itertools import count
from pathlib import Path

from fowt_env.caches import cached
from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing

# palette of Okabe and Ito, distinguishable with any colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
OWN = ("gspi_oc3", "mpc", "lqr", "floating_feedback", "rosco_float", "pi", "pi_tuned")  # of these colours
LINES = ("-", "--", ":", "-.")  # for each further round of colours
INK, SOFT, FAINT = "#333333", "#777777", "#D9D9D9"
UNSCORED = "#EFEFEF"
LONGEST_NAME = 28  # characters of a controller's name in a plot
SCREEN, SHARP = 96, 2  # dots per inch of a notebook page, and pixels per dot


def new_figure(width, height):
    """Return an empty Figure in the common style, displayed as an image in notebooks.

    Raises: InputError that names the extra to install.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f'plots need matplotlib ({error}): pip install "fowt-env[plot]"') from error
    return _shown(Figure)(figsize=(width, height), layout="constrained", facecolor="white")


@cached(1)
def _shown(figure_class):
    """Return a Figure subclass with a PNG representation, which IPython lacks without pyplot."""

    class NotebookFigure(figure_class):
        def _repr_png_(self):
            """Return (PNG, size on the page) for IPython."""
            picture = BytesIO()
            self.savefig(picture, format="png", dpi=SCREEN * SHARP)
            width, height = (round(SCREEN * side) for side in self.get_size_inches())
            return picture.getvalue(), {"width": width, "height": height}

    return NotebookFigure


def style_axes(axes, xlabel=None, ylabel=None, title=None):
    """Set a light grid, no box, grey ticks, and the labels and title unless None."""
    axes.grid(True, color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(INK)
    axes.tick_params(colors=INK, labelsize=8)
    for write, text in ((axes.set_xlabel, xlabel), (axes.set_ylabel, ylabel), (axes.set_title, title)):
        if text is not None:
            write(text, fontsize=9, color=INK)


def style_numbers(names):
    """Return [number] of names for COLOURS and line_style: controllers in OWN have the same in every picture.

    Other names take the numbers that are left, in order.
    """
    names = list(names)
    own = {name: OWN.index(name) for name in names if name in OWN}
    left = (number for number in count() if number not in own.values())
    return [own[name] if name in own else next(left) for name in names]


def line_style(number):
    """Return colour and line style of a number; the first 28 combinations differ."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": LINES[number // len(COLOURS) % len(LINES)],
    }


def short_names(names):
    """Return {name: text} for plots, without `policy:`, modules and folders, at most LONGEST_NAME long.

    Names with the same text keep their full form.
    """
    short = {name: _short(str(name)) for name in names}
    texts = list(short.values())
    return {name: text if texts.count(text) == 1 else str(name) for name, text in short.items()}


def _short(name):
    kind, colon, rest = name.partition(":")
    if colon and rest:
        rest = rest.partition(",")[0]  # a library without its input file
        name = Path(rest).stem if "/" in rest or Path(rest).suffix else rest
    if len(name) > LONGEST_NAME:
        half = LONGEST_NAME // 2
        name = f"{name[:half]}…{name[len(name) - half + 1 :]}"
    return name


def head_of(figure, panels, names, title=None):
    """Put the title and a common legend above all panels; a run named "" has no entry."""
    texts, handles = short_names(names), {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    shown = [name for name in names if name in handles]
    head(figure, title, [handles[name] for name in shown], [texts[name] for name in shown])


def head(figure, title=None, handles=(), names=()):
    """Put the title and a legend of the named handles above the panels."""
    named = [(handle, name) for handle, name in zip(handles, names, strict=True) if name]
    if not named:
        if title:
            figure.suptitle(title, fontsize=11, color=INK)
        return
    width = 72.0 * figure.get_size_inches()[0]  # points
    entry = 0.6 * 8.5 * max(len(name) for _, name in named) + 40.0
    figure.legend(
        *zip(*named, strict=True),
        loc="outside upper center", ncols=max(1, min(len(named), int(width // entry))), fontsize=8.5,
        labelcolor=INK, frameon=False, handlelength=1.8,
        title=title, title_fontproperties={"size": 11},  # title of the legend: a suptitle would overlap
    )  # fmt: skip


def note(axes, text, position, offset, scale="data", **look):
    """Write a small text into a panel at a position (see scale) plus an offset in points."""
    coordinates = ("data", "axes fraction") if scale == "data" else ("axes fraction", "data")
    look = {"fontsize": 7, "color": SOFT, "textcoords": "offset points"} | look
    axes.annotate(text, position, xycoords=coordinates, xytext=offset, **look)


def plot_path(path):
    """Return the path of a plot, .png without an extension. Raises: InputError for an unknown one."""
    path = Path(path)
    if not path.name:
        raise InputError(f"plot file {str(path)!r}: must name a file")
    if not path.suffix:
        path = path.with_suffix(".png")
    supported = new_figure(1.0, 1.0).canvas.get_supported_filetypes()
    if path.suffix[1:].lower() not in supported:
        allowed = ", ".join(sorted(supported))
        raise InputError(f"plot file {str(path)!r}: unknown extension; allowed: {allowed}")
    return path


def save_figure(figure, path):
    """Write the figure to `path` (format by extension, default PNG) unless None; return the figure."""
    if path is not None:
        with replacing(plot_path(path)) as temporary:
            figure.savefig(temporary, dpi=150)
    return figure
