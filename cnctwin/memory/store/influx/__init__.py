"""The store on a server: InfluxDB 2, InfluxDB 1.x or VictoriaMetrics, behind a ring on the disk that outlives their absence."""
