"""The matrix of requirements and tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from fluxlock.docs.matrix import main
from fluxlock.paths import ROOT

# Assembled so that this file's own text makes no claim.
VERIFIES = "Veri" + "fies:"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for folder in ("docs/verification/requirements.d", "tests/a", "cocotb_tests/b", "formal"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "docs/verification/requirements.d/part.md").write_text(
        "# Part\n\n- PART-01: First of\n  two lines.\n- PART-02: Second | with a bar.\n"
        "- PART-03: Third.\n- PART-04: Last.\n"
    )
    (tmp_path / "tests/a/test_x.py").write_text(
        f'def test_one():\n    """Text.\n\n    {VERIFIES} PART-01, PART-02.\n    """\n'
    )
    (tmp_path / "cocotb_tests/b/test_y.py").write_text(
        f'async def test_two(dut):\n    """Text.\n\n    {VERIFIES} PART-01,\n        PART-02\n    """\n'
    )
    (tmp_path / "formal/guard.sv").write_text(f"// {VERIFIES} PART-03\nmodule m; endmodule\n")
    return tmp_path


def test_matrix(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Tests and proofs appear under their requirements; what nothing verifies is listed.

    Verifies: FRONT-16
    """
    assert main(["--root", str(checkout)]) == 0
    assert capsys.readouterr().out == "4 requirements, 1 not verified: PART-04\n"
    text = (checkout / "docs/verification/matrix.md").read_text()
    both = "`tests/a/test_x.py::test_one`<br>`cocotb_tests/b/test_y.py::test_two`"
    assert f"| PART-01 | First of two lines. | {both} |" in text
    assert f"| PART-02 | Second \\| with a bar. | {both} |" in text
    assert "| PART-03 | Third. | `formal/guard.sv` |" in text
    assert "| PART-04 | Last. | **nothing** |" in text
    assert text.rstrip().endswith("## Not verified\n\n- PART-04: Last.")
    assert main(["--root", str(checkout), "--strict"]) == 1


def test_stale_page(checkout: Path) -> None:
    """--check accepts a fresh page and refuses a stale or missing one.

    Verifies: FRONT-16
    """
    arguments = ["--root", str(checkout), "--check"]
    assert main(arguments) == 1
    main(["--root", str(checkout)])
    assert main(arguments) == 0
    with (checkout / "docs/verification/requirements.d/part.md").open("a") as file:
        file.write("- PART-05: New.\n")
    assert main(arguments) == 1


def test_errors(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Unknown IDs, IDs stated twice and malformed lines fail, each with its place.

    Verifies: FRONT-16
    """
    (checkout / "tests/a/test_x.py").write_text(f'def test_one():\n    """{VERIFIES} PART-09"""\n')
    with (checkout / "docs/verification/requirements.d/part.md").open("a") as file:
        file.write("- PART-01: Again.\n- part 7: Malformed.\n")
    assert main(["--root", str(checkout)]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "part.md:8: PART-01 is stated twice",
        "part.md:9: not of the form `- ID: text`",
        "tests/a/test_x.py::test_one: verifies PART-09, which is no requirement",
    ]


def test_this_checkout() -> None:
    """All claims of this checkout name a requirement that exists.

    Verifies: FRONT-16
    """
    from fluxlock.docs.matrix import check_claims, read_claims, read_requirements

    requirements, problems = read_requirements(ROOT / "docs" / "verification" / "requirements.d")
    assert problems == []
    assert check_claims(requirements, read_claims(ROOT)) == []
