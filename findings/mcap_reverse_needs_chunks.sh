#!/bin/sh
# mcap 1.6.0: reading backwards reads forwards if a file has no chunks.
#
# Guess before running: for every file that the library writes, `iter_messages(reverse=True)` yields the messages in
# the opposite order of `iter_messages()`, or raises an error.
# Outcome: wrong for a file that was written with use_chunking=False. It has no index of chunks, so the reader sorts
# all messages by time and yields them from the first one on. It ignores `reverse`, and raises no error. The first
# message from such a file is therefore its oldest, not its newest.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet mcap==1.6.0
"$folder/env/bin/python" - <<'EOF'
import io

from mcap.reader import make_reader
from mcap.writer import Writer


def times_read(*, use_chunking: bool, reverse: bool) -> list[int]:
    file = io.BytesIO()
    writer = Writer(file, use_chunking=use_chunking)
    writer.start()
    channel = writer.register_channel("/pose", "json", writer.register_schema("pose", "jsonschema", b"{}"))
    for time_ns in (1, 2, 3):
        writer.add_message(channel, time_ns, b"{}", time_ns)
    writer.finish()
    file.seek(0)
    return [message.log_time for _, _, message in make_reader(file).iter_messages(reverse=reverse)]


found = {(chunks, back): times_read(use_chunking=chunks, reverse=back) for chunks in (True, False) for back in (False, True)}
print(found)
assert found[True, False] == found[False, False] == [1, 2, 3]
assert found[True, True] == [3, 2, 1]
assert found[False, True] == [1, 2, 3]
EOF
