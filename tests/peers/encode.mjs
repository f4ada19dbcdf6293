// Payloads as JSON on stdin, one a line; the bytes that sparkplug-payload makes of them on stdout, {"hex": "…"}.
import sparkplug from "sparkplug-payload";
import { fromTagged, serve } from "./tagged.mjs";

const codec = sparkplug.get("spBv1.0");
await serve((line) => ({ hex: Buffer.from(codec.encodePayload(fromTagged(JSON.parse(line)))).toString("hex") }));
