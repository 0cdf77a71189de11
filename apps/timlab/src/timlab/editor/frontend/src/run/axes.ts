import type { Sheet } from "./sheet";
import type { SvgContext } from "./svg";

export interface Frame {
  x: (value: number) => number;
  y: (value: number) => number;
}

/** The width of a digit, in pixels. */
const LETTER = 6.6;

/** Room about the axes: for numbers, and for titles where there are some. */
function marginOf({ head = 8, left = 0, titles }: Sheet): { left: number; right: number; top: number; bottom: number } {
  const [least, bottom] = titles ? [62, 38] : [42, 22];
  return { left: Math.max(least, left), right: 10, top: head, bottom };
}

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

/** Numbers of an axis as texts: as many digits as tell each from the next, and powers of ten where these are long. */
export function labels(values: number[]): string[] {
  const [first = 0, second = first] = values;
  const step = Math.abs(second - first) || Math.abs(first) || 1;
  const largest = Math.max(...values.map(Math.abs), 0);
  const digits = Array.from({ length: 6 }, (_, n) => n).find(
    (n) => Math.abs(step * 10 ** n - Math.round(step * 10 ** n)) < 1e-6 * step * 10 ** n,
  );
  if (digits !== undefined && largest < (digits === 0 ? 1e8 : 1e6))
    return values.map((value) => value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1"));
  const needed = Math.max(0, Math.ceil(Math.log10(largest / step)));
  return values.map((value) => (value === 0 ? "0" : value.toExponential(Math.min(9, needed)).replace("e+", "e")));
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

/** Draws a grid with numbers beside it, whole ones on a vertical axis that is `counted`. Answers where values stand. */
export function axes(
  sheet: Sheet,
  [left, right]: [number, number],
  [bottom, top]: [number, number],
  counted = false,
): Frame {
  const { context, width, height, ink, line, titles } = sheet;
  const { top: above, bottom: below } = marginOf(sheet);
  const up = ticksBetween(Math.min(bottom, top), Math.max(bottom, top), (height - above - below) / 30).filter(
    (value) => !counted || Number.isInteger(value),
  );
  const numbers = labels(up);
  sheet.left = (titles ? 28 : 10) + LETTER * Math.max(0, ...numbers.map((text) => text.length));
  const margin = marginOf(sheet);
  const inner = { width: width - margin.left - margin.right, height: height - margin.top - margin.bottom };
  const x = (value: number) => margin.left + ((value - left) / (right - left)) * inner.width;
  const y = (value: number) => margin.top + (1 - (value - bottom) / (top - bottom)) * inner.height;
  context.strokeStyle = line;
  context.fillStyle = ink;
  context.lineWidth = 1;
  context.textAlign = "center";
  const across = ticksBetween(left, right, inner.width / 70);
  const texts = labels(across);
  across.forEach((value, i) => {
    context.strokeRect(Math.round(x(value)) + 0.5, margin.top, 0, inner.height);
    context.fillText(texts[i]!, x(value), margin.top + inner.height + 16);
  });
  context.textAlign = "right";
  up.forEach((value, i) => {
    context.strokeRect(margin.left, Math.round(y(value)) + 0.5, inner.width, 0);
    context.fillText(numbers[i]!, margin.left - 6, y(value) + 4);
  });
  if (titles) {
    context.textAlign = "center";
    context.fillText(titles[0], margin.left + inner.width / 2, margin.top + inner.height + 32);
    upwards(context, titles[1], 13, margin.top + inner.height / 2);
  }
  return { x, y };
}

/** Writes a text that is read from below. */
function upwards(context: Sheet["context"], text: string, x: number, y: number): void {
  if ("fillTextUpwards" in context) return (context as unknown as SvgContext).fillTextUpwards(text, x, y);
  context.save();
  context.translate(x, y);
  context.rotate(-Math.PI / 2);
  context.fillText(text, 0, 0);
  context.restore();
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
export function clip(sheet: Sheet): void {
  const { context, width, height } = sheet;
  const margin = marginOf(sheet);
  context.beginPath();
  context.rect(margin.left, margin.top, width - margin.left - margin.right, height - margin.top - margin.bottom);
  context.clip();
}
