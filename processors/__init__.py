"""Stream processors: pure folds keyed by machine, one file each, and the runtime that feeds them from the broker.

A processor is declared in `contract`, found by `discovery`, fed by `engine` (no I/O) and run by `runtime` (all the I/O).
"""
