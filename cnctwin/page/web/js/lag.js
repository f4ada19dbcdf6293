// The lag of the paint: from the stamp of a value to the moment after the frame that shows it was painted.
// The last SAMPLES_MAX of them are kept. The browser's clock is set by the server's, see clock.js.

import { serverNow } from "./clock.js";

const SAMPLES_MAX = 4096;
const samples = new Float32Array(SAMPLES_MAX);
let count = 0;
let pending = [];
const channel = new MessageChannel();
channel.port1.onmessage = () => {
  const now = serverNow();
  for (const t of pending) samples[count++ % SAMPLES_MAX] = now - t;
  pending = [];
};

/** Values with these stamps are in the DOM by the end of this frame. Call it on an animation frame. */
export function painted(stamps) {
  if (!stamps.length) return;
  pending = pending.length ? pending.concat(stamps) : stamps;
  if (pending.length > SAMPLES_MAX) pending = pending.slice(-SAMPLES_MAX);
  // A task that is posted on a frame runs after that frame was painted.
  channel.port2.postMessage(0);
}

/** {count, median, p95, max} in ms of what is kept; null of nothing. */
export function lag() {
  const kept = samples.slice(0, Math.min(count, SAMPLES_MAX)).sort();
  if (!kept.length) return null;
  const at = (share) => kept[Math.min(kept.length - 1, Math.floor(share * kept.length))];
  return { count, median: at(0.5), p95: at(0.95), max: kept[kept.length - 1] };
}

export function forget() {
  count = 0;
}
