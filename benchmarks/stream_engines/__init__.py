"""Stream engines for keyed folds with exactly-once on Kafka, the same fold in each of them.

    python -m benchmarks.stream_engines --engines plain,thin,quix,flink

plain    poll, fold, produce on confluent-kafka; no transaction and no saved state: the unit of cost
thin     60 lines on confluent-kafka: outputs, snapshots of changed keys and offsets in one transaction, static member
quix     Quix Streams: at-least-once, exactly-once as it comes, exactly-once with stable names
flink    PyFlink: exactly-once from checkpoints, a local cluster of one slot

Messages have 200 B and 64 keys in 4 partitions; a state has 200 B or 20 kB, and each message brings one output (`fold`).
Cost: processor time of the worker with its children and threads, from the moment at which a backlog becomes visible (it is laid
in one transaction) until a read_committed reader has all its outputs; 20,000 messages before that warm up. Kill: messages come
at a rate, the worker gets kill -9, its local state is deleted, it is started again half a second later; seconds are from that
start to the first output that was not there before. Takeover: one of two workers is killed and stays away; seconds are from the
kill until every key has the output of a message sent after it. Outputs that come twice are counted by the reader, and a key is
exact if all its outputs came and each is what an undisturbed fold gives.

The broker is one of Maven's jars, each engine has a virtual environment; both stay in the folder of `--scratch`.
"""
