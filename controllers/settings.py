"""Defines the base class of control-law settings, which checks the range of each value."""

from dataclasses import fields, replace
from typing import ClassVar

from fowt_env.descriptions.checks import check_number
from fowt_env.errors import unknown

POSITIVE = {"low": 0.0, "low_open": True, "allowed": "finite and positive"}
NOT_NEGATIVE = {"low": 0.0, "allowed": "non-negative and finite"}
POSITIVE_OR_INF = {"low": 0.0, "low_open": True, "infinite": True, "allowed": "positive; inf switches it off"}


class Settings:
    """Checks the values of a frozen settings dataclass. Raises: InputError with key, value, allowed range."""

    RANGES: ClassVar = {}  # {key: arguments of check_number}
    NAME: ClassVar = ""  # prefix of the key in messages

    def __post_init__(self):
        for key, limits in self.RANGES.items():
            check_number(f"{self.NAME} {key}".lstrip(), getattr(self, key), **limits)

    def changed(self, **changes):
        """Return a copy with some settings changed. Raises: InputError for unknown names."""
        known = [item.name for item in fields(self)]
        for key in changes:
            if key not in known:
                raise unknown(f"setting of {self.NAME}".removesuffix(" of "), key, known)
        return replace(self, **changes)
