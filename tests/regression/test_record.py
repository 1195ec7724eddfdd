# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The record of the regression: bands about the last accepted values, and what happens to a row outside of one."""

from __future__ import annotations

import copy
import json
import random
from pathlib import Path
from typing import Any

import pytest

from fluxlock.config import ConfigError
from fluxverify.regression import command
from fluxverify.regression.case import Row
from fluxverify.regression.record import (
    ERROR,
    FACTOR,
    LEAST_SEEDS,
    TINY,
    Record,
    band,
    drift,
    entry_of,
    is_magnitude,
    judged,
    read_record,
    write_record,
)

RECORD = read_record()
PLANTED = {
    "vector/catch/90000": "angle_error_deg.rms",
    "vector/catch/20000": "angle_error_deg.rms",
    "five-phase/tian-best/100rpm-2A": "angle_error_deg.rms",
    "five-phase/ipm-reversal": "angle_error_deg.max",
    "five-phase/tian-start/30deg": "settled_s",
    "six-step/hall/after": "commutation_error_deg.rms",
    "six-step/patterns/ON-PWM": "commutation_error_deg.rms",
    "six-step/asymmetry/emf-none": "trips",
    "five-phase/tian-dead-time/0rpm-2A-10deg": "angle_error_deg.mean",
    "six-step/zcd-source/sinusoidal-mean": "commutation_error_deg.rms",
}


def row_of(name: str, record: Record = RECORD) -> dict[str, Any]:
    """A row whose values are the recorded ones; the record keeps no limits."""
    values = {value: entry["value"] for value, entry in record[name]["values"].items()}
    made = {"git_revision": "abc", "seed": 1, "conditions": {}, "note": "", "limit": {}, "pass": True}
    return {"id": name, "values": values, **made}


def test_recorded_values_pass() -> None:
    """Every row of the committed record passes with its own values.

    Verifies: REC-01
    """
    assert len(RECORD) > 380
    assert [(name, lines) for name in RECORD if (lines := drift(row_of(name), RECORD))] == []


def test_committed_bands() -> None:
    """In the committed record no band of an error's size reaches beyond 1.5 times its value; five seeds give a scatter.

    Verifies: REC-02
    """
    sizes = 0
    for name, entry in RECORD.items():
        for value, told in entry["values"].items():
            few = len(entry["seeds"]) < LEAST_SEEDS
            assert not few or told["scatter"] is None, (name, value)
            if told["band"] and is_magnitude(value, told["value"], None):
                sizes += 1
                assert told["band"][1] <= FACTOR * told["value"] * (1 + 1e-5) + TINY, (name, value)
    assert sizes > 300


@pytest.mark.parametrize("name", PLANTED)
def test_twice_as_bad_fails(name: str) -> None:
    """A planted worsening by two fails its row, which names value, band and record, although the limit holds.

    Verifies: REC-01
    """
    row = row_of(name)
    value = PLANTED[name]
    assert judged(row, RECORD)["pass"]
    row["values"][value] = 2 * row["values"][value] or 2
    worse = judged(row, RECORD)
    assert not worse["pass"]
    assert [line.partition(" = ")[0] for line in worse["drift"]] == [value]
    assert "about the recorded" in worse["drift"][0]


def test_random_perturbations() -> None:
    """Of 200 recorded errors, each moved by a random factor, those beyond their bands fail their rows, and only those.

    The expectation is worked out here from value and rule, not read from the stored band.

    Verifies: REC-01, REC-02
    """
    seed = random.SystemRandom().randrange(1 << 32)
    print(f"seed {seed}")
    chance = random.Random(seed)
    sizes = [
        (name, value)
        for name, entry in RECORD.items()
        for value, told in entry["values"].items()
        if told["scatter"] is None
        and told["value"]
        and ERROR.search(value)
        and is_magnitude(value, told["value"], None)
    ]
    beyond = 0
    for name, value in chance.sample(sizes, 200):
        row = row_of(name)
        factor = 2 ** chance.uniform(-2, 2)
        row["values"][value] *= factor
        found = [line.partition(" = ")[0] for line in drift(row, RECORD)]
        outside = factor > FACTOR or factor < 1 / FACTOR
        beyond += outside
        if min(abs(factor - FACTOR), abs(factor - 1 / FACTOR)) > 1e-4:
            assert found == ([value] if outside else []), (name, value, factor)
    assert beyond > 20


def test_band_rules() -> None:
    """Bands of sizes, signed values and counts, from one seed and from a scatter.

    Verifies: REC-02
    """

    def edges(*arguments: Any) -> list[float] | None:
        found = band(*arguments)
        return None if found is None else [round(edge, 6) for edge in found]

    assert edges("angle_error_deg.rms", 0.6, None, None) == [0.4, 0.9]
    assert edges("settled_s", 0.06, None, (None, 1.0)) == [0.04, 0.09]
    assert edges("angle_error_deg.rms", 0.6, 0.01, (None, 2.0)) == [0.55, 0.65]
    assert edges("angle_error_deg.rms", 0.6, 0.2, (None, 2.0)) == [0.4, 0.9], "no scatter widens it beyond 1.5"
    assert edges("angle_error_deg.rms", 0.6, 0.0, (None, 2.0)) == [0.594, 0.606], "the same with all seeds"
    assert edges("trips", 0, None, (0, 0)) == [0, 0]
    assert edges("speed_rpm.mean", 2e4, 3.0, (19_800, 20_200)) == [19_800, 20_200]
    assert edges("speed_rpm.mean", 2e4, 100.0, (19_000, 21_000)) == [19_500, 20_500], "scatter alone widens these"
    assert edges("angle_error_deg.mean", 0.1, None, (-1.0, 1.0), 0.4) == [-0.1, 0.3], "half of the rms"
    assert edges("angle_error_deg.mean", -0.6, None, (-1.0, 1.0), 0.4) == [-0.9, -0.3]
    assert edges("flux_error_percent", 0.01, None, (-3.0, 3.0)) == [-0.14, 0.16], "half of a tenth of its limit"
    assert edges("iq_a", 2.0, None, None) is None, "neither limit nor error"


def regression_row(name: str, **values: float | None) -> dict[str, Any]:
    """A row as a run makes it, with an upper limit for each error."""
    limit = {value: {"min": None, "max": 5.0} for value in values if "error" in value}
    return {"id": name, "values": values, "limit": limit, "pass": True, "note": "", "conditions": {}, "seed": 1} | {
        "git_revision": "abc"
    }


def test_entry_of_seeds() -> None:
    """Mean and sample deviation of five seeds; fewer give no scatter; a value that one seed lacks is none.

    Verifies: REC-02
    """
    row = regression_row("r", **{"error.rms": 1.0, "left": 3, "error.max": None})
    seeds = {
        seed: {"error.rms": value, "left": 3, "error.max": None}
        for seed, value in enumerate((1.0, 1.1, 0.9, 1.05, 0.95), 1)
    }
    entry = entry_of(row, "abc", seeds, "why")
    assert entry["seeds"] == [1, 2, 3, 4, 5] and entry["revision"] == "abc"
    assert entry["values"]["error.rms"] == {"value": 1, "scatter": 0.0790569, "band": [0.666667, 1.39528]}
    assert entry["values"]["error.max"] == {"value": None, "scatter": None, "band": None}
    assert entry_of(row, "abc", {1: seeds[1]}, "why")["values"]["error.rms"]["scatter"] is None


def test_what_is_not_as_recorded() -> None:
    """A new row, a new or missing value, and a value where none was, or none where one was, each fail by name.

    Verifies: REC-01
    """
    record = {
        "r": entry_of(
            regression_row("r", **{"error.rms": 1.0, "x": None}), "abc", {1: {"error.rms": 1.0, "x": None}}, "w"
        )
    }
    assert drift(regression_row("s", x=1), record) == ["not in the record"]
    assert drift(regression_row("r", **{"error.rms": 1.0}), record) == ["x is recorded but has gone"]
    assert drift(regression_row("r", **{"error.rms": 1.0, "x": None, "y": 1}), record) == ["y is not in the record"]
    assert drift(regression_row("r", **{"error.rms": None, "x": 2.0}), record) == [
        "error.rms = no value, recorded 1",
        "x = 2, recorded no value",
    ]
    assert drift(regression_row("r", **{"error.rms": 0.5, "x": None}), record) == [
        "error.rms = 0.5 is outside of 0.6667 … 1.5 about the recorded 1 (one seed, revision abc)"
    ]


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Record and result of three rows of two cases, in a folder of their own, in place of the checkout's."""
    record, result = tmp_path / "record.json", tmp_path / "regression.json"
    names = ("six-step/hall/before", "six-step/hall/after", "six-step/patterns/ON-PWM")
    rows = [regression_row(name, **{"error.rms": 1.0}) for name in names]
    write_record({row["id"]: entry_of(row, "abc", {1: row["values"]}, "first") for row in rows}, record)
    result.write_text(json.dumps({"schema": 1, "quick": False, "rows": rows}))
    for module, name, path in ((command, "RECORD", record), (command, "RESULT", result)):
        monkeypatch.setattr(module, name, path)
    return record, result


def change(result: Path, name: str, value: float) -> None:
    document = json.loads(result.read_text())
    for row in document["rows"]:
        if row["id"] == name:
            row["values"]["error.rms"] = value
            row |= {"pass": False, "drift": ["moved"]}
    result.write_text(json.dumps(document))


def test_accept(files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    """Accepting stores value, revision, seed and reason of the row that moved, and of no other; the row passes then.

    Verifies: REC-03
    """
    record, result = files
    before = read_record(record)
    change(result, "six-step/hall/after", 2.0)
    command.accept_rows(["six-step/hall"], "the estimator is new")
    assert capsys.readouterr().out.splitlines() == [
        "accepted: six-step/hall/after: error.rms 1 → 2",
        f"written: {record}; the page follows with python -m fluxverify.docs.regression",
    ]
    after = read_record(record)
    entry = after.pop("six-step/hall/after")
    assert (entry["revision"], entry["seeds"], entry["why"]) == ("abc", [1], "the estimator is new")
    assert entry["values"]["error.rms"] == {"value": 2, "scatter": None, "band": [1.33333, 3]}
    before.pop("six-step/hall/after")
    assert after == before
    assert all(row["pass"] for row in json.loads(result.read_text())["rows"])


def test_accept_refuses(files: tuple[Path, Path]) -> None:
    """No reason, nothing to accept, no result, a missed limit and a short version are refused; nothing is written.

    Verifies: REC-03
    """
    record, result = files
    before = record.read_text()
    change(result, "six-step/hall/after", 9.0)
    document = json.loads(result.read_text())
    expected = {
        ("six-step/hall/after", "  "): "say why",
        ("six-step/hall/before", "why"): "is within its bands",
        ("six-step/none", "why"): "has no result",
        ("six-step/hall/after", "why"): "misses a limit",
    }
    for (row, why), text in expected.items():
        with pytest.raises(ConfigError, match=text):
            command.accept_rows([row], why)
    result.write_text(json.dumps({**document, "quick": True}))
    with pytest.raises(ConfigError, match="short versions"):
        command.accept_rows(["six-step/hall/after"], "why")
    result.unlink()
    with pytest.raises(ConfigError, match="is missing"):
        command.accept_rows(["six-step/hall/after"], "why")
    assert record.read_text() == before


def test_accept_a_row_that_has_gone(files: tuple[Path, Path]) -> None:
    """A recorded row whose case has run without it leaves the record with an acceptance only.

    Verifies: REC-03
    """
    record, result = files
    document = json.loads(result.read_text())
    document["rows"] = [row for row in document["rows"] if row["id"] != "six-step/hall/after"]
    result.write_text(json.dumps(document))
    command.accept_rows(["six-step/hall/after"], "measured by the reversal now")
    assert sorted(read_record(record)) == ["six-step/hall/before", "six-step/patterns/ON-PWM"]


def documents(values: dict[int, float], name: str = "six-step/hall/after") -> Any:
    """`run_cases` in whose place each seed gives this value of the one row."""

    def run_cases(names: Any, quick: bool, seed: int, jobs: int, done: Any) -> dict[str, Any]:
        row = regression_row(name, **{"error.rms": values[seed]})
        return {"schema": 1, "quick": False, "rows": [copy.deepcopy(row)]}

    return run_cases


def test_record_seeds(files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """Five seeds within the band replace one, with their scatter and the reason that the row had.

    Verifies: REC-02, REC-03
    """
    record, _ = files
    monkeypatch.setattr(command, "run_cases", documents({1: 1.0, 2: 1.1, 3: 0.9, 4: 1.05, 5: 0.95}))
    assert command.record_regression(["six-step/hall"], 5, 1)
    entry = read_record(record)["six-step/hall/after"]
    assert (entry["seeds"], entry["why"], entry["values"]["error.rms"]["value"]) == ([1, 2, 3, 4, 5], "first", 1)
    assert entry["values"]["error.rms"]["scatter"] == 0.0790569


@pytest.mark.parametrize("values", [{s: 2.0 for s in range(1, 6)}, {1: 1.0, 2: 1.0, 3: 1.0, 4: 1.0, 5: 5.5}])
def test_record_keeps_what_has_moved(
    values: dict[int, float], files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seeds whose mean lies outside of the band, or of which one misses a limit, record nothing.

    Verifies: REC-03
    """
    record, _ = files
    before = record.read_text()
    monkeypatch.setattr(command, "run_cases", documents(values))
    assert not command.record_regression(["six-step/hall"], 5, 1)
    assert record.read_text() == before


def test_record_refuses_unvouched_runs(files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """A run of one seed that cannot be vouched for keeps every row of its case out of the record.

    Verifies: REC-03
    """
    record, _ = files
    before = record.read_text()
    good = documents(dict.fromkeys(range(1, 6), 1.0))

    def run_cases(names: Any, quick: bool, seed: int, jobs: int, done: Any) -> dict[str, Any]:
        document: dict[str, Any] = good(names, quick, seed, jobs, done)
        if seed == 3:
            document["rows"].append(regression_row("six-step/hall/vouched", unvouched=1))
        return document

    monkeypatch.setattr(command, "run_cases", run_cases)
    assert not command.record_regression(["six-step/hall"], 5, 1)
    assert record.read_text() == before


def test_run_judges(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`fluxverify regression` fails for a row outside of its band and for a recorded row that is made no more.

    Verifies: REC-01
    """

    def run_cases(*arguments: Any) -> dict[str, Any]:
        document = documents({1: 2.0})(*arguments)
        document["rows"] = [judged(row, read_record(files[0])) for row in document["rows"]]
        return document

    monkeypatch.setattr(command, "run_cases", run_cases)
    assert not command.run_regression(["six-step/hall"], False, 1, 1)
    lines = capsys.readouterr().out.splitlines()
    moved = "error.rms = 2 is outside of 0.6667 … 1.5 about the recorded 1 (one seed, revision abc)"
    assert f"failed: six-step/hall/after: {moved}" in lines
    assert "failed: six-step/hall/before: recorded, but its case makes it no more" in lines


@pytest.mark.parametrize("value", [float("nan"), float("inf"), None])
def test_no_number_is_no_value(value: float | None) -> None:
    """What is no number misses its limit, and the results stay JSON: a NaN in one row lost those of all others."""
    row = Row(
        "six-step/lost-lock/sequence", {}, {"gap_deg": value, "trips": 0}, {"gap_deg": (None, 65), "trips": (0, 0)}
    )
    assert row.misses() == ["gap_deg has no value"]
    assert json.loads(json.dumps(row.as_json(), allow_nan=False))["values"] == {"gap_deg": None, "trips": 0}


def test_bad_records(tmp_path: Path) -> None:
    """A file that is no record, or has a value that is no number, is refused in one line.

    Verifies: REC-01
    """
    path = tmp_path / "record.json"
    entry: dict[str, Any] = {"revision": "abc", "seeds": [1], "why": "w"}
    wrong: list[Any] = [
        "{",
        "[]",
        {"schema": 2, "rows": {}},
        {"schema": 1, "rows": {"r": {}}},
        {"schema": 1, "rows": {"r": {**entry, "values": {"x": {"value": 1, "scatter": None, "band": [1]}}}}},
        {
            "schema": 1,
            "rows": {"r": {**entry, "values": {"x": {"value": float("nan"), "scatter": None, "band": None}}}},
        },
        {"schema": 1, "rows": {"r": {**entry, "why": " ", "values": {}}}},
    ]
    for document in wrong:
        path.write_text(document if isinstance(document, str) else json.dumps(document))
        with pytest.raises(ConfigError):
            read_record(path)
    path.unlink()
    with pytest.raises(ConfigError, match="cannot be read"):
        read_record(path)
