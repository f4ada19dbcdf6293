"""The lives that the statements are held against."""

import pytest

from tests.sparkplug.conformance.life import EdgeLife, HostLife, new_host_life, whole_edge_life


@pytest.fixture(scope="session")
def life() -> EdgeLife:
    """Every message of a whole life of an edge node; shared, so only to be read."""
    return whole_edge_life()


@pytest.fixture
def edge() -> EdgeLife:
    """An edge node that was born, sent, died and lives again, to go on with."""
    lived = whole_edge_life()
    lived.connect(bd_seq=3)
    return lived


@pytest.fixture
def host() -> HostLife:
    """A host application that has not connected yet."""
    return new_host_life()
