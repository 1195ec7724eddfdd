# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a viewer may send, and that nothing else does anything."""

from __future__ import annotations

import asyncio
import io
import json
import random
import string
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import uvicorn
from pyarrow import parquet
from starlette.applications import Starlette
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect
from websockets.asyncio.client import connect
from websockets.typing import Origin

from fluxlock.live import messages
from fluxlock.live.cli import listening
from fluxlock.live.link import Link
from fluxlock.live.server import Server, application, picture
from fluxlock.live.traces import NAMES, Ring

ORIGIN = "http://127.0.0.1:8437"
SOCKET = "ws://127.0.0.1:8437/socket"  # the client adds no host of its own
MALFORMED = 10_000
UNREAD, LEFT_S = 120, 20.0  # pictures that nobody reads; until one is gone
GOOD: list[dict[str, Any]] = [
    {"kind": "view", "traces": ["ia", "speed_rpm"], "width": 100, "span_s": 0.5},
    {"kind": "drive", "do": "start"},
    {"kind": "set", "name": "speed_rpm", "value": "-3000"},
    {"kind": "load", "factor": 1.5},
    {"kind": "supply", "volt": 20, "ramp_s": 0.1},
    {"kind": "fault", "fault": {"kind": "open_phase", "phases": ["A"]}},
    {"kind": "pace", "factor": 0.5},
    {"kind": "step", "seconds": 0.01},
    {"kind": "step", "seconds": 0.01, "until": "tick"},
    {"kind": "restart"},
    {"kind": "export", "name": "my-play"},
    {"kind": "planes", "span_s": 0.02},
    {"kind": "parquet", "name": "my-table", "traces": ["ia"], "from_s": 0, "to_s": 1},
    {"kind": "csv", "name": "my-table", "traces": ["ia"], "from_s": 0, "to_s": 1},
]
PATHS = (
    "../../etc/passwd",
    "/etc/passwd",
    "..",
    "a/b",
    "a\\b",
    "%2e%2e%2fx",
    "x\0y",
    "C:\\x",
    "~",
    "$(id)",
    "`id`",
    "",
)


class Quiet(Link):
    """A source that only keeps what it is told."""

    def __init__(self) -> None:
        super().__init__(Path(), 1, 1.0, lambda _: None)
        self.ring, self.orders = Ring(4096), list[object]()
        self.hello = {"kind": "hello", "name": "none"}
        time_s = np.arange(1000) * 1e-3
        self.ring.append(time_s, np.tile(np.sin(20 * time_s), (len(NAMES), 1)).astype(np.float32))

    def begin(self) -> None: ...

    def end(self) -> None: ...

    def order(self, message: object) -> bool:
        self.orders.append(message)
        return True


def client_of(folder: Path, token: str = "") -> tuple[TestClient, Quiet, Server]:
    server, link = Server(folder, token), Quiet()
    return TestClient(application_of(server, link), base_url=ORIGIN), link, server


def application_of(server: Server, link: Quiet) -> Starlette:
    return application(server, link, ["127.0.0.1", "localhost"])


def answer(socket: Any) -> dict[str, Any] | bytes:
    """The next message that is no status and no greeting."""
    while True:
        event = socket.receive()
        if event.get("bytes"):
            return bytes(event["bytes"])
        message: dict[str, Any] = json.loads(event["text"])
        if message["kind"] not in ("status", "hello"):
            return message


def spoilt(rng: random.Random) -> str:
    """A message that is wrong in one way or another."""
    good = json.loads(json.dumps(rng.choice(GOOD)))
    keys = [key for key in good if key != "kind"]
    way = rng.randrange(7)
    if way == 0 or (way in (1, 2) and not keys):
        return "".join(rng.choices(string.printable, k=rng.randrange(60)))
    if way == 1:
        good[rng.choice(keys)] = rng.choice([None, [], {}, "x" * 50, 1e400, -1e30, float("nan"), [[[]]], True, *PATHS])
    elif way == 2:
        good[rng.choice(keys)] = {"kind": rng.choice(PATHS), "phases": rng.choice(PATHS)}
    elif way == 3:
        good["kind"] = rng.choice([*PATHS, "exec", 5, None])
    elif way == 4:
        good["more"] = rng.choice(PATHS)
    elif way == 5:
        return json.dumps(good)[: rng.randrange(len(json.dumps(good)))]
    else:
        return "[" * rng.randrange(1, 15_000)
    return json.dumps(good)


def test_malformed(tmp_path: Path) -> None:
    """10 000 malformed messages: each gets an answer that says why, no order reaches the source, no file is made.

    Verifies: LIVE-03
    """
    rng, (_, link, server) = random.Random(37), client_of(tmp_path)
    texts = [spoilt(rng) for _ in range(MALFORMED)]
    for text in texts:
        with pytest.raises(ValueError, match=r"^[ -~]+$"):
            messages.parse(text)

    async def flood() -> None:
        listener = listening("127.0.0.1", 0)
        address = f"127.0.0.1:{listener.getsockname()[1]}"
        running = uvicorn.Server(uvicorn.Config(application_of(server, link), log_level="warning"))
        task = asyncio.create_task(running.serve([listener]))
        async with connect(f"ws://{address}/socket", origin=Origin(f"http://{address}")) as socket:

            async def told() -> dict[str, Any] | bytes:
                while True:
                    event = await socket.recv()
                    if isinstance(event, bytes):
                        return event
                    message: dict[str, Any] = json.loads(event)
                    if message["kind"] not in ("status", "hello"):
                        return message

            for text in texts:
                await socket.send(text)
                refused = await told()
                assert isinstance(refused, dict) and refused["kind"] == "error", text
            await socket.send(b"\0\1")
            assert await told() == {"kind": "error", "text": "a message is a text"}
            await socket.send(json.dumps(GOOD[0]))
            assert isinstance(await told(), bytes), "it still serves"
        running.should_exit = True
        await task

    asyncio.run(flood())
    assert link.orders == [] and server.files == {} and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("good", GOOD, ids=lambda good: str(good["kind"]))
def test_well_formed(good: dict[str, Any]) -> None:
    """What the page sends is taken, and every text field refuses a path.

    Verifies: LIVE-03
    """
    messages.parse(json.dumps(good))
    for key, value in good.items():
        for path in PATHS if isinstance(value, str) else ():
            with pytest.raises(ValueError):
                messages.parse(json.dumps(good | {key: path}))


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:9999", "null", ""])
def test_foreign_origin(tmp_path: Path, origin: str) -> None:
    """A websocket of another origin, or of none, is closed before a word is said.

    Verifies: LIVE-02
    """
    client, _, _ = client_of(tmp_path)
    with client, pytest.raises(WebSocketDisconnect), client.websocket_connect(SOCKET, headers={"origin": origin}):
        pass


def test_foreign_host(tmp_path: Path) -> None:
    """A name that another party has bent to the loopback is not answered.

    Verifies: LIVE-02
    """
    client, _, _ = client_of(tmp_path)
    with client:
        assert client.get("/", headers={"host": "evil.example:8437"}).status_code == 400
        assert client.get("/").status_code == 200


def test_token(tmp_path: Path) -> None:
    """With a token, neither a websocket nor a download works without it.

    Verifies: LIVE-02
    """
    client, _, server = client_of(tmp_path, token="open-sesame")
    server.keep("my-table.csv", "t_s\n")
    with client:
        for query in ("", "?token=", "?token=open-sesam", "?token=ö"):
            with (
                pytest.raises(WebSocketDisconnect),
                client.websocket_connect(f"{SOCKET}{query}", headers={"origin": ORIGIN}),
            ):
                pass
            assert client.get(f"/files/my-table.csv{query}").status_code == 404
        with client.websocket_connect(f"{SOCKET}?token=open-sesame", headers={"origin": ORIGIN}) as socket:
            told = answer(socket)
            assert isinstance(told, dict) and told["names"] == ["my-table.csv"], "what there is to load"
            socket.send_text(json.dumps(GOOD[0]))
            assert isinstance(answer(socket), bytes)
        assert client.get("/files/my-table.csv?token=open-sesame").text == "t_s\n"


def test_no_other_file(tmp_path: Path) -> None:
    """Only files that this server has written can be downloaded, whatever the address says.

    Verifies: LIVE-02
    """
    client, _, _ = client_of(tmp_path)
    (tmp_path / "private.txt").write_text("x")
    with client:
        for name in (
            "private.txt",
            "../server.py",
            "..%2fserver.py",
            "%2fetc%2fpasswd",
            "....//x",
            "vendor/uPlot.min.css",
        ):
            assert client.get(f"/files/{name}").status_code == 404
            assert client.get(f"/{name}").status_code == 404


def test_table(tmp_path: Path) -> None:
    """A CSV has the span and the traces that were asked for, with units; it lies in the output folder.

    Verifies: LIVE-06
    """
    client, _, _ = client_of(tmp_path)
    with client, client.websocket_connect(SOCKET, headers={"origin": ORIGIN}) as socket:
        asked = {"kind": "csv", "name": "my-table", "traces": ["ia", "torque_nm"], "from_s": 0.1, "to_s": 0.2}
        socket.send_text(json.dumps(asked))
        told = answer(socket)
        assert isinstance(told, dict) and told["names"] == ["my-table.csv"]
        head, *rows = client.get("/files/my-table.csv").text.splitlines()
    assert head == "t_s,ia [A],torque_nm [N*m]" and len(rows) == 100
    assert (tmp_path / "my-table.csv").is_file()


def test_parquet(tmp_path: Path) -> None:
    """The same table as Parquet: names with units, every value of the span.

    Verifies: LIVE-12
    """
    client, link, _ = client_of(tmp_path)
    with client, client.websocket_connect(SOCKET, headers={"origin": ORIGIN}) as socket:
        asked = {"kind": "parquet", "name": "my-table", "traces": ["ia", "torque_nm"], "from_s": 0.1, "to_s": 0.2}
        socket.send_text(json.dumps(asked))
        told = answer(socket)
        assert isinstance(told, dict) and told["names"] == ["my-table.parquet"]
        content = client.get("/files/my-table.parquet").content
    table = parquet.read_table(io.BytesIO(content))
    assert table.column_names == ["t_s", "ia [A]", "torque_nm [N*m]"]
    _, rows = link.ring.cut(0.1, 0.2, ["ia"])
    assert np.array_equal(table.column("ia [A]").to_numpy(), rows[0])


def test_planes(tmp_path: Path) -> None:
    """Balanced currents are a circle in the stationary plane and a point in the rotor's; an unknown angle is none.

    Verifies: LIVE-12
    """
    client, link, _ = client_of(tmp_path)
    time_s = np.arange(2000) * 5e-5
    rows = np.zeros((len(NAMES), time_s.size), np.float32)
    angle = 2 * np.pi * 50 * time_s
    for k, name in enumerate(("ia", "ib", "ic")):
        rows[NAMES.index(name)] = 3.0 * np.cos(angle - 2 * np.pi * k / 3)
    rows[NAMES.index("id")] = 3.0
    rows[NAMES.index("theta_deg")] = np.degrees(angle) % 360.0
    rows[NAMES.index("angle_error_deg")] = np.nan
    link.ring = Ring(4096)
    link.ring.append(time_s, rows)
    with client, client.websocket_connect(SOCKET, headers={"origin": ORIGIN}) as socket:
        socket.send_text(json.dumps({"kind": "planes", "span_s": 0.05}))
        told = answer(socket)
    assert isinstance(told, dict) and 100 < len(told["alpha"]) <= 400
    assert np.allclose(np.hypot(told["alpha"], told["beta"]), 3.0, atol=1e-4) and set(told["id"]) == {3.0}
    assert told["error_deg"] is None and told["theta_deg"] == pytest.approx(rows[NAMES.index("theta_deg"), -1])


def test_before_the_first_time(tmp_path: Path) -> None:
    """A span longer than what there is begins at 0; held there, it gets nothing that comes later.

    Verifies: LIVE-05
    """
    _, link, server = client_of(tmp_path)
    link.ring = Ring(4096)
    asked: dict[str, Any] = {"kind": "view", "traces": ["ia"], "width": 2000, "span_s": 2.0}

    def shown(**more: float) -> tuple[list[float], int]:
        view = messages.parse(json.dumps(asked | more))
        assert isinstance(view, messages.View)
        data = picture(link, view)
        return list(struct.unpack_from("<2d", data, 16)), struct.unpack_from("<4I", data)[1]

    link.ring.append(np.arange(500) * 1e-3, np.zeros((len(NAMES), 500), np.float32))
    assert shown() == ([0.0, 2.0], 500)
    link.ring.append(0.5 + np.arange(2000) * 1e-3, np.zeros((len(NAMES), 2000), np.float32))
    assert shown(to_s=0.499) == ([0.0, 2.0], 500)
    span, count = shown()
    assert span == [pytest.approx(0.499), pytest.approx(2.499)] and count == 2000 and not server.files


def test_all_traces_at_once() -> None:
    """A page with every box ticked gets its picture.

    Verifies: LIVE-05
    """
    messages.parse(json.dumps({"kind": "view", "traces": list(NAMES), "width": 100, "span_s": 0.5}))


def test_a_table_stops_nobody(tmp_path: Path) -> None:
    """While a long table is being made, a picture is answered, and a second table is refused.

    Verifies: LIVE-06, LIVE-08
    """
    client, link, _ = client_of(tmp_path)
    link.ring = Ring(2**18)
    link.ring.append(np.arange(2**17) * 1e-4, np.zeros((len(NAMES), 2**17), np.float32))
    table = {"kind": "csv", "name": "my-table", "traces": list(NAMES), "from_s": 0, "to_s": 100}
    with client, client.websocket_connect(SOCKET, headers={"origin": ORIGIN}) as socket:
        for asked in (table, table | {"name": "more"}, GOOD[0]):
            socket.send_text(json.dumps(asked))
        refused, shown, told = (answer(socket) for _ in range(3))
    assert isinstance(refused, dict) and "the next one when it is there" in refused["text"]
    assert isinstance(shown, bytes) and isinstance(told, dict) and told["names"] == ["my-table.csv"]
    assert sum(1 for _ in (tmp_path / "my-table.csv").open()) == 2**17 + 1 == told["rows"] + 1


def test_a_viewer_that_reads_nothing_leaves(tmp_path: Path) -> None:
    """One that asks for pictures, reads none and breaks off is forgotten.

    Verifies: LIVE-08
    """
    _, link, server = client_of(tmp_path)

    async def leave() -> None:
        listener = listening("127.0.0.1", 0)
        address = f"127.0.0.1:{listener.getsockname()[1]}"
        running = uvicorn.Server(
            uvicorn.Config(application_of(server, link), log_level="warning", timeout_graceful_shutdown=1)
        )
        task = asyncio.create_task(running.serve([listener]))
        many = json.dumps({"kind": "view", "traces": list(NAMES), "width": 8192, "span_s": 1.0})
        async with connect(f"ws://{address}/socket", origin=Origin(f"http://{address}"), max_queue=1) as socket:
            for _ in range(UNREAD):
                await socket.send(many)
            await asyncio.sleep(1.0)
            assert len(server.viewers) == 1
            socket.transport.abort()
        end = asyncio.get_running_loop().time() + LEFT_S
        while server.viewers and asyncio.get_running_loop().time() < end:
            await asyncio.sleep(0.05)
        running.should_exit = True
        await task

    asyncio.run(leave())
    assert not server.viewers
