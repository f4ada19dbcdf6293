// An edge node built with sparkplug-client: `node client.mjs <url> <group> <node> <publishDeath>`.
// Commands on stdin: "data <count>" sends so many DDATA, "stop" ends it. It says on stdout what it does.
import { createInterface } from "node:readline";
import client from "sparkplug-client";

const [serverUrl, groupId, edgeNode, publishDeath] = process.argv.slice(2);
const edge = client.newClient({
  serverUrl,
  groupId,
  edgeNode,
  publishDeath: publishDeath === "true",
  clientId: `js-${edgeNode}`,
  username: "",
  password: "",
});
let part = 0;
const say = (text) => process.stdout.write(`${text}\n`);

function birth() {
  edge.publishNodeBirth({ timestamp: Date.now(), metrics: [{ name: "uptime", type: "Int64", value: 12 }] });
  edge.publishDeviceBirth("lathe", {
    timestamp: Date.now(),
    metrics: [
      { name: "load", type: "Double", value: 37.5, properties: { engUnit: { type: "String", value: "%" } } },
      { name: "part", type: "Int32", value: part },
      { name: "mode", type: "String", value: null },
    ],
  });
  say("birth");
}

edge.on("birth", birth);
edge.on("ncmd", (payload) => {
  for (const metric of payload.metrics) say(`ncmd ${metric.name} ${metric.value}`);
  if (payload.metrics.some((metric) => metric.name === "Node Control/Rebirth" && metric.value === true)) birth();
});

for await (const line of createInterface({ input: process.stdin })) {
  const [word, count] = line.split(" ");
  if (word === "data") {
    for (let i = 0; i < Number(count); i += 1) {
      part += 1;
      edge.publishDeviceData("lathe", { timestamp: Date.now(), metrics: [{ name: "part", type: "Int32", value: part }] });
    }
    say(`data ${part}`);
  }
  if (word === "stop") {
    edge.stop();
    break;
  }
}
