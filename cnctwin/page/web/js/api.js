// Questions to the API. Every one has a time limit; every error is one line that names what was asked.

export class ApiError extends Error {
  constructor(status, text) {
    super(text);
    this.status = status;
  }
}

/** The log-in that is asked for when the API says 401. */
export const login = { needed: () => {} };

async function ask(path, options, limitMs) {
  const stop = new AbortController();
  const timer = setTimeout(() => stop.abort(), limitMs);
  const outer = options.signal;
  const forward = () => stop.abort();
  if (outer?.aborted) stop.abort();
  outer?.addEventListener("abort", forward);
  try {
    const answer = await fetch(path, {
      ...options,
      signal: stop.signal,
      headers: { Accept: "application/json", ...options.headers },
      credentials: "same-origin",
      cache: "no-store",
    });
    if (answer.status === 401) {
      login.needed();
      throw new ApiError(401, "not logged in");
    }
    const text = await answer.text();
    const body = text && (answer.headers.get("content-type") ?? "").includes("json") ? JSON.parse(text) : null;
    if (!answer.ok) throw new ApiError(answer.status, told(body) || `${path.split("?")[0]}: the server says ${answer.status}`);
    return body;
  } catch (error) {
    if (error instanceof ApiError) throw error;
    if (outer?.aborted) throw new ApiError(-1, "no longer wanted");
    if (stop.signal.aborted) throw new ApiError(0, `no answer within ${limitMs / 1000} s`);
    throw new ApiError(0, "the server cannot be reached");
  } finally {
    clearTimeout(timer);
    outer?.removeEventListener("abort", forward);
  }
}

/** The message of an error body, in one line. */
function told(body) {
  if (!body) return "";
  if (typeof body.error === "string") return body.error;
  if (typeof body.error?.message === "string") return body.error.message;
  if (typeof body.detail === "string") return body.detail;
  if (Array.isArray(body.detail)) return body.detail.map((one) => `${(one.loc ?? []).join(".")}: ${one.msg}`).join("; ");
  return "";
}

export const get = (path, { signal, limitMs = 10000 } = {}) => ask(path, { signal }, limitMs);

export const post = (path, body, { signal, limitMs = 15000 } = {}) =>
  ask(path, { method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" }, signal }, limitMs);

/** `path` with these parameters; those without a value are left out. */
export function query(path, parameters) {
  const given = Object.entries(parameters).filter(([, value]) => value !== null && value !== undefined && value !== "");
  return given.length ? `${path}?${new URLSearchParams(given)}` : path;
}

export const part = encodeURIComponent;
