"""For `make test-oldest`: the tests' own client is of today, though the server's library is old.

The tests speak through `websockets.sync` and `.asyncio`, which websockets 10.4 has not. A copy of a
newer release is installed as `newer_websockets`, and only the tests see it.
"""

from __future__ import annotations

import sys

import newer_websockets.asyncio.client
import newer_websockets.exceptions
import newer_websockets.sync.client
import websockets.exceptions

sys.modules["websockets.asyncio"] = newer_websockets.asyncio
sys.modules["websockets.asyncio.client"] = newer_websockets.asyncio.client
sys.modules["websockets.sync"] = newer_websockets.sync
sys.modules["websockets.sync.client"] = newer_websockets.sync.client
websockets.exceptions.InvalidStatus = newer_websockets.exceptions.InvalidStatus
