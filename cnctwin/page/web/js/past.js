// The past of a machine, asked for in columns, as a machine that can be charted.

import { get, part, query } from "./api.js";
import { CONTEXT, SCORES, TILES } from "./charted.js";
import { Machine } from "./plant.js";
import { unitWord } from "./text.js";
import { ALERT_STATE, ANOMALY_ALARM, TWIN_PREFIX } from "./vocabulary.js";

const COLUMNS = 1200;
const AT_ONCE_MAX = 60;
const LIMIT_MS = 30000;
const MORE = [
  "feed_mm_min",
  "spindle_rpm",
  "spindle_rpm_cmd",
  "alarm",
  ALERT_STATE,
  ANOMALY_ALARM,
  ...Object.values(SCORES),
];

/** All that is wanted of a stretch, in as many questions as the interface takes at once. */
export async function columnsOf(known, start, finish, chosen, signal) {
  const charted = TILES.flatMap((tile) => [...tile.own, tile.twin, tile.residual, tile.learned]);
  const numbers = [...known.values].filter(([, held]) => typeof held.value === "number").map(([one]) => one);
  const wanted = [...new Set([...CONTEXT, ...MORE, ...charted, chosen, ...numbers])]
    .filter((one) => one && (known.values.size === 0 || known.values.has(one)))
    .slice(0, 2 * AT_ONCE_MAX);
  const every = Math.max(100, Math.ceil((finish - start) / COLUMNS / 100) * 100);
  const asked = [];
  for (let i = 0; i < wanted.length; i += AT_ONCE_MAX) {
    const stretch = { signals: wanted.slice(i, i + AT_ONCE_MAX).join(","), from: start, to: finish, every_ms: every };
    asked.push(get(query(`history/${part(known.name)}`, stretch), { signal, limitMs: LIMIT_MS }));
  }
  const answers = await Promise.all(asked);
  const columns = answers.flatMap((answer) => answer.columns ?? []);
  await addBefore(known.name, columns, start, signal);
  return { every, source: answers[0]?.source, columns };
}

/** A value that does not change is not told again: what held at the start is looked for in the hour before, then in the day. */
export async function addBefore(name, columns, start, signal) {
  for (const [back, every] of [
    [3600000, 1000],
    [86400000, 60000],
  ]) {
    const missing = columns.filter((column) => !column.t.length || column.t[0] > start + 2000).map((column) => column.signal);
    if (!missing.length) return;
    const stretch = { signals: missing.slice(0, 50).join(","), from: start - back, to: start, every_ms: every };
    const earlier = await get(query(`history/${part(name)}`, stretch), { signal, limitMs: LIMIT_MS }).catch(() => null);
    for (const column of earlier?.columns ?? []) {
      const own = columns.find((one) => one.signal === column.signal);
      const last = column.t.length - 1;
      if (!own || last < 0) continue;
      own.unit ??= column.unit;
      for (const key of ["value", "quality", "reason"]) own[key].unshift(column[key]?.[last] ?? null);
      own.t.unshift(start);
    }
  }
}

/** A machine that has lived through these columns, up to the newest moment that is known of it. What a signal means is taken from
 * what is known of it now. */
export function livedThrough(known, columns) {
  const past = new Machine(known.name);
  past.until = Math.max(known.knownUntil(), ...columns.map((column) => column.t?.at(-1) ?? -Infinity));
  for (const column of columns) {
    if (!column.t?.length) continue;
    past.backfill(column);
    const held = known.value(column.signal);
    const last = column.t.length - 1;
    past.values.set(column.signal, {
      value: column.value[last],
      t: column.t[last],
      unit: column.unit ? unitWord(column.unit) : (held?.unit ?? null),
      quality: "good",
      reason: column.reason?.[last] ?? null,
      provenance: held?.provenance ?? (column.signal.startsWith(TWIN_PREFIX) ? "inferred" : "measured"),
      meaning: held?.meaning ?? null,
    });
  }
  past.online = true;
  return past;
}
