// A table that is asked with words from a machine: it has the keys that were put into it and no others. A plain object has
// `constructor`, `toString` and `__proto__` besides, and a machine may call its state so.

export const lookup = (entries) => Object.freeze(Object.assign(Object.create(null), entries));
