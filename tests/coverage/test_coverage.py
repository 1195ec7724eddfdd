"""Coverage of the RTL: reading and adding up counters, the report, reasons for what is not reached."""

from __future__ import annotations

from fluxlock.coverage import Point, explain, merge, page, read_points, summary
from fluxlock.paths import ROOT

FILE = "rtl/safety/a.sv"


def counter(line: int, kind: str, what: str, count: int, file: str = FILE, instance: str = "top") -> str:
    fields = {"f": str(ROOT / file), "l": line, "n": 3, "t": kind, "page": f"v_{kind}/a", "o": what, "h": instance}
    return "C '" + "".join(f"\x01{k}\x02{v}" for k, v in fields.items()) + f"' {count}"


def test_counters_of_all_instances_and_builds_are_added() -> None:
    """Counts of one point are summed; other files and other lines are left out.

    Verifies: COV-01
    """
    first = [counter(2, "line", "block", 0), counter(2, "line", "block", 3, instance="top.u_b"), "# a comment"]
    second = [counter(2, "line", "block", 4), counter(7, "toggle", "x:0->1", 1), counter(1, "line", "if", 1, "a.sv")]
    assert merge([read_points(first), read_points(second)]) == {
        Point(FILE, 2, 3, False, "block"): 7,
        Point(FILE, 7, 3, True, "x:0->1"): 1,
    }


def test_reasons_fit_what_is_not_reached() -> None:
    """A missing reason, and a reason for what is reached, are problems; elsewhere none is asked for.

    Verifies: COV-02
    """
    other = "rtl/zcd/b.sv"
    counts = read_points(
        [
            counter(1, "line", "block", 5),
            counter(2, "branch", "else", 0),
            counter(3, "branch", "if", 0),
            counter(3, "toggle", "x[1]:1->0", 0),
            counter(1, "line", "if", 0, other),
        ]
    )
    files = summary(counts, {FILE: ["a <= 1;", "if (b)", "if (c)"], other: ["if (d)"]})
    assert files[FILE]["statements"] == [3, 1] and files[FILE]["toggles"] == [1, 0]
    assert files[FILE]["still"] == ["3: x[1]:1->0"]
    given = [{"code": "if (b)", "reason": "never"}, {"code": "a <= 1", "reason": "stale"}]
    report, problems = explain(files, {FILE: given, "rtl/safety/not_measured.sv": given})
    assert report == [f"- {FILE}:2 (else) `if (b)`: never", f"- {FILE}:3 (if) `if (c)`: no reason given"]
    assert len(problems) == 2
    assert problems[0].startswith(f"{FILE}:3 (if)") and "reached, or not there: 'a <= 1'" in problems[1]
    text = page(files, report, ["safety", "zcd"])
    assert f"| {FILE} | 3 | 33.3 | 1 | 0.0 |" in text and f"- {other}:1 (if) `if (d)`" in text
