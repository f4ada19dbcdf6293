"""`cnctwin train`: options of the command line; `cnctwin/training` does the work."""
