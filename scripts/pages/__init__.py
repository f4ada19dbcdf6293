"""The pages of docs/reference that the code holds, a module for each, whose `page()` is its text; scripts/reference writes
them."""
