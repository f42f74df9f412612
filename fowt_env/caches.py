"""What is computed once and kept in memory: every such cache is bounded, and clear_caches empties them all.

Kept are values that follow from their keys alone and are never written to, so that dropping one changes no
figure. Not among them are the hashes that plant/compile keeps of this package's own sources.
"""

from collections import OrderedDict
from functools import lru_cache

_CACHES = []


class Cache:
    """The most recently used values by key, `size` of them at most."""

    def __init__(self, size):
        self.size = size
        self._values = OrderedDict()
        _CACHES.append(self)

    def get(self, key, make):
        """The value of a key, made by make() where it is not kept."""
        if key in self._values:
            self._values.move_to_end(key)
            return self._values[key]
        value = self._values[key] = make()
        while len(self._values) > self.size:
            self._values.popitem(last=False)
        return value

    def __len__(self):
        return len(self._values)

    def cache_clear(self):
        """Forget every value."""
        self._values.clear()


def cached(size):
    """Decorator: functools.lru_cache of a size that clear_caches empties too."""

    def decorate(function):
        kept = lru_cache(maxsize=size)(function)
        _CACHES.append(kept)
        return kept

    return decorate


def clear_caches() -> None:
    """Forget what this process computed and keeps in memory: tables, trims, designs, spectra.

    What is asked for next is computed anew, with the same bits. Compiled kernels stay.
    """
    for cache in _CACHES:
        cache.cache_clear()
