"""`/pair` and `/api/pair`: pairing of browsers, which needs `--lan`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, HTTPException, Request
from fastapi.responses import FileResponse, JSONResponse, RedirectResponse, Response

from robot.devices.raw_value import RawValue, text
from server.access.gateway import NetworkGateway
from server.access.pairing import LONGEST_TEXT, Pairing, cookie_name
from server.gateway.gateway import PREFIX
from server.gateway.guard import person_of
from server.gateway.roles import Refusal
from server.routes.answers import Route
from server.services import Extension, Services, services_of

router = APIRouter(route_class=Route)
_YEAR_S = 365 * 24 * 3600


class PairingToken(RawValue):
    """A request's body: the token of a pairing address, or the whole address."""

    token: str = text(most=LONGEST_TEXT)


@router.get("/pair", include_in_schema=False)
async def pair_page(request: Request) -> Response:
    """Return the page that redeems the token after the `#` of its address."""
    _require_pairing(request)
    return FileResponse(services_of(request).config.web / "pair/index.html")


@router.get("/pair#{token}", include_in_schema=False)
async def encoded_pair_page(token: str) -> Response:
    """Redirect a browser to the pairing page if an app has encoded the `#` of its address."""
    return RedirectResponse(f"pair#{quote(token)}", 303)


@router.post("/api/pair")
async def pair(request: Request, body: PairingToken) -> JSONResponse:
    """Exchange a token for a session cookie."""
    pairing, now_s = _require_pairing(request), services_of(request).robot.clock.now_s()
    result = pairing.redeem(body.token, now_s, person_of(request), _secret(request))
    if isinstance(result, Refusal):
        headers = {"retry-after": "60"} if result.status == 429 else None
        told = {"error": result.reason, "detail": result.sentence}
        return JSONResponse(told, result.status, headers)
    if result.secret != _secret(request):
        _end_sockets(request)
    response = JSONResponse({"role": result.role.value, "kept": result.is_kept})
    response.set_cookie(value=result.secret, max_age=_YEAR_S, **_cookie(request))
    return response


@router.post("/api/unpair")
async def unpair(request: Request) -> JSONResponse:
    """End the session of this browser, which unpairs all of its tabs."""
    is_kept = _require_pairing(request).forget(_secret(request))
    _end_sockets(request)
    response = JSONResponse({"role": None, "kept": is_kept})
    response.delete_cookie(**_cookie(request))
    return response


@router.get("/ca.crt", include_in_schema=False)
async def authority(request: Request) -> Response:
    """Return the certificate of the authority that `--tls` made, for the phone to trust."""
    config = gateway_of(request).config
    file = config.data / "tls" / "ca.crt"
    if not config.tls or not file.is_file():
        raise HTTPException(404, "There is no certificate: the robot is served without --tls.")
    return FileResponse(file, media_type="application/x-x509-ca-cert")


def _end_sockets(request: Request) -> None:
    """Close the websockets of the session that ends, because one of them may still be driving."""
    sockets = gateway_of(request).admission.sockets
    for place in sockets:
        if place.person == person_of(request):
            sockets.end(place)


def _secret(request: Request) -> str:
    return request.cookies.get(cookie_name(gateway_of(request).config), "")


def _cookie(request: Request) -> dict[str, Any]:
    config = gateway_of(request).config
    return {
        "key": cookie_name(config),
        "httponly": True,
        "samesite": "strict",
        "secure": config.is_secure,
        "path": f"{request.scope.get(PREFIX, '')}/",
    }


def gateway_of(request: Request) -> NetworkGateway:
    """Return the gateway of the server that got a request."""
    gateway = services_of(request).gateway
    assert isinstance(gateway, NetworkGateway)
    return gateway


def _require_pairing(request: Request) -> Pairing:
    pairing = gateway_of(request).pairing
    if pairing is None:
        raise HTTPException(404, "Pairing is off: the robot is served to this machine only.")
    return pairing


class AccessExtension(Extension):
    """Adds the pairing page and its routes to a robot's server."""

    routers = (router,)

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        page = {"/pair", "/api/pair", "/pair/pair.js", "/pair/pair.css"}
        services.gateway.public_paths |= {*page, "/ca.crt"}
        services.gateway.open_paths.add("/api/unpair")
