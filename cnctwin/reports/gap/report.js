// Lets a reader look at every part of a trace. What the page shows without it is the part that was chosen when it was made.
"use strict";

const NS = "http://www.w3.org/2000/svg";
const MISSING = 65535;
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;

function unpacked(series) {
  return Float64Array.from(new Uint16Array(bytes(series.data)), (v) => (v === MISSING ? NaN : series.low + series.step * v));
}

function traceOf(given) {
  const t = given.t ? Float64Array.from(new Float32Array(bytes(given.t))) : Float64Array.from({ length: given.n }, (_, i) => given.t0 + i * given.dt);
  const series = {};
  for (const name of ["measured", "before", "after"]) if (given[name]) series[name] = unpacked(given[name]);
  return { ...given, t, series, start: t[0], end: t[t.length - 1] };
}

/** Index of the first sample at or after a time. */
function indexAt(t, at) {
  let low = 0, high = t.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (t[middle] < at) low = middle + 1; else high = middle;
  }
  return low;
}

/** The value that [index, value] steps have at an index. */
function stepAt(steps, index) {
  let low = 0, high = steps.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (steps[middle][0] <= index) low = middle + 1; else high = middle;
  }
  return low ? steps[low - 1][1] : null;
}

function ticks(low, high, count) {
  const raw = (high - low) / Math.max(count, 1);
  if (!(raw > 0) || !isFinite(raw)) return [];
  const unit = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * unit).reduce((a, b) => (Math.abs(Math.log(b / raw)) < Math.abs(Math.log(a / raw)) ? b : a));
  const made = [];
  for (let n = Math.ceil(low / step - 1e-9); n <= Math.floor(high / step + 1e-9); n++) made.push(Number((n * step).toPrecision(12)));
  return made;
}

const written = (v, digits = 4) => (Number.isFinite(v) ? String(Number(v.toPrecision(digits))).replace("-", "−") : "–");
const anchor = (x) => (x < 15 ? "start" : x > 985 ? "end" : "middle");

function drawn(name, attributes, text) {
  const element = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

/** A path of at most two points a column of the screen, least and greatest, so that no peak is lost. */
function pathOf(t, value, first, last, x, y, columns) {
  const words = [];
  let down = false;
  const put = (px, v) => {
    if (Number.isNaN(v)) { down = false; return; }
    words.push((down ? "L" : "M") + px.toFixed(1) + " " + y(v).toFixed(1));
    down = true;
  };
  if (last - first <= 2 * columns) {
    for (let i = first; i < last; i++) put(x(t[i]), value(i));
    return words.join("");
  }
  for (let i = first; i < last;) {
    const column = Math.floor((x(t[i]) / 1000) * columns);
    let low = Infinity, high = -Infinity, lowAt = i, highAt = i;
    for (; i < last && Math.floor((x(t[i]) / 1000) * columns) === column; i++) {
      const v = value(i);
      if (v < low) { low = v; lowAt = i; }
      if (v > high) { high = v; highAt = i; }
    }
    const middle = ((column + 0.5) / columns) * 1000;
    if (low === Infinity) { put(middle, NaN); continue; }
    put(middle, lowAt < highAt ? low : high);
    put(middle, lowAt < highAt ? high : low);
  }
  return words.join("");
}

class Figure {
  constructor(figure, trace) {
    this.figure = figure;
    this.trace = trace;
    [this.low, this.high] = trace.window;
    this.charts = figure.querySelector(".charts");
    this.readout = figure.querySelector(".readout");
    this.panels = [...figure.querySelectorAll("[data-panel]")].map((element) => this.panelOf(element));
    figure.classList.add("live");
    for (const element of figure.querySelectorAll(".scripted")) element.hidden = false;
    figure.addEventListener("click", (event) => this.act(event.target.closest("[data-do]")?.dataset.do));
    this.charts.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.redraw()).observe(this.charts);
  }

  panelOf(element) {
    const plot = element.querySelector(".plot");
    const panel = { kind: element.dataset.panel, plot, labels: element.querySelector(".y"), height: plot.viewBox.baseVal.height };
    plot.addEventListener("pointerdown", (event) => this.pull(panel, event));
    if (panel.kind !== "overview") {
      panel.cursor = plot.appendChild(drawn("path", { class: "cursor" }));
      plot.addEventListener("pointermove", (event) => this.point(panel, event));
      plot.addEventListener("pointerleave", () => this.leave());
      plot.addEventListener("dblclick", () => this.act("chosen"));
    }
    return panel;
  }

  timeAt(panel, event) {
    const box = panel.plot.getBoundingClientRect();
    const part = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    const [low, high] = panel.kind === "overview" ? [this.trace.start, this.trace.end] : [this.low, this.high];
    return low + part * (high - low);
  }

  /** A drag across a chart picks what is looked at; one in the overview moves it, or jumps to where the pointer is. */
  pull(panel, event) {
    if (event.button !== 0) return;
    const from = this.timeAt(panel, event), [low, high] = [this.low, this.high];
    const shade = panel.kind === "overview" ? null : panel.plot.appendChild(drawn("rect", { class: "picked", y: 0, height: panel.height }));
    const width = high - low, inside = from >= low && from <= high;
    if (panel.kind === "overview" && !inside) this.show(from - width / 2, from + width / 2);
    const start = this.low;
    panel.plot.setPointerCapture(event.pointerId);
    const move = (moved) => {
      const at = this.timeAt(panel, moved);
      if (!shade) { this.show(start + at - from, start + at - from + width); return; }
      const x = (t) => (1000 * (t - low)) / (high - low);
      shade.setAttribute("x", x(Math.min(from, at)));
      shade.setAttribute("width", x(Math.max(from, at)) - x(Math.min(from, at)));
    };
    const end = (ended) => {
      panel.plot.removeEventListener("pointermove", move);
      panel.plot.removeEventListener("pointerup", end);
      panel.plot.removeEventListener("pointercancel", end);
      shade?.remove();
      const at = this.timeAt(panel, ended);
      if (shade && ended.type === "pointerup" && Math.abs(at - from) > 0.01 * width) this.show(Math.min(from, at), Math.max(from, at));
    };
    panel.plot.addEventListener("pointermove", move);
    panel.plot.addEventListener("pointerup", end);
    panel.plot.addEventListener("pointercancel", end);
  }

  act(what) {
    const middle = (this.low + this.high) / 2, width = this.high - this.low;
    const to = {
      earlier: () => [this.low - width / 4, this.high - width / 4],
      later: () => [this.low + width / 4, this.high + width / 4],
      closer: () => [middle - width / 4, middle + width / 4],
      wider: () => [middle - width, middle + width],
      whole: () => [this.trace.start, this.trace.end],
      chosen: () => this.trace.window,
    }[what];
    if (to) this.show(...to());
  }

  key(event) {
    const keys = { ArrowLeft: "earlier", ArrowRight: "later", "+": "closer", "=": "closer", "-": "wider", Home: "chosen", End: "whole" };
    const what = keys[event.key];
    if (!what || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.act(what);
  }

  /** Shows a part of the run, no shorter than 20 samples, within it. */
  show(low, high) {
    const { start, end, n } = this.trace;
    const width = Math.min(Math.max(high - low, (20 * (end - start)) / n), end - start);
    const at = Math.min(Math.max((low + high) / 2 - width / 2, start), end - width);
    [this.low, this.high] = [at, at + width];
    this.redraw();
  }

  redraw() {
    const { t } = this.trace;
    const first = Math.max(indexAt(t, this.low) - 1, 0), last = Math.min(indexAt(t, this.high) + 1, t.length);
    const x = (at) => (1000 * (at - this.low)) / (this.high - this.low);
    this.panels.forEach((panel) => (panel.kind === "overview" ? this.overview(panel) : this.panel(panel, first, last, x)));
    this.regimes(x, first, last);
    this.times(x);
    this.leave();
  }

  valueOf(kind, name) {
    const { measured, before, after } = this.trace.series;
    if (name === "measured") return (i) => measured[i];
    const gap = name === "before" ? before : after;
    return kind === "gap" ? (i) => gap[i] : (i) => measured[i] + gap[i] / this.trace.scale;
  }

  panel(panel, first, last, x) {
    const lines = [...panel.plot.querySelectorAll("[data-series]")].map((line) => [line, this.valueOf(panel.kind, line.dataset.series)]);
    let low = Infinity, high = -Infinity;
    const seen = (v) => { if (v < low) low = v; if (v > high) high = v; };
    for (const [, value] of lines) for (let i = first; i < last; i++) seen(value(i));
    const steps = panel.kind === "gap" ? this.floorSteps(first, last) : [];
    for (const [, , half] of steps) { seen(half); seen(-half); }
    if (low > high) [low, high] = [0, 1];
    const room = 0.06 * (high - low) || 0.5 * Math.abs(high) || 1;
    [low, high] = [low - room, high + room];
    const y = (v) => (panel.height * (high - v)) / (high - low);
    const columns = Math.max(100, Math.round(panel.plot.clientWidth || 900));
    for (const [line, value] of lines) line.setAttribute("d", pathOf(this.trace.t, value, first, last, x, y, columns));
    const area = ([from, to, half]) => `M${x(from).toFixed(1)} ${y(half).toFixed(1)}H${x(to).toFixed(1)}V${y(-half).toFixed(1)}H${x(from).toFixed(1)}z`;
    panel.plot.querySelector(".band")?.setAttribute("d", steps.map(area).join(""));
    const rows = ticks(low, high, Math.max(2, Math.floor(panel.height / 30)));
    const along = ticks(this.low, this.high, this.columnCount());
    panel.plot.querySelector(".grid").setAttribute("d", rows.map((v) => `M0 ${y(v).toFixed(1)}H1000`).concat(along.map((v) => `M${x(v).toFixed(1)} 0V${panel.height}`)).join(""));
    panel.plot.querySelector(".zero").setAttribute("d", low < 0 && high > 0 ? `M0 ${y(0).toFixed(1)}H1000` : "");
    const place = (v) => Math.min(Math.max(y(v) + 4, 10), panel.height - 1).toFixed(1);
    panel.labels.replaceChildren(...rows.map((v) => drawn("text", { x: "100%", dx: -8, y: place(v), "text-anchor": "end" }, written(v))));
  }

  /** [from, to, half height] of the floor, s and the unit of the gap. */
  floorSteps(first, last) {
    const { floor, t } = this.trace, made = [];
    floor.forEach(([index, value], k) => {
      const next = k + 1 < floor.length ? floor[k + 1][0] : t.length - 1;
      if (value !== null && next >= first && index < last) made.push([Math.max(t[index], this.low), Math.min(t[next], this.high), value]);
    });
    return made;
  }

  columnCount() {
    return Math.max(3, Math.round((this.charts.clientWidth - 64) / 120));
  }

  regimes(x, first, last) {
    const strip = this.figure.querySelector(".strip");
    if (!strip) return;
    const { regime, regimes, t } = this.trace, made = [];
    const wide = strip.clientWidth || 900;
    regime.forEach(([index, which], k) => {
      const next = k + 1 < regime.length ? regime[k + 1][0] : t.length - 1;
      if (next < first || index >= last || !(which in regimes)) return;
      const from = Math.max(x(t[index]), 0) / 10, to = Math.min(x(t[next]), 1000) / 10, name = regimes[which].replace(/ -$/, " −");
      const block = drawn("rect", { x: `${from}%`, width: `${Math.max(to - from, 0)}%`, y: 0, height: 16, class: `r${which % 6}` });
      block.append(drawn("title", {}, name));
      made.push(block);
      if (((to - from) / 100) * wide > 6.4 * name.length) made.push(drawn("text", { x: `${(from + to) / 2}%`, y: 12, "text-anchor": "middle" }, name));
    });
    strip.replaceChildren(...made);
  }

  times(x) {
    const axis = this.figure.querySelector(".time .x");
    const label = (v) => drawn("text", { x: `${x(v) / 10}%`, y: 14, "text-anchor": anchor(x(v)) }, written(v, 7));
    axis.replaceChildren(...ticks(this.low, this.high, this.columnCount()).map(label));
  }

  overview(panel) {
    const { start, end } = this.trace, x = (at) => (1000 * (at - start)) / (end - start);
    const [left, right] = [x(this.low), x(this.high)];
    panel.plot.querySelector(".window").setAttribute("x", left);
    panel.plot.querySelector(".window").setAttribute("width", Math.max(right - left, 1));
    panel.plot.querySelector(".outside").setAttribute("d", `M0 0H${left}V${panel.height}H0zM${right} 0H1000V${panel.height}H${right}z`);
  }

  point(panel, event) {
    const { t, series, regime, regimes, floor } = this.trace;
    const at = this.timeAt(panel, event);
    let i = Math.min(indexAt(t, at), t.length - 1);
    if (i > 0 && at - t[i - 1] < t[i] - at) i -= 1;
    const x = (1000 * (t[i] - this.low)) / (this.high - this.low);
    for (const other of this.panels) other.cursor?.setAttribute("d", `M${x} 0V${other.height}`);
    const unit = this.figure.dataset.unit, signed = (v) => (v > 0 ? "+" : "") + written(v, 3);
    const parts = [`${written(t[i], 6)} s`, regimes[stepAt(regime, i)]?.replace(/ -$/, " −"), `measured ${written(series.measured[i], 5)} ${this.figure.dataset.own}`];
    parts.push(series.after ? `gap ${signed(series.before[i])} → ${signed(series.after[i])} ${unit}` : `gap ${signed(series.before[i])} ${unit}`);
    parts.push(`floor ${written(stepAt(floor, i), 3)} ${unit}`);
    this.readout.textContent = parts.filter(Boolean).join(" · ");
  }

  leave() {
    for (const panel of this.panels) panel.cursor?.setAttribute("d", "");
    const parts = [`${written(this.low, 5)} to ${written(this.high, 5)} s of ${written(this.trace.end - this.trace.start, 5)} s`];
    this.readout.textContent = parts.join("");
  }
}

const samples = document.getElementById("samples");
const given = samples ? JSON.parse(samples.textContent) : [];
for (const element of document.querySelectorAll("section > .scripted")) element.hidden = false;
for (const figure of document.querySelectorAll("[data-trace]")) new Figure(figure, traceOf(given[figure.dataset.trace]));

for (const button of document.querySelectorAll("[data-copy]")) {
  const source = document.getElementById(button.dataset.copy);
  button.hidden = false;
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(source.textContent);
      button.textContent = "Copied";
    } catch {
      getSelection().selectAllChildren(source);
      button.textContent = "Selected: copy with Ctrl C";
    }
    setTimeout(() => { button.textContent = "Copy"; }, 2500);
  });
}
