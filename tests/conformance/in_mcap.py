"""Runs in the environment of Python's mcap: reads a recording, and checks all checksums."""

from __future__ import annotations

import json
import sys
from collections import Counter
from importlib.metadata import version
from pathlib import Path

from mcap.reader import NonSeekingReader, make_reader
from mcap_protobuf.decoder import DecoderFactory

recording = Path(sys.argv[1])
print("VERSION", version("mcap"))

print("TRY reads, and checks the checksums")
with recording.open("rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    assert summary is not None and summary.statistics is not None
    found: Counter[str] = Counter()
    for schema, channel, message in reader.iter_messages():
        assert schema is not None
        found[channel.topic] += 1
        if channel.message_encoding == "json":
            json.loads(message.data)
    assert sum(found.values()) == summary.statistics.message_count
print("PASSED", f": {sum(found.values())} messages")

print("TRY decodes Foxglove's pictures")
with recording.open("rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    pictures = [m.decoded_message for m in reader.iter_decoded_messages(topics=["/camera"])]
assert len(pictures) == found["/camera"] and all(picture.data for picture in pictures)
print("PASSED", f": {len(pictures)}")

print("TRY reads without the index")
with recording.open("rb") as file:
    assert sum(1 for _ in NonSeekingReader(file, validate_crcs=True).iter_messages()) == sum(
        found.values()
    )
print("PASSED")
