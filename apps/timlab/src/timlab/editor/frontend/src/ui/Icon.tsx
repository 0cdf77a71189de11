/** Small drawings for buttons, in a square of 16. */
const PATHS = {
  play: "M5 3l8 5-8 5z",
  pause: "M5 3v10M11 3v10",
  tick: "M4 3l6 5-6 5zM12.5 3v10",
  reset: "M3.5 8a4.5 4.5 0 1 0 1.4-3.3M3.2 2.8v2.8H6",
  undo: "M6 3L3 6l3 3M3 6h6a4 4 0 0 1 0 8H7",
  redo: "M10 3l3 3-3 3M13 6H7a4 4 0 0 0 0 8h2",
  save: "M3 3h8l2 2v8H3zM5.5 3v3.5h4V3M5.5 13V9.5h5V13",
  open: "M2 13V3.5h4l1.5 1.5H13V7M2 13l2-6h11l-2 6z",
  add: "M4 2.5h5.5L12.5 6v7.5H4zM9.5 2.5V6h3",
  gallery: "M2.5 2.5h4.5v4.5H2.5zM9 2.5h4.5v4.5H9zM2.5 9h4.5v4.5H2.5zM9 9h4.5v4.5H9z",
  help: "M5.5 6a2.5 2.5 0 1 1 3.6 2.2c-.8.4-1.1.8-1.1 1.8M8 12.5v.5",
  theme: "M8 2.5a5.5 5.5 0 1 0 0 11zM8 2.5a5.5 5.5 0 0 1 0 11",
  left: "M2.5 3h11v10h-11zM6 3v10",
  right: "M2.5 3h11v10h-11zM10 3v10",
  bottom: "M2.5 3h11v10h-11zM2.5 9h11",
  layout: "M2 6h4v4H2zM10 2h4v4h-4zM10 10h4v4h-4zM6 8h2M8 4v8M8 4h2M8 12h2",
  fork: "M4 13V3M4 9c4 0 6-1 6-5M10 2v3M8 4l2-2 2 2",
  close: "M4 4l8 8M12 4l-8 8",
  search: "M7 2.5a4.5 4.5 0 1 0 0 9 4.5 4.5 0 0 0 0-9zM10.5 10.5L14 14",
} as const;

export type IconName = keyof typeof PATHS;

const FILLED = new Set<IconName>(["play"]);

export function Icon({ name }: { name: IconName }) {
  return (
    <svg className="icon" viewBox="0 0 16 16" aria-hidden="true">
      <path d={PATHS[name]} className={FILLED.has(name) ? "filled" : ""} />
    </svg>
  );
}
