"""A store that a test leaves open is closed after it, so that one failure is not reported as three."""

from collections.abc import Iterator
from typing import Any

import pytest

from cnctwin.memory.store.embedded import EmbeddedStore


@pytest.fixture(autouse=True)
def closed_at_the_end(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    opened: list[EmbeddedStore] = []
    make = EmbeddedStore.__init__

    def tracked(self: EmbeddedStore, *arguments: Any, **named: Any) -> None:
        make(self, *arguments, **named)
        opened.append(self)

    monkeypatch.setattr(EmbeddedStore, "__init__", tracked)
    yield
    for store in opened:
        store.close()
