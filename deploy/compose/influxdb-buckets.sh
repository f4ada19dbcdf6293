#!/usr/bin/env bash
# Run once by the image of InfluxDB 2, when it sets itself up: the other two buckets, and a reader for Grafana that InfluxQL knows.
# A bucket is a database of its name there without more.
set -euo pipefail

reads=()
for bucket in cnc_raw cnc_twin_state cnc_pinned; do
    if [ "$bucket" != "$DOCKER_INFLUXDB_INIT_BUCKET" ]; then
        influx bucket create --org "$DOCKER_INFLUXDB_INIT_ORG" --name "$bucket" --retention 0
    fi
    id="$(influx bucket list --org "$DOCKER_INFLUXDB_INIT_ORG" --name "$bucket" --hide-headers | cut -f 1)"
    reads+=(--read-bucket "$id")
done
influx v1 auth create --org "$DOCKER_INFLUXDB_INIT_ORG" --username grafana \
    --password "$(cat /run/secrets/influxdb_grafana_password)" "${reads[@]}"
