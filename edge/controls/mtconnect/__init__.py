"""MTConnect agents: documents, the cursor that decides what to ask for next, the connection that asks, names of data items."""
