// One panel of time: uPlot with what a machine needs around it. Values hold until the next one (report by exception), so lines are
// steps; where a value is unknown the line ends. Behind the lines: tool changes (gates) shaded, stale stretches hatched. Over them:
// tools, the threshold, and the moment that is looked at.

import { digits } from "./text.js";

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const themes = new Set();
let theme = null;

function colours() {
  theme ??= Object.fromEntries(
    ["ink", "soft", "line", "raised", "paper", "before", "after", "measured", "gate", "hatch", "alarm", "focus"].map((name) => [
      name,
      css(`--${name}`),
    ]),
  );
  return theme;
}

const dark = matchMedia("(prefers-color-scheme: dark)");
dark.addEventListener("change", () => {
  theme = null;
  for (const chart of themes) chart.retheme();
});

const FONT = (px) => `${px}px Inter, system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif`;
const two = (value) => String(value).padStart(2, "0");

function tickTexts(splits) {
  const withSeconds = splits.length > 1 && splits[1] - splits[0] < 60000;
  const days = splits.length > 1 && splits[splits.length - 1] - splits[0] > 86400000;
  return splits.map((t) => {
    const at = new Date(t);
    const time = `${two(at.getHours())}:${two(at.getMinutes())}${withSeconds ? `:${two(at.getSeconds())}` : ""}`;
    return days ? `${two(at.getDate())}. ${time}` : time;
  });
}

const MINUTE = 60000,
  HOUR = 3600000;
const STEPS = [
  100,
  200,
  500,
  1000,
  2000,
  5000,
  10000,
  15000,
  30000,
  MINUTE,
  2 * MINUTE,
  5 * MINUTE,
  10 * MINUTE,
  15 * MINUTE,
  30 * MINUTE,
  HOUR,
  2 * HOUR,
  3 * HOUR,
  6 * HOUR,
  12 * HOUR,
  24 * HOUR,
  48 * HOUR,
  168 * HOUR,
];

/** The values of all series on the times of all: undefined where a series has no sample there (it goes on), null where it is unknown. */
export function aligned(series) {
  const times = [...new Set(series.flatMap(([t]) => t))].sort((a, b) => a - b);
  const columns = series.map(([t, v]) => {
    const column = new Array(times.length);
    for (let i = 0, k = 0; k < t.length; k++) {
      while (times[i] < t[k]) i++;
      column[i] = Number.isNaN(v[k]) ? null : v[k];
    }
    return column;
  });
  return [times, ...columns];
}

export class Chart {
  /**
   * lines: [{label, colour: name of a theme colour, width, dash, fill}]
   * zero: whether 0 is always in sight; low, high: limits that are always in sight; axis: whether the time is written below
   * roof: room above the lines for the tools' names
   */
  constructor(
    host,
    {
      lines,
      height,
      roof = false,
      unit = "",
      zero = false,
      low = null,
      high = null,
      axis = true,
      sync = null,
      format = null,
      onCursor = null,
      label = "",
    },
  ) {
    this.options = { lines, roof, unit, zero, low, high, axis, sync, format, onCursor };
    this.host = host;
    this.height = height;
    this.marks = { gates: [], stale: [], tools: [], threshold: null, at: null };
    this.range = [0, 1];
    this.data = [[0], ...lines.map(() => [null])];
    this.host.setAttribute("role", "img");
    this.host.setAttribute("aria-label", label);
    this.resize = new ResizeObserver(() => this.#size());
    this.resize.observe(host);
    themes.add(this);
    this.#make();
  }

  #make() {
    const { lines, axis, sync, format, onCursor } = this.options,
      c = colours();
    const width = Math.max(120, Math.floor(this.host.clientWidth || 600));
    const grid = { stroke: c.line, width: 1 };
    const common = { stroke: c.soft, font: FONT(12), grid, ticks: { show: false } };
    const options = {
      width,
      height: this.height,
      ms: 1,
      pxAlign: 1,
      padding: [8, 10, axis ? 0 : 6, 0],
      legend: { show: false },
      cursor: {
        x: true,
        y: false,
        drag: { setScale: false, x: false, y: false },
        points: { size: 7 },
        ...(sync ? { sync: { key: sync, setSeries: false } } : {}),
        focus: { prox: -1 },
      },
      select: { show: false },
      scales: { x: { time: true, range: () => this.range }, y: { range: (_, low, high) => this.#yRange(low, high) } },
      axes: [
        { ...common, show: axis, size: 26, gap: 4, incrs: STEPS, space: 80, values: (_, splits) => tickTexts(splits) },
        {
          ...common,
          size: 56,
          gap: 6,
          space: this.height < 100 ? 17 : 26,
          values: (_, splits) => splits.map((v) => digits(v, 6)),
        },
      ],
      series: [
        {},
        ...lines.map((line) => ({
          label: line.label,
          stroke: c[line.colour],
          width: line.width ?? 2,
          dash: line.dash,
          points: { show: false },
          spanGaps: false,
          fill: line.fill ? `${c[line.colour]}22` : undefined,
          paths: window.uPlot.paths.stepped({ align: 1 }),
          value: (_, v) => (v === null ? "–" : format ? format(v) : v),
        })),
      ],
      hooks: {
        drawClear: [(u) => this.#behind(u)],
        draw: [(u) => this.#over(u)],
        setCursor: onCursor ? [(u) => onCursor(u.cursor.left >= 0 ? u.posToVal(u.cursor.left, "x") : null)] : [],
      },
    };
    this.plot = new window.uPlot(options, this.data, this.host);
  }

  #yRange(low, high) {
    const { zero, low: least, high: most } = this.options;
    let [from, to] = [low, high];
    if (!Number.isFinite(from) || !Number.isFinite(to)) [from, to] = [0, 1];
    const threshold = this.marks.threshold;
    if (Number.isFinite(threshold)) [from, to] = [Math.min(from, threshold), Math.max(to, threshold)];
    if (zero) [from, to] = [Math.min(from, 0), Math.max(to, 0)];
    if (least !== null) from = Math.min(from, least);
    if (most !== null) to = Math.max(to, most);
    const size = Math.max(Math.abs(from), Math.abs(to));
    const least_span = Math.max(1e-9, size * 1e-3);
    const room = to - from > least_span ? 0.08 * (to - from) : 0.5 * (size * 0.02 || 1);
    // Room below 0 only where something is below 0.
    return [zero && from === 0 ? 0 : from - room, to + (this.options.roof ? 2.5 * room : room)];
  }

  #behind(u) {
    const { ctx, bbox } = u,
      c = colours(),
      px = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = c.raised;
    ctx.fillRect(bbox.left, bbox.top, bbox.width, bbox.height);
    const x = (t) => u.valToPos(t, "x", true);
    ctx.fillStyle = c.gate;
    for (const [from, to] of this.marks.gates) ctx.fillRect(x(from), bbox.top, Math.max(px, x(to) - x(from)), bbox.height);
    for (const [from, to] of this.marks.stale) {
      const [left, right] = [x(from), x(to)];
      ctx.save();
      ctx.beginPath();
      ctx.rect(left, bbox.top, right - left, bbox.height);
      ctx.clip();
      ctx.strokeStyle = c.hatch;
      ctx.lineWidth = px;
      ctx.beginPath();
      const step = 9 * px;
      for (let at = Math.floor((left - bbox.height) / step) * step; at < right; at += step) {
        ctx.moveTo(at, bbox.top + bbox.height);
        ctx.lineTo(at + bbox.height, bbox.top);
      }
      ctx.stroke();
      ctx.restore();
    }
    ctx.restore();
  }

  #over(u) {
    const { ctx, bbox } = u,
      c = colours(),
      px = devicePixelRatio;
    const x = (t) => u.valToPos(t, "x", true),
      [from, to] = this.range;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.font = FONT(11 * px);
    ctx.textBaseline = "top";
    ctx.textAlign = "left";
    const { threshold } = this.marks;
    if (Number.isFinite(threshold)) {
      const y = Math.round(u.valToPos(threshold, "y", true));
      ctx.strokeStyle = c.alarm;
      ctx.setLineDash([6 * px, 4 * px]);
      ctx.lineWidth = 1.5 * px;
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
      ctx.setLineDash([]);
    }
    let free = -Infinity;
    for (const { t, text } of this.marks.tools) {
      if (t < from || t > to) continue;
      const at = Math.round(x(t));
      ctx.fillStyle = c.soft;
      ctx.fillRect(at, bbox.top, px, 15 * px);
      const wide = ctx.measureText(text).width + 6 * px;
      if (at < free) continue;
      free = at + wide + 2 * px;
      ctx.fillText(text, at + 4 * px, bbox.top + 3 * px);
    }
    if (this.marks.at !== null) {
      ctx.fillStyle = c.focus;
      ctx.fillRect(Math.round(x(this.marks.at)) - px, bbox.top, 2 * px, bbox.height);
    }
    ctx.restore();
  }

  #size() {
    const width = Math.floor(this.host.clientWidth);
    if (width > 0 && width !== this.plot.width) this.plot.setSize({ width, height: this.height });
  }

  /** Draws data ([times, values, …]) from `from` to `to`, with what else there is to mark. */
  show(data, range, marks = {}) {
    this.data = data;
    this.range = range;
    Object.assign(this.marks, marks);
    this.plot.setData(data, true);
  }

  /** Moves the line of the moment that is looked at. */
  pointAt(t) {
    this.marks.at = t;
    this.plot.redraw(false, false);
  }

  retheme() {
    this.plot.destroy();
    this.#make();
  }

  destroy() {
    themes.delete(this);
    this.resize.disconnect();
    this.plot.destroy();
  }
}

/** A line of the last minutes in a small canvas: [times, values] from `from` to `to`, its top at `top`. */
export function sparkline(canvas, [t, v], [from, to], top, gates = []) {
  const px = devicePixelRatio,
    width = Math.round(canvas.clientWidth * px),
    height = Math.round(canvas.clientHeight * px);
  if (!width || !height) return;
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const ctx = canvas.getContext("2d"),
    c = colours();
  ctx.clearRect(0, 0, width, height);
  const x = (at) => (width * (at - from)) / (to - from),
    y = (value) => height - px - ((height - 2 * px) * Math.min(Math.max(value, 0), top)) / top;
  ctx.fillStyle = c.gate;
  for (const [a, b] of gates) ctx.fillRect(x(a), 0, Math.max(px, x(b) - x(a)), height);
  ctx.strokeStyle = c.ink;
  ctx.lineWidth = 1.3 * px;
  ctx.lineJoin = "round";
  ctx.beginPath();
  let down = false,
    before = 0;
  for (let i = 0; i < t.length; i++) {
    if (Number.isNaN(v[i])) {
      if (down) ctx.lineTo(x(t[i]), before);
      down = false;
      continue;
    }
    const at = Math.max(0, x(t[i])),
      high = y(v[i]);
    if (down) ctx.lineTo(at, before);
    else ctx.moveTo(at, high);
    ctx.lineTo(at, high);
    [down, before] = [true, high];
  }
  if (down) ctx.lineTo(width, before);
  ctx.stroke();
}
