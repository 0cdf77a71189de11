import { axes, clip, extent, trail } from "./axes";
import { lineColour } from "./colours";
import { lineage } from "./lineage";
import type { Sheet } from "./sheet";
import type { Source } from "./sources";

const LEAST_FORCE = 1e-9;
const TRAIL = 200; // samples of the path

/** The last row of a signal of the first seed; NaN where it is not finite, of which nothing is drawn. */
function last(sheet: Sheet, address: string | undefined): number[] {
  const trace = lineage(sheet.branch ?? "", address ?? "");
  const at = trace?.ticks.findLastIndex((tick) => tick <= sheet.now) ?? -1;
  return at < 0 ? [] : (trace!.columns.rows ?? []).map((column) => column[at] ?? Number.NaN);
}

/** Where Gaussian units are: an ellipse of one standard deviation about each centre, the force, and the path taken. */
export function map(source: Source, sheet: Sheet): void {
  const {
    units,
    observed,
    axes: shown,
    forces,
  } = source.fields as { units: number; observed: number; axes: [number, number]; forces: [number, number][] | null };
  const address = (name: string) => source.signals.find(({ address: each }) => each.endsWith(`.${name}`))?.address;
  const numbers = last(sheet, address("parameters"));
  const count = last(sheet, address("units"))[0] || units;
  const place = lineage(sheet.branch ?? "", address("place") ?? "");
  const end = (place?.ticks.findLastIndex((tick) => tick <= sheet.now) ?? -1) + 1;
  const path = shown.map((axis) => place?.columns.rows?.[axis]?.slice(Math.max(0, end - TRAIL), end) ?? []) as [
    (number | null)[],
    (number | null)[],
  ];
  const ellipses = Array.from({ length: numbers.length ? Math.min(count, units) : 0 }, (_, unit) => ({
    unit,
    centre: shown.map((axis) => numbers[unit * observed + axis]!) as [number, number],
    width: shown.map((axis) => Math.exp(numbers[(units + unit) * observed + axis]!)) as [number, number],
  }));
  const span = (i: 0 | 1) =>
    extent([...path[i], ...ellipses.flatMap(({ centre, width }) => [centre[i] - width[i], centre[i] + width[i]])]);
  const given = (name: string) =>
    Array.isArray(source.fields[name]) ? (source.fields[name] as [number, number]) : null;
  const at = axes(sheet, given("across") ?? span(0), given("up") ?? span(1));
  const { context, dark, ink } = sheet;
  context.save();
  clip(sheet);
  context.strokeStyle = ink;
  context.globalAlpha = 0.35;
  context.beginPath();
  trail(context, path[0], path[1], at);
  context.stroke();
  context.globalAlpha = 1;
  const longest = Math.max(LEAST_FORCE, ...(forces ?? []).map(([x, y]) => Math.hypot(x, y)));
  for (const { unit, centre, width } of ellipses) {
    const [x, y] = [at.x(centre[0]), at.y(centre[1])];
    context.strokeStyle = context.fillStyle = lineColour(unit, dark);
    context.beginPath();
    context.ellipse(x, y, Math.abs(at.x(centre[0] + width[0]) - x), Math.abs(at.y(centre[1] + width[1]) - y), 0, 0, 7);
    context.stroke();
    context.globalAlpha = 0.12;
    context.fill();
    context.globalAlpha = 1;
    const force = forces?.[unit];
    if (force) arrow(context, x, y, (30 * force[0]) / longest, (-30 * force[1]) / longest);
  }
  context.restore();
}

function arrow(context: CanvasRenderingContext2D, x: number, y: number, dx: number, dy: number): void {
  const angle = Math.atan2(dy, dx);
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x + dx, y + dy);
  for (const side of [2.6, -2.6]) {
    context.moveTo(x + dx, y + dy);
    context.lineTo(x + dx + 6 * Math.cos(angle + side), y + dy + 6 * Math.sin(angle + side));
  }
  context.stroke();
}
