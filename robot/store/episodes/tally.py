"""What a recording holds, counted message by message: what its summary says in the end."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field

from robot.policy.history import HistoryEvent, Taught, Undone
from robot.store.episodes.messages import CAMERA, LESSON
from robot.store.models.events import PlainEvent, read_event
from robot.types import Example


def note_taught(examples: dict[int, Example], event: HistoryEvent) -> None:
    """Note by its frame what an event teaches, or takes back."""
    if isinstance(event, Taught):
        examples[event.example.frame_id] = event.example
    elif isinstance(event, Undone):
        for frame_id in event.frame_ids:
            examples.pop(frame_id, None)


@dataclass(slots=True)
class Tally:
    """Counts pictures, time and examples; `taught` are those that were not undone, by frame."""

    frames: set[int] = field(default_factory=set)
    taught: dict[int, Example] = field(default_factory=dict)
    first_ns: int | None = None
    last_ns: int = 0

    def note(self, topic: str, log_ns: int, sequence: int, lesson: PlainEvent | None) -> None:
        """Count one message; `lesson` is what one of the topic `/lesson` says."""
        self.first_ns = log_ns if self.first_ns is None else min(self.first_ns, log_ns)
        self.last_ns = max(self.last_ns, log_ns)
        if topic == CAMERA:
            self.frames.add(sequence)
        elif topic == LESSON and lesson is not None:
            note_taught(self.taught, read_event(lesson))

    def describe(self) -> dict[str, str]:
        """Return it as the summary at the end of a recording has it."""
        duration_ns = 0 if self.first_ns is None else self.last_ns - self.first_ns
        return {
            "frames": str(len(self.frames)),
            "taught": json.dumps(Counter(example.label for example in self.taught.values())),
            "duration_s": f"{duration_ns / 1e9:.6f}",
        }
