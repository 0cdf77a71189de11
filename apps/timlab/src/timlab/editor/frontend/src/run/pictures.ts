import { useRun } from "../session/store";
import { histogram } from "./histogram";
import { lines } from "./lines";
import { map } from "./map";
import { portrait } from "./portrait";
import { raster } from "./raster";
import type { Sheet } from "./sheet";
import type { Source } from "./sources";
import { lineage } from "./lineage";
import { spanOf } from "./span";
import { SvgContext } from "./svg";

/** How each kind of sink is drawn on a sheet. */
export const PICTURES: Record<string, (source: Source, sheet: Sheet) => void> = {
  lines,
  portrait,
  raster,
  histogram,
  map,
};

/** What is to be drawn, and over which seconds; null for all. */
export interface Wanted {
  source: Source;
  branches: string[];
  window: number | null;
  tick: number;
}

const SIZE = { width: 720, height: 360, head: 24 };
const LIGHT = { ink: "#4a5058", line: "#dfe2e6", page: "#ffffff" };

/** Draw a picture with its title, as it is kept: on white, whatever the page's colours are. */
function paint(context: CanvasRenderingContext2D, { source, branches, window: seconds, tick }: Wanted): void {
  context.font = "600 13px system-ui, sans-serif";
  context.textAlign = "left";
  context.fillStyle = "#26292e";
  context.fillText(source.path, 12, 15);
  context.font = "11px system-ui, sans-serif";
  const { branch, tick: now } = useRun.getState();
  PICTURES[source.drawing]?.(source, {
    context,
    width: SIZE.width,
    height: SIZE.height,
    head: SIZE.head,
    titles: source.titles,
    dark: false,
    ink: LIGHT.ink,
    line: LIGHT.line,
    branch,
    branches,
    span: spanOf(seconds, tick),
    tick,
    now,
  });
}

export function asSvg(wanted: Wanted): string {
  const context = new SvgContext(SIZE.width, SIZE.height);
  paint(context as unknown as CanvasRenderingContext2D, wanted);
  return context.text(LIGHT.page);
}

export async function asPng(wanted: Wanted): Promise<Blob> {
  const canvas = document.createElement("canvas");
  canvas.width = 2 * SIZE.width;
  canvas.height = 2 * SIZE.height;
  const context = canvas.getContext("2d")!;
  context.scale(2, 2);
  context.fillStyle = LIGHT.page;
  context.fillRect(0, 0, SIZE.width, SIZE.height);
  paint(context, wanted);
  return new Promise((resolve) => canvas.toBlob((blob) => resolve(blob!), "image/png"));
}

const quoted = (text: string): string => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** The points that are drawn of the present branch, over all time: a row for each tick at which there are some. */
export function asCsv({ source, tick }: Wanted): string {
  const { branch } = useRun.getState();
  const heads: string[] = [];
  const rows = new Map<number, (number | null)[]>();
  for (const { address, label } of source.signals) {
    const trace = lineage(branch ?? "", address);
    for (const part of ["rows", "low", "median", "high"]) {
      const columns = trace?.columns[part] ?? [];
      columns.forEach((column, place) => {
        const which = columns.length > 1 ? `[${place}]` : "";
        const at = heads.push(`${label}${which}${part === "rows" ? "" : ` ${part}`}`) - 1;
        trace!.ticks.forEach((time, i) => {
          const row = rows.get(time) ?? [];
          rows.set(time, row);
          row[at] = column[i] ?? null;
        });
      });
    }
  }
  const body = [...rows].sort(([a], [b]) => a - b);
  const number = (value: number | null | undefined) => (value == null ? "" : String(value));
  return [
    ["time (s)", ...heads].map(quoted).join(","),
    ...body.map(([time, row]) =>
      [Number((time * tick).toPrecision(12)), ...heads.map((_, i) => number(row[i]))].join(","),
    ),
    "",
  ].join("\n");
}
