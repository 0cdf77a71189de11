import { useEffect, useRef, useState } from "react";
import uPlot from "uplot";
import { useDark } from "../ui/useDark";
import { extent, labels } from "./axes";
import { pageColour } from "./colours";
import { drawn } from "./series";
import type { Source } from "./sources";
import { onMoving, spanOf } from "./span";
import { useSize } from "./useSize";
import { useRun } from "../session/store";

interface Props {
  source: Source;
  branches: string[];
  /** Seconds that are shown; null for all. */
  window: number | null;
  tick: number;
  /** Whether it stands on the canvas, where it is small and nothing can be read off. */
  small?: boolean;
}

const limitsOf = (source: Source): [number, number] | null => {
  const { limits } = source.fields;
  return Array.isArray(limits) ? (limits as [number, number]) : null;
};

/** A little room above and below, and about a signal that does not move; 0 to 1 of nothing. */
const roomy = (_: uPlot, low: number | null, high: number | null): [number, number] =>
  low === null || high === null || low === high
    ? extent([low, high])
    : (uPlot.rangeNum(low, high, 0.1, true) as [number, number]);

/** The numbers of an axis, with as many digits as tell them apart. */
const written = (_: uPlot, values: number[]): string[] => labels(values);

/** How wide a vertical axis is, in pixels, so that its numbers do not reach its title. */
const wideEnough = (_: uPlot, texts: string[] | null): number =>
  Math.max(52, 16 + 6.6 * Math.max(0, ...(texts ?? []).map((text) => text.length)));

/** Where the run stands, if that is not the end of what was seen. */
function drawNow(plot: uPlot, tick: number, colour: string): void {
  const { tick: now, head } = useRun.getState();
  if (now >= head) return;
  const x = Math.round(plot.valToPos(now * tick, "x", true));
  const { left, top, width, height } = plot.bbox;
  if (x < left || x > left + width) return;
  plot.ctx.fillStyle = colour;
  plot.ctx.fillRect(x, top, devicePixelRatio || 1, height);
}

/** The line from which differences are read. */
function drawMark(plot: uPlot, mark: number | null, colour: string): void {
  if (mark === null) return;
  const x = Math.round(plot.valToPos(mark, "x", true));
  const { left, top, width, height } = plot.bbox;
  if (x < left || x > left + width) return;
  plot.ctx.save();
  plot.ctx.fillStyle = colour;
  plot.ctx.fillRect(x, top, devicePixelRatio || 1, height);
  plot.ctx.restore();
}

const MOST_READ = 6;

/** What stands under the cursor: the time and the values, and how far they are from those at the mark. */
function read(plot: uPlot, mark: number | null): string {
  const { left = -1, idx } = plot.cursor;
  if (left < 0 || idx == null) return "";
  const [times, ...columns] = plot.data;
  const short = (value: number) => String(Number(value.toPrecision(4)));
  const place = mark === null ? null : plot.valToIdx(mark);
  const change = (values: ArrayLike<number | null | undefined>, value: number) => {
    const before = place === null ? null : values[place];
    return before == null ? "" : ` (Δ ${short(value - before)})`;
  };
  const named = columns
    .map((values, i) => ({ values, series: plot.series[i + 1]! }))
    .filter(({ series }) => (series.width ?? 1) > 0)
    .slice(0, MOST_READ)
    .map(({ values, series }) => {
      const value = values[idx];
      return `${String(series.label)} ${value == null ? "–" : short(value) + change(values, value)}`;
    });
  return [`t ${short(times[idx]!)} s${change(times, times[idx]!)}`, ...named].join("   ");
}

/** A scope: signals over time. Drag to look closer, double click for all, click for a mark to read differences from. */
export function Lines({ source, branches, window: seconds, tick, small }: Props) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const key = useRef("");
  const mark = useRef<number | null>(null);
  const [reading, setReading] = useState("");
  const { width, height } = useSize(box);
  const dark = useDark();
  const names = branches.join("\n");

  useEffect(() => {
    const element = box.current;
    if (!element || width < 40 || height < 40) return;
    const draw = () => {
      const span = spanOf(seconds, tick);
      const made = drawn(source, names.split("\n"), useRun.getState().branch, span, tick, dark, uPlot.join as never);
      if (!plot.current || made.key !== key.current || plot.current.width !== width || plot.current.height !== height) {
        plot.current?.destroy();
        key.current = made.key;
        const ink = pageColour(element, "--quiet");
        const grid = { stroke: pageColour(element, "--line"), width: 1 };
        const title = (label: string) =>
          small || !label ? {} : { label, labelFont: "11px system-ui, sans-serif", labelSize: 18, labelGap: -2 };
        const axis = { stroke: ink, grid, ticks: { ...grid, size: 4 }, font: "11px system-ui, sans-serif" };
        const limits = limitsOf(source);
        plot.current = new uPlot(
          {
            width,
            height,
            series: made.series,
            bands: made.bands,
            axes: [
              { ...axis, size: small ? 20 : 26, space: 60, values: written, ...title(source.titles[0]) },
              { ...axis, size: small ? 40 : wideEnough, space: 28, values: written, ...title(source.titles[1]) },
            ],
            scales: { x: { time: false }, y: limits ? { range: limits } : { range: roomy } },
            legend: { show: false },
            cursor: {
              show: !small,
              points: { show: false },
              drag: { x: true, y: false },
              sync: small ? undefined : { key: "time", scales: ["x", null] },
            },
            padding: [8, 16, 0, 0],
            hooks: {
              draw: [
                (own) => drawNow(own, tick, pageColour(element, "--vermilion")),
                (own) => drawMark(own, mark.current, pageColour(element, "--accent")),
              ],
              setCursor: [(own) => setReading(read(own, mark.current))],
              ready: [
                (own) =>
                  // A click that is no drag sets the mark from which differences are read; on the mark it takes it away.
                  own.over.addEventListener("click", () => {
                    const { left = -1 } = own.cursor;
                    if (own.select.width > 2 || left < 0) return;
                    const there = mark.current !== null && Math.abs(own.valToPos(mark.current, "x") - left) < 6;
                    mark.current = there ? null : own.posToVal(left, "x");
                    own.redraw(false);
                    setReading(read(own, mark.current));
                  }),
              ],
            },
          },
          made.data,
          element,
        );
      } else plot.current.setData(made.data);
      if (seconds !== null) plot.current.setScale("x", { min: span[0] * tick, max: span[1] * tick });
    };
    draw();
    const off = onMoving(draw);
    return () => {
      off();
      plot.current?.destroy();
      plot.current = null;
    };
  }, [source, names, seconds, tick, dark, width, height, small]);
  return (
    <div className="plot">
      <div className="plot-box" ref={box} />
      {reading && (
        <output className="reading" aria-label={`cursor of ${source.path}`}>
          {reading}
        </output>
      )}
    </div>
  );
}
