"""Gives the tests of `make test-oldest` a new websocket client; the server's library stays old.

The tests use `websockets.sync` and `websockets.asyncio`, which websockets 10.4 lacks. A copy of a
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
