import { useEffect, useRef } from "react";
import uPlot from "uplot";
import { useDark } from "../ui/useDark";
import { labels } from "./axes";
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

/** A little room above and below; 0 to 1 of nothing. */
const roomy = (_: uPlot, low: number | null, high: number | null): [number, number] =>
  low === null || high === null ? [0, 1] : (uPlot.rangeNum(low, high, 0.1, true) as [number, number]);

/** The numbers of an axis, with as many digits as tell them apart. */
const written = (_: uPlot, values: number[]): string[] => labels(values);

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

/** A scope: signals over time. Drag to look closer, double click for all. */
export function Lines({ source, branches, window: seconds, tick, small }: Props) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const key = useRef("");
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
        const axis = { stroke: ink, grid, ticks: { ...grid, size: 4 }, font: "11px system-ui, sans-serif" };
        const limits = limitsOf(source);
        plot.current = new uPlot(
          {
            width,
            height,
            series: made.series,
            bands: made.bands,
            axes: [
              { ...axis, size: small ? 20 : 26, space: 60, values: written },
              { ...axis, size: small ? 40 : 52, space: 28, values: written },
            ],
            scales: { x: { time: false }, y: limits ? { range: limits } : { range: roomy } },
            legend: { show: false },
            cursor: { show: !small, points: { show: false }, drag: { x: true, y: false } },
            padding: [8, 10, 0, 0],
            hooks: { draw: [(own) => drawNow(own, tick, pageColour(element, "--vermilion"))] },
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
  return <div className="plot" ref={box} />;
}
