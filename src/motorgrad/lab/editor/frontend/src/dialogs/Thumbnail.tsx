import type { GalleryEntry } from "../session/types";
import { hueOf } from "../ui/category";

const MARGIN = 24;

/** A diagram so small that its blocks are boxes in the colours of their headings. */
export function Thumbnail({ boxes, wires }: Pick<GalleryEntry, "boxes" | "wires">) {
  const left = Math.min(...boxes.map(([x]) => x)) - MARGIN;
  const top = Math.min(...boxes.map(([, y]) => y)) - MARGIN;
  const width = Math.max(...boxes.map(([x, , w]) => x + w)) + MARGIN - left;
  const height = Math.max(...boxes.map(([, y, , h]) => y + h)) + MARGIN - top;
  return (
    <svg className="thumbnail" viewBox={`${left} ${top} ${width} ${height}`} aria-hidden="true">
      {wires.map(([x, y, u, v], index) => {
        const bend = Math.max(40, Math.abs(u - x) / 2);
        return <path key={index} d={`M${x} ${y}C${x + bend} ${y} ${u - bend} ${v} ${u} ${v}`} />;
      })}
      {boxes.map(([x, y, w, h, category], index) => (
        <rect key={index} x={x} y={y} width={w} height={h} rx={10} style={{ fill: hueOf(category) }} />
      ))}
    </svg>
  );
}
