import type { Sheet } from "./sheet";

export interface Frame {
  x: (value: number) => number;
  y: (value: number) => number;
}

const MARGIN = { left: 42, right: 10, top: 8, bottom: 22 };

/** Round numbers between two ends. */
export function ticksBetween(low: number, high: number, most: number): number[] {
  const raw = (high - low) / Math.max(1, most);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= raw)!;
  const found: number[] = [];
  for (let value = Math.ceil(low / step) * step; value <= high + step * 1e-9; value += step)
    found.push(Number(value.toPrecision(12)));
  return found;
}

/** The ends of some numbers, with a little room; of nothing 0 to 1. */
export function extent(values: Iterable<number | null>): [number, number] {
  let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const value of values) {
    if (value === null || !Number.isFinite(value)) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  if (low > high) return [0, 1];
  const room = high > low ? 0.05 * (high - low) : Math.max(0.5, 0.1 * Math.abs(low));
  return [low - room, high + room];
}

/** Draws a grid with numbers beside it. Answers where values stand. */
export function axes(sheet: Sheet, [left, right]: [number, number], [bottom, top]: [number, number]): Frame {
  const { context, width, height, ink, line } = sheet;
  const inner = { width: width - MARGIN.left - MARGIN.right, height: height - MARGIN.top - MARGIN.bottom };
  const x = (value: number) => MARGIN.left + ((value - left) / (right - left)) * inner.width;
  const y = (value: number) => MARGIN.top + (1 - (value - bottom) / (top - bottom)) * inner.height;
  context.strokeStyle = line;
  context.fillStyle = ink;
  context.lineWidth = 1;
  context.textAlign = "center";
  for (const value of ticksBetween(left, right, inner.width / 70)) {
    context.strokeRect(Math.round(x(value)) + 0.5, MARGIN.top, 0, inner.height);
    context.fillText(String(value), x(value), height - 6);
  }
  context.textAlign = "right";
  for (const value of ticksBetween(Math.min(bottom, top), Math.max(bottom, top), inner.height / 30)) {
    context.strokeRect(MARGIN.left, Math.round(y(value)) + 0.5, inner.width, 0);
    context.fillText(String(value), MARGIN.left - 6, y(value) + 4);
  }
  return { x, y };
}

/** Adds a path to what is drawn; it is broken where a number is not finite. */
export function trail(context: Sheet["context"], x: (number | null)[], y: (number | null)[], at: Frame): void {
  let drawing = false;
  x.forEach((across, i) => {
    const up = y[i] ?? null;
    if (across === null || up === null) drawing = false;
    else if (drawing) context.lineTo(at.x(across), at.y(up));
    else {
      context.moveTo(at.x(across), at.y(up));
      drawing = true;
    }
  });
}

/** Keep what follows within the axes. */
export function clip({ context, width, height }: Sheet): void {
  context.beginPath();
  context.rect(MARGIN.left, MARGIN.top, width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom);
  context.clip();
}
