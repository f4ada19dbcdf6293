// The last samples of a number, oldest first: bounded, appended to, and filled up at the front from the store.

export class Ring {
  constructor(capacity = 4096, capacityMax = 20000) {
    this.capacityMax = capacityMax;
    this.t = new Float64Array(capacity);
    this.v = new Float64Array(capacity);
    this.start = 0;
    this.length = 0;
  }

  /** A value as of t, NaN = none. Not after the last one: it stands in for it where it is of the same time, else it is left out. */
  push(t, v) {
    if (this.length) {
      const last = this.start + this.length - 1,
        at = last % this.t.length;
      if (t < this.t[at]) return false;
      if (t === this.t[at]) {
        this.v[at] = v;
        return true;
      }
    }
    if (this.length === this.t.length) this.#grow();
    const at = (this.start + this.length) % this.t.length;
    this.t[at] = t;
    this.v[at] = v;
    if (this.length < this.t.length) this.length += 1;
    else this.start = (this.start + 1) % this.t.length;
    return true;
  }

  #grow() {
    if (this.t.length >= this.capacityMax) return;
    const capacity = Math.min(this.capacityMax, this.t.length * 2);
    const [t, v] = [new Float64Array(capacity), new Float64Array(capacity)];
    for (let i = 0; i < this.length; i++) [t[i], v[i]] = [this.timeAt(i), this.valueAt(i)];
    [this.t, this.v, this.start] = [t, v, 0];
  }

  timeAt(i) {
    return this.t[(this.start + i) % this.t.length];
  }
  valueAt(i) {
    return this.v[(this.start + i) % this.t.length];
  }
  get first() {
    return this.length ? this.timeAt(0) : Infinity;
  }
  get last() {
    return this.length ? this.timeAt(this.length - 1) : -Infinity;
  }

  /** Index of the first sample at or after t. */
  indexAt(t) {
    let low = 0,
      high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.timeAt(middle) < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Samples from the store, oldest first, put where there are none: before the first one, and into holes (NaN until the next). */
  merge(times, values) {
    const t = [],
      v = [],
      own = this.length;
    let i = 0,
      open = true;
    for (let k = 0; k <= own; k++) {
      const until = k < own ? this.timeAt(k) : open && own ? Infinity : own ? -Infinity : Infinity;
      while (i < times.length && times[i] < until) {
        if (open) {
          t.push(times[i]);
          v.push(values[i]);
        }
        i += 1;
      }
      if (k === own) break;
      const value = this.valueAt(k),
        isHole = Number.isNaN(value),
        filled = isHole && i < times.length && (k + 1 === own || times[i] < this.timeAt(k + 1));
      if (!filled) {
        t.push(this.timeAt(k));
        v.push(value);
      }
      open = isHole;
    }
    const skipped = Math.max(0, t.length - this.capacityMax);
    const capacity = Math.min(this.capacityMax, Math.max(this.t.length, t.length));
    [this.t, this.v, this.start, this.length] = [new Float64Array(capacity), new Float64Array(capacity), 0, t.length - skipped];
    for (let k = 0; k < this.length; k++) [this.t[k], this.v[k]] = [t[k + skipped], v[k + skipped]];
  }

  /** Nothing is known from t on, until the next sample. */
  hole(t) {
    if (this.length && !Number.isNaN(this.valueAt(this.length - 1))) this.push(Math.max(t, this.last + 1), NaN);
  }

  /** [times, values] from `from` on, with the sample before it, which holds until then. */
  since(from, to = Infinity) {
    const first = Math.max(0, this.indexAt(from) - 1),
      [t, v] = [[], []];
    for (let i = first; i < this.length; i++) {
      const at = this.timeAt(i);
      if (at > to) break;
      t.push(at);
      v.push(this.valueAt(i));
    }
    return [t, v];
  }
}

/** Changes of a text or a yes/no: {t, value}, bounded. */
export class Steps {
  constructor(max = 2000) {
    this.max = max;
    this.items = [];
  }

  get first() {
    return this.items.length ? this.items[0].t : Infinity;
  }

  push(t, value) {
    const last = this.items[this.items.length - 1];
    if (last && t < last.t) return;
    if (last && last.value === value) return;
    if (last && last.t === t) last.value = value;
    else this.items.push({ t, value });
    if (this.items.length > this.max) this.items.splice(0, this.items.length - this.max);
  }

  /** Changes from the store, put where there are none: before the first one, and into holes (null until the next). */
  merge(times, values) {
    const given = times.map((t, k) => ({ t, value: values[k] })),
      all = [...this.items.map((item) => ({ ...item, own: true })), ...given].sort((a, b) => a.t - b.t || (a.own ? -1 : 1));
    const merged = new Steps(this.max);
    let isOpen = true;
    for (const { t, value, own } of all) {
      if (own) isOpen = value === null;
      if (own || isOpen) merged.push(t, value);
    }
    this.items = merged.items;
  }

  hole(t) {
    const last = this.items[this.items.length - 1];
    if (last && last.value !== null) this.push(Math.max(t, last.t + 1), null);
  }

  /** The value that holds at t; undefined before the first. */
  at(t) {
    let low = 0,
      high = this.items.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.items[middle].t <= t) low = middle + 1;
      else high = middle;
    }
    return low ? this.items[low - 1].value : undefined;
  }

  /** [from, to, value] of each stretch that touches [from, to]; the last one lasts until `to`. */
  stretches(from, to) {
    const made = [];
    this.items.forEach(({ t, value }, i) => {
      const end = i + 1 < this.items.length ? this.items[i + 1].t : to;
      if (end >= from && t <= to) made.push([Math.max(t, from), Math.min(end, to), value]);
    });
    return made;
  }
}
