"""The Python interface: what `import cnctwin` hands out, a file a noun, each thin over the services that the commands call."""
