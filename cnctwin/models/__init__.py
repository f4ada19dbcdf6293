"""The model registry: versions of each kind and machine, which of them counts, and what a challenger has to show."""
