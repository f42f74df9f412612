"""Slow, obvious twins of radiation memory: every past velocity kept, every integral a plain sum."""

import numpy as np
from scipy.linalg import expm


def state_matrices(memory):
    """(A, B (n, 6), C (6, n)) of z' = A z + B v, F = -C z, of a StateSpaceMemory, its states in order."""
    size = 2 * memory.pole.shape[1]
    a, b, c = np.zeros((size, size)), np.zeros((size, 6)), np.zeros((6, size))
    for j in range(6):
        first, count = memory.begin[j], memory.begin[j + 1] - memory.begin[j]
        for k in range(count):
            real, imaginary = 2 * first + k, 2 * first + count + k
            decay, turn = memory.pole[:, first + k]
            a[real, real] = a[imaginary, imaginary] = decay
            a[real, imaginary], a[imaginary, real] = -turn, turn
            b[real, j] = 1.0
    for i in range(6):
        for e in range(memory.row[i], memory.row[i + 1]):
            j = memory.column[e]
            start, count = 2 * memory.begin[j], 2 * (memory.begin[j + 1] - memory.begin[j])
            c[i, start : start + count] = memory.weight[e, :count]
    return a, b, c


def states_after(memory, z, before, after, dt):
    """Memory states dt after z, while the inertial velocities go linearly from before to after (6,)."""
    a, b, _ = state_matrices(memory)
    n = a.shape[0]
    block = np.zeros((n + 12, n + 12))  # of z, v and v', which is constant
    block[:n, :n], block[:n, n : n + 6], block[n : n + 6, n + 6 :] = a, b, np.eye(6)
    return (expm(block * dt) @ np.r_[z, before, (np.asarray(after) - before) / dt])[:n]


def convolution(kernel, dt, velocities):
    """-integral of K(tau) v(t - tau) at the last of velocities (n, 6), trapezoid rule; K(m dt) (m, 6, 6)."""
    total, last = np.zeros(6), len(velocities) - 1
    for m in range(min(len(kernel), last + 1)):
        share = 0.5 if m in (0, last) else 1.0
        total -= share * dt * kernel[m] @ velocities[last - m]
    return total


def convolution_half(kernel, dt, velocities, stage):
    """The same half a step after the last of velocities, where they are `stage`; K(m dt/2)."""
    total, last = np.zeros(6), len(velocities) - 1
    total -= 0.25 * dt * (kernel[0] @ stage + kernel[1] @ velocities[last])
    for m in range(last + 1):
        if 2 * m + 1 < len(kernel):
            share = 0.5 if m in (0, last) else 1.0
            total -= share * dt * kernel[2 * m + 1] @ velocities[last - m]
    return total
