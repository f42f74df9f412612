"""Computes first-order potential-flow coefficients of a hull from a panel mesh, by Capytaine.

Capytaine (optional, `pip install "fowt-env[hydro]"`) solves the radiation and diffraction problems by
boundary elements; this module defines the problems, conventions and hydrostatics for a PotentialFlow.
"""

from math import inf, sqrt
from pathlib import Path

import numpy as np

from fowt_env.descriptions.potential_flow import PotentialFlow
from fowt_env.errors import InputError

MOTIONS = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")  # Capytaine's names
SHALLOW = 0.1  # wave number times depth, below which Capytaine's finite-depth Green function is not valid
MOST_PANELS = 20_000  # dense matrices of this many panels take 13 GB


def solve_mesh(
    path, omega, heading, *, water_depth, water_density=1025.0, gravity=9.80665, lid=True, report=None
):
    """Return the PotentialFlow of a hull from a panel mesh file, about the mesh's origin at still water.

    path         mesh file that Capytaine reads (.gdf, .pnl, .dat, .stl, .msh ...), in metres, z up from still
                 water, normals outwards; panels above the water are cut off
    omega        (n,) rad/s, increasing, > 0
    heading      (m,) rad, increasing, direction of travel of the waves
    water_depth  m
    lid          close the interior water plane, which removes irregular frequencies
    report       progress callback (text, problems done, total problems)
    Added mass at infinite frequency is computed too; added mass at zero frequency is omitted, because
    Capytaine has no such limit in finite depth.
    Raises: InputError without Capytaine, for an invalid mesh file, and for frequencies below its range.
    """
    cpt = _capytaine()
    omega, heading = np.asarray(omega, dtype=float), np.asarray(heading, dtype=float)
    _check_omega(omega, water_depth, gravity)
    body = _body(cpt, path, lid)
    water = {"water_depth": water_depth, "rho": water_density, "g": gravity}
    solver = cpt.BEMSolver()
    total = (omega.size + 1) * 6 + omega.size * heading.size
    done = 0

    def solved(problem, text):
        nonlocal done
        if report is not None:
            report(text, done, total)
        done += 1
        return solver.solve(problem)

    added, damping = np.zeros((omega.size + 1, 6, 6)), np.zeros((omega.size + 1, 6, 6))
    excitation = np.zeros((omega.size, heading.size, 6), dtype=complex)
    for i, w in enumerate((*omega, inf)):
        for j, name in enumerate(MOTIONS):
            problem = cpt.RadiationProblem(body=body, omega=w, radiating_dof=name, **water)
            result = solved(problem, f"radiation at {w:.3g} rad/s")
            added[i, :, j] = [result.added_mass[row] for row in MOTIONS]
            damping[i, :, j] = [result.radiation_damping[row] for row in MOTIONS]
    for i, w in enumerate(omega):
        for j, beta in enumerate(heading):
            problem = cpt.DiffractionProblem(body=body, omega=w, wave_direction=beta, **water)
            result = solved(problem, f"waves at {w:.3g} rad/s")
            incident = cpt.bem.airy_waves.froude_krylov_force(problem)
            force = np.array([result.forces[name] + incident[name] for name in MOTIONS])
            # Capytaine's convention is exp(-i omega t) with waves exp(i k x): conjugate
            excitation[i, j] = force.conj()
    volume, centre, stiffness = _hydrostatics(body.mesh, water_density, gravity)
    depth = -float(np.min(body.mesh.vertices[:, 2]))
    return PotentialFlow(
        omega=omega,
        added_mass=added[:-1],
        damping=damping[:-1],
        added_mass_infinite=added[-1],
        excitation_omega=omega,
        heading=heading,
        excitation=excitation,
        stiffness=stiffness,
        volume=volume,
        centre_of_buoyancy=(float(centre[0]), float(centre[1])),
        draft=depth,
        source=f"Capytaine {cpt.__version__}, {body.mesh.nb_faces} panels of {Path(path).name}",
    )


def _capytaine():
    try:
        import capytaine
    except ImportError as error:
        raise InputError(f'panel meshes need Capytaine 3 ({error}): pip install "fowt-env[hydro]"') from error
    capytaine.set_logging("ERROR")
    return capytaine


def _check_omega(omega, depth, gravity):
    """Refuse frequencies that do not increase, or whose waves are too long for the depth."""
    if not (omega.size and omega[0] > 0.0 and (np.diff(omega) > 0.0).all() and np.isfinite(omega).all()):
        raise InputError(f"omega = {omega.tolist()[:5]} ...: must increase and be > 0 rad/s")
    lowest = SHALLOW * sqrt(gravity / depth)  # long waves: omega = k sqrt(g h)
    if omega[0] < lowest:
        raise InputError(f"omega = {omega[0]:g}: must be > {lowest:.3g} rad/s in {depth:g} m of water")


def _body(cpt, path, lid):
    """Return the Capytaine FloatingBody of a mesh file, cut at still water, with six rigid-body motions."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"mesh file {str(path)!r} does not exist")
    try:
        mesh = cpt.load_mesh(str(path))
        mesh = mesh.merged() if hasattr(mesh, "merged") else mesh
        wet = mesh.immersed_part()
    except Exception as error:  # the mesh readers may raise any exception
        raise InputError(f"mesh file {str(path)!r} cannot be read: {type(error).__name__}: {error}") from None
    if not 0 < wet.nb_faces <= MOST_PANELS:
        raise InputError(
            f"mesh file {str(path)!r}: {wet.nb_faces} panels below the water; allowed: 1 to {MOST_PANELS}"
        )
    volume = _volume(wet)[0]
    if volume <= 0.0:
        raise InputError(
            f"mesh file {str(path)!r}: encloses {volume:.4g} m3: normals must point out of the hull, z up"
        )
    dofs = cpt.rigid_body_dofs(rotation_center=(0.0, 0.0, 0.0))
    return cpt.FloatingBody(mesh=wet, lid_mesh=wet.generate_lid() if lid else None, dofs=dofs)


def _volume(mesh):
    """Return (volume, centre of buoyancy (3,)) of a cut mesh, by the divergence theorem."""
    centre, normal, area = mesh.faces_centers, mesh.faces_normals, mesh.faces_areas
    volume = float(np.sum(area * normal[:, 2] * centre[:, 2]))
    moment = 0.5 * np.sum((area * normal[:, 2] * centre[:, 2])[:, None] * centre, axis=0)
    moment[:2] *= 2.0
    return volume, moment / volume


def _hydrostatics(mesh, density, gravity):
    """Return (volume, centre, (6, 6) hydrostatic stiffness without weight) of a cut mesh."""
    volume, centre = _volume(mesh)
    x, y = mesh.faces_centers[:, 0], mesh.faces_centers[:, 1]
    plane = -mesh.faces_areas * mesh.faces_normals[:, 2]  # water-plane area above each panel
    c = density * gravity
    stiffness = np.zeros((6, 6))
    stiffness[2, 2] = c * plane.sum()
    stiffness[2, 3] = stiffness[3, 2] = c * (plane * y).sum()
    stiffness[2, 4] = stiffness[4, 2] = -c * (plane * x).sum()
    stiffness[3, 4] = stiffness[4, 3] = -c * (plane * x * y).sum()
    stiffness[3, 3] = c * ((plane * y * y).sum() + volume * centre[2])
    stiffness[4, 4] = c * ((plane * x * x).sum() + volume * centre[2])
    stiffness[3:5, 5] = -c * volume * centre[:2]
    return volume, centre, stiffness
