import { axes } from "./axes";
import type { Sheet } from "./sheet";
import type { Source } from "./sources";
import { lineage } from "./lineage";

/** Which of many units fired when. */
export function raster(source: Source, sheet: Sheet): void {
  const trace = lineage(sheet.branch ?? "", source.signals[0]?.address ?? "");
  const rows = trace?.columns.rows ?? [];
  const ticks = trace?.ticks ?? [];
  const last = Number.isFinite(sheet.span[1]) ? sheet.span[1] : (ticks[ticks.length - 1] ?? 1);
  const at = axes(
    sheet,
    [sheet.span[0] * sheet.tick, Math.max(last, 1) * sheet.tick],
    [Math.max(1, rows.length) - 0.5, -0.5],
    true,
  );
  const { context } = sheet;
  context.fillStyle = sheet.dark ? "#dfe3e8" : "#26292e";
  const tall = Math.max(1, Math.abs(at.y(1) - at.y(0)) * 0.8);
  rows.forEach((row, unit) => {
    for (let i = 0; i < row.length; i += 1) {
      if (row[i] && ticks[i]! >= sheet.span[0])
        context.fillRect(at.x(ticks[i]! * sheet.tick), at.y(unit) - tall / 2, 1, tall);
    }
  });
}
