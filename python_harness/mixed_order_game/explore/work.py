"""What is worked out for the page, each kind in a thread of its own, given up when nobody waits for it."""

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from ..errors import MixedOrderGameError
from ..files.temporary import temporary_folder
from ..fmu.run import Simulator
from ..fmu.schedule import write_disturbance
from ..studies.validate import validate
from .facts import facts_of
from .game_file import changed_game
from .picture import picture_of
from .spectrum import spectrum_of
from .wish import Wish, WishError

Answer = TypeVar("Answer")
Stale = Callable[[], bool]


class Superseded(Exception):  # noqa: N818 - nothing went wrong
    """Nobody waits for the answer any more."""


class Worker:
    """One game: a single FMU instance for all runs and linearizations, and what follows from them."""

    def __init__(self, simulator: Simulator, name: str) -> None:
        self.simulator, self.model = simulator, simulator.model
        self.facts = facts_of(self.model, name)
        self._threads = {kind: ThreadPoolExecutor(1, kind) for kind in ("run", "spectrum", "claims")}
        self._closing = threading.Event()

    def close(self) -> None:
        """Give up what is being worked out."""
        self._closing.set()
        for thread in self._threads.values():
            thread.shutdown(cancel_futures=True)

    async def run(self, wish: Wish, gone: threading.Event) -> bytes:
        """The packed picture. Raises Superseded, as all of these do."""
        return await self._in_thread(
            "run", gone, lambda go_on: picture_of(self.simulator, wish, go_on).packed()
        )

    async def spectrum(self, wish: Wish, gone: threading.Event) -> dict[str, Any]:
        """Eigenvalues, verdict and reason."""
        return await self._in_thread(
            "spectrum", gone, lambda _: spectrum_of(self.simulator, wish.changes).as_json()
        )

    async def claims(self, wish: Wish, gone: threading.Event) -> dict[str, Any]:
        """The claims about the game with these values. Raises MixedOrderGameError."""

        def judge(go_on: Callable[[], None]) -> dict[str, Any]:
            with temporary_folder(MixedOrderGameError) as folder:
                fmu = changed_game(self.model, wish.changes).build(folder / "game.fmu")
                found = validate(fmu, progress=lambda _name, _part: go_on())
            told = found.as_json()
            return {"summary": found.summary(), "claims": told["claims"], "notes": told["notes"]}

        return await self._in_thread("claims", gone, judge)

    async def file(self, suffix: str, wish: Wish, gone: threading.Event) -> bytes:
        """The game (.toml), its FMU (.fmu) or the pushes (.csv). Raises MixedOrderGameError."""

        def write(_: object) -> bytes:
            if suffix == ".toml":
                return changed_game(self.model, wish.changes).text().encode()
            with temporary_folder(MixedOrderGameError) as folder:
                if suffix == ".fmu":
                    return changed_game(self.model, wish.changes).build(folder / "game.fmu").read_bytes()
                pushes = wish.disturbance(self.model)
                if pushes is None:
                    raise WishError("there are no pushes")
                return write_disturbance(folder / "pushes.csv", pushes.time, pushes.values).read_bytes()

        return await self._in_thread("spectrum", gone, write)

    async def _in_thread(
        self, kind: str, gone: threading.Event, work: Callable[[Callable[[], None]], Answer]
    ) -> Answer:
        """What the work gives; it calls what it is given, which raises Superseded, wherever it can end."""

        def go_on() -> None:
            if gone.is_set() or self._closing.is_set():
                raise Superseded

        def begin() -> Answer:
            go_on()
            return work(go_on)

        return await asyncio.get_running_loop().run_in_executor(self._threads[kind], begin)
