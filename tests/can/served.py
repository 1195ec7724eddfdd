# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A native drive whose node is on a bus of this process."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import can

from fluxlock.native.serve import serve

CHANNELS = itertools.count()


@contextmanager
def on_a_bus(drive: Any) -> Iterator[str]:
    """The drive serves its node in a thread, at the clock's pace; name of its bus. Others leave it alone meanwhile."""
    over, channel = threading.Event(), f"served-{next(CHANNELS)}"
    with can.Bus(interface="virtual", channel=channel) as bus:
        thread = threading.Thread(target=serve, args=(drive, bus, over.is_set, 1.0))
        thread.start()
        try:
            yield f"virtual:{channel}"
        finally:
            over.set()
            thread.join()
