// The server's clock as the browser knows it, so that a tablet whose clock is wrong still shows the right ages.
// Each message says when it was sent; the largest of (sent − received) of the last minute is the offset with the least delay on the way.

const KEPT_MS = 60000;
let offset = 0;
let heardAt = -Infinity;
let heard = false;

/** A message that was sent at `now` by the server's clock has come. */
export function heardClock(now) {
  const one = now - Date.now(),
    at = performance.now();
  if (!heard || one > offset || at - heardAt > KEPT_MS) {
    offset = one;
    heardAt = at;
    heard = true;
  }
}

/** ms since 1970 by the server's clock. Where the two differ by no more than the way takes, it is the browser's own. */
export function serverNow() {
  return Math.abs(offset) <= 50 ? Date.now() : Date.now() + offset;
}

/** Server minus browser in ms. */
export const clockOffset = () => offset;
