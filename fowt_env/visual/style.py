"""The style that all figures share: colours, axes, writing."""

from pathlib import Path

from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing

# Okabe and Ito's palette: told apart with any colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
INK, FAINT = "#333333", "#D9D9D9"


def new_figure(width, height):
    """An empty Figure in the house style. Raises: InputError that names the extra to install."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f'plots need matplotlib ({error}): pip install "fowt-env[plot]"') from error
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def style_axes(axes):
    """Light grid, no box, quiet ticks."""
    axes.grid(True, color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(INK)
    axes.tick_params(colors=INK, labelsize=8)


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
