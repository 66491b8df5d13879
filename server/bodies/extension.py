"""The phone as the robot's eye, as a part of a robot's server."""

from __future__ import annotations

from server.bodies import eye_routes
from server.extension import Extension


class EyeExtension(Extension):
    """The page and the socket of the phone that is the robot's camera."""

    routers = (eye_routes.router,)
