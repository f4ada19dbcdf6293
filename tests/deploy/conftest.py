"""One plant for all tests that do not change it."""

from collections.abc import Iterator

import pytest

from tests.deploy.plant import FOR_2_0, FOR_2_1, Plant, need_programs, plugin_folder


@pytest.fixture(scope="session", params=[FOR_2_0, FOR_2_1] if plugin_folder() else [FOR_2_0])
def plant(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Iterator[Plant]:
    """A broker with the files of deploy/, running; with each of its configurations where it is Mosquitto 2.1."""
    assert mosquitto_program
    need_programs()
    plant = Plant(tmp_path_factory.mktemp("plant"), request.param)
    plant.build()
    plant.start()
    yield plant
    plant.stop()
