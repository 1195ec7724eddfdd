# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fluxlock from Python."""

from __future__ import annotations

import dataclasses
import doctest
import inspect
import json
import re
import sys
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import fluxlock
from fluxlock.api import run_checked
from fluxlock.base.paths import ROOT
from fluxlock.base.stage import ProgressInfo
from fluxlock.config import schema
from fluxlock.config.fields import Model
from fluxlock.config.json_schema import json_schema

OWN = ROOT / "scenarios" / "own-spindle.toml"
SHORT = {"duration_s": 0.3, "window": [{"name": "end", "from_s": 0.25, "to_s": 0.3}], "expect": []}


@pytest.fixture(scope="module")
def run() -> fluxlock.Run:
    return fluxlock.simulate(OWN, twin=True, **SHORT)


def test_public_names() -> None:
    """Every public name is there, has a docstring, and `import fluxlock` alone loads nothing slow.

    Verifies: PACKAGE-7
    """
    assert set(fluxlock.__all__) == set(fluxlock._HOME)
    with pytest.raises(AttributeError, match="no_such"):
        _ = fluxlock.no_such


def members(public: type) -> Iterator[tuple[str, Any]]:
    """Public functions and properties that a class brings itself."""
    for name, member in vars(public).items():
        found = member.fget if isinstance(member, property) else getattr(member, "func", member)
        if not name.startswith("_") and (inspect.isfunction(found) or isinstance(member, (property, cached_property))):
            yield name, found


def left_out(public: Any) -> list[str]:
    """What the docstring of a function or a class does not say: names, errors, shapes; of a class its members' too."""
    text = inspect.getdoc(public) or ""
    if isinstance(public, type):
        if issubclass(public, Model):  # each key with its unit
            return [
                f"{public.__name__}.{key}"
                for key, field in public.model_fields.items()
                if not field.description
                or ("float" in str(field.annotation) and "unit" not in (field.json_schema_extra or ()))
            ] + [f"{public.__name__}.{name}" for name, member in members(public) if not inspect.getdoc(member)]
        wanted = [field.name for field in dataclasses.fields(public)] if dataclasses.is_dataclass(public) else []
        missing = [f"{public.__name__}: {name}" for name in wanted if not re.search(rf"\b{name}:\s", text)]
        return missing + [line for _, member in members(public) for line in left_out(member)]
    signature = inspect.signature(public)
    wanted = [name for name in signature.parameters if name != "self"]
    missing = [f"{public.__qualname__}: {name}" for name in wanted if not re.search(rf"\b{name}\b", text)]
    raises = re.search(r"raise (\w+\.)?ConfigError", inspect.getsource(public))
    if not text or (raises and "Raises ConfigError" not in text):
        missing.append(f"{public.__qualname__}: text, or its errors")
    if re.search("Array|ndarray", str(signature.return_annotation)) and not re.search(r"\[n[,\]]", text):
        missing.append(f"{public.__qualname__}: shape")
    return missing


def comment_of(variable: str) -> str:
    """The comment before a public variable, where Sphinx takes its text from."""
    home = Path(sys.modules[fluxlock._HOME[variable]].__file__ or "").read_text(encoding="utf-8")
    found = re.search(rf"((?:^#:.*\n)+){variable} = ", home, re.MULTILINE)
    assert found is not None
    return re.sub("^#: ?", "", found[1], flags=re.MULTILINE)


@pytest.mark.parametrize("name", fluxlock.__all__)
def test_docstring_is_whole(name: str) -> None:
    """A docstring names every argument, field, error and shape, a model the unit of each key.

    Verifies: PACKAGE-7
    """
    public = getattr(fluxlock, name)
    if name == "UNITS":
        assert "their units" in comment_of(name)
        return
    assert inspect.getdoc(public) and left_out(public) == []


def test_docstring_that_is_not() -> None:
    """What is missing is found.

    Verifies: PACKAGE-7
    """

    @dataclasses.dataclass
    class Planted:
        """A thing. seen: of it."""

        seen: int
        hidden: int

        def waves(self, count: int) -> np.ndarray[Any, Any]:
            """Return waves."""
            raise fluxlock.ConfigError([])

    found = [line.rpartition("Planted")[2] for line in left_out(Planted)]
    assert found == [": hidden", ".waves: count", ".waves: text, or its errors", ".waves: shape"]


@pytest.mark.parametrize("name", fluxlock.__all__)
def test_public_name_on_the_site(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Docstring with errors, where a function raises them, and an example, which runs if it is quick; on the site.

    Verifies: PACKAGE-7
    """
    public = getattr(fluxlock, name)
    module = fluxlock._HOME[name]
    page = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    assert f"[`{module}`]" in page
    # Sphinx puts on a module's page what the module makes, and what stands in its `__all__`.
    made_there = getattr(public, "__module__", module) == module
    assert made_there or name in getattr(sys.modules[module], "__all__", ())
    assert f"`{name}" in (ROOT / "docs" / "howto" / "python-and-sweeps.md").read_text(encoding="utf-8")
    text = comment_of(name) if name == "UNITS" else public.__doc__
    assert ">>> " in text and (name == "UNITS" or isinstance(public, type) or "Raises ConfigError" in text)
    if "+SKIP" in text or name in ("simulate", "sweep"):
        return
    monkeypatch.chdir(ROOT)
    home = sys.modules[module]
    example = doctest.DocTestParser().get_doctest(text, vars(home).copy(), name, None, 0)
    assert doctest.DocTestRunner(verbose=False).run(example).failed == 0


def test_traces(run: fluxlock.Run) -> None:
    """Traces have one length and a unit each; speed is the derivative of the angle; the table holds the same.

    Verifies: PACKAGE-7
    """
    assert set(fluxlock.UNITS) - set(run.traces) == {"id", "ie", "vd", "ve"}  # of five phases
    assert {"t_s", *run.to_dataframe().attrs["units"]} == set(run.traces)
    t_s, theta = run.traces["t_s"], run.traces["theta_e_rad"]
    assert {len(trace) for trace in run.traces.values()} == {len(t_s)} and t_s[-1] == pytest.approx(0.3, abs=1e-3)
    turned = np.trapezoid(run.traces["speed_rpm"], t_s) / 60 * run.scenario.motor.pole_pairs * 2 * np.pi
    assert turned == pytest.approx(theta[-1] - theta[0], rel=1e-3)
    table = run.to_dataframe()
    assert table.index.name == "t_s" and table.attrs["units"]["ia"] == "A"
    np.testing.assert_array_equal(table["ia"], run.traces["ia"])
    assert run.metrics["end"]["speed_rpm"]["mean"] > 1000


def test_progress(run: fluxlock.Run, capsys: pytest.CaptureFixture[str]) -> None:
    """The twin says what it builds and how far it is, and runs as it does without; a run is shown by its verdict.

    Verifies: PACKAGE-7
    """
    again = fluxlock.simulate(OWN, twin=True, progress=True, **SHORT)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("building twin ")
    assert lines[-1].startswith("simulating ") and "0.300/0.300 s" in lines[-1]
    assert f"{again.traces['speed_rpm'][-1]:.0f} r/min" in lines[-1]
    np.testing.assert_array_equal(again.data.records, run.data.records)
    seen: list[ProgressInfo] = []
    run_checked(fluxlock.scenario_of(OWN, SHORT), True, None, progress=seen.append)
    assert seen[0].phase == "building twin" and len(seen) > 2
    assert all(info.phase == "simulating" and info.t_s > 0.0 for info in seen[1:])  # the first step compiles
    assert repr(run) == f"<Run of own-spindle: ok: {'; '.join(run.verdict.lines)}>"


def test_plot(run: fluxlock.Run) -> None:
    """A panel a trace; a name that is none is refused with those that are.

    Verifies: PACKAGE-7
    """
    mpl.use("Agg")
    panels = run.plot("speed_rpm", "ia")
    assert [panel.get_ylabel() for panel in panels] == ["speed_rpm / r/min", "ia / A"]
    with pytest.raises(fluxlock.ConfigError, match="permitted: t_s"):
        run.plot("current")
    with pytest.raises(fluxlock.ConfigError, match=r"^plot: id: no such trace, permitted: t_s, .*, ic, va, "):
        run.plot("id")


def test_changed_in_code() -> None:
    """Keys changed on a loaded scenario give what the file with the same `--set` gives; problems name the key.

    Verifies: PACKAGE-7
    """
    texts = ["motor.resistance_ohm=0.2", "drive.commutation=CSC", "window.steady.to_s=1.16"]
    keys = {"motor.resistance_ohm": 0.2, "drive__commutation": "CSC", "window.steady.to_s": 1.16}
    of_file = fluxlock.load_scenario(OWN, texts)
    assert fluxlock.scenario_of(OWN, keys) == of_file
    assert fluxlock.scenario_of(fluxlock.load_scenario(OWN), keys) == of_file
    with pytest.raises(fluxlock.ConfigError, match=r"motor\.resistance_ohm: .*out of range"):
        fluxlock.scenario_of(fluxlock.load_scenario(OWN), {"motor.resistance_ohm": -1.0})
    with pytest.raises(fluxlock.ConfigError, match="unknown key"):
        fluxlock.simulate(OWN, twin=True, drive__no_such=1)


def stated(model: Model) -> dict[str, Any]:
    return {key: getattr(model, key) for key in model.model_fields_set}


@pytest.mark.parametrize("kind", ["Motor", "Inverter", "Scenario"])
def test_made_in_code(kind: str) -> None:
    """A model that code makes is that of the file; missing, unknown and wrong keys are refused, each by name.

    Verifies: PACKAGE-7
    """
    scenario = fluxlock.load_scenario(OWN)
    made = {"Motor": scenario.motor, "Inverter": scenario.inverter, "Scenario": scenario}[kind]
    model, keys = type(made), stated(made)
    assert model.__name__ == kind and stated(model(**keys)) == keys
    required = [key for key, field in model.model_fields.items() if field.is_required() and key != "name"]
    with pytest.raises(fluxlock.ConfigError) as caught:
        model(name="x")
    assert str(caught.value) == "\n".join(f"{kind}: {key}: required key is missing" for key in required)
    with pytest.raises(fluxlock.ConfigError) as caught:
        model(**keys | {"descripton": "x", "name": ""})
    assert sorted(str(caught.value).splitlines()) == [
        f'{kind}: descripton: unknown key, did you mean "description"?',
        f"{kind}: name: must not be empty",
    ]
    with pytest.raises(fluxlock.ConfigError, match=rf"^{kind}: name: cannot be assigned: .*scenario_of"):
        made.name = "y"  # type: ignore[misc]  # what a user may try


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"motor": "motors/pump-4pp.toml"}, r"^Scenario: motor: must be a Motor, not 'motors/pump-4pp\.toml'$"),
        ({"inverter": None}, r"^Scenario: inverter: must be an Inverter, not None$"),
        ({"window": [{"name": "a", "from_s": 0.1}]}, r"^Scenario: window\[0\]\.to_s: required key is missing$"),
        (
            {"drive": {"carrier_hz": 1}},
            r"^Scenario: drive\.carrier_hz: 1 Hz is out of range, permitted 1000 to 200000 Hz$",
        ),
    ],
)
def test_parts_made_in_code(keys: dict[str, Any], message: str) -> None:
    """A key of a table below has its place; a file's path is no motor.

    Verifies: PACKAGE-7
    """
    with pytest.raises(fluxlock.ConfigError, match=message):
        fluxlock.Scenario(**stated(fluxlock.load_scenario(OWN)) | keys)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"duration_s": 0.05}, r"window\[0\]\.to_s: 1\.15 s is after the end of the run"),
        ({"duration_s": "x"}, r"duration_s: must be a number, not 'x'$"),
        ({"durations_s": 0.5}, r'durations_s: unknown key, did you mean "duration_s"\?$'),
        ({"motor": 3}, r"^motor: must be a Motor or the path of its file, not 3$"),
        ({"motor": {"pole_pairs": 0, "polepairs": 1}}, r"pole_pairs: 0 is out of range.*\n.*polepairs: unknown key"),
    ],
)
def test_copied_in_code(changes: dict[str, Any], message: str) -> None:
    """A scenario that code has copied unchecked is checked before it runs.

    Verifies: PACKAGE-7
    """
    scenario = fluxlock.load_scenario(OWN)
    if isinstance(motor := changes.get("motor"), dict):
        changes = {"motor": scenario.motor.model_copy(update=motor)}
    copied = scenario.model_copy(update=changes)
    for call in (fluxlock.scenario_of, fluxlock.simulate, lambda given: fluxlock.sweep(given, {"seed": [1]})):
        with pytest.raises(fluxlock.ConfigError, match=message):
            call(copied)


def test_overload_that_is_allowed() -> None:
    """What the loader was told to accept, it accepts of the changed scenario too.

    Verifies: PACKAGE-7
    """
    loaded = fluxlock.load_scenario(ROOT / "scenarios" / "demo.toml", ["drive.current_limit_a=11"], allow_overload=True)
    assert fluxlock.scenario_of(loaded) is loaded
    assert fluxlock.scenario_of(loaded, {"seed": 2}).accept == loaded.accept


def test_whole_motor() -> None:
    """A motor that code made replaces that of the file, with keys of it changed in the same call.

    Verifies: PACKAGE-7
    """
    motor = fluxlock.load_motor(ROOT / "motors" / "spindle-2pp.toml").model_copy(update={"name": "mine"})
    made = fluxlock.scenario_of(OWN, {"motor": motor, "motor.load.coulomb_nm": 1e-3})
    assert made.motor.name == "mine" and made.motor.load.coulomb_nm == 1e-3
    with pytest.raises(fluxlock.ConfigError, match="must be a Motor"):
        fluxlock.scenario_of(fluxlock.load_scenario(OWN), {"motor": 3})


@pytest.mark.parametrize("given", [Path("motors/pump-4pp.toml"), str(ROOT / "motors" / "pump-4pp.toml")])
@pytest.mark.parametrize("base", ["file", "scenario"])
def test_motor_by_its_file(given: Path | str, base: str) -> None:
    """A motor by the path of its file, also in a scenario that has been read; a path of none is refused by key.

    Verifies: PACKAGE-7
    """
    loaded = OWN if base == "file" else fluxlock.load_scenario(OWN)
    made = fluxlock.scenario_of(loaded, {**SHORT, "event": [], "window": [], "motor": given, "motor.pole_pairs": 3})
    assert made.motor.name == "Pump 24 V" and made.motor.pole_pairs == 3
    assert Path(made.sources.motor).name == "pump-4pp.toml"
    with pytest.raises(fluxlock.ConfigError, match=r"^motor: file not found \(motors/no-such\.toml\)"):
        fluxlock.scenario_of(loaded, {"motor": "motors/no-such.toml"})


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("seed", np.int64(3), 3),
        ("drive.carrier_hz", np.float32(20_000), 20_000.0),
        ("motor.resistance_ohm", np.array([0.1, 0.2, 0.3]), (0.1, 0.2, 0.3)),
        ("motor.resistance_ohm", list(np.array([0.1, 0.2, 0.3])), (0.1, 0.2, 0.3)),
    ],
)
def test_numbers_of_numpy(key: str, value: object, expected: object) -> None:
    """Keys take NumPy's numbers and arrays.

    Verifies: PACKAGE-7
    """
    made: Any = fluxlock.scenario_of(OWN, {key: value})
    for part in key.split("."):
        made = getattr(made, part)
    assert made == expected


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, r"^seed: must be a whole number from 0 to 2147483647, not -1$"),
        ({"seed": 1.5}, r"^seed: .*not 1\.5$"),
        ({"seed": True}, r"^seed: .*not True$"),
        ({"folder": OWN}, r"^folder: .*own-spindle\.toml: cannot be written: .*; name another folder$"),
        ({"twinn": True}, r'^twinn: unknown keyword, did you mean "twin"\?$'),
        ({"Folder": "x", "sed": 3}, r'^Folder: unknown keyword, .*"folder"\?\nsed: unknown keyword, .*"seed"\?$'),
        ({"drives": {}}, r'^drives: unknown key, did you mean "drive"\?$'),
        ({"drive__comutation": "CSC"}, r'^drive\.comutation: unknown key, did you mean "commutation"\?$'),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], message: str) -> None:
    """An argument that is none is refused by its name, before anything runs.

    Verifies: PACKAGE-7
    """
    with pytest.raises(fluxlock.ConfigError, match=message):
        fluxlock.simulate(OWN, twin=True, **arguments)


def test_python_without_its_library(monkeypatch: pytest.MonkeyPatch) -> None:
    """A chip whose simulator could not load this Python is refused before it is built, with the package that helps.

    Verifies: PACKAGE-5
    """
    stages: list[str] = []
    monkeypatch.setattr("find_libpython.find_libpython", lambda: None)
    with pytest.raises(fluxlock.ConfigError, match=r"lacks the shared library of .*: install libpython3\.\d+ "):
        fluxlock.simulate("scenarios/spinning.toml", progress=lambda info: stages.append(info.stage))
    assert not stages


@pytest.mark.parametrize("given", [5, None, fluxlock.Motor, {"name": "x"}])
def test_no_scenario(given: Any) -> None:
    """What is neither a model nor the path of its file is refused in a line that says what it must be.

    Verifies: PACKAGE-7
    """
    for call in (fluxlock.simulate, fluxlock.scenario_of, lambda given: fluxlock.sweep(given, {"seed": [1]})):
        with pytest.raises(fluxlock.ConfigError, match=r"^scenario: must be a Scenario or the path of its file, not "):
            call(given)
    for load, kind in ((fluxlock.load_motor, "a motor file"), (fluxlock.load_inverter, "an inverter file")):
        with pytest.raises(fluxlock.ConfigError, match=rf"^must be the path of {kind}, not "):
            load(given)
    with pytest.raises(fluxlock.ConfigError, match=r"^must be the path of a scenario, not "):
        fluxlock.load_scenario(given)


@pytest.mark.parametrize("kind", ["motor", "inverter", "scenario"])
def test_example_is_of_the_docstring_alone(kind: str) -> None:
    """The example of a model is in no schema that an editor shows, and on no page of the files.

    Verifies: PACKAGE-7
    """
    assert ">>>" not in json.dumps(json_schema(kind)) and ">>>" not in schema.page()


def test_chip(tmp_path: Path) -> None:
    """On the chip, with results kept in a folder: trace, result and plots as `fluxlock run` writes them.

    Verifies: PACKAGE-7
    """
    run = fluxlock.simulate(
        "scenarios/spinning.toml", folder=tmp_path, duration_s=0.002, event=[], window=[], expect=[]
    )
    assert run.data.cycles == 100_000 and repr(run).startswith("<Run of spinning: ok: ")
    assert {"trace.npz", "result.json", "overview.png"} <= {path.name for path in tmp_path.iterdir()}
