"""Slow, obvious twin of fowt_env/plant/hydro/hydrostatics.py: fibres along the hull, each integrated."""

import numpy as np


def submerged(r, R, z, radius, rings=40, spokes=64):
    """(V, Q (3,)): submerged volume and its first moment in body axes below the plane Z = 0.

    A fibre runs at a fixed share s of the local radius and a fixed angle; its height above water is
    linear along it, so its wet part is one interval. Exact up to rounding while no fibre end is cut.
    """
    n = R[2]
    x, w = np.polynomial.legendre.leggauss(rings)
    share, share_weight = 0.5 * (x + 1.0), 0.5 * w
    angle = (np.arange(spokes) + 0.5) * 2.0 * np.pi / spokes
    s, a = np.meshgrid(share, angle, indexing="ij")
    weight = np.outer(share_weight, np.full(spokes, 2.0 * np.pi / spokes))
    slant = s * (n[0] * np.cos(a) + n[1] * np.sin(a))  # height above water per metre of local radius
    gx, gw = np.polynomial.legendre.leggauss(4)  # the integrands are at most quartic in z
    volume, Q = 0.0, np.zeros(3)
    for z0, z1, r0, r1 in zip(z[:-1], z[1:], radius[:-1], radius[1:], strict=True):
        growth = (r1 - r0) / (z1 - z0)
        at_bottom = r[2] + n[2] * z0 + slant * r0
        rate = n[2] + slant * growth
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = np.clip(z0 - at_bottom / rate, z0, z1)
        low = np.where(rate >= 0.0, z0, crossing)
        high = np.where(rate >= 0.0, crossing, z1)
        for x, w in zip(gx, gw, strict=True):
            height = low + (high - low) * (x + 1.0) / 2.0
            local = r0 + growth * (height - z0)
            element = weight * s * local**2 * w * (high - low) / 2.0
            volume += element.sum()
            Q += [
                (element * s * local * np.cos(a)).sum(),
                (element * s * local * np.sin(a)).sum(),
                (element * height).sum(),
            ]
    return volume, Q


def wrench(r, R, z, radius, specific_weight, **fibres):
    """(F, M) of the buoyancy in body axes about the body origin."""
    volume, Q = submerged(r, R, z, radius, **fibres)
    return specific_weight * volume * R[2], specific_weight * np.cross(Q, R[2])
