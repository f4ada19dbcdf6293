"""The plant as metrics for Prometheus."""
