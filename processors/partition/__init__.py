"""The folds over a log: what the processors of a process make of one partition of it, without I/O."""
