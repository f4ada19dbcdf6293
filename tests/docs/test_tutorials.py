"""Each tutorial, done from an empty folder: its commands run, and print what the page shows."""

import socket
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.docs.console import PORTS, Terminals, steps

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted(path.name for path in (ROOT / "docs" / "tutorials").glob("*.md") if path.name != "index.md")


def free_ports() -> dict[str, str]:
    """Return a free port of loopback for each that a page uses."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in PORTS]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return {port: str(one.getsockname()[1]) for port, one in zip(PORTS, sockets, strict=True)}


@pytest.mark.broker
@pytest.mark.parametrize("tutorial", TUTORIALS)
def test_the_commands_of_a_tutorial_print_what_it_shows(tutorial: str, tmp_path: Path) -> None:
    found = steps((ROOT / "docs" / "tutorials" / tutorial).read_text(encoding="utf-8"))
    assert len(found) >= 4
    environment = {
        "CNCTWIN": str(ROOT),
        "PATH": f"{Path(sys.executable).parent}:/usr/sbin:/usr/bin:/bin",
        "XDG_STATE_HOME": str(tmp_path / ".state"),
        "CNCTWIN_STATE_DIR": str(tmp_path / ".state"),
        "COLUMNS": "120",
    }
    terminals = Terminals(tmp_path, environment, free_ports())
    try:
        for step in found:
            terminals.do(step)
    finally:
        terminals.close()
