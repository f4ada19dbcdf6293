"""The machinery that runs an edge: connection, pipeline, store and forward, receipts, health."""
