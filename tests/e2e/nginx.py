"""A real nginx or Caddy in front of robots, with the configuration of the docs.

nginx also runs with a minimal configuration."""

from __future__ import annotations

import contextlib
import datetime as dt
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from server.access.certificates import make_certificates

FROM_THE_DOCS = Path(__file__).resolve().parents[2] / "docs" / "examples" / "proxy" / "nginx.conf"
_PLAIN = """
server {
    listen 127.0.0.1:PORT;
    location / {
        proxy_pass http://127.0.0.1:ROBOT;
        proxy_http_version 1.1;
        proxy_set_header Upgrade $http_upgrade;
        proxy_set_header Connection CONNECTION;
    }
}
"""
_AROUND = """
daemon off; master_process off; pid FOLDER/nginx.pid; error_log FOLDER/error.log;
events { worker_connections 4096; }
http {
    access_log off; default_type application/octet-stream;
    client_body_temp_path FOLDER/body; proxy_temp_path FOLDER/proxy; fastcgi_temp_path FOLDER/f;
    uwsgi_temp_path FOLDER/u; scgi_temp_path FOLDER/s;
SITE
}
"""


def find_proxy(name: str, package: str) -> str:
    """Return a program's path; skips visibly if it is missing, and fails in CI."""
    found = shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin")
    if found is None and os.environ.get("CI") == "true":
        pytest.fail(f"CI needs {name}: apt-get install {package}")
    if found is None:
        pytest.skip(f"{name} IS MISSING: nothing was tried behind it (install {package})")
    return found


def plain_site(port: int, robot: int, connection: str = "upgrade") -> str:
    """Return a minimal configuration, which passes on only the request."""
    site = _PLAIN.replace("PORT", str(port)).replace("ROBOT", str(robot))
    return site.replace("CONNECTION", connection)


def site_of_the_docs(port: int, robots: Sequence[int], folder: Path, *, tls: bool = True) -> str:
    """Return the configuration of the docs, with this test's ports and certificate."""
    site = FROM_THE_DOCS.read_text().replace("443 ssl", f"127.0.0.1:{port}{' ssl' * tls}")
    for given, robot in zip((8000, 8001), robots, strict=False):
        site = site.replace(f"127.0.0.1:{given}", f"127.0.0.1:{robot}")
    if tls:
        files = make_certificates(folder / "tls", ["localhost"], dt.datetime.now(dt.UTC))
        site = site.replace("/etc/ssl/home.example.crt", str(files.chain))
        site = site.replace("/etc/ssl/home.example.key", str(files.key))
    else:
        site = "\n".join(line for line in site.splitlines() if "ssl_" not in line)
    return site.replace("home.example", "localhost")


@contextlib.contextmanager
def running_nginx(folder: Path, site: str, port: int) -> Iterator[None]:
    """While the `with` block runs, serve a site."""
    folder.mkdir()
    config = folder / "nginx.conf"
    config.write_text(_AROUND.replace("SITE", site).replace("FOLDER", str(folder)))
    words = ["-e", str(folder / "start.log"), "-p", str(folder), "-c", str(config)]
    with _running([find_proxy("nginx", "nginx-light"), *words], port, folder):
        yield


@contextlib.contextmanager
def running_caddy(folder: Path, robots: Sequence[int], port: int) -> Iterator[None]:
    """Serve the robots by the Caddyfile of the docs, with a certificate of this test."""
    folder.mkdir()
    site = FROM_THE_DOCS.with_name("Caddyfile").read_text()
    for given, robot in zip((8000, 8001), robots, strict=True):
        site = site.replace(f"127.0.0.1:{given}", f"127.0.0.1:{robot}")
    files = make_certificates(folder / "tls", ["localhost"], dt.datetime.now(dt.UTC))
    ours = f"https://localhost:{port} {{\n\tbind 127.0.0.1\n\ttls {files.chain} {files.key}"
    site = "{\n\tadmin off\n\tauto_https off\n}\n" + site.replace("home.example {", ours)
    (folder / "Caddyfile").write_text(site)
    words = [find_proxy("caddy", "caddy"), "run", "--config", str(folder / "Caddyfile")]
    with _running([*words, "--adapter", "caddyfile"], port, folder):
        yield


@contextlib.contextmanager
def _running(words: list[str], port: int, folder: Path) -> Iterator[None]:
    with (folder / "said.log").open("wb") as said:
        process = subprocess.Popen(words, stderr=said, env={**os.environ, "HOME": str(folder)})
    try:
        for _ in range(600):
            assert process.poll() is None, [log.read_text() for log in folder.glob("*.log")]
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
                break
            time.sleep(0.05)
        yield
    finally:
        process.terminate()
        process.wait(30)
