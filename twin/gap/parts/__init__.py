"""The parts of a machine, each compared alone, and the verdict that they and the whole give together."""
