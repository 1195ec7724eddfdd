# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Synthesis: `python -m fluxlock.synth [NAME...]`, a configuration, a block or `blocks` for all of them.

Configurations of `constraints/configurations.toml` go through Yosys, nextpnr and ecppack to a bitstream; blocks of
the RTL, one by one or as the sets of `constraints/blocks.toml`, go through Yosys and nextpnr out of context. Fails if a
latch is inferred, if the clock is not reached, if a way between pad and flip-flop is too long or if nextpnr does not
end in time, and prints which, with the critical path. Results, failed or not, go to `build/synth.json`, into the tables
of `docs/reference/synthesis.md` and of `docs/verification/measured.md`; there a row stays as it is until its
configuration or block is built again. `python -m fluxverify.docs.readme` brings the sizes to the README.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from fluxlock.base.paths import BUILD
from fluxlock.base.writable import alone, guarded
from fluxlock.sources import Hashes, source_hashes
from fluxlock.synth import report
from fluxlock.synth.blocks import (
    ALL_BLOCKS,
    BlockResult,
    BlockSet,
    Settings,
    block_files,
    build_block,
    build_set,
    load_settings,
)
from fluxlock.synth.configurations import CONFIGURATIONS, Configuration, Result, build, load_configurations
from fluxlock.synth.report import Results
from fluxlock.synth.tools import WORK, SynthesisError, relative, sources

RESULTS = BUILD / "synth.json"


def complain(name: str, problems: list[str], critical_path: list[str]) -> None:
    """What failed, on the error output."""
    for problem in problems:
        print(f"{name}: {problem}", file=sys.stderr)
    if problems and critical_path:
        print("critical path: " + "\n  ".join(critical_path), file=sys.stderr, flush=True)


def run_configurations(wanted: list[Configuration], seed: int) -> dict[str, Result | None]:
    """Build each; None: a tool failed."""
    results: dict[str, Result | None] = {}
    for config in wanted:
        print(
            f"{config.name}: Yosys, then nextpnr for at most {config.limit_s / 60:.0f} min of processor time",
            flush=True,
        )
        try:
            results[config.name] = result = build(config, seed)
        except SynthesisError as error:
            print(error, file=sys.stderr)
            results[config.name] = None
            continue
        print(f"{config.name}: {report.fmax_text(asdict(result))} MHz, {result.lut4} LUT4, {result.ff} FF", flush=True)
        complain(config.name, result.problems, result.critical_path)
    return results


def run_blocks(
    wanted: list[str], paths: dict[str, Path], settings: Settings, seed: int, jobs: int
) -> dict[str, BlockResult | None]:
    """Build each block or set of blocks, `jobs` at a time; None: a tool failed."""
    files = sources()
    results: dict[str, BlockResult | None] = {}

    def one(name: str) -> BlockResult | SynthesisError:
        try:
            if name in settings.sets:
                return build_set(settings.sets[name], paths, files, settings, seed)
            return build_block(name, paths[name], files, settings, seed)
        except SynthesisError as error:
            return error

    with ThreadPoolExecutor(jobs) as pool:
        for name, result in zip(wanted, pool.map(one, wanted), strict=True):
            if isinstance(result, SynthesisError):
                print(result, file=sys.stderr)
                results[name] = None
                continue
            results[name] = result
            print(f"{name}: {result.fmax_mhz or '-'} MHz, {result.cpu_s:.0f} s of processor time", flush=True)
            complain(name, result.problems, result.critical_path)
    return results


def finished(results: Mapping[str, Result | BlockResult | None], made: Hashes) -> Results:
    """Those that no tool failed on, as the files hold them, with the hash of the RTL that they were made from."""
    return {name: {**asdict(result), "sources": made} for name, result in results.items() if result}


def from_0(text: str) -> int:
    """Value of an option: a whole number from 0."""
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"must be a whole number from 0, not {text!r}")
    return int(text)


def from_1(text: str) -> int:
    """Value of an option: a whole number from 1."""
    if not (text.isascii() and text.isdigit() and int(text)):
        raise argparse.ArgumentTypeError(f"must be a whole number from 1, not {text!r}")
    return int(text)


def keep(
    results: dict[str, Results],
    sets: dict[str, BlockSet],
    orders: tuple[Mapping[str, Configuration], Iterable[str]],
) -> None:
    """New results, `configurations` and `blocks`, beside the kept ones, and into the docs."""
    # Another run may end at the same time.
    with alone(WORK, wait=True):
        stored: dict[str, Results] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
        kept = {kind: stored.get(kind, {}) | new for kind, new in results.items()}
        RESULTS.write_text(json.dumps(kept, indent=2) + "\n")
        report.write(results["configurations"], results["blocks"], sets, orders)


def main() -> int:
    """Command line of this module."""
    configurations, settings = load_configurations(), load_settings()
    blocks = block_files(settings)
    parser = argparse.ArgumentParser(description="Synthesize configurations and blocks for an ECP5.")
    parser.add_argument(
        "name",
        nargs="*",
        help=f"configuration ({', '.join(configurations)}), block, set of blocks ({', '.join(settings.sets)}), or "
        f"{ALL_BLOCKS}; default: all configurations",
    )
    parser.add_argument("--seed", type=from_0, default=1, metavar="NUMBER", help="first seed of the placement, from 0")
    parser.add_argument("--jobs", type=from_1, default=1, metavar="NUMBER", help="blocks at a time, from 1")
    options = parser.parse_args()
    names = options.name or list(configurations)
    unknown = [name for name in names if name not in {*configurations, *blocks, *settings.sets, ALL_BLOCKS}]
    if unknown:
        known = ", ".join([*configurations, *settings.sets, ALL_BLOCKS])
        print(
            f"{relative(CONFIGURATIONS)}: no configuration and no block {unknown[0]!r}; there are: {known}",
            file=sys.stderr,
        )
        return 2
    made = source_hashes(["chip"])  # before the runs: the checkout may change while they last
    new_configurations = run_configurations([configurations[n] for n in names if n in configurations], options.seed)
    wanted = list(blocks) if ALL_BLOCKS in names else [name for name in names if name in {*blocks, *settings.sets}]
    new_blocks = run_blocks(wanted, blocks, settings, options.seed, options.jobs) if wanted else {}
    results = {"configurations": finished(new_configurations, made), "blocks": finished(new_blocks, made)}
    keep(results, settings.sets, (configurations, blocks))
    new: dict[str, Result | BlockResult | None] = {**new_configurations, **new_blocks}
    failed = [name for name, result in new.items() if result is None or result.problems]
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(guarded(main))
