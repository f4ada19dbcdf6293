"""Stream processors: pure folds keyed by machine, a file or a folder each, and the runtime that feeds them from the broker.

A processor is declared by `contract`, found by `discovery`, fed by `running/engine` (no I/O) and run by `running/runtime`
(all the I/O).
"""
