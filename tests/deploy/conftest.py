"""One plant for all tests that do not change it."""

from collections.abc import Iterator

import pytest

from tests.deploy.plant import Plant, need_programs


@pytest.fixture(scope="session")
def plant(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Iterator[Plant]:
    """A broker with the files of deploy/, running."""
    assert mosquitto_program
    need_programs()
    plant = Plant(tmp_path_factory.mktemp("plant"))
    plant.build()
    plant.start()
    yield plant
    plant.stop()
