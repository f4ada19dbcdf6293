"""Training of models: anomaly scores, the tool-change detector, the residual of the heat model."""
