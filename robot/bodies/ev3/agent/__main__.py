"""Start the agent: `python3 agent.pyz`, or `python3 -m robot.bodies.ev3.agent` from a clone."""

import argparse
import os
import signal
import socket
import stat
import sys

from robot.bodies.ev3.agent.server import Agent
from robot.bodies.ev3.agent.wire import PORT

CONFIGURATION = 2
"""Exit status for an error that a person must correct, because a restart would not help."""


def give_up(why: str) -> None:
    """Exit with the status that tells `keep-agent` not to restart the agent."""
    print("agent: " + why, file=sys.stderr)
    sys.exit(CONFIGURATION)


def read_secret(path: str) -> str:
    """Read the shared secret from a file that only its owner may read."""
    if stat.S_IMODE(os.stat(path).st_mode) & 0o077:
        give_up("other users can read {}; run: chmod 600 {}".format(path, path))
    with open(path) as file:
        secret = file.read().strip()
    if len(secret) < 8:
        give_up("the secret in {} is shorter than 8 characters".format(path))
    return secret


def main() -> None:
    parser = argparse.ArgumentParser(description="Let a Drivelesson server control this brick.")
    parser.add_argument("--host", default="0.0.0.0", help="address to listen on")
    parser.add_argument("--port", type=int, default=PORT, help="port to listen on")
    parser.add_argument("--secret-file", required=True, help="file with the shared secret")
    parser.add_argument("--root", default="/", help="folder with the brick's sys and dev")
    args = parser.parse_args()
    secret = read_secret(args.secret_file)
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((args.host, args.port))
    except OSError as error:
        give_up(
            "cannot use port {} ({}); is another agent running?".format(args.port, error.strerror)
        )
    listener.listen(16)
    print("listening on port {}".format(listener.getsockname()[1]), flush=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        Agent(listener, secret, args.root).serve_forever()
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
