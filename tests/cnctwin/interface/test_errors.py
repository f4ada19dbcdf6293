"""Errors at the interface: one tree, and the line that the command prints."""

from collections.abc import Callable
from pathlib import Path

import pytest

import cnctwin
from cnctwin.interface.errors import one_tree
from edge.errors import ConfigError
from sparkplug.errors import TopicError
from twin.errors import EffectError, LimitsError, PartProgramError, RunLogError

VMC = Path(__file__).parents[3] / "docs" / "notebooks" / "vmc.toml"


@pytest.mark.parametrize(
    ("asked", "kind", "line"),
    [
        (lambda: cnctwin.read_machine("no.toml"), cnctwin.MachineError, "no.toml: cannot be read"),
        (lambda: cnctwin.read_run("no.parquet"), cnctwin.RunError, "no.parquet: there is no such file"),
        (lambda: cnctwin.diagnose("no"), cnctwin.CaseError, "no: cannot be read"),
        (lambda: cnctwin.open_store("no"), cnctwin.StoreError, "no: there is no store"),
        (lambda: cnctwin.open_store("ftp://host"), cnctwin.StoreError, "there is no store of the kind ftp://"),
        (lambda: cnctwin.simulate("part.nc", VMC), cnctwin.UsageError, "for a file, give pathlib.Path('part.nc')"),
        (lambda: cnctwin.simulate(Path("no.nc"), VMC), cnctwin.UsageError, "no.nc: cannot be read"),
        (lambda: cnctwin.simulate("G0 X1\nG123\n", VMC), cnctwin.ProgramError, "program: line 2: G123: "),
        (lambda: cnctwin.optimise("G0 X1\n", VMC, objective="speed"), cnctwin.UsageError, "'speed': is not known"),  # type: ignore[arg-type]
        (lambda: cnctwin.optimise("G0 X1\n", VMC, force_limit_n=-1.0), cnctwin.UsageError, "-1.0 N; it has to be more than 0"),
        (lambda: cnctwin.write_run({"t_s": [0.0]}, "run.xlsx"), cnctwin.UsageError, "run.xlsx: a run log is written as"),
        (lambda: cnctwin.watch("http://broker", "vmc"), cnctwin.BrokerError, "is not mqtt://"),
        (lambda: cnctwin.watch("mqtts://b?ca_file=/no", "vmc"), cnctwin.BrokerError, "there is no file /no"),
        (lambda: cnctwin.watch("mqtt://b", "vmc", queue_max=0), cnctwin.UsageError, "queue_max is 0"),
    ],
)
def test_wrong_input_is_one_line_of_one_tree(
    asked: Callable[[], object], kind: type[Exception], line: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(kind) as caught:
        asked()
    assert isinstance(caught.value, cnctwin.ApplicationError)
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_without_any_broker_the_way_out_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CNCTWIN_BROKER", raising=False)
    with pytest.raises(cnctwin.UsageError, match=r"name one, as mqtt://broker:1883, or set CNCTWIN_BROKER"):
        cnctwin.watch(None, "vmc")


@pytest.mark.parametrize(
    ("inner", "outer", "line"),
    [
        (RunLogError("x"), cnctwin.RunError, "x"),
        (EffectError("x"), cnctwin.MachineError, "x"),
        (LimitsError("x"), cnctwin.LimitsError, "part.nc: x"),
        (PartProgramError(3, "G123", "x"), cnctwin.ProgramError, "part.nc: line 3: G123: x"),
        (TopicError("x"), cnctwin.BrokerError, "x"),
        (ConfigError("x"), cnctwin.UsageError, "x"),
    ],
)
def test_an_error_of_a_package_below_keeps_its_words_and_its_cause(inner: Exception, outer: type[Exception], line: str) -> None:
    with pytest.raises(outer) as caught, one_tree("part.nc"):
        raise inner
    assert str(caught.value) == line
    assert caught.value.__cause__ is inner


def test_a_bug_of_ours_is_not_dressed_up() -> None:
    with pytest.raises(ZeroDivisionError), one_tree():
        _ = 1 / 0
