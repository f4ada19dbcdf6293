"""The controls that an edge can read: a file or a folder for each, named like its adapter."""
