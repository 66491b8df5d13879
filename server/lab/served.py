"""Serves an application on a thread, for benchmarks and tests."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

from server.config import Config
from server.gateway.gateway import Gateway
from server.hosting.serving import make_server, open_socket, run, serve_until_told


@contextlib.contextmanager
def served(app: Any, config: Config) -> Iterator[str]:
    """While the `with` block runs, serve the application on a thread; yield its address."""
    gateway: Gateway = app.state.gateway
    listener = gateway.limit(open_socket(config.host, config.port))
    server = make_server(app, gateway.tls_files)
    thread = threading.Thread(
        target=lambda: run(serve_until_told(server, gateway, listener)), name="server"
    )
    thread.start()
    try:
        while not server.started and thread.is_alive():
            thread.join(0.01)
        scheme = "https" if gateway.tls_files else "http"
        yield f"{scheme}://{config.host}:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()
        listener.close()
