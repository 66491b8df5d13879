"""The board's web server. The server has a page for the teacher, and serves only the teacher's
computer."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, Literal

from fastapi import FastAPI, HTTPException, Request, WebSocket
from fastapi.responses import FileResponse, JSONResponse, Response

from robot.clock import Clock
from robot.devices.raw_value import RawValue, must_be, text, whole
from robot.errors import NotFoundError, RobotError
from server.board.board import Board, BoardViewer
from server.board.class_models import ClassModels, ClassOrder
from server.board.model_copy import copy_model
from server.board.ready_lesson import NAME, left_turns
from server.config import Config
from server.gateway.gateway import STOP_PATH, gateway_type
from server.gateway.guard import Guard
from server.hosting.static_files import CompressedFiles
from server.routes.bodies import HANDLERS, Short, do
from server.routes.sockets import end_with_either

SEND_EVERY_S = 0.1
"""Time for which the board collects news and pictures before it sends them to a page, in
seconds."""
LANGUAGES = ("en", "es", "zh")
"""The languages of the lessons."""
PICTURE_HEADER = struct.Struct("<HI")
"""Header of each picture: the robot's number and the picture's length in bytes."""


class StopOrder(RawValue):
    """A request's body. `robot` is the number of the robot to stop. Without `robot`, all robots are
    stopped."""

    robot: int | None = whole(None)


class RobotChange(RawValue):
    """A request's body: changes to one robot."""

    name: str | None = text(None)
    colour: str | None = text(None)
    locks: list[Short] | None = must_be("a list of what is locked", None)


class ModelCopies(RawValue):
    """A request's body: the numbers of the robots that get the model."""

    to: list[int] = must_be("a list of robots' numbers")


class OrderBody(RawValue):
    """A request's body: an order to all robots."""

    order: Literal["keep", "reset", "hand_over"] = must_be("keep, reset or hand_over")


class LessonModel(RawValue):
    """A request's body: the name under which the robots save the model."""

    name: str = text(NAME, most=60)


_ALL = StopOrder()


def create_board_app(
    config: Config,
    board: Board,
    clock: Clock,
    begin: Callable[[], None] = lambda: None,
    lesson: str = "",
) -> FastAPI:
    """Make the board's application.

    Args:
        config: The configuration of the board's server.
        board: The board.
        clock: The clock.
        begin: Called as soon as the event loop runs, to add the robots.
        lesson: The lesson that the page of lessons shows if its address names no lesson.
    """
    app = FastAPI(
        title="Drivelesson board",
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        exception_handlers=HANDLERS,
        strict_content_type=False,
    )

    @app.exception_handler(RobotError)
    @app.exception_handler(OSError)
    async def refuse(request: Request, error: RobotError | OSError) -> JSONResponse:
        """Answer with the robot's own error message and status. If the robot does not answer, the
        status is 502."""
        if isinstance(error, NotFoundError):
            return JSONResponse({"detail": str(error)}, 404)
        sentence = f"{board.robot(int(request.path_params['number'])).name}: {error}"
        return JSONResponse({"detail": sentence}, getattr(error, "status", 502))

    gateway = gateway_type()(config, clock)
    app.state.gateway = gateway
    _add_routes(app, config, board, clock, lesson)
    app.mount("/", CompressedFiles(config.web), name="web")

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        begin()
        try:
            yield
        finally:
            await board.close()

    # NOTE: `lifespan` is set here, because FastAPI takes it as an argument only since 0.93.
    app.router.lifespan_context = lifespan
    app.add_middleware(Guard, gateway=gateway)
    return app


def _add_routes(
    app: FastAPI, config: Config, board: Board, clock: Clock, running_lesson: str
) -> None:
    @app.get("/", include_in_schema=False)
    async def page() -> Response:
        return FileResponse(config.web / "board" / "index.html")

    @app.get("/codes", include_in_schema=False)
    async def codes() -> Response:
        return FileResponse(config.web / "board" / "codes.html")

    @app.get("/lesson", include_in_schema=False)
    async def lesson() -> Response:
        return FileResponse(config.web / "board" / "lesson.html")

    @app.get("/lesson/{language}", include_in_schema=False)
    async def lesson_text(language: str) -> Response:
        """Return the Markdown of the three lessons in one language."""
        written = (config.web / "lessons", config.web.parent / "docs" / "lessons")
        for folder in written if language in LANGUAGES else ():
            if (folder / f"{language}.md").is_file():
                kind = "text/markdown; charset=utf-8"
                return FileResponse(folder / f"{language}.md", media_type=kind)
        raise HTTPException(
            404, f"There are lessons only in these languages: {', '.join(LANGUAGES)}."
        )

    @app.get("/api/lesson")
    async def show_lesson() -> dict[str, str]:
        """Return the lesson with which the class was started; empty if none was named."""
        return {"lesson": running_lesson}

    @app.get("/api/robots")
    async def list_robots() -> dict[str, Any]:
        strangers = board.strangers.describe()
        return {"robots": board.describe(), "strangers": strangers, "code": board.code}

    @app.post(STOP_PATH)
    async def stop(body: StopOrder = _ALL) -> dict[str, Any]:
        board.stop(body.robot)
        return {"robots": board.describe()}

    @app.put("/api/robots/{number}")
    async def change(number: int, body: RobotChange) -> dict[str, Any]:
        robot = board.robot(number)
        words = {"name": body.name, "colour": body.colour}
        words = {field: word for field, word in words.items() if word is not None}
        if words:
            await robot.ask("PUT", "/api/settings", words)
        if body.locks is not None:
            await robot.ask("PUT", "/api/class/locks", {"locks": body.locks})
        await robot.refresh()
        return robot.describe()

    models = ClassModels(board.shown, clock)

    @app.get("/api/models")
    async def last_order() -> dict[str, Any]:
        """Return the newest order to all robots that can still be undone."""
        return models.describe()

    @app.post("/api/models")
    async def order(body: OrderBody) -> dict[str, Any]:
        """Give an order to all robots: save the model, start an empty model, or start an empty
        model and sign out the phones."""
        return await models.give(ClassOrder(body.order))

    @app.post("/api/models/left-turns")
    async def give_left_turns(body: LessonModel) -> dict[str, Any]:
        """Have all robots load the ready-made model "left turns only", under the given name."""
        return await models.give(ClassOrder.LOAD, await do(left_turns), body.name)

    @app.post("/api/models/undo")
    async def undo() -> dict[str, Any]:
        """Undo the last order to all robots."""
        return await models.undo()

    @app.post("/api/robots/{number}/copy-model")
    async def take_model(number: int, body: ModelCopies) -> dict[str, Any]:
        """Copy the current model of one robot to other robots. Return a sentence for each
        failure."""
        targets = [board.robot(target) for target in body.to if target != number]
        return {"faults": await copy_model(board.robot(number), targets)}

    @app.get("/api/robots/{number}/qr.svg")
    async def draw_code(number: int, printed: bool = False) -> Response:
        """Draw the QR code that pairs a phone with a robot; with `printed`, the permanent one."""
        address = board.robot(number).page_address(printed=printed)
        if address is None:
            raise HTTPException(409, "This robot does not answer, so its QR code is not known.")
        import segno

        out = io.BytesIO()
        segno.make(address, error="m", micro=False).save(
            out, kind="svg", border=3, light="#fff", dark="#000", xmldecl=False, scale=4
        )
        headers = {"cache-control": "no-store"}
        return Response(out.getvalue(), media_type="image/svg+xml", headers=headers)

    @app.websocket("/ws/board")
    async def follow(websocket: WebSocket) -> None:
        """Serve an open page: send news and pictures; receive STOP, releases and other requests."""
        await websocket.accept()
        onlooker = BoardViewer()
        board.join(onlooker)
        try:
            await end_with_either(
                _hear(websocket, board, onlooker), _tell(websocket, board, onlooker, clock)
            )
        finally:
            board.leave(onlooker)


async def _hear(websocket: WebSocket, board: Board, onlooker: BoardViewer) -> None:
    while True:
        event = await websocket.receive()
        if event["type"] == "websocket.disconnect":
            return
        try:
            message = json.loads(event.get("text") or "")
            kind = message["type"]
            if kind == "stop":
                board.stop(message.get("robot"))
            elif kind == "release":
                stops = message["stops"]
                board.release({int(number): str(stops[number]) for number in stops})
            elif kind == "watch":
                board.watch(onlooker, map(int, message["robots"]))
            elif kind == "drawn":
                onlooker.may_send.set()
            else:
                raise ValueError(kind)
        except (ValueError, LookupError, TypeError, ArithmeticError, RecursionError):
            await websocket.close(1008, "the message is not valid")
            return


async def _tell(websocket: WebSocket, board: Board, onlooker: BoardViewer, clock: Clock) -> None:
    """Send news and the newest pictures to a page, but nothing while a stop is under way.

    Further pictures are sent only after the page has drawn the previous ones.
    """
    while True:
        await onlooker.due.wait()
        await board.at_leisure.wait()
        onlooker.due.clear()
        if onlooker.changed:
            numbers, onlooker.changed = sorted(onlooker.changed), set()
            shown = {robot.number: robot for robot in board.shown()}
            robots = [shown[number].describe() for number in numbers if number in shown]
            gone = [number for number in numbers if number not in shown]
            await websocket.send_json({"type": "robots", "robots": robots, "gone": gone})
        if onlooker.strangers_changed:
            onlooker.strangers_changed = False
            await websocket.send_json({"type": "strangers", **board.strangers.describe()})
        if onlooker.pictures and onlooker.may_send.is_set():
            onlooker.may_send.clear()
            pictures, onlooker.pictures = onlooker.pictures, {}
            parts = [PICTURE_HEADER.pack(n, len(data)) + data for n, data in pictures.items()]
            await websocket.send_bytes(b"".join(parts))
        await clock.pause(SEND_EVERY_S)
        if onlooker.pictures:
            onlooker.due.set()
