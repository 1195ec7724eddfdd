# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The server of the page: static files of the package, one websocket per viewer, downloads of what was exported.

Safety: only hosts by the names that it was bound to are answered, a websocket needs the page's own origin and, beyond
the loopback, the token. A client names no path: downloads are looked up in the list of files written by this server.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from fluxlock.live import messages
from fluxlock.live.link import Link
from fluxlock.live.traces import MARKS, NAMES, TRACES, Floats, Ring

PAGE = Path(__file__).parent / "page"
STATIC = {
    "": ("index.html", "text/html"),
    "live.js": ("live.js", "text/javascript"),
    "pictures.js": ("pictures.js", "text/javascript"),
    "lines.js": ("lines.js", "text/javascript"),
    "wizard.js": ("wizard.js", "text/javascript"),
    "live.css": ("live.css", "text/css"),
    "uPlot.js": ("vendor/uPlot.iife.min.js", "text/javascript"),
    "uPlot.css": ("vendor/uPlot.min.css", "text/css"),
}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self'; img-src 'self' data:"
)
STATUS_S = 0.1
NO_ENTRY = 4403  # code with which a websocket is closed
CSV_ROWS = 2_000_000
WAITING = 50


class Server:
    """One source for any number of viewers. token: asked of every websocket and download, "" for none."""

    def __init__(self, folder: Path, token: str = "") -> None:
        self.folder, self.token = folder, token
        self.files: dict[str, Path] = {}
        self.viewers: set[Viewer] = set()
        self.link: Link

    def tell(self, message: dict[str, Any]) -> None:
        """Put a message into every viewer's queue; files are written first."""
        if message["kind"] == "files":
            message = self._written(message)
        for viewer in self.viewers:
            viewer.put(message)

    def _written(self, message: dict[str, Any]) -> dict[str, Any]:
        try:
            for name, text in message["texts"].items():
                self.keep(name, text)
        except OSError as error:
            return {"kind": "error", "text": f"{error.filename}: {error.strerror}"}
        told = {"kind": "files", "names": list(message["texts"]), "folder": str(self.folder)}
        return told | ({"scenario": message["scenario"]} if "scenario" in message else {})

    def keep(self, name: str, content: str | bytes) -> None:
        """Write a file that may be downloaded; its name is made of a checked word and a suffix."""
        path = self.folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        self.files[name] = path

    def permitted(self, request: Request | WebSocket) -> bool:
        """Whether the token fits, if there is one."""
        given = request.query_params.get("token", "")
        return not self.token or secrets.compare_digest(given.encode(), self.token.encode())

    async def static(self, request: Request) -> Response:
        """A file of the page."""
        name = request.path_params.get("name", "")
        if name not in STATIC:
            return PlainTextResponse("not found", 404)
        file, kind = STATIC[name]
        headers = {"Content-Security-Policy": POLICY, "Cache-Control": "no-cache", "Referrer-Policy": "no-referrer"}
        return FileResponse(PAGE / file, media_type=kind, headers=headers)

    async def download(self, request: Request) -> Response:
        """A file that was exported."""
        path = self.files.get(request.path_params["name"])
        if path is None or not self.permitted(request):
            return PlainTextResponse("not found", 404)
        return FileResponse(path, filename=path.name)

    async def socket(self, websocket: WebSocket) -> None:
        """A viewer."""
        origin, host = websocket.headers.get("origin", ""), websocket.headers.get("host", "")
        if origin not in (f"http://{host}", f"https://{host}") or not self.permitted(websocket):
            await websocket.close(NO_ENTRY)
            return
        await websocket.accept()
        viewer = Viewer(self, websocket)
        self.viewers.add(viewer)
        try:
            await viewer.run()
        finally:
            self.viewers.discard(viewer)


class Viewer:
    """One websocket."""

    def __init__(self, server: Server, websocket: WebSocket) -> None:
        self._server, self._socket = server, websocket
        self._queue: asyncio.Queue[dict[str, Any] | bytes] = asyncio.Queue()
        self._tables: set[asyncio.Task[None]] = set()
        link = server.link
        if link.hello is not None:
            self.put(link.hello)
            for entry in link.said:
                self.put(entry)
        if server.files:
            self.put({"kind": "files", "names": list(server.files), "folder": str(server.folder)})
        if link.died:
            self.put({"kind": "died", "text": link.died})

    def put(self, message: dict[str, Any] | bytes) -> None:
        """Send it when its turn comes."""
        if isinstance(message, dict) and message["kind"] == "hello":
            message = message | {"traces": [[name, *TRACES[name]] for name in NAMES], "marks": MARKS}
        self._queue.put_nowait(message)

    async def run(self) -> None:
        """Until the viewer leaves."""
        tasks = [asyncio.create_task(work()) for work in (self._send, self._report)]
        try:
            while True:
                event = await self._socket.receive()
                if event["type"] == "websocket.disconnect":
                    return
                self._take(event.get("text"))
                while self._queue.qsize() > WAITING and not tasks[0].done():  # who asks faster than it reads waits
                    await asyncio.sleep(STATUS_S / 10)
        finally:
            for task in [*tasks, *self._tables]:
                task.cancel()
            with suppress(asyncio.CancelledError):  # the server ends
                await asyncio.gather(*tasks, *self._tables, return_exceptions=True)

    async def _send(self) -> None:
        try:
            while True:
                message = await self._queue.get()
                if isinstance(message, bytes):
                    await self._socket.send_bytes(message)
                else:
                    await self._socket.send_text(json.dumps(message))
        except (WebSocketDisconnect, RuntimeError):
            return

    async def _report(self) -> None:
        """The status, where something has changed."""
        before: dict[str, Any] = {}
        while True:
            status = {"kind": "status", "viewers": len(self._server.viewers)} | self._server.link.status
            if status != before and self._queue.qsize() < 20:
                self.put(status)
                before = status
            await asyncio.sleep(STATUS_S)

    def _take(self, text: str | None) -> None:
        """One message; whatever it is, the viewer gets an answer and nobody else notices."""
        link = self._server.link
        try:
            if text is None:
                raise ValueError("a message is a text")
            message = messages.parse(text)
            if isinstance(message, messages.View):
                self.put(picture(link, message))
            elif isinstance(message, messages.Planes):
                self.put(planes(link, message))
            elif isinstance(message, messages.Table):
                self._begin_table(message)
            elif link.died and isinstance(message, messages.Restart):
                link.begin()
            elif not link.order(message):
                raise ValueError("the source is not running")
        except (ValueError, OSError) as error:
            self.put({"kind": "error", "text": str(error)})

    def _begin_table(self, message: messages.Table) -> None:
        """Make a table in a thread, or all viewers would wait for it."""
        names = known(message.traces)
        time_s, rows = self._server.link.ring.cut(message.from_s, message.to_s, names)
        if time_s.size > CSV_ROWS:
            raise ValueError(f"a table has at most {CSV_ROWS} rows")
        if self._tables:
            raise ValueError("a table is being made; the next one when it is there")
        head = ["t_s", *(f"{name} [{TRACES[name][0]}]" for name in names)]
        task = asyncio.create_task(self._table(message, head, time_s.copy(), rows))
        self._tables.add(task)
        task.add_done_callback(self._tables.discard)

    async def _table(self, message: messages.Table, head: list[str], time_s: Floats, rows: Floats) -> None:
        name = f"{message.name}.{message.kind}"
        try:
            make: Callable[..., str | bytes] = csv_of if message.kind == "csv" else parquet_of
            self._server.keep(name, await asyncio.to_thread(make, head, time_s, rows))
        except (ValueError, OSError) as error:
            self.put({"kind": "error", "text": str(error)})
            return
        self.put({"kind": "files", "names": [name], "folder": str(self._server.folder), "rows": int(time_s.size)})


def csv_of(head: list[str], time_s: Floats, rows: Floats) -> str:
    """A table as text."""
    line = ",".join(["%.9g", *["%.7g"] * len(rows)]) + "\n"
    return (
        ",".join(head)
        + "\n"
        + "".join([line % values for values in zip(*(column.tolist() for column in (time_s, *rows)), strict=True)])
    )


def parquet_of(head: list[str], time_s: Floats, rows: Floats) -> bytes:
    """A table as Parquet: time in float64, traces in float32; ValueError without its library."""
    if find_spec("pyarrow") is None:
        raise ValueError("Parquet needs pyarrow: `make setup` in a checkout, else pip install 'fluxlock[live]'")
    from pyarrow import BufferOutputStream, table
    from pyarrow.parquet import write_table

    out = BufferOutputStream()
    write_table(table([time_s, *rows], names=head), out)
    return bytes(out.getvalue())


def planes(link: Link, message: messages.Planes) -> dict[str, Any]:
    """What the page draws planes and dial from."""
    newest = link.ring.newest_s
    to_s = newest if message.to_s is None else min(message.to_s, newest)
    return {"kind": "planes"} | link.ring.planes(to_s - message.span_s, np.nextafter(to_s, np.inf))


def known(names: list[str]) -> list[str]:
    """The names, all of them traces; ValueError."""
    for name in names:
        if name not in TRACES:
            raise ValueError(f"{name} is no trace, permitted: {', '.join(NAMES)}")
    return names


def triggered(ring: Ring, trigger: messages.Trigger, until_s: float) -> float | None:
    """Time at which a trigger was met last before a time, and not before `after_s`; None: it was not."""
    if trigger.mark:
        found = ring.last_mark(MARKS.index(trigger.mark), until_s)
    else:
        known([trigger.trace])
        found = ring.last_crossing(trigger.trace, trigger.level, trigger.rising, trigger.size, until_s)
    return found if found is not None and found > trigger.after_s else None


def picture(link: Link, view: messages.View) -> bytes:
    """A picture as the page reads it.

    Little endian: traces, points per trace, marks and 0, uint32; begin and end of the span, time of the trigger (nan:
    none), newest time, float64 in s; times of the marks and their numbers, float64 [2][marks]; times, float64 [points];
    traces, float32 [traces][points].
    """
    names, ring = known(view.traces), link.ring
    newest, at_s = ring.newest_s, float("nan")
    to_s = newest if view.to_s is None else min(view.to_s, newest)
    if view.trigger is not None:
        after_s = (1.0 - view.trigger.before) * view.span_s
        found = triggered(ring, view.trigger, to_s - after_s)
        if found is not None:
            at_s, to_s = found, found + after_s
    until_s = to_s
    to_s = max(to_s, view.span_s) if np.isnan(at_s) else to_s  # before time 0 is nothing to see
    from_s = to_s - view.span_s
    time_s, rows = ring.picture(from_s, to_s, names, view.width, float(np.nextafter(until_s, np.inf)))
    marks = np.array(ring.marks(from_s, until_s), "<f8").reshape(-1, 2).T
    head = struct.pack("<4I4d", len(names), time_s.size, marks.shape[1], 0, from_s, to_s, at_s, newest)
    return head + marks.tobytes() + np.asarray(time_s, "<f8").tobytes() + np.ascontiguousarray(rows, "<f4").tobytes()


def application(server: Server, link: Link, hosts: list[str]) -> Starlette:
    """The server as an ASGI application; the source runs as long as it does. hosts: names that it answers to."""
    server.link = link

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        link.begin()
        try:
            yield
        finally:
            link.end()

    routes = [
        Route("/", server.static),
        Route("/{name}", server.static),
        Route("/files/{name}", server.download),
        WebSocketRoute("/socket", server.socket),
    ]
    middleware = [Middleware(TrustedHostMiddleware, allowed_hosts=hosts)]
    return Starlette(routes=routes, middleware=middleware, lifespan=lifespan)
