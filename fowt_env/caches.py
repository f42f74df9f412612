"""Caches computed values in memory: every cache is bounded, and clear_caches empties all of them.

Cached values depend on their keys alone and are never modified, so discarding one changes no result. The
hashes of source files in plant/compile are stored elsewhere.
"""

from collections import OrderedDict
from functools import lru_cache

_CACHES = []


class Cache:
    """Holds the most recently used values by key, at most `size` of them."""

    def __init__(self, size):
        self.size = size
        self._values = OrderedDict()
        _CACHES.append(self)

    def get(self, key, make):
        """Return the value of a key, computed by make() if the cache does not hold the key."""
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
        """Discard all values."""
        self._values.clear()


def cached(size):
    """Return a decorator like functools.lru_cache(size), for a cache that clear_caches empties too."""

    def decorate(function):
        kept = lru_cache(maxsize=size)(function)
        _CACHES.append(kept)
        return kept

    return decorate


def clear_caches() -> None:
    """Discard the values cached in the memory of this process: tables, trims, designs, spectra.

    Later requests recompute bit-identical values. Compiled kernels remain loaded.
    """
    for cache in _CACHES:
        cache.cache_clear()
