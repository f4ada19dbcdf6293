"""The examples in the docstrings are true."""

import doctest
import importlib
import pkgutil

import pytest

import twin.optimisation


@pytest.mark.parametrize("name", [module.name for module in pkgutil.iter_modules(twin.optimisation.__path__)])
def test_the_examples_of_a_module_are_true(name: str) -> None:
    assert doctest.testmod(importlib.import_module(f"twin.optimisation.{name}")).failed == 0
