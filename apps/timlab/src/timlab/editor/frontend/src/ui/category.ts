/** A hue for each heading of the palette; colour helps, but nothing depends on it. */
const HUES: Record<string, string> = {
  sources: "var(--green)",
  sinks: "var(--sky)",
  learning: "var(--vermilion)",
  "bodies and worlds": "var(--purple)",
  dynamics: "var(--blue)",
  logic: "var(--ochre)",
  subsystems: "var(--ink)",
};

export const hueOf = (category: string): string => HUES[category] ?? "var(--slate)";
