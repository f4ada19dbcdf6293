"""Open loops: the parts of an axis one by one, each driven by what was measured at its input."""
