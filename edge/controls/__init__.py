"""What the adapters are made of: a folder for each control, named like its adapter."""
