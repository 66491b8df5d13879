#!/usr/bin/env bash
# mcap-ros2-support 0.6.0 (PyPI) and @foxglove/rosmsg2-serialization 3.1.0 (npm): a misspelt field is written as 0.
#
# Guess before running: a message is refused if it has a field that its type does not have.
# Outcome: wrong for both. Fields that the type does not have are left out, and missing fields become 0. A velocity
# given as {"linear": ..} for a TwistStamped, which has it under "twist", is recorded as a robot that stands still.
# Not even {"twist": 0.5} is refused. The example in the README of the npm package, a PointStamped with "x" beside
# "header" instead of in "point", writes the point 0, 0, 0.
#
# Our program uses neither library.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install --quiet --disable-pip-version-check mcap-ros2-support==0.6.0 mcap==1.6.0
cat > record.py <<'PY'
from io import BytesIO

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

NEXT = "=" * 80
TYPE = f"""geometry_msgs/Twist twist
{NEXT}
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
{NEXT}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def recorded(message: dict) -> float:
    file = BytesIO()
    writer = Writer(file)
    writer.write_message("/cmd_vel", writer.register_msgdef("demo/Drive", TYPE), message)
    writer.finish()
    file.seek(0)
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    ((_, _, _, back),) = reader.iter_decoded_messages()
    return back.twist.linear.x


print(*[recorded(m) for m in ({"twist": {"linear": {"x": 0.5}}}, {"linear": {"x": 0.5}}, {"twist": 0.5})])
PY
npm install --silent --no-audit --no-fund @foxglove/rosmsg2-serialization@3.1.0 @foxglove/rosmsg@5.0.5
cat > write.mjs <<'JS'
import { parse } from '@foxglove/rosmsg';
import { MessageReader, MessageWriter } from '@foxglove/rosmsg2-serialization';
const next = '='.repeat(80);
const type = parse(`std_msgs/Header header
geometry_msgs/Point point
${next}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
${next}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
`, { ros2: true });
const header = { stamp: { sec: 0, nanosec: 0 }, frame_id: '' };
const back = (message) => new MessageReader(type).readMessage(new MessageWriter(type).writeMessage(message)).point.x;
console.log(back({ header, point: { x: 1, y: 0, z: 0 } }), back({ header, x: 1, y: 0, z: 0 }));
JS
python=$(env/bin/python record.py); node=$(node write.mjs)
printf 'Python: %s\nJavaScript: %s\n' "$python" "$node"
[ "$python" = "0.5 0.0 0.0" ] && [ "$node" = "1 0" ]
