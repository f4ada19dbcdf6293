"""The text of a program, read: tokens, expressions, statements, blocks, and where they stand."""
