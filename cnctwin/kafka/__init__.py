"""Past one machine: Kafka between the broker and the processors (docs/how-to/kafka.md). Needs the extra `kafka`."""
