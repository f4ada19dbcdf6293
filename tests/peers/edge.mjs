// An edge node built with sparkplug-client: `node edge.mjs edge HOST PORT GROUP NODE PRIMARY_HOST`. The package has no host
// application and knows no primary host. The language on stdin and stdout is that of process.py.
import { createInterface } from "node:readline";
import Long from "long";
import client from "sparkplug-client";

const [, host, port, groupId, edgeNode] = process.argv.slice(2);
const lines = createInterface({ input: process.stdin })[Symbol.asyncIterator]();
const born = JSON.parse((await lines.next()).value);
const say = (event, rest) => process.stdout.write(`${JSON.stringify({ event, ...rest })}\n`);
const LONGS = new Set(["Int64", "UInt32", "UInt64", "DateTime"]);

function valueOf(type, text) {
  if (text === null) return null;
  if (type === "DataSet") {
    const rows = text.rows.map((row) => row.map((cell, i) => valueOf(text.types[i], cell)));
    return { numOfColumns: text.columns.length, columns: text.columns, types: text.types, rows };
  }
  if (type === "Template") {
    return {
      isDefinition: text.definition,
      ...(text.definition ? {} : { templateRef: text.ref }),
      version: "1",
      metrics: text.metrics.map(metricOf),
      parameters: [],
    };
  }
  if (LONGS.has(type)) return Long.fromString(text, type !== "Int64");
  if (type.startsWith("Int") || type.startsWith("UInt") || type === "Float" || type === "Double") return Number(text);
  if (type === "Boolean") return text === "true";
  if (type === "Bytes" || type === "File") return new Uint8Array(Buffer.from(text, "hex"));
  return text;
}

function metricOf({ name, type, value, alias, unit }) {
  return {
    name,
    type,
    value: valueOf(type, value),
    timestamp: Date.now(),
    ...(alias === undefined ? {} : { alias }),
    ...(unit === undefined ? {} : { properties: { engUnit: { type: "String", value: unit } } }),
  };
}

function textOf(value) {
  if (value === null || value === undefined) return null;
  return value instanceof Uint8Array ? Buffer.from(value).toString("hex") : String(value);
}

function commanded(device, payload) {
  const metrics = payload.metrics.map(({ name, alias, type, value }) => ({
    name: name ?? null,
    alias: alias === undefined ? null : Number(alias),
    type,
    value: textOf(value),
  }));
  say("command", { device, metrics });
}

const edge = client.newClient({
  serverUrl: `mqtt://${host}:${port}`,
  groupId,
  edgeNode,
  publishDeath: true,
  clientId: `js-${edgeNode}`,
  username: "",
  password: "",
});
const ready = (metrics) => ({ timestamp: Date.now(), metrics: metrics.map(metricOf) });
const birthOfDevice = () => edge.publishDeviceBirth("lathe", ready(born.device));

function birth() {
  edge.publishNodeBirth(ready(born.node));
  birthOfDevice();
}

edge.on("birth", birth);
edge.on("dcmd", commanded);
edge.on("ncmd", (payload) => {
  commanded(null, payload);
  if (payload.metrics.some(({ name, value }) => name === "Node Control/Rebirth" && value === true)) birth();
});
say("started");

// What a data message of a metric with an alias leaves out.
const inData = (metric) => (metric.alias === undefined ? metric : { ...metric, name: undefined });
for await (const line of lines) {
  const { do: what, metrics, metric, count } = JSON.parse(line);
  if (what === "data") edge.publishDeviceData("lathe", ready(metrics.map(inData)));
  if (what === "device death") edge.publishDeviceDeath("lathe", { timestamp: Date.now() });
  if (what === "device birth") birthOfDevice();
  for (let number = 1; what === "run" && number <= count; number += 1) {
    edge.publishDeviceData("lathe", ready([inData({ ...metric, value: String(number) })]));
  }
  if (what === "stop") {
    edge.stop();
    break;
  }
}
