"""What is worked out for the page beside its server, and given up when nobody waits for it."""

import asyncio
import json
import sys
import threading
from asyncio.subprocess import PIPE
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from ..errors import MixedOrderGameError
from ..files.temporary import temporary_folder
from ..fmu.run import Simulator
from ..fmu.schedule import write_disturbance
from .facts import facts_of
from .game_file import changed_game
from .picture import picture_of
from .spectrum import spectrum_of
from .wish import Wish, WishError

Answer = TypeVar("Answer")

ASKED = 0.2
"""Seconds between two looks whether anybody still waits for the claims."""


class Superseded(Exception):  # noqa: N818 - nothing went wrong
    """Nobody waits for the answer any more."""


class Worker:
    """One game: a single FMU instance for all runs and linearizations, and what follows from them."""

    def __init__(self, simulator: Simulator, name: str) -> None:
        self.simulator, self.model = simulator, simulator.model
        self.facts = facts_of(self.model, name)
        self._threads = {kind: ThreadPoolExecutor(1, kind) for kind in ("run", "others")}
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
            "others", gone, lambda _: spectrum_of(self.simulator, wish.changes).as_json()
        )

    async def claims(self, wish: Wish, gone: threading.Event) -> dict[str, Any]:
        """What mog validate --json tells of the game with these values. Raises MixedOrderGameError.

        It is a process of its own, as only that can be ended at any moment: large games take minutes.
        """
        with temporary_folder(MixedOrderGameError) as folder:
            fmu = folder / "game.fmu"
            fmu.write_bytes(await self.file(".fmu", wish, gone))
            command = [sys.executable, "-m", __package__.partition(".")[0], "validate", str(fmu), "--json"]
            process = await asyncio.create_subprocess_exec(*command, stdout=PIPE, stderr=PIPE)
            try:
                judged = asyncio.ensure_future(process.communicate())
                while not (await asyncio.wait({judged}, timeout=ASKED))[0]:
                    if gone.is_set():
                        raise Superseded
                told, said = judged.result()
            finally:
                if process.returncode is None:
                    process.kill()
                    await process.wait()
        if not told:
            raise MixedOrderGameError(said.decode().strip().removeprefix("mog: "))
        answer: dict[str, Any] = json.loads(told)
        return answer

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

        return await self._in_thread("others", gone, write)

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
