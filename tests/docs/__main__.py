"""Writes the program's facts into the documents: `make docs`."""

from __future__ import annotations

from .made import made

for path, text in made().items():
    path.write_text(text, "utf-8")
