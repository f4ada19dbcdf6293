"""Past one machine: Kafka between the broker and the processors (docs/kafka.md). Needs the extra `kafka`."""
