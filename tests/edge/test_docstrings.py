"""The examples in the docstrings are true."""

import doctest
import importlib
import pkgutil

import pytest

import edge


@pytest.mark.parametrize("name", [module.name for module in pkgutil.walk_packages(edge.__path__, "edge.")])
def test_the_examples_of_a_module_are_true(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0
