"""The machinery that runs processors: broker, clock, lanes, ledger, snapshots, dead letters."""
