"""Makes tests/reference/lidar_spectra.csv anew: python tests/lidar_spectra.py FOLDER.

FOLDER has LidarRotorSpectra_IEA15MW_4BeamPulsed.mat and LidarRotorSpectra_IEA15MW_CircularCW.mat of
github.com/IEAWindTask52/LidarAssistedControl, commit 45992f0, Release/AnalyticalModel.
"""

import hashlib
import sys
from pathlib import Path

import numpy as np

PATH = Path(__file__).parent / "reference" / "lidar_spectra.csv"
FILES = {
    "four_beam_pulsed": (
        "LidarRotorSpectra_IEA15MW_4BeamPulsed.mat",
        "f2a84070a2807265399b59232e6c92d562c5c3dac0427ed5abf2cac6b74e5d32",
    ),
    "circular_cw": (
        "LidarRotorSpectra_IEA15MW_CircularCW.mat",
        "049e8bf7614dd931d0417b6ba9b46e1c4c31bf144f0eb7afd0060a36141687e9",
    ),
}
KEPT = np.unique(np.geomspace(1, 256, 16).round().astype(int)) - 1  # to 0.25 Hz, even in the logarithm
HEAD = """\
# Spectra of rotor-effective wind (RR) and a lidar's estimate of it (LL), and size of their cross spectrum (RL), (m/s)^2/Hz,
# of the IEA 15 MW (rotor radius 120 m, hub 150 m) at 18 m/s, sigma_u = 2.674 m/s, wind that does not evolve; computed by an
# independent MATLAB model (Schlipf and Guo, Flensburg): IEA Wind Task 52, github.com/IEAWindTask52/LidarAssistedControl,
# commit 45992f0, Release/AnalyticalModel/LidarRotorSpectra_IEA15MW_*.mat, some of 1024 frequencies (MIT License, Copyright
# (c) 2022 Flensburg University of Applied Sciences, WETI). There v and w of distinct points along the beams are independent.
lidar,frequency_Hz,RR,RL,LL
"""  # noqa: E501


def text_of(folder):
    """Text of the stored file, from the two MATLAB files. Raises: ValueError where one is another."""
    from scipy.io import loadmat

    rows = []
    for lidar, (name, digest) in FILES.items():
        path = Path(folder) / name
        if hashlib.sha256(path.read_bytes()).hexdigest() != digest:
            raise ValueError(f"{path}: not the file of commit 45992f0")
        data = loadmat(path, squeeze_me=True)
        for k in KEPT:
            values = data["S_RR"][k], abs(data["S_RL"][k]), data["S_LL"][k]
            rows.append(",".join([lidar, f"{data['f'][k]:.10g}", *(f"{value:.7g}" for value in values)]))
    return HEAD + "\n".join(rows) + "\n"


if __name__ == "__main__":
    PATH.write_text(text_of(sys.argv[1]))
