import type uPlot from "uplot";
import { lineColour } from "./colours";
import type { Source } from "./sources";
import { lineage } from "./lineage";
import type { Trace } from "./traces";

/** What a scope draws: uPlot's series and bands, and the data for them. */
export interface Drawn {
  /** Changes when the picture must be made anew. */
  key: string;
  series: uPlot.Series[];
  bands: uPlot.Band[];
  data: uPlot.AlignedData;
}

type Join = (tables: uPlot.AlignedData[]) => uPlot.AlignedData;
const MOST_LINES = 24;

/** The first place in a rising list that is not below a number. */
function lowerBound(list: number[], wanted: number): number {
  let [low, high] = [0, list.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle]! < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

const name = (label: string, column: number, columns: number): string => (columns > 1 ? `${label}[${column}]` : label);

/** The lines of all branches between two ticks; those of other branches than the present one are broken and faint. */
export function drawn(
  source: Source,
  branches: string[],
  present: string | null,
  span: [number, number],
  tick: number,
  dark: boolean,
  join: Join,
): Drawn {
  const series: uPlot.Series[] = [{ label: "time" }];
  const bands: uPlot.Band[] = [];
  const tables: uPlot.AlignedData[] = [];
  let key = "";
  for (const branch of branches) {
    const other = branch !== present;
    let place = 0;
    for (const { address, label } of source.signals) {
      const trace = lineage(branch, address);
      if (!trace?.ticks.length) continue;
      const [from, to] = [Math.max(0, lowerBound(trace.ticks, span[0]) - 1), lowerBound(trace.ticks, span[1] + 1)];
      const table: (number | null)[][] = [trace.ticks.slice(from, to).map((each) => each * tick)];
      const main = trace.columns.rows ?? trace.columns.median ?? [];
      const columns = Math.min(main.length, MOST_LINES);
      for (let column = 0; column < columns; column += 1, place += 1) {
        const stroke = lineColour(place, dark);
        const title = name(label, column, main.length) + (branches.length > 1 ? ` · ${branch}` : "");
        const line: uPlot.Series = {
          label: title,
          stroke: other ? `${stroke}99` : stroke,
          width: other ? 1 : 1.5,
          dash: other ? [5, 4] : undefined,
          points: { show: false },
          pxAlign: 0, // points at whole pixels make waves bumpy
        };
        table.push(main[column]!.slice(from, to));
        series.push(line);
        key += `${title}|`;
        if (trace.columns.low && trace.columns.high) addBand(trace, column, [from, to], stroke, table, series, bands);
      }
      tables.push(table as uPlot.AlignedData);
    }
  }
  const data = tables.length === 1 ? tables[0]! : tables.length ? join(tables) : ([[]] as unknown as uPlot.AlignedData);
  return { key: `${key}${dark}${series.length}`, series, bands, data };
}

function addBand(
  trace: Trace,
  column: number,
  [from, to]: [number, number],
  stroke: string,
  table: (number | null)[][],
  series: uPlot.Series[],
  bands: uPlot.Band[],
): void {
  for (const part of ["high", "low"] as const) {
    table.push(trace.columns[part]![column]!.slice(from, to));
    series.push({ label: part, stroke: "transparent", width: 0, points: { show: false }, pxAlign: 0 });
  }
  bands.push({ series: [series.length - 2, series.length - 1], fill: `${stroke}33` });
}
