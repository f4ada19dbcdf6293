// The shade of a gap: a class for each size in floors, as in the report.

const LEVELS = [1.3, 2, 3, 6, 12, 24];

export const shade = (floors) =>
  `h${LEVELS.findIndex((level) => floors < level) < 0 ? 6 : LEVELS.findIndex((level) => floors < level)}`;
