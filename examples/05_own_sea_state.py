"""Seas of your own: a spectrum, a list of wave components from a measured record, and a file."""

from pathlib import Path

import numpy as np

import fowt_env

measured = {  # two swells, one at a slant; any list of components does
    "kind": "components",
    "omega": [0.50, 0.57, 0.80],  # rad/s
    "amplitude": [1.2, 0.8, 0.3],  # m
    "phase": [0.0, 1.0, 4.0],  # rad
    "heading": [0.0, 0.0, 30.0],  # deg from the wind
}

file = Path("results/examples/my_sea.toml")  # a path works wherever a name does
file.parent.mkdir(parents=True, exist_ok=True)
file.write_text('kind = "jonswap"\nHs = 4.0\nTp = 9.0\ngamma = 2.0\nsource = "my site, winter"\n')

seas = {
    "named: paper_wind_wave": "paper_wind_wave",
    "spectrum": {"kind": "pierson_moskowitz", "Hs": 4.0, "Tp": 9.0},
    "components": measured,
    "file": file,
}
for name, sea in seas.items():
    scene = fowt_env.build_scene(wind=18.0, sea=sea, seed=2, fidelity="standard")
    run = fowt_env.simulate(scene, controller="pi", duration=600.0)
    height = 4.0 * np.std(run["Wave1Elev_[m]"])
    print(f"{name:24} 4 x std of elevation {height:5.2f} m, heave std {run['PtfmHeave_[m]'].std():.3f} m")
