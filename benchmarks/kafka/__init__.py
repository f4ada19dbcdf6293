"""The folds on Kafka: what they cost, and what is left of the data when something dies."""
