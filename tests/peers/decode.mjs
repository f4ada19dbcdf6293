// Payloads in hex on stdin, one a line; what sparkplug-payload makes of them on stdout, as JSON.
import sparkplug from "sparkplug-payload";
import { serve, toTagged } from "./tagged.mjs";

const codec = sparkplug.get("spBv1.0");
await serve((line) => ({ payload: toTagged(codec.decodePayload(Buffer.from(line, "hex"))) }));
