import { useMemo } from "react";
import { drawnPath, route } from "../canvas/router";
import type { GalleryEntry } from "../session/types";
import { hueOf } from "../ui/category";

const MARGIN = 24;
/** Radius of the corners of wires, in pixels of the diagram. */
const CORNER = 12;

/** A diagram so small that its blocks are boxes in the colours of their headings. */
export function Thumbnail({ boxes, wires }: Pick<GalleryEntry, "boxes" | "wires">) {
  const paths = useMemo(() => {
    const blocks = boxes.map(([x, y, width, height]) => ({ x, y, width, height }));
    const links = wires.map(([x, y, u, v], index) => ({
      id: String(index),
      net: `${x},${y}`,
      from: [x, y] as [number, number],
      to: [u, v] as [number, number],
    }));
    return [...route(blocks, links).paths.values()];
  }, [boxes, wires]);
  const corners = [
    ...paths.flat(),
    ...boxes.flatMap(([x, y, w, h]) => [
      [x, y],
      [x + w, y + h],
    ]),
  ];
  const [xs, ys] = [corners.map(([x]) => x!), corners.map(([, y]) => y!)];
  const [left, top] = [Math.min(...xs) - MARGIN, Math.min(...ys) - MARGIN];
  const [width, height] = [Math.max(...xs) + MARGIN - left, Math.max(...ys) + MARGIN - top];
  return (
    <svg className="thumbnail" viewBox={`${left} ${top} ${width} ${height}`} aria-hidden="true">
      {paths.map((path, index) => (
        <path key={index} d={drawnPath(path, CORNER)} />
      ))}
      {boxes.map(([x, y, w, h, category], index) => (
        <rect key={index} x={x} y={y} width={w} height={h} rx={10} style={{ fill: hueOf(category) }} />
      ))}
    </svg>
  );
}
