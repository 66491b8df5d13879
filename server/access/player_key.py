"""The key in the video's address, for programs that store no cookie and therefore cannot be paired.

Programs without cookies are VLC, ffmpeg, dashboards and the `<img>` of another site. Anybody who
has the address may watch the video and do nothing else. The server reads the key's file for each
request, so the key can be replaced while the server runs.
"""

from __future__ import annotations

import contextlib
import hmac
import os
import secrets
from pathlib import Path

NAME = "player.key"
_N_BYTES = 16  # 128 random bits cannot be guessed at the rate that the server allows
_MOST = 128


class PlayerKey:
    """The key of one data folder."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / NAME

    def read(self) -> str:
        """Return the key; empty if there is no key."""
        try:
            return self._file.read_text("ascii").strip()[:_MOST]
        except (OSError, ValueError):
            return ""

    def accepts(self, key: str) -> bool:
        """Return True if `key` is the key of this data folder."""
        kept = self.read()
        return bool(kept) and hmac.compare_digest(kept.encode(), key.encode())

    def replace(self) -> str:
        """Write a new key and return it; addresses with the old key stop working.

        Raises:
            OSError: If the key cannot be written.
        """
        key, new = secrets.token_urlsafe(_N_BYTES), self._file.with_suffix(".new")
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(new, os.O_CREAT | os.O_WRONLY | os.O_TRUNC, 0o600), "w") as out:
            out.write(key + "\n")
        new.replace(self._file)
        return key

    def remove(self) -> None:
        """Delete the key; players cannot watch until `replace` makes a new one."""
        with contextlib.suppress(FileNotFoundError):
            self._file.unlink()
