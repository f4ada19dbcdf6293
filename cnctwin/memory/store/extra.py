"""The extra `historian`, which sealing needs: looked up without importing it."""

from importlib.util import find_spec

NEEDED = ("numpy", "pyarrow", "duckdb")
MISSING = "numpy, pyarrow and duckdb are not installed (pip install 'cnctwin[historian]')"


def extra_is_there() -> bool:
    """Return True if all of it can be imported."""
    return all(find_spec(name) is not None for name in NEEDED)
