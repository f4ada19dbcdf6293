"""Finds what is in no catalogue: terms learned in the simulator, fitted like effects, judged on runs that were not fitted."""
