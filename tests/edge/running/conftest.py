"""The thread that edges share, for the tests of what it drives."""

from collections.abc import Iterator

import pytest

from edge.running.driver import Driver


@pytest.fixture
def driver() -> Iterator[Driver]:
    driver = Driver()
    driver.start()
    yield driver
    driver.stop()
