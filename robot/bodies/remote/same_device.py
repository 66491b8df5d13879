"""Which device a driver has: chosen when it first connects, and only that one afterwards. Pure.

Schools own dozens of hubs with the same name. A search finds any of them, so after a lost
connection the neighbour's robot would obey. Where two fit at the start, nobody knows which one a
pilot means.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Found:
    """A device that a search has found: what it is called, and what no other device has."""

    name: str
    address: str

    def __str__(self) -> str:
        return f"{self.name!r} ({self.address})" if self.name else self.address

    def is_called(self, wanted: str) -> bool:
        """True if a person may mean this one by `wanted`; the empty text means any."""
        return wanted in ("", self.name) or wanted.lower() == self.address.lower()


class SameDevice:
    """The one device of a driver.

    Args:
        kind: Its noun in a sentence, such as `hub`.
        wanted: The name or address that a person gave; empty for the only one in reach.
        flag: The option by which a person tells devices apart.
    """

    def __init__(self, kind: str, wanted: str = "", flag: str = "--hub") -> None:
        self._kind, self._wanted, self._flag = kind, wanted, flag
        self.chosen: Found | None = None
        """The device that was connected; None before the first connection."""

    def may_be(self, found: Found) -> bool:
        """True if this device could be the one to take."""
        if self.chosen is not None:
            return found.address == self.chosen.address
        return found.is_called(self._wanted)

    def is_certain(self, found: Found) -> bool:
        """True if no other device could be meant."""
        wanted = self.chosen.address if self.chosen is not None else self._wanted
        return found.address.lower() == wanted.lower()

    def pick(self, found: Iterable[Found]) -> Found | None:
        """Return the device to take among all that were found; None if it is not there.

        Raises:
            ConnectionError: If several fit; it lists them and says how to tell them apart.
        """
        fitting = {one.address: one for one in found if self.may_be(one)}
        if len(fitting) > 1:
            first, *_ = sorted(fitting)
            listed = ", ".join(str(fitting[address]) for address in sorted(fitting))
            raise ConnectionError(
                f"{len(fitting)} {self._kind}s in reach fit: {listed}; name yours with "
                f"{self._flag} {first}, or give each a name of its own"
            )
        return next(iter(fitting.values()), None)

    def name_absent(self, found: Iterable[Found]) -> str:
        """Return the end of the sentence about a device that was not found among these."""
        others = {str(one) for one in found}
        if self.chosen is None:
            listed = f"; in reach: {', '.join(sorted(others))}" if others else ""
            return f"is it on, and not connected elsewhere?{listed}"
        aside = " (another one is in reach, and is left alone)" if others else ""
        return f"{self.chosen} was lost, and is not in reach{aside}; is it on?"
