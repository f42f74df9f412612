"""Slow, obvious twin of fowt_env/plant/mooring.py: the equations of theory.md 5.5 as printed, N and m."""

import numpy as np
from scipy.optimize import brentq


def spans(H, V, L, w, EA, CB=0.0):
    """(x_F, z_F) of the fairlead tensions: Eqs. (18)(19) for V >= wL, else (18t)(19t)."""
    if V >= w * L:
        V_a = V - w * L
        x = H / w * (np.arcsinh(V / H) - np.arcsinh(V_a / H)) + H * L / EA
        z = (np.hypot(H, V) - np.hypot(H, V_a)) / w + L / EA * (V - w * L / 2)
        return x, z
    L_B = L - V / w
    x = L_B + H / w * np.arcsinh(V / H) + H * L / EA
    if CB > 0:
        grip = L_B - H / (CB * w)
        x += CB * w / (2 * EA) * (-(L_B**2) + grip * max(grip, 0.0))
    z = (np.hypot(H, V) - H) / w + V**2 / (2 * EA * w)
    return x, z


def jacobian(H, V, L, w, EA, CB=0.0):
    """d(x_F, z_F)/d(H, V), (2, 2), each branch differentiated by hand."""
    a = np.hypot(H, V)
    if V >= w * L:
        V_a = V - w * L
        b = np.hypot(H, V_a)
        x_H = (np.arcsinh(V / H) - np.arcsinh(V_a / H) - V / a + V_a / b) / w + L / EA
        x_V = H / w * (1 / a - 1 / b)
        return np.array([[x_H, x_V], [x_V, (V / a - V_a / b) / w + L / EA]])
    x_H = (np.arcsinh(V / H) - V / a) / w + L / EA
    x_V = z_H = (H / a - 1) / w
    if CB > 0:
        L_B = L - V / w
        slack = max(L_B - H / (CB * w), 0.0)
        x_H -= slack / EA
        x_V += CB * (L_B - slack) / EA
    return np.array([[x_H, x_V], [z_H, V / (a * w) + V / (EA * w)]])


def catenary(x_f, z_f, L, w, EA, CB=0.0):
    """(H, V) by bisection in bisection: V(H) from the height, then H from the distance."""
    hanging = EA / w * (np.sqrt(1 + 2 * z_f * w / EA) - 1)
    if L - hanging >= x_f:
        return 0.0, w * hanging

    def vertical(H):
        top = w * L + EA * z_f / L + w * z_f + np.sqrt(2 * EA * w * z_f)
        return brentq(lambda V: spans(H, V, L, w, EA, CB)[1] - z_f, 0.0, top, xtol=1e-300, rtol=1e-15)

    def miss(log_H):
        H = np.exp(log_H)
        return spans(H, vertical(H), L, w, EA, CB)[0] - x_f

    high = EA * (abs(x_f / L) + 1) + CB * w * L
    H = np.exp(brentq(miss, np.log(1e-9 * w), np.log(high), xtol=1e-15, rtol=1e-15))
    return H, vertical(H)


def anchor_tension(H, V, L, w, CB=0.0):
    """Tension at the anchor."""
    return np.hypot(H, V - w * L) if V >= w * L else max(H - CB * (w * L - V), 0.0)


def load(position, R, anchors, fairleads, L, w, EA, CB=0.0):
    """(force, moment about the body origin) of lines, both in body axes."""
    force, moment = np.zeros(3), np.zeros(3)
    for anchor, fairlead in zip(anchors, fairleads, strict=True):
        span = anchor - (position + R @ fairlead)
        x_f = np.hypot(span[0], span[1])
        H, V = catenary(x_f, -span[2], L, w, EA, CB)
        f = R.T @ np.array([H * span[0] / x_f, H * span[1] / x_f, -V])
        force += f
        moment += np.cross(fairlead, f)
    return force, moment
