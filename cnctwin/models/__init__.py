"""The model registry: versions of each kind and machine, which of them counts, and the golden week that each is judged on."""
