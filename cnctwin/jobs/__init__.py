"""Jobs that take their time: queued, run one at a time or spread over processes and machines, resumed or reported when killed."""
