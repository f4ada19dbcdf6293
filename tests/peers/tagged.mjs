// JSON for what JSON cannot say: 64-bit numbers {"long": "…"}, bytes {"bytes": hex}, odd floats {"float": "NaN"}.
import { createInterface } from "node:readline";
import Long from "long";

export function toTagged(value) {
  if (Long.isLong(value)) return { long: value.toString() };
  if (value instanceof Uint8Array) return { bytes: Buffer.from(value).toString("hex") };
  if (typeof value === "number" && (!Number.isFinite(value) || Object.is(value, -0))) {
    return { float: Object.is(value, -0) ? "-0.0" : String(value) };
  }
  if (Array.isArray(value)) return value.map(toTagged);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, toTagged(inner)]));
}

export function fromTagged(value) {
  if (Array.isArray(value)) return value.map(fromTagged);
  if (value === null || typeof value !== "object") return value;
  const keys = Object.keys(value);
  if (keys.length === 1 && keys[0] === "long") return Long.fromString(value.long, !value.long.startsWith("-"));
  if (keys.length === 1 && keys[0] === "bytes") return new Uint8Array(Buffer.from(value.bytes, "hex"));
  if (keys.length === 1 && keys[0] === "float") return Number(value.float);
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, fromTagged(inner)]));
}

// Answers each line of stdin with one line of JSON: what `answer` says, or {"error": why}.
export async function serve(answer) {
  for await (const line of createInterface({ input: process.stdin })) {
    let said;
    try {
      said = answer(line);
    } catch (error) {
      said = { error: String(error.message) };
    }
    process.stdout.write(`${JSON.stringify(said)}\n`);
  }
}
