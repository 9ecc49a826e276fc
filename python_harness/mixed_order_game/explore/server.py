"""The page's server: on the loopback interface alone, and for the page alone."""

import asyncio
import json
import os
import socket
import threading
from abc import abstractmethod
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from bokeh.settings import settings as bokeh_settings
from tornado.httpserver import HTTPServer
from tornado.web import Application, HTTPError, RequestHandler, StaticFileHandler

from ..errors import MixedOrderGameError
from ..fmu.run import Simulator
from .picture import refused
from .wish import Wish, wish_of
from .work import Superseded, Worker

ADDRESS = "127.0.0.1"
HOSTS = ("localhost", ADDRESS)

PORT = 8640
"""Where the page is unless this is taken: with an address that stays, a bookmark keeps its state."""

LONGEST_REQUEST = 1_000_000

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


def serve(game: Path | str | None, *, port: int | None, ready: Callable[[str], object]) -> None:
    """Serve the page of a game until the process is interrupted; ready is called with its address.

    port: one that must be free, 0 for any that is; None: PORT, or any where that is taken.
    Raises what Simulator raises, MixedOrderGameError if the port cannot be had.
    """
    with Simulator(game) as simulator:
        simulator.model.require_plants()
        worker = Worker(simulator, "" if game is None else str(game))
        try:
            asyncio.run(_serve(worker, port, ready))
        finally:
            worker.close()


async def _serve(worker: Worker, port: int | None, ready: Callable[[str], object]) -> None:
    listening = _listening(port)
    server = HTTPServer(_application(worker), max_body_size=LONGEST_REQUEST)
    server.add_socket(listening)
    ready(f"http://{ADDRESS}:{listening.getsockname()[1]}/")
    await asyncio.Event().wait()


def _listening(port: int | None) -> socket.socket:
    try:
        listening = socket.create_server((ADDRESS, PORT if port is None else port))
    except OSError as error:
        if port is None:
            return _listening(0)
        why = os.strerror(error.errno or 0).lower()  # without the address, which Python's own text repeats
        raise MixedOrderGameError(f"there can be no page at port {port}: {why}") from error
    listening.setblocking(False)  # noqa: FBT003 - the name says it
    return listening


def _application(worker: Worker) -> Application:
    page = Path(__file__).parent / "page"
    bokeh = bokeh_settings.bokehjs_path() / "js"
    given = {"worker": worker}
    return Application(
        [
            (r"/game", Game, given),
            (r"/run", Run, given),
            (r"/spectrum", Spectrum, given),
            (r"/claims", Claims, given),
            (r"/file(\.toml|\.fmu|\.csv)", File, given),
            (r"/bokeh/(bokeh(?:-api)?\.min\.js)", Files, {"path": str(bokeh)}),
            (r"/()", Files, {"path": str(page), "default_filename": "index.html"}),
            (r"/(\w+\.(?:js|css|svg))", Files, {"path": str(page)}),
        ],
        default_handler_class=NotFound,
        log_function=lambda _: None,
    )


class Guarded(RequestHandler):
    """Refuses whoever is not the page itself: a foreign Host (a name bound to this address) or Origin."""

    def set_default_headers(self) -> None:
        for name, value in HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        if self.request.host_name not in HOSTS:
            raise HTTPError(403, reason=f"Host is not {' or '.join(HOSTS)}")
        if self.request.headers.get("Origin", f"http://{self.request.host}") != f"http://{self.request.host}":
            raise HTTPError(403, reason="Origin is not this page")

    def write_error(self, status_code: int, **_: Any) -> None:
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}: {self._reason}\n")

    def log_exception(self, kind: Any, value: Any, trace: Any) -> None:
        if not isinstance(value, HTTPError):
            super().log_exception(kind, value, trace)


class NotFound(Guarded):
    """Every other path."""

    def prepare(self) -> None:
        super().prepare()
        raise HTTPError(404)


class Files(Guarded, StaticFileHandler):
    """The page's own files and those of Bokeh, which a new version of a package changes."""

    def set_extra_headers(self, _path: str) -> None:
        self.set_header("Cache-Control", "no-cache")


class Game(Guarded):
    """What the page has to know of the game."""

    def initialize(self, worker: Worker) -> None:
        self.worker = worker

    def get(self) -> None:
        self.finish(self.worker.facts)


class Asked(Guarded):
    """Answers a wish, in JSON; an error of the package is an answer as well, its sentence the problem."""

    def initialize(self, worker: Worker) -> None:
        self.worker = worker
        self.gone = threading.Event()

    def on_connection_close(self) -> None:
        self.gone.set()

    async def post(self, *arguments: str) -> None:
        try:
            data = json.loads(self.request.body)
        except ValueError:
            raise HTTPError(400, reason="The body is not JSON") from None
        try:
            answer = await self.answer(wish_of(data, self.worker.model), *arguments)
        except (Superseded, asyncio.CancelledError):  # the page asks no more, or the server ends
            return
        except MixedOrderGameError as error:
            answer = self.refusal(str(error))
        self.set_header("Cache-Control", "no-store")
        self.finish(answer)

    @abstractmethod
    def answer(self, wish: Wish, *arguments: str) -> Awaitable[bytes | dict[str, Any]]:
        """What is sent. Raises MixedOrderGameError, Superseded."""

    def refusal(self, problem: str) -> bytes | dict[str, Any]:
        """What is sent in place of the answer."""
        return {"problem": problem}


class Run(Asked):
    """The packed picture of a run."""

    def answer(self, wish: Wish, *_: str) -> Awaitable[bytes]:
        self.set_header("Content-Type", "application/octet-stream")
        return self.worker.run(wish, self.gone)

    def refusal(self, problem: str) -> bytes:
        return refused(self.worker.model, problem).packed()


class Spectrum(Asked):
    """Eigenvalues of the unperturbed loop."""

    def answer(self, wish: Wish, *_: str) -> Awaitable[dict[str, Any]]:
        return self.worker.spectrum(wish, self.gone)


class Claims(Asked):
    """The paper's claims about the game as it is shown."""

    def answer(self, wish: Wish, *_: str) -> Awaitable[dict[str, Any]]:
        return self.worker.claims(wish, self.gone)


class File(Asked):
    """A file to keep: the game, its FMU or the pushes."""

    def answer(self, wish: Wish, *arguments: str) -> Awaitable[bytes]:
        (suffix,) = arguments
        self.set_header("Content-Type", "application/octet-stream")
        return self.worker.file(suffix, wish, self.gone)

    def refusal(self, problem: str) -> dict[str, Any]:
        self.set_header("Content-Type", "application/json")
        return {"problem": problem}
