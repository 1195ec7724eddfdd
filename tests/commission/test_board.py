# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock identify --port`: a board behind a terminal, whose commissioning program the averaged bench plays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import pytest
from typer.testing import CliRunner

from fluxlock.base.paths import ROOT
from fluxlock.cli import app
from fluxlock.commission.bench import bench_of
from fluxlock.commission.simulate import known_of
from fluxlock.config import ConfigError, load_motor
from fluxlock.firmware import build_commission
from fluxlock.flash import board_console
from fluxlock.flash.image import pack_image
from fluxlock.generate.memory import FLASH_IMAGE
from tests.commission.averaged_bench import AveragedBench, Machine
from tests.flash.board_terminal import Answer, BoardTerminal, behind_a_terminal

PLANT, INVERTER = ROOT / "motors" / "motor-1.toml", ROOT / "inverters" / "bench-25v.toml"
CONVERSION = "inverter.sensing.conversion_s=0.68e-6"  # of the boards
GAP_TICKS = 200  # the longest time between two lines: a host is slow, and the machine goes on


@dataclass
class Bench:
    """Machine and program; time goes on between the lines."""

    machine: Machine = field(default_factory=Machine)
    spoil: Callable[[int, bytes], bytes] = lambda count, data: data
    lab: AveragedBench | None = None

    def board(self) -> BoardTerminal:
        """Its board."""
        return BoardTerminal(self._program, self.spoil)

    def _program(self, flash: dict[int, bytes]) -> Answer:
        image = pack_image(build_commission().read_bytes(), 3)
        written = b"".join(flash[address] for address in sorted(flash) if address < FLASH_IMAGE + len(image))
        assert written.startswith(image)
        self.lab = lab = AveragedBench(known_of(bench_of(PLANT, INVERTER))[0].scales, self.machine, seed=1)
        gaps = Random(5)

        def answer(line: str) -> list[str]:
            for _ in range(gaps.randrange(GAP_TICKS) if lab.mode != "o" else 0):
                lab.control_tick()
            return lab.reply(line)

        return answer


def identify(port: Path, out: Path, *more: str) -> tuple[int, str, str]:
    """The command at a port; exit code, both outputs."""
    arguments = ["identify", "--plant", str(PLANT), "--inverter", str(INVERTER), "--set", CONVERSION]
    result = CliRunner().invoke(app, [*arguments, "--port", str(port), "--out", str(out), *more])
    if isinstance(result.exception, ConfigError):
        raise result.exception
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


def refused(count: int, data: bytes) -> bytes:
    """Twice the program got a damaged line."""
    return f"{board_console.with_checksum('error: wrong checksum')}\r\n".encode() if count in (10, 20) else data


def test_a_machine_at_a_port_is_found(tmp_path: Path) -> None:
    """Written, started and measured with a host that is slow between lines, the damaged ones again; gates off at last.

    Verifies: IDENT-11, IDENT-01
    """
    bench, out = Bench(spoil=refused), tmp_path / "found.toml"
    board = bench.board()
    with behind_a_terminal(board.serve) as port:
        code, said, _ = identify(port, out)
    assert code == 0 and said.startswith("ok: measured; "), said
    assert board.starts == 1 and board.lines[-1] == "o"
    assert sum(first == second for first, second in zip(board.lines, board.lines[1:], strict=False)) >= 2
    motor = load_motor(out)
    assert motor.psi_vs[0] == pytest.approx(bench.machine.psi_vs, rel=0.03)
    assert motor.inductance_h[0] == pytest.approx(bench.machine.ld_h, rel=0.03)
    assert motor.inertia_kgm2 == pytest.approx(bench.machine.inertia_kgm2, rel=0.1)
    assert "seed" not in out.read_text(encoding="utf-8") and (tmp_path / "found.png").stat().st_size > 10_000


def test_what_its_file_states_otherwise_is_told(tmp_path: Path) -> None:
    """A machine with twice the inductance of its file is measured, and the line says by how much the file is off.

    Verifies: IDENT-11
    """
    bench = Bench(Machine(ld_h=44e-6, lq_h=44e-6))
    with behind_a_terminal(bench.board().serve) as port:
        code, said, _ = identify(port, tmp_path / "found.toml")
    assert code == 0 and "off its file by more than 20 %" in said and "L d +" in said, said


def cut(count: int, data: bytes) -> bytes:
    """The cable is out from the thirtieth reply on."""
    return data if count < 30 else b""


def noise(count: int, data: bytes) -> bytes:
    """One character of the thirtieth reply becomes another."""
    return data.replace(b"b ", b"c ", 1) if count == 30 else data


def tripped(count: int, data: bytes) -> bytes:
    """A protection has switched off."""
    return f"{board_console.with_checksum('error: tripped')}\r\n".encode() if count >= 12 else data


@pytest.mark.parametrize(
    ("spoil", "text"),
    [(cut, "no answer to"), (noise, "came damaged"), (tripped, "protection of the inverter")],
    ids=["cut", "noise", "tripped"],
)
def test_what_goes_wrong_is_a_line(
    spoil: Callable[[int, bytes], bytes], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 1, one line that says what, no file, and the last line to the board switches the gates off.

    Verifies: IDENT-11, IDENT-04
    """
    monkeypatch.setattr(board_console, "REPLY_S", 0.5)
    board, out = Bench(spoil=spoil).board(), tmp_path / "found.toml"
    with behind_a_terminal(board.serve) as port:
        code, said, error = identify(port, out)
    last = error.strip().splitlines()[-1]
    assert code == 1 and not said and text in last and "Traceback" not in error, error
    assert board.lines[-1] == "o" and not out.exists()


def test_a_board_that_nobody_resets(tmp_path: Path) -> None:
    """Without a loader: one line that says what to do; nothing is measured.

    Verifies: IDENT-11
    """
    with behind_a_terminal(BoardTerminal(None).serve) as port:
        code, _, error = identify(port, tmp_path / "found.toml", "--wait-s", "0.2")
    assert code == 1 and "reset the board" in error.strip().splitlines()[-1]


@pytest.mark.parametrize(
    ("more", "text"),
    [
        (["--port", "/dev/null"], "--port: /dev/null: does not work as a serial port"),
        (["--port", "/dev/null", "--seed", "3"], "--seed: 3: has an effect without --port only"),
        (["--wait-s", "3"], "--wait-s: 3.0: has an effect with --port only"),
    ],
)
def test_bad_options(more: list[str], text: str, tmp_path: Path) -> None:
    """Each is one line that names the option.

    Verifies: IDENT-08, IDENT-11
    """
    arguments = ["identify", "--plant", str(PLANT), "--inverter", str(INVERTER), "--set", CONVERSION]
    result = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "found.toml"), *more])
    assert isinstance(result.exception, ConfigError) and text in str(result.exception), result.exception


def test_a_bench_that_a_board_cannot_sample(tmp_path: Path) -> None:
    """An inverter file whose converters are those of a simulation only.

    Verifies: IDENT-11
    """
    arguments = ["identify", "--plant", str(PLANT), "--inverter", str(INVERTER), "--port", "/dev/null"]
    result = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "found.toml")])
    assert isinstance(result.exception, ConfigError) and "conversion_s" in str(result.exception)
