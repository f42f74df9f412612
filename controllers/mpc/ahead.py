"""Predicts the wind from the estimate at the rotor and from a preview with errors.

The estimate is more accurate for the first seconds, a lidar for later ones. The filter's prediction e(k) of
the wind k periods ahead is corrected by a fraction of its difference from the preview p(k),

w(k) = e(k) + g(k) (p(k) - e(k)),    g(k) = E[(v - e(k)) (p(k) - e(k))] / E[(p(k) - e(k))^2],

with the least mean square error, where v is the wind estimated on arrival. Both means are estimated online
for each k, so that an uninformative preview has no influence.
"""

import numpy as np

DOUBT = 1.0  # m/s, initial RMS difference of preview and prediction, without correlation


class LearntShare:
    """Estimates the fractions g of a preview for 0 to n - 1 periods ahead, with a forgetting factor."""

    def __init__(self, count, decay):
        self.decay = decay
        self.along = np.zeros(count - 1)  # for g(1) and later; g(0) is zero because v is the estimate
        self.square = np.full(count - 1, DOUBT**2)
        self.expected = np.full((count - 1, count), np.nan)  # m/s, at past instants, latest first
        self.differing = np.full((count - 1, count), np.nan)

    def learn(self, estimate, expected, differing):
        """Return g (n,), updated by earlier predictions of the present wind, and store the new predictions.

        estimate: of the present wind, m/s; expected (n,): e, m/s; differing (n,): p - e, m/s.
        """
        came, differed = estimate - np.diagonal(self.expected, 1), np.diagonal(self.differing, 1)
        due = np.isfinite(differed)
        new = 1.0 - self.decay
        self.along[due] += new * ((came * differed)[due] - self.along[due])
        self.square[due] += new * (differed[due] ** 2 - self.square[due])
        for kept, latest in ((self.expected, expected), (self.differing, differing)):
            kept[1:] = kept[:-1].copy()
            kept[0] = latest
        return np.r_[0.0, np.clip(self.along / self.square, 0.0, 1.0)]
