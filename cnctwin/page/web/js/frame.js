// The DOM is written on animation frames only, and each writer at most once a frame.

const waiting = new Set();
let asked = false;

function run(stamp) {
  asked = false;
  const now = [...waiting];
  waiting.clear();
  for (const write of now) write(stamp);
}

/** Calls `write` on the next frame; asked for twice, it is called once. */
export function onFrame(write) {
  waiting.add(write);
  if (!asked) {
    asked = true;
    requestAnimationFrame(run);
  }
}

/** Forgets a writer whose view is gone. */
export function offFrame(write) {
  waiting.delete(write);
}

/** `write`, asked for as often as you like, called at most so many times a second, on a frame; the last call is never lost. */
export function atMost(perSecond, write) {
  let last = -Infinity,
    timer = 0;
  const go = () => {
    timer = 0;
    onFrame(written);
  };
  const written = (stamp) => {
    last = performance.now();
    write(stamp);
  };
  const ask = () => {
    if (timer) return;
    const wait = 1000 / perSecond - (performance.now() - last);
    if (wait <= 4) onFrame(written);
    else timer = setTimeout(go, wait);
  };
  ask.stop = () => {
    clearTimeout(timer);
    timer = 0;
    offFrame(written);
  };
  return ask;
}
