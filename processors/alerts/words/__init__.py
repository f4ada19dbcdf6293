"""The words of notifications: one file for each language, the templates in it, and the facts that they are filled with."""
