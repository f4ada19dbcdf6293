"""The command line: a folder for each group of commands that `cnctwin --help` shows, which only the entry point imports.

A folder's `__init__.py` names its commands (`group.py`); options that several commands have are in `options.py`.
"""
