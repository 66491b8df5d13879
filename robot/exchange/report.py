"""What an import could not take, or took with a reservation: counted, and listed by reason."""

from __future__ import annotations

from robot.errors import RecordingError


class ImportReport:
    """Collects what was skipped while a drive is read; a strict one refuses it at the first."""

    def __init__(self, *, is_strict: bool = False) -> None:
        self.is_strict = is_strict
        self.skipped: list[tuple[str, str]] = []
        """Place and reason of each thing that was left out."""
        self.remarks: list[str] = []

    def skip(self, place: str, reason: str) -> None:
        """Leave something out; raises RecordingError if the import is strict."""
        place, reason = map(_shown, (place, reason))
        if self.is_strict:
            raise RecordingError(f"{place}: {reason}")
        self.skipped.append((place, reason))

    def remark(self, text: str | None) -> None:
        """Note something that a person should know of the drive; None says nothing."""
        if text and text not in self.remarks:
            self.remarks.append(text)

    def lines(self) -> list[str]:
        """Return the remarks, then how much was skipped, and each reason with its places."""
        places: dict[str, list[str]] = {}
        for place, reason in self.skipped:
            places.setdefault(reason, []).append(place)
        told = [f"skipped: {len(self.skipped)}"] if self.skipped else []
        told += [f"  {reason}: {', '.join(found)}" for reason, found in places.items()]
        return self.remarks + told

    def why_nothing(self) -> str:
        """Return the first reason for which a drive has nothing left, as the end of a sentence."""
        if not self.skipped:
            return ""
        place, reason = self.skipped[0]
        return f"; {len(self.skipped)} were skipped, the first in {place}: {reason}"


def _shown(text: str) -> str:
    """Leave out what a terminal would obey: some of it is from names that others gave."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)
