"""The table of `cnctwin edge check`: a reason that several signals share is said once."""

import pytest
from typer.testing import CliRunner

from cnctwin.commands.connect import edge as command
from cnctwin.commands.connect.edge import edge_app
from edge.adapter import Row

LONG = "the control answers EW_NOOPT: the option is not on this machine, or its parameter 1234 is off; ask the builder"


def row(signal: str, reason: str | None) -> Row:
    return Row(signal, "cnc_rdload", "%", "%", None if reason else 1.0, reason)


def test_a_long_reason_of_several_signals_is_said_once_below_the_table(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rows = [row("spindle_load_pct", None), *(row(f"axis_{axis}_load_pct", LONG) for axis in "xyzac"), row("alarm", "no alarm")]
    monkeypatch.setattr("edge.check.check", lambda _config: rows)
    file = tmp_path_factory.mktemp("edge") / "vmc.toml"
    told = CliRunner().invoke(edge_app, ["check", str(file)]).output
    assert told.count("(1) below") == 5
    assert told.rstrip().endswith(f"(1) {LONG}")
    assert told.count("EW_NOOPT") == 1
    assert "no alarm" in told
    assert command.repeated(rows[:2]) == ()
