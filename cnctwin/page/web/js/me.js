// Who looks at the page, and what the role may do. The server decides; the page only does not offer what would be refused.

import { get } from "./api.js";
import { lookup } from "./lookup.js";

const RANK = lookup({ reader: 1, operator: 2, administrator: 3 });

/** user: null where nobody has a name; role: null until it is known; logsOut: whether there is a session to end. */
export const me = { user: null, role: null, logsOut: false };

export async function askMe() {
  try {
    const told = await get("whoami");
    Object.assign(me, { user: told.user ?? null, role: told.role ?? null, logsOut: told.logs_out === true });
  } catch {
    Object.assign(me, { user: null, role: null, logsOut: false }); // the log-in, or the stream, tells what is wrong
  }
}

/** True where the role may, or is not known yet. */
export const may = (role) => me.role === null || (RANK[me.role] ?? 0) >= RANK[role];

const article = (role) => `${role === "reader" ? "a" : "an"} ${role}`;

/** Why something is not offered, in a sentence. */
export const whyNot = (role, deed) => `You are ${article(me.role)}${me.user ? ` (${me.user})` : ""}: ${deed} takes ${article(role)}.`;
