# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The matrix of requirements and tests."""

from __future__ import annotations

import ast
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxverify.docs.matrix import (
    PROOF_TEST,
    VERIFICATION,
    Places,
    check_claims,
    lost,
    main,
    read_places,
    read_proofs,
    read_requirements,
    read_tests,
    recorded_places,
)

# Assembled so that this file's own text makes no claim.
VERIFIES = "Veri" + "fies:"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for folder in ("docs/verification/requirements.d", "tests/a", "cocotb_tests/b", "tests/formal"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "docs/verification/requirements.d/part.md").write_text(
        "# Part\n\n- PART-01: First of\n  two lines.\n- PART-02: Second | with a bar.\n"
        "- PART-03: Third.\n- PART-04: Last.\n"
    )
    (tmp_path / "tests/a/test_x.py").write_text(
        f'def test_one():\n    """Text.\n\n    {VERIFIES} PART-01, PART-02.\n    """\n'
    )
    (tmp_path / "cocotb_tests/b/test_y.py").write_text(
        f'@cocotb.test()\nasync def two(dut):\n    """Text.\n\n    {VERIFIES} PART-01,\n        PART-02\n    """\n\n\n'
        'def test_y():\n    run_block_test("y", ["y.sv"], __name__)\n'
    )
    (tmp_path / "tests/formal/test_safety_proofs.py").write_text("def test_proof(name, task):\n    pass\n")
    (tmp_path / "cocotb_tests/b/guard.sby").write_text(
        "# A licence\n\n[tasks]\nprove\n[options]\n[files]\nguard_f.sv\n"
    )
    (tmp_path / "cocotb_tests/b/guard_f.sv").write_text(
        f"module m;\n  // {VERIFIES} PART-03\n  a_one : assert (x);\n  if (y) a_two : assert (z);\n\n"
        "  a_other : assert (w);\nendmodule\n"
    )
    return tmp_path


def run(root: Path, *options: str) -> int:
    return main(["--root", str(root), *options])


def test_matrix(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Tests and properties appear under their requirements; what nothing verifies is listed.

    Verifies: FRONT-16
    """
    assert run(checkout) == 0
    assert capsys.readouterr().out == "4 requirements, 1 not verified: PART-04\n"
    text = (checkout / "docs/verification/matrix.md").read_text()
    both = "`tests/a/test_x.py::test_one`<br>`cocotb_tests/b/test_y.py::two`"
    assert f"| PART-01 | First of two lines. | {both} |" in text
    assert f"| PART-02 | Second \\| with a bar. | {both} |" in text
    assert "| PART-03 | Third. | `cocotb_tests/b/guard_f.sv:a_one`<br>`cocotb_tests/b/guard_f.sv:a_two` |" in text
    assert "| PART-04 | Last. | **nothing** |" in text
    assert text.rstrip().endswith("## Not verified\n\n- PART-04: Last.")
    assert run(checkout, "--strict") == 1
    assert (checkout / "docs/verification/places.txt").read_text().splitlines() == [
        "cocotb_tests/b/guard.sby:prove",
        "cocotb_tests/b/guard_f.sv:a_one = PART-03",
        "cocotb_tests/b/guard_f.sv:a_other",
        "cocotb_tests/b/guard_f.sv:a_two = PART-03",
        "cocotb_tests/b/test_y.py::test_y",
        "cocotb_tests/b/test_y.py::two = PART-01, PART-02",
        "tests/a/test_x.py::test_one = PART-01, PART-02",
        "tests/formal/test_safety_proofs.py::test_proof",
    ]


def test_stale_page(checkout: Path) -> None:
    """--check accepts fresh files and refuses stale or missing ones; a new test makes them stale.

    Verifies: FRONT-16
    """
    assert run(checkout, "--check") == 1
    assert run(checkout) == 0
    assert run(checkout, "--check") == 0
    with (checkout / "docs/verification/requirements.d/part.md").open("a") as file:
        file.write("- PART-05: New.\n")
    assert run(checkout, "--check") == 1
    assert run(checkout) == 0
    (checkout / "tests/a/test_new.py").write_text("def test_new():\n    pass\n")
    assert run(checkout, "--check") == 1


def test_errors(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Unknown IDs, IDs stated twice and malformed lines fail, each with its place.

    Verifies: FRONT-16
    """
    (checkout / "tests/a/test_x.py").write_text(f'def test_one():\n    """{VERIFIES} PART-09"""\n')
    with (checkout / "docs/verification/requirements.d/part.md").open("a") as file:
        file.write("- PART-01: Again.\n- part 7: Malformed.\n")
    assert run(checkout) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "part.md:8: PART-01 is stated twice",
        "part.md:9: not of the form `- ID: text`",
        "tests/a/test_x.py::test_one: verifies PART-09, which is no requirement",
    ]


NOT_RUN = "says what it verifies, but no run collects it as a test"
# A file of the checkout above, text in it, what stands there instead, and the line of the error.
NOWHERE = {
    "function": ("tests/a/test_x.py", "test_one", "check_one", f"tests/a/test_x.py::check_one: {NOT_RUN}"),
    "module": ("cocotb_tests/b/test_y.py", "__name__", '"z"', f"cocotb_tests/b/test_y.py::two: {NOT_RUN}"),
    "not cocotb's": ("cocotb_tests/b/test_y.py", "@cocotb.test()", "", f"cocotb_tests/b/test_y.py::two: {NOT_RUN}"),
    "skipped": (
        "cocotb_tests/b/test_y.py",
        "cocotb.test()",
        "cocotb.test(skip=True)",
        f"cocotb_tests/b/test_y.py::two: {NOT_RUN}",
    ),
    "no property": (
        "cocotb_tests/b/guard_f.sv",
        "  a_one",
        "  // Why.\n  a_one",
        "cocotb_tests/b/guard_f.sv:2: no labelled property stands below this line",
    ),
    "proof not read": (
        "cocotb_tests/b/guard.sby",
        "guard_f.sv",
        "other_f.sv",
        "cocotb_tests/b/guard_f.sv: no task of a .sby reads this proof",
    ),
    "proofs not run": (
        "tests/formal/test_safety_proofs.py",
        "test_proof",
        "proof",
        "tests/formal/test_safety_proofs.py::test_proof: gone, so that no proof is run",
    ),
    "the same name": (
        "tests/a/test_x.py",
        "def",
        "def test_one():\n    pass\n\n\ndef",
        "tests/a/test_x.py::test_one: two tests of this name, the first is never run",
    ),
}


@pytest.mark.parametrize("claim", NOWHERE)
def test_claims_where_nothing_runs(claim: str, checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What no run collects verifies nothing: named, and nothing is written.

    Verifies: FRONT-16
    """
    file, old, new, expected = NOWHERE[claim]
    text = (checkout / file).read_text()
    assert old in text
    (checkout / file).write_text(text.replace(old, new, 1))
    assert run(checkout) == 1
    assert capsys.readouterr().err.splitlines() == [expected]
    assert not (checkout / "docs/verification/places.txt").exists()


def test_what_is_gone_is_named(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A deleted test, proof or claim fails, also when the page is written anew, until it is given up on purpose.

    Verifies: FRONT-16
    """
    assert run(checkout) == 0
    (checkout / "cocotb_tests/b/guard_f.sv").unlink()
    (checkout / "cocotb_tests/b/guard.sby").unlink()
    (checkout / "tests/a/test_x.py").write_text(f'def test_one():\n    """{VERIFIES} PART-01"""\n')
    capsys.readouterr()
    for options in (("--check",), ()):
        assert run(checkout, *options) == 1
        assert capsys.readouterr().err.splitlines() == [
            "cocotb_tests/b/guard.sby:prove: gone",
            "cocotb_tests/b/guard_f.sv:a_one: gone; it verified PART-03",
            "cocotb_tests/b/guard_f.sv:a_other: gone",
            "cocotb_tests/b/guard_f.sv:a_two: gone; it verified PART-03",
            "tests/a/test_x.py::test_one: verifies PART-02 no more",
            "on purpose? then: python -m fluxverify.docs.matrix --accept",
        ]
    assert run(checkout, "--accept") == 0
    assert run(checkout, "--check") == 0
    assert capsys.readouterr().out.endswith("4 requirements, 2 not verified: PART-03, PART-04\n")


@pytest.fixture(scope="module")
def this_checkout() -> Places:
    """Places of this checkout."""
    places, problems = read_places(ROOT)
    assert problems == []
    return places


def test_this_checkout(this_checkout: Places) -> None:
    """Claims name requirements that exist, every requirement has one, and nothing that is recorded has gone.

    Verifies: FRONT-16
    """
    requirements, problems = read_requirements(ROOT / VERIFICATION / "requirements.d")
    assert problems == []
    assert check_claims(requirements, this_checkout) == []
    assert {r.id for r in requirements} == {i for ids in this_checkout.values() for i in ids}
    recorded = recorded_places((ROOT / VERIFICATION / "places.txt").read_text(encoding="utf-8"))
    assert lost(recorded, this_checkout) == []
    assert sorted(set(this_checkout) - set(recorded)) == [], "new: run python -m fluxverify.docs.matrix"


def copied(target: Path) -> Path:
    """What the matrix reads of this checkout."""
    for folder in ("tests", "cocotb_tests", "sim/fluxverify/regression", "docs/verification"):
        shutil.copytree(ROOT / folder, target / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return target


def test_each_proof_is_missed(tmp_path: Path) -> None:
    """Without any one file of the proofs of this checkout the check fails and names what was in it.

    Verifies: FRONT-16
    """
    root = copied(tmp_path)
    recorded = recorded_places((root / VERIFICATION / "places.txt").read_text(encoding="utf-8"))
    proofs = sorted(p for kind in ("*.sby", "*_f.sv") for p in (root / "cocotb_tests").rglob(kind))
    assert len(proofs) >= 28
    for path in proofs:
        text = path.read_text()
        path.unlink()
        places, _ = read_proofs(root)
        here = {place: ids for place, ids in recorded.items() if ".sby:" in place or "_f.sv:" in place}
        gone = [line.partition(": ")[0] for line in lost(here, places)]
        assert path.relative_to(root).as_posix() in {place.rpartition(":")[0] for place in gone}, path
        path.write_text(text)


def test_each_test_and_row_is_missed(this_checkout: Places) -> None:
    """Without any one test, property, task, case or row that the record of this checkout holds the check names it.

    Verifies: FRONT-16
    """
    recorded = recorded_places((ROOT / VERIFICATION / "places.txt").read_text(encoding="utf-8"))
    assert len(recorded) > 1900
    rest = dict(this_checkout)
    for place in recorded:
        ids = rest.pop(place)
        assert [line.partition(": gone")[0] for line in lost(recorded, rest)] == [place]
        rest[place] = ids


def test_deleted_functions_are_missed(tmp_path: Path) -> None:
    """Twenty tests at random, deleted from the text of a copy of this checkout, are named one by one.

    Verifies: FRONT-16
    """
    seed = random.SystemRandom().randrange(1 << 32)
    print(f"seed {seed}")
    root = copied(tmp_path)
    recorded = {p: i for p, i in recorded_places((root / VERIFICATION / "places.txt").read_text()).items() if "::" in p}
    for place in random.Random(seed).sample(sorted(recorded), 20):
        file, _, name = place.partition("::")
        path = root / file
        text = path.read_text()
        lines = text.splitlines(keepends=True)
        node = next(n for n in ast.parse(text).body if getattr(n, "name", "") == name)
        assert isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
        path.write_text("".join(lines[: first - 1] + lines[node.end_lineno :]))
        places, _ = read_tests(root, (path,))
        here = {p: ids for p, ids in recorded.items() if p.startswith(f"{file}::")}
        assert place in [line.partition(": gone")[0] for line in lost(here, places)], place
        path.write_text(text)


def test_claims_are_collected(this_checkout: Places, request: pytest.FixtureRequest) -> None:
    """Every test that the matrix counts is one that pytest collects, every task of a proof too.

    A run of all tests has collected them already; a run of some collects them anew.

    Verifies: FRONT-16
    """
    config = request.config
    folders = {Path(argument).resolve() for argument in config.args}  # a worker of xdist gets those of testpaths
    whole = (
        folders == {ROOT / "tests", ROOT / "cocotb_tests"} and not config.option.keyword and not config.option.markexpr
    )
    if whole:
        found = {item.nodeid for item in request.session.items}
    else:
        command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:xdist", "-p", "no:cacheprovider"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-2000:]
        found = set(done.stdout.splitlines())
    functions = {name.partition("[")[0] for name in found}
    tests = {p for p in this_checkout if "::" in p and p.rpartition("::")[2].startswith("test_")}
    assert len(tests) > 1000
    assert sorted(tests - functions) == []
    tasks = [p.rpartition("/")[2].replace(".sby:", "-") for p in this_checkout if ".sby:" in p]
    assert sorted(task for task in tasks if f"{PROOF_TEST}[{task}]" not in found) == []


def test_empty_parameter_sets_fail(tmp_path: Path) -> None:
    """A test whose parameter set is empty fails where it is collected; it is not skipped.

    Verifies: FRONT-16
    """
    (tmp_path / "test_empty.py").write_text(
        'import pytest\n\n\n@pytest.mark.parametrize("x", [])\ndef test_none(x):\n    pass\n'
    )
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-c", str(ROOT / "pyproject.toml")]
    done = subprocess.run([*command, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stdout
    assert "Empty parameter set in 'test_none'" in done.stdout
