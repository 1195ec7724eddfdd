# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a first run needs besides the chip, made by a process of its own while the chip's compiler runs.

Firmware and the plant's kernel take as long as the chip, and each of the three keeps one core busy.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from fluxlock.firmware import build_firmware
from fluxlock.plant.build import Variant, compiled, is_compiled


@contextmanager
def built_beside(variant: Variant, can_method: str | None) -> Iterator[None]:
    """Make a kernel and the firmware of so many phases beside the body, if this kernel was never compiled.

    can_method: as in `build_firmware`. The body ends when both are there. Nothing depends on it: whoever needs one
    makes it, and says what is wrong.
    """
    if is_compiled(variant):
        yield
        return
    command = [sys.executable, "-m", __name__, str(variant.phases), str(int(variant.field)), can_method or ""]
    # A group of its own: whoever interrupts takes the compiler with it.
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        yield
        process.wait()
    finally:
        if process.poll() is None:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def main() -> None:
    """Arguments: phases; 1 for a machine by its flux linkages, else 0; method of the image with the node, or empty."""
    phases, field, method = sys.argv[1:]
    build_firmware(phases=int(phases), can_method=method or None)
    compiled(Variant(int(phases), field == "1"))


if __name__ == "__main__":
    main()
