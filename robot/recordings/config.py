"""The recorder's options."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderConfig:
    """Configures the recorder: the size of its queue, its time limits, and which recordings to
    keep."""

    keeps_drives: bool = True
    """Whether to keep recordings in which the robot moved but learned nothing."""
    queue_bytes: int = 32 * 2**20
    """Maximum size of the queued pictures, in bytes; further pictures are dropped and counted."""
    queue_items: int = 4096
    """Maximum number of queued items. A picture is one item, and so are the messages of one tick
    together. Messages are dropped last, because they are small."""
    pause_s: float = 10.0
    """Time for which the robot must stand still before the recording ends, in seconds."""
    trail_s: float = 1.0
    """Time for which pictures are still recorded after the robot stopped, in seconds."""
    lead_frames: int = 15
    """Number of pictures from before the start that are also recorded, because the pilot may label
    them. The pictures fill at most a quarter of the queue."""
    part_bytes: int = 64 * 2**20
    """Size at which a recording continues in another file, in bytes."""
    part_s: float = 600.0
    """Time after which a recording continues in another file, in seconds. It limits the memory of
    the recorder, and of a program that reads a file without an index."""
    spare_bytes: int = 64 * 2**20
    """Recording stops if the disk has fewer free bytes than this number. These bytes are left for
    models and the system."""
