"""Access rules, by the Host, Origin and role of a request.

Host and Origin are checked even on loopback. Without these checks, a page of another site in the
same browser could reach the robot by a cross-site websocket or by DNS rebinding.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from urllib.parse import urlsplit

from server.config import as_address
from server.gateway.gateway import READING, Gateway
from server.gateway.roles import Refusal, Role, Session


def check_host(gateway: Gateway, headers: Mapping[str, str]) -> Refusal | None:
    """Refuse a request whose Host is not a name of the robot; it may be DNS rebinding."""
    host = headers.get("host", "")
    name = host_name(host)
    if name in gateway.names or (gateway.allows_addresses and as_address(name) is not None):
        return None
    open_at = gateway.addresses()
    where = f" Open its page at {open_at[0]}."
    advice = gateway.advise(short(name), short(f"http://{host}"))
    sentence = f"This robot does not answer to {short(host)}.{where}{advice}"
    return Refusal(421, "host", sentence, open_at=tuple(open_at))


def check_origin(
    gateway: Gateway, headers: Mapping[str, str], scheme: str, method: str | None
) -> Refusal | None:
    """Refuse a request that a page of another site has sent.

    A page cannot forge the headers Origin and Sec-Fetch-Site; other programs can send anything in
    them. `method` is None for a websocket.
    """
    origin, host = headers.get("origin"), headers.get("host", "")
    if origin is not None:
        if origin in (f"{scheme}://{host}", *gateway.origins):
            return None
        told = f"Origin is {short(origin)}, but the request went to {short(f'{scheme}://{host}')}"
        return _cross_site(f"{told}.{gateway.advise('', short(origin))}")
    site = headers.get("sec-fetch-site", "none")
    # Another site may link to the page, but may not show it in a frame.
    is_link = method in ("GET", "HEAD") and headers.get("sec-fetch-mode") == "navigate"
    if site in ("none", "same-origin") or is_link:
        return None
    return _cross_site(f"Sec-Fetch-Site is {short(site)}.")


def admit(
    gateway: Gateway,
    path: str,
    method: str | None,
    headers: Mapping[str, str],
    session: Session | None,
) -> Role | Refusal:
    """Return the role in which a request is admitted, or why it is not."""
    is_public = path.partition("#")[0] in gateway.public_paths  # some apps send the `#` encoded
    role = session.role if session else Role.VIEWER
    may_any = path in gateway.public_paths or path in gateway.open_paths or role.paths is not None
    refusal: Refusal | None = None
    if not session and not is_public:
        refusal = gateway.not_admitted
    elif role.paths is not None and not (is_public or role.paths.fullmatch(path)):
        refusal = Refusal(403, "role", role.refusal, role.start)
    elif not (role.may_change or method in READING or may_any):
        refusal = Refusal(403, "role", role.refusal)
    if refusal is None:
        return role
    if refusal.location and "text/html" in headers.get("accept", ""):
        return replace(refusal, status=303)
    return replace(refusal, location=None)


def host_name(host: str) -> str:
    """Return the name in a Host header: without port, in lower case; empty if not valid."""
    try:
        return (urlsplit(f"//{host}").hostname or "").rstrip(".")
    except ValueError:
        return ""


def _cross_site(why: str) -> Refusal:
    return Refusal(403, "origin", f"A page of another site has sent this request: {why}")


def short(text: str) -> str:
    """Return a client's text in a form that can be shown: at most 80 printable characters."""
    return re.sub(r"[^!-~]", "?", text)[:80]
