import { useEffect, useRef } from "react";
import { useRun } from "../session/store";
import { useDark } from "../ui/useDark";
import { PICTURES } from "./pictures";
import type { Source } from "./sources";
import { onMoving, spanOf } from "./span";
import { useSize } from "./useSize";

interface Props {
  source: Source;
  branches: string[];
  window: number | null;
  tick: number;
  /** Whether it stands on the canvas, where it is small and nothing can be read off. */
  small?: boolean;
}

/** Pictures that are no lines over time. */
export function Drawing({ source, branches, window: seconds, tick, small }: Props) {
  const box = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const { width, height } = useSize(box);
  const dark = useDark();
  const names = branches.join("\n");
  useEffect(() => {
    const own = canvas.current;
    const context = own?.getContext("2d");
    if (!own || !context || !width || !height) return;
    const scale = devicePixelRatio || 1;
    own.width = width * scale;
    own.height = height * scale;
    const style = getComputedStyle(own);
    const draw = () => {
      context.setTransform(scale, 0, 0, scale, 0, 0);
      context.clearRect(0, 0, width, height);
      context.font = "11px system-ui, sans-serif";
      const { branch, tick: now } = useRun.getState();
      const span = spanOf(seconds, tick);
      const [ink, line] = [style.getPropertyValue("--quiet"), style.getPropertyValue("--line")];
      PICTURES[source.drawing]?.(source, {
        context,
        width,
        height,
        titles: small ? undefined : source.titles,
        dark,
        ink,
        line,
        branch,
        branches: names.split("\n"),
        span,
        tick,
        now,
      });
    };
    draw();
    return onMoving(draw);
  }, [source, names, seconds, tick, dark, width, height, small]);
  return (
    <div className="plot" ref={box}>
      <canvas ref={canvas} role="img" aria-label={`${source.drawing} ${source.path}${small ? " on the canvas" : ""}`} />
    </div>
  );
}
