import type { GalleryEntry } from "../session/types";
import { hueOf } from "../ui/category";

const MARGIN = 24;
/** How far a wire that leads back swings out, as a part of its width. */
const REACH = 0.1;

/** A diagram so small that its blocks are boxes in the colours of their headings. */
export function Thumbnail({ boxes, wires }: Pick<GalleryEntry, "boxes" | "wires">) {
  // Wires that lead back begin to the right and end to the left of their blocks.
  const back = wires.map(([x, , u]) => ({ from: x + REACH * Math.max(0, x - u), to: u - REACH * Math.max(0, x - u) }));
  const left = Math.min(...boxes.map(([x]) => x), ...back.map(({ to }) => to)) - MARGIN;
  const top = Math.min(...boxes.map(([, y]) => y)) - MARGIN;
  const width = Math.max(...boxes.map(([x, , w]) => x + w), ...back.map(({ from }) => from)) + MARGIN - left;
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
