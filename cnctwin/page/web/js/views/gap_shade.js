// The shade of a gap: a class for each multiple of the repeatability, as in the report.

const LEVELS = [1.3, 2, 3, 6, 12, 24];

export const shade = (gap) => `h${LEVELS.findIndex((level) => gap < level) < 0 ? 6 : LEVELS.findIndex((level) => gap < level)}`;
