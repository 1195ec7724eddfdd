# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Mutation score: choice of mutants, outcome of each, proof of equality, page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fluxlock.base.paths import ROOT, RTL
from fluxverify.docs import mutation as mutation_page
from fluxverify.mutation import command
from fluxverify.mutation.blocks import BLOCKS, Block
from fluxverify.mutation.equivalence import equal_mutants, unproved
from fluxverify.mutation.netlist import SELECTOR, Netlist, folder, make_netlist, parse_list, with_selector
from fluxverify.mutation.product import Signal, equal_at_the_outputs, read_signals
from fluxverify.mutation.run import MutationError, run_mutants
from fluxverify.mutation.score import measure, score_percent
from fluxverify.mutation.simulation import OTHER_ENDS, still_known

HERE = Path(__file__).parent
SMALL = Block(
    name="fl_small",
    sources=(str(HERE / "fl_small.sv"),),
    test_modules=("tests.mutation.small_bench",),
    goal_percent=50.0,
    left_out=("left_out",),
)
TESTS = ("delays_by_a_clock", "keeps_a_level")
COUNT = 16


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    (folder(SMALL) / "outcomes.jsonl").unlink(missing_ok=True)  # of an earlier run of these tests
    return measure(SMALL, COUNT, 1, 2, lambda _: None)


def test_outcome_of_each_mutant(result: dict[str, Any]) -> None:
    """A stuck register is found, a reset that nothing looks at is not, what changes nothing is proved equal.

    Verifies: MUT-01, MUT-02
    """
    assert result["count"] == len(result["mutants"]) == COUNT
    by_result: dict[str, list[str]] = {"killed": [], "equal": [], "survived": []}
    for row in result["mutants"]:
        by_result[row["result"]].append(f"{row['source'].rpartition(':')[2]} {row['port']} {row['kind']}")
    assert result["killed"] == len(by_result["killed"]), by_result
    assert all(by_result.values()), by_result
    assert all(text.endswith(" SRST[0] stuck at 0") for text in by_result["survived"]), by_result
    # `a | b` is what changes nothing: any defect of b's bit, the sum stuck at 1.
    harmless = ("15.19-15.28 ", "15.12-15.29 B[0] stuck at 1")
    assert all(text.startswith(harmless) for text in by_result["equal"]), by_result
    assert any(" Q[0] stuck at 1" in text for text in by_result["killed"]), by_result
    assert list(result["tests"]) == [f"tests.mutation.small_bench.{name}" for name in TESTS]


def test_a_stopped_run_goes_on(result: dict[str, Any]) -> None:
    """What has ended is kept, what was being written is not; another seed of the tests begins anew.

    Verifies: MUT-01
    """
    netlist = make_netlist(SMALL, COUNT, 1)
    numbers, out = [m.number for m in netlist.mutants], folder(SMALL) / "outcomes.jsonl"
    begun = [json.loads(line) for line in out.read_text().splitlines()]
    half = begun[: 1 + COUNT // 2]
    marked = [{**line, "cpu_s": 99.0} for line in half]
    out.write_text("".join(json.dumps(line) + "\n" for line in marked) + '{"mutant": 3, "kil')

    def cpu_of(seed: int) -> list[float]:
        outcomes = run_mutants(SMALL, netlist, numbers, seed, 1, lambda _: None)
        killed = {row["mutant"] for row in result["mutants"] if row["result"] == "killed"}
        assert {n for n in numbers if outcomes[n]["killed_by"]} == killed
        return [outcomes[number]["cpu_s"] for number in numbers]

    kept = {line["mutant"] for line in half}
    assert [cpu_s == 99.0 for cpu_s in cpu_of(1)] == [number in kept for number in numbers]
    assert 99.0 not in cpu_of(2)


def test_same_seed_same_mutants() -> None:
    """Seed and sources fix the mutants, another seed gives others.

    Verifies: MUT-01
    """
    first, again, other = ([m.options for m in make_netlist(BLOCKS["fl_gate_guard"], 20, s).mutants] for s in (1, 1, 2))
    assert len(first) == 20 and first == again != other


def test_list_is_read() -> None:
    text = (
        "mutate -ctrl s 4 0 -mode none\n"
        "mutate -ctrl s 4 3 -mode cnot1 -module m -cell $1 -port A -portbit 9 -ctrlbit 2 -wire w -wirebit 4 "
        "-src rtl/a.sv:1.2 -src rtl/a.sv:49.17-49.35\n"
    )
    (mutant,) = parse_list(text)
    assert (mutant.number, mutant.cell, mutant.port, mutant.wire) == (3, "$1", "A[9]", "w[4]")
    assert (mutant.kind, mutant.source) == ("inverted while bit 2 is 1", "rtl/a.sv:49.17-49.35")
    assert mutant.options.startswith("-mode cnot1 -module m -cell $1 ")


def test_selector_becomes_a_register() -> None:
    netlist = f"module m(a, {SELECTOR});\n  input a;\n  input [3:0] {SELECTOR};\n  wire [3:0] {SELECTOR};\nendmodule\n"
    assert with_selector(netlist, "m", {"Phases": 3}) == (
        f"module m #(parameter Phases = 3) (a);\n  input a;\n  reg [3:0] {SELECTOR};\nendmodule\n"
    )
    with pytest.raises(ValueError, match="the netlist has no"):
        with_selector("module n(a);", "m", {})


def test_proofs_are_read_by_mutant() -> None:
    part = "\nmutant under proof: {}\nFound 9 $equiv cells in equiv:\n"
    part += "  Of those cells {} are proven and {} are unproven.\n"
    cell = "  Unproven $equiv $auto$equiv_make.cc:295:find_same_wires$4: \\{0}_gold{1} \\{0}_gate{1}\n"
    log = part.format(4, 9, 0) + part.format(7, 6, 3) + cell.format("a.b_q", " [7]") + cell.format("a.b_q", " [0]")
    log += cell.format("y_o", "") + "\nmutant under proof: 8\nERROR\n"
    assert unproved(log) == {4: set(), 7: {"a.b_q", "y_o"}}
    with pytest.raises(ValueError, match="mutant 7: 3 unproven, but 2 of them named"):
        unproved(log.replace("y_o_gold", "y_o"))


APART = Block(name="fl_apart", sources=(str(HERE / "fl_apart.sv"),), test_modules=(), goal_percent=0.0)
# Column of the cell after the file's line, port and kind; all of one line each.
EQUAL = {"^word_i) != parity_q: 29-36 Y[0] inverted", "run_i && busy_q: 17-32 A[0] stuck at 1"}
DIFFERENT = {
    "^word_i) != parity_q: 28-49 B[0] inverted",
    "run_i && busy_q: 17-32 B[0] stuck at 1",
    "age_q >= 8'd200: 18-33 A[3] inverted",
}
UNDECIDED = {"age_q != 8'd255: 14-29 A[0] inverted"}


def named(block: Block, netlist: Netlist, text: str) -> int:
    """Number of a mutant by a text of the source line, columns, port and kind."""
    code, _, rest = text.partition(": ")
    columns, port, kind = rest.split(" ", 2)
    lines = Path(block.sources[0]).read_text().splitlines()
    (line,) = (i for i, source in enumerate(lines, 1) if code in source)
    place = "-".join(f"{line}.{column}" for column in columns.split("-"))
    (found,) = (
        m.number for m in netlist.mutants if (m.source.rpartition(":")[2], m.port, m.kind) == (place, port, kind)
    )
    return found


def test_proof_without_a_reset() -> None:
    """An input that holds the block stands for its reset, for as long as it takes: equal, and different.

    Verifies: MUT-02
    """
    held = Block("fl_held", (str(HERE / "fl_held.sv"),), (), 0.0, reset="hold_i", reset_clocks=2)
    netlist = make_netlist(held, 400, 1)
    equal, different = (named(held, netlist, f"run_i && busy_q: 17-32 {port}[0] stuck at 1") for port in ("A", "B"))
    tried = [m for m in netlist.mutants if m.number in (equal, different)]
    assert equal_mutants(held, netlist, tried) == {equal}


def test_proof_at_the_outputs() -> None:
    """Registers differ: equal by the registers that agree, equal while a flag is set, different, and not decided.

    Verifies: MUT-02
    """
    netlist = make_netlist(APART, 400, 1)
    names = {named(APART, netlist, text): text for text in EQUAL | DIFFERENT | UNDECIDED}
    tried = [m for m in netlist.mutants if m.number in names]
    assert {names[number] for number in equal_mutants(APART, netlist, tried)} == EQUAL
    # Nor does a wrong guess of the registers that agree prove anything.
    for mutant in (m for m in tried if names[m.number] in DIFFERENT):
        assert not equal_at_the_outputs(APART, netlist, mutant, {"parity_q", "count_q", "age_q"})


def test_defects_of_a_clock_are_not_tried() -> None:
    """A register without a clock is none of the proofs' business.

    Verifies: MUT-02
    """
    netlist = make_netlist(APART, 400, 1)
    stopped = [m for m in netlist.mutants if m.port == "CLK[0]"]
    assert stopped and equal_mutants(APART, netlist, stopped) == set()


def test_proof_with_an_asynchronous_clear() -> None:
    """Equal where the clear says the same twice, different without the register; the clear itself is not tried.

    Verifies: MUT-02
    """
    cleared = Block("fl_cleared", (str(HERE / "fl_cleared.sv"),), (), 0.0, reset="clear_i")
    netlist = make_netlist(cleared, 200, 1)
    equal, different = (
        named(cleared, netlist, f"stage_q[1] && !clear_i: 20-42 {port}[0] stuck at 1") for port in ("B", "A")
    )
    clears = [m for m in netlist.mutants if m.port.startswith("ARST[")]
    tried = [m for m in netlist.mutants if m.number in (equal, different)]
    assert clears and equal_mutants(cleared, netlist, [*tried, *clears]) == {equal}


def test_signals_of_a_module() -> None:
    text = (
        '  attribute \\src "a.sv:1.2"\n  wire width 4 input 3 \\word_i\n  wire output 2 \\y_o\n'
        "  wire width 8 \\gen[0].q\n  wire \\between\n  wire $1y\n"
        "  cell $dff $3\n    connect \\Q \\y_o\n  end\n"
        "  cell $sdff $4\n    connect \\Q { \\gen[0].q [7:5] \\gen[0].q [0] }\n  end\n"
    )
    assert read_signals(text) == [
        Signal("word_i", 4, "input", ""),
        Signal("y_o", 1, "output", "{}"),
        Signal("gen[0].q", 8, "", "{} [7:5], {} [0]"),
    ]
    assert read_signals(text)[2].pattern == "gen?0?.q"


def test_score() -> None:
    assert score_percent(90, 110, 10) == 90.0
    assert score_percent(0, 3, 3) == 100.0


def test_blocks_name_what_there_is() -> None:
    """Sources, benches and test modules exist.

    Verifies: MUT-01
    """
    for block in BLOCKS.values():
        for name in (*block.sources, *block.bench_sources):
            assert (ROOT if name.startswith("cocotb_tests/") else RTL).joinpath(name).exists(), name
        for module in block.test_modules:
            assert (ROOT / f"{module.replace('.', '/')}.py").exists(), module


def survivor(source: str, wire: str) -> dict[str, Any]:
    return {"source": source, "wire": wire, "port": "Q[0]", "kind": "inverted", "result": "survived"}


def test_reasons_fit_survivors() -> None:
    """A reason applies to source and net; one that fits nothing is reported.

    Verifies: MUT-03
    """
    base = {
        "block": "b",
        "parameters": {"Width": 4},
        "seed": 1,
        "sources": {"chip": "0123456789ab"},
        "count": 9,
        "killed": 7,
        "equal": 0,
        "survived": 2,
        "score_percent": 77.8,
    }
    mutants = [survivor("rtl/x/b.sv:10.3", "w[2]"), survivor("rtl/x/b.sv:11.3", "")]
    result = {**base, "goal_percent": 70.0, "cpu_s": 3.0, "yosys": "Y", "mutants": mutants}
    fits = {"source": "rtl/x/b.sv:10.", "wire": "w", "reason": "it is so"}
    wrong = [fits | change for change in ({"wire": "v"}, {"port": "D"}, {"kind": "stuck at 0"})]
    text, stale = mutation_page.page([result], {"b": [*wrong, fits | {"port": "Q[0]", "kind": "inverted"}]})
    assert "| b.sv:10.3 | Q[0] | w[2] | inverted | it is so |" in text
    assert "| b.sv:11.3 | Q[0] | - | inverted | not explained |" in text
    assert "\n## b\n\nSeed 1, Y, `Width` = 4, chip `0123456789ab`.\n" in text
    assert len(stale) == 3 and all("rtl/x/b.sv:10." in line for line in stale)
    assert mutation_page.page([result], {"other": [fits]})[1] == []


def test_page_keeps_blocks_that_were_not_measured() -> None:
    """Their rows and sections stay in the order of the blocks; a new result takes the place of an old one.

    Verifies: MUT-03
    """
    base = {"parameters": {}, "seed": 1, "count": 9, "killed": 7, "equal": 0, "survived": 2, "score_percent": 77.8}
    base |= {"goal_percent": 70.0, "cpu_s": 3.0, "yosys": "Y", "mutants": [survivor("rtl/x/b.sv:10.3", "w[2]")]}
    first, second, third = list(BLOCKS)[:3]
    before, _ = mutation_page.page([base | {"block": first}, base | {"block": third}], {})
    assert mutation_page.page([], {}, before) == (before, [])
    new = {"cpu_s": 4.0, "mutants": []}
    text, _ = mutation_page.page([base | new | {"block": second}, base | new | {"block": third}], {}, before)
    everything, _ = mutation_page.page(
        [base | {"block": first}, base | new | {"block": second}, base | new | {"block": third}], {}
    )
    assert text == everything


def test_what_holds_of_an_earlier_outcome() -> None:
    """A kill holds with its module, passed tests with theirs; what ended otherwise only if nothing has changed.

    Verifies: MUT-01
    """
    passed = {"a.t.one": 1.0, "a.tt.two": 2.0}
    survived = {"killed_by": "", "times": passed, "simulated_ns": passed}
    killed = survived | {"killed_by": "a.t.three"}
    for unchanged, wanted in [({"a.t", "a.tt"}, passed), ({"a.t"}, {"a.t.one": 1.0}), (set(), {})]:
        known = still_known(survived, unchanged, all_unchanged=False)
        assert known == {"killed_by": "", "times": wanted, "simulated_ns": wanted}
        assert still_known(killed, unchanged, all_unchanged=False) == (killed if unchanged else {})
    assert still_known(killed, {"a.tt"}, all_unchanged=False) == {}
    for other in OTHER_ENDS:
        end = survived | {"killed_by": other}
        assert still_known(end, {"a.t"}, all_unchanged=True) == end
        assert still_known(end, {"a.t"}, all_unchanged=False) == {}


def test_block_that_fails_its_own_tests(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    """One line that says which test of which block, and where to look; no traceback, and the command fails.

    Verifies: MUT-01
    """

    def broken(*_: object) -> dict[str, Any]:
        raise MutationError("fl_trip: the netlist without a mutation fails a.test: build/x.log")

    monkeypatch.setattr(command, "measure", broken)
    assert not command.mutate(["fl_trip"], 1, 1, 1)
    assert "error: fl_trip: the netlist without a mutation fails a.test: build/x.log" in capfd.readouterr().err
