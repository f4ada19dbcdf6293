"""Between the broker and the log: a host session of ours to Kafka, and results back as edge nodes."""
