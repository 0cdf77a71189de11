import uPlot from "uplot";
import { axes, clip, extent, trail } from "./axes";
import { lineColour } from "./colours";
import { drawn } from "./series";
import type { Sheet } from "./sheet";
import type { Source } from "./sources";

/** Signals over time on a sheet, for pictures that are kept; on the page uPlot draws them. */
export function lines(source: Source, sheet: Sheet): void {
  const { branches, branch, span, tick, dark, context } = sheet;
  const { data, series, bands } = drawn(source, branches, branch, span, tick, dark, uPlot.join as never);
  const [times, ...columns] = data as (number | null)[][];
  if (!times?.length) return;
  const { limits } = source.fields;
  const right = Number.isFinite(span[1]) ? span[1] * tick : times[times.length - 1]!;
  const at = axes(
    sheet,
    [span[0] * tick, Math.max(right, tick)],
    Array.isArray(limits) ? (limits as [number, number]) : extent(columns.flat()),
  );
  context.save();
  clip(sheet);
  for (const { series: between, fill } of bands) {
    const [high, low] = between.map((place) => columns[place - 1]!) as [(number | null)[], (number | null)[]];
    context.fillStyle = String(fill).slice(0, 7);
    context.globalAlpha = 0.2;
    context.beginPath();
    times.forEach((x, i) => high[i] != null && context.lineTo(at.x(x!), at.y(high[i])));
    [...times].reverse().forEach((x, i) => {
      const value = low[times.length - 1 - i];
      if (value != null) context.lineTo(at.x(x!), at.y(value));
    });
    context.closePath();
    context.fill();
    context.globalAlpha = 1;
  }
  columns.forEach((column, i) => {
    const { stroke, width, dash } = series[i + 1]!;
    if (!width) return;
    context.strokeStyle = String(stroke).slice(0, 7);
    context.lineWidth = width;
    context.setLineDash(dash ?? []);
    context.beginPath();
    trail(context, times, column, at);
    context.stroke();
  });
  context.setLineDash([]);
  context.restore();
  legend(source, sheet, series);
}

function legend({ signals }: Source, { context, dark, ink, width }: Sheet, series: uPlot.Series[]): void {
  const names = series.slice(1).filter((each) => each.width);
  if (names.length < 2 && signals.length < 2) return;
  let x = width - 10;
  context.textAlign = "right";
  [...names.slice(0, 8)].reverse().forEach(({ label }, i, all) => {
    const text = String(label);
    context.fillStyle = ink;
    context.fillText(text, x, 14);
    x -= 6.2 * text.length + 6;
    context.fillStyle = lineColour(all.length - 1 - i, dark);
    context.fillRect(x - 12, 9, 12, 2);
    x -= 22;
  });
}
