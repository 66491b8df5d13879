#!/bin/sh
# array_record 0.8.6 (PyPI): a recording opens with 0 records if its program did not call close().
#
# Guess before running: if a recorder ends without close(), the records of all full groups can be read, since each
# group of records is a chunk of its own, or opening the file raises an error. If the program ends normally, the
# writer closes itself.
# Outcome: wrong in all three points. ArrayRecordReader opens the file without an error, and its num_records() is 0,
# although the file contains megabytes. Only ok(), or reading a record, shows that something is wrong. Only close()
# writes the list of the groups, and neither the end of the program nor the deletion of the writer object calls it. A
# loader that takes the length of a data set from num_records() trains without this recording.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check array_record==0.8.6
cd "$folder"
cat > record.py <<'PY'
import os
import sys

from array_record.python import array_record_module

end = sys.argv[1]
writer = array_record_module.ArrayRecordWriter(f"{end}.array_record", "group_size:1")
for _ in range(1000):
    writer.write(os.urandom(20_000))
if end == "closed":
    writer.close()
if end == "killed":
    os._exit(0)
PY
for end in closed ended killed; do "$folder/env/bin/python" record.py "$end"; done
"$folder/env/bin/python" - <<'PY'
import os

from array_record.python import array_record_module

found = {}
for end in ("closed", "ended", "killed"):
    name = f"{end}.array_record"
    reader = array_record_module.ArrayRecordReader(name)
    found[end] = reader.num_records(), reader.ok()
    print(f"{end}: {os.path.getsize(name) / 1e6:.0f} MB, (records, ok): {found[end]}")
    if end != "closed":
        try:
            reader.read()
        except RuntimeError as error:
            print("  reading raises:", str(error)[:60])
        else:
            raise AssertionError("a record was read")
assert os.path.getsize("killed.array_record") > 10_000_000
assert found == {"closed": (1000, True), "ended": (0, False), "killed": (0, False)}
PY
