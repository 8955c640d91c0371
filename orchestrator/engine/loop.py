"""An event loop in a thread of its own, for a client of a Dask cluster.

``distributed`` starts one itself, but gives up with a bare assertion when it is not there within ten seconds, as on
a machine whose disk is busy. This one waits for the loop, however long that takes, and for nothing else.
"""

import asyncio
import threading

from tornado.ioloop import IOLoop


class LoopThread:
    """A running event loop; close it when nothing uses it any more."""

    loop: IOLoop  # the loop, as ``Client(loop=...)`` takes it

    def __init__(self) -> None:
        self._ready = threading.Event()
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="cluster loop", daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """End the loop and wait for its thread."""
        if self._thread.is_alive():
            self.loop.add_callback(self._stop.set)
            self._thread.join()

    def _run(self) -> None:
        try:
            asyncio.run(self._main())
        except BaseException as error:  # raised again where the loop was asked for
            self._failure = error
            self._ready.set()

    async def _main(self) -> None:
        self._stop = asyncio.Event()
        self.loop = IOLoop.current()
        self._ready.set()
        await self._stop.wait()
