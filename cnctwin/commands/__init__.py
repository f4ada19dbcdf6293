"""The command line: one file for each command or group of commands, which only the entry point imports.

They share `extras.py`, `moment.py` and `options.py`.
"""
