// Elements, made and written to. Text goes in as text only: nothing here parses HTML, so a program name cannot become an element.

const SVG = "http://www.w3.org/2000/svg";

/** An element: attributes by name (`class`, `on…` functions, `dataset`, properties of true/false), then its children. */
export function el(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "dataset") Object.assign(element.dataset, value);
    else if (key === "value" || key === "checked" || key === "disabled") element[key] = value;
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  element.append(...children.flat(3).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** One of the symbols in index.html, only to be looked at. */
export function symbol(id, className = "") {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("class", `symbol ${className}`);
  svg.setAttribute("aria-hidden", "true");
  const use = document.createElementNS(SVG, "use");
  use.setAttribute("href", `#${id}`);
  svg.append(use);
  return svg;
}

/** Points a symbol elsewhere, where it does not point there already. */
export function setSymbol(svg, id) {
  const use = svg.firstChild;
  if (use.getAttribute("href") !== `#${id}`) use.setAttribute("href", `#${id}`);
}

/** An SVG element. */
export function drawn(name, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes))
    if (value !== undefined && value !== null) element.setAttribute(key, value);
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** Writes a text only where it is another one. */
export function setText(element, text) {
  if (element.firstChild && element.firstChild === element.lastChild && element.firstChild.nodeType === 3) {
    if (element.firstChild.data !== text) element.firstChild.data = text;
  } else if (element.textContent !== text) element.textContent = text;
}

export function setClass(element, name, on) {
  if (element.classList.contains(name) !== on) element.classList.toggle(name, on);
}

export function setData(element, key, value) {
  if (value === null || value === undefined) {
    if (key in element.dataset) delete element.dataset[key];
  } else if (element.dataset[key] !== String(value)) element.dataset[key] = value;
}

export function setHidden(element, hidden) {
  if (element.hidden !== hidden) element.hidden = hidden;
}

export function setTitle(element, text) {
  if (element.title !== text) element.title = text;
}

/** A table that scrolls in itself: its first column names the row. cells: texts or elements; numbers: columns set to the right. */
/** The head of a column. One without a word is no head: a screen reader would read it as an empty one. */
export const columnHead = (text, isNumber = false) =>
  el(text ? "th" : "td", { scope: text ? "col" : null, class: isNumber ? "number" : null }, text);

export function table(heads, rows, { numbers = [], label = "", className = "" } = {}) {
  const side = (i) => (numbers.includes(i) ? "number" : null);
  const head = heads.map((text, i) => columnHead(text, numbers.includes(i)));
  const body = rows.map((cells) =>
    el(
      "tr",
      {},
      cells.map((cell, i) => (i ? el("td", { class: side(i) }, cell) : el("th", { scope: "row" }, cell))),
    ),
  );
  const whole = el("table", { class: className || null }, el("thead", {}, el("tr", {}, head)), el("tbody", {}, body));
  return el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": label }, whole);
}

/** Tells a screen reader, politely. */
export function say(text) {
  const said = document.getElementById("said");
  said.textContent = "";
  said.textContent = text;
}
