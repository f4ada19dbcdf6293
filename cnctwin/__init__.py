"""The program: commands over services, over what is kept and what stands in; the ground is files, terminal and processes."""
