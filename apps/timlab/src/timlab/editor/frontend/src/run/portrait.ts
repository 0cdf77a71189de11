import { axes, extent, trail } from "./axes";
import { lineColour } from "./colours";
import type { Sheet } from "./sheet";
import type { Source } from "./sources";
import { lineage } from "./lineage";

/** One signal against another: a path, with a dot where it ends. */
export function portrait(source: Source, sheet: Sheet): void {
  const paths = sheet.branches.flatMap((branch) => {
    const [x, y] = source.signals.map(({ address }) => lineage(branch, address));
    if (!x || !y) return [];
    const from = Math.max(
      0,
      x.ticks.findIndex((tick) => tick >= sheet.span[0]),
    );
    return (x.columns.rows ?? []).map((column, i) => ({
      x: column.slice(from),
      y: (y.columns.rows?.[i] ?? []).slice(from),
      place: Math.floor(i % Math.max(1, (x.columns.rows?.length ?? 1) / x.seeds)),
      other: branch !== sheet.branch,
    }));
  });
  const given = (name: string) =>
    Array.isArray(source.fields[name]) ? (source.fields[name] as [number, number]) : null;
  const across = given("across") ?? extent(paths.flatMap((path) => path.x));
  const up = given("up") ?? extent(paths.flatMap((path) => path.y));
  const at = axes(sheet, across, up);
  const { context } = sheet;
  for (const path of paths) {
    context.strokeStyle = context.fillStyle = lineColour(path.place, sheet.dark);
    context.globalAlpha = (path.other ? 0.4 : 0.9) / Math.max(1, Math.sqrt(paths.length) / 2);
    context.setLineDash(path.other ? [5, 4] : []);
    context.beginPath();
    trail(context, path.x, path.y, at);
    context.stroke();
    context.globalAlpha = 1;
    const final = path.x.length - 1;
    if (final < 0 || path.x[final] == null || path.y[final] == null) continue;
    context.beginPath();
    context.arc(at.x(path.x[final]!), at.y(path.y[final]!), 3, 0, 7);
    context.fill();
  }
  context.setLineDash([]);
}
