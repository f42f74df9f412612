"""Writes linear models to MATLAB files."""

from pathlib import Path
from typing import Any

from fowt_env.errors import InputError
from fowt_env.files.atomic import replacing


def write_mat(model: Any, path: str | Path) -> Path:
    """Write an analysis.linear_model.LinearModel to a MATLAB file (version 5, SI, radians); return the path.

    The file contains the model's matrices by name (A, B, and C to F if present), the cell arrays states,
    inputs and outputs, and the operating point: x0 and u0 in the order of states and inputs (NaN for no wind)
    and the struct operating_point of OpenFAST channels.
    In MATLAB: m = load("model.mat"); plant = ss(m.A, m.B, eye(size(m.A)), 0, "StateName", m.states).
    Raises: InputError if the path does not end with .mat.
    """
    import numpy as np
    from scipy.io import savemat

    from fowt_env.plant.state import STATE_INDEX

    path = Path(path)
    if path.suffix.lower() != ".mat":
        raise InputError(f"output file {str(path)!r}: must end with .mat")
    point: Any = model.point  # an OperatingPoint
    wind = np.nan if point.wind_speed is None else point.wind_speed
    content = {name: getattr(model, name) for name in "ABCDEF" if hasattr(model, name)}
    for name in ("states", "inputs", "outputs"):
        if hasattr(model, name):
            content[name] = np.array(getattr(model, name), dtype=object)
    content |= {
        "x0": np.asarray(model.x0 if hasattr(model, "x0") else point.state[list(STATE_INDEX)])[:, None],
        "u0": np.array([*point.command, wind])[:, None],
        "operating_point": dict(point),
    }
    with replacing(path) as temporary:
        savemat(temporary, content, appendmat=False, oned_as="column")
    return path
