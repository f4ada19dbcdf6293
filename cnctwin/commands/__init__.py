"""The command line: one file for each command or group of commands. Nothing imports these but the entry point."""
