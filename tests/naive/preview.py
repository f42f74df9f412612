"""What the motion of the nacelle does to a preview, over a whole run at once."""

import numpy as np


def add_motion(preview, time, velocity):
    """Return the values (len(times), n) of a preview at even times (n,) s with a nacelle velocity (n,).

    The velocity, positive downwind, is linear between the times and constant before the first.
    """
    values = np.array([np.interp(time, preview.time, value) for value in preview.values])
    corner, offset, weight, delay = preview.motion
    slow = low_passed(velocity, corner * (time[1] - time[0]))
    mixed = sum(w * np.interp(time - o, time, slow) for o, w in zip(offset, weight, strict=True))
    return values - np.array([np.interp(time - late, time, mixed) for late in delay])


def low_passed(value, step):
    """Filter a series (n,), linear between its samples, by a first-order low pass that starts settled.

    step: time between samples times the corner, rad.
    """
    if np.isinf(step):
        return np.array(value, dtype=np.float64)
    decay = np.exp(-step)
    new = 1.0 - (1.0 - decay) / step  # exact for a ramp from one sample to the next
    old = 1.0 - decay - new
    slow = np.array(value, dtype=np.float64)
    for i in range(1, slow.size):
        slow[i] = decay * slow[i - 1] + old * value[i - 1] + new * value[i]
    return slow
