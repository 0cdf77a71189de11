import { axes, extent } from "./axes";
import { lineColour } from "./colours";
import type { Sheet } from "./sheet";
import type { Source } from "./sources";
import { lineage } from "./lineage";

/** How often a signal had which value. */
export function histogram(source: Source, sheet: Sheet): void {
  const bins = Number(source.fields.bins) || 30;
  const trace = lineage(sheet.branch ?? "", source.signals[0]?.address ?? "");
  const values = (trace?.columns.rows ?? []).flat().filter((value): value is number => value !== null);
  const limits = Array.isArray(source.fields.limits) ? (source.fields.limits as [number, number]) : extent(values);
  const counts = new Array<number>(bins).fill(0);
  for (const value of values) {
    const bin = Math.floor(((value - limits[0]) / (limits[1] - limits[0])) * bins);
    if (bin >= 0 && bin < bins) counts[bin]! += 1 / values.length;
  }
  const at = axes(sheet, limits, [0, Math.max(...counts, 0.01) * 1.05]);
  const wide = (limits[1] - limits[0]) / bins;
  sheet.context.fillStyle = lineColour(0, sheet.dark);
  sheet.context.globalAlpha = 0.8;
  counts.forEach((part, i) => {
    const left = at.x(limits[0] + i * wide);
    sheet.context.fillRect(left, at.y(part), at.x(limits[0] + (i + 1) * wide) - left - 1, at.y(0) - at.y(part));
  });
  sheet.context.globalAlpha = 1;
}
