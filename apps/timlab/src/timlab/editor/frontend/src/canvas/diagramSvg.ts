import { escaped } from "../run/svg";
import { useDocument } from "../session/store";
import type { BlockView, Port, Scope } from "../session/types";
import { shapeLabel } from "../session/ports";
import { iconOf } from "../ui/BlockIcon";
import { faceOf, gainText, inputLabel, isTriangle } from "./face";
import { routesOf } from "./flow";
import { portHeight, type Size, sizeOf } from "./geometry";
import { placed } from "./layout";
import { drawnPath } from "./router";

const INK = { name: "#26292e", quiet: "#646b75", edge: "#b8bec7", wire: "#5b6470", page: "#ffffff", remark: "#fbf6e6" };
const HUES: Record<string, string> = {
  sources: "#009e73",
  sinks: "#2c92c9",
  learning: "#d55e00",
  "bodies and worlds": "#9a5fa8",
  dynamics: "#0072b2",
  logic: "#a67c00",
};
const MARGIN = 30;

const text = (x: number, y: number, size: number, content: string, more = ""): string =>
  `<text x="${x}" y="${y}" font-size="${size}" ${more}>${escaped(content)}</text>`;

const fitting = (content: string, width: number, letter: number): string =>
  content.length * letter > width ? `${content.slice(0, Math.max(1, Math.floor(width / letter) - 1))}…` : content;

function port(port: Port, x: number, row: number, side: "input" | "output", label: string): string {
  const y = portHeight(row);
  const dot = `<circle cx="${x}" cy="${y}" r="4" fill="${INK.wire}"/>`;
  if (!label) return dot;
  const [anchor, at] = side === "input" ? ["start", x + 9] : ["end", x - 9];
  const name = `${label}${shapeLabel(port)}`;
  return dot + text(at, y + 4, 11, name, `fill="${INK.quiet}" text-anchor="${anchor}"`);
}

function block(name: string, view: BlockView, { width, height }: Size): string {
  const parts: string[] = [];
  const triangle = isTriangle(view);
  if (triangle) {
    parts.push(`<path d="M1 21V79L${width - 1} 50Z" fill="${INK.page}" stroke="${INK.wire}"/>`);
    parts.push(text(0, 14, 13, fitting(name, width, 7.4), `fill="${INK.name}" font-weight="600"`));
    parts.push(text(10 + 0.29 * width, 54, 12, gainText(view), `fill="${INK.name}" text-anchor="middle"`));
  } else {
    const hue = HUES[view.category] ?? INK.wire;
    const face = faceOf(view, name, useDocument.getState().declarations[view.type]);
    parts.push(`<rect width="${width}" height="${height}" rx="7" fill="${INK.page}" stroke="${INK.edge}"/>`);
    const pen = `fill="none" stroke="${hue}" stroke-width="1.5" stroke-linecap="round" stroke-linejoin="round"`;
    parts.push(`<path transform="translate(8 10) scale(1.125)" d="${iconOf(view.type, view.category)}" ${pen}/>`);
    parts.push(text(32, 17, 13, fitting(name, width - 40, 7.4), `fill="${INK.name}" font-weight="600"`));
    parts.push(text(32, 32, 11, fitting(face.text, width - 40, 6.2), `fill="${INK.quiet}"`));
  }
  view.inputs.forEach((each, row) =>
    parts.push(port(each, 0, row, "input", triangle ? "" : (inputLabel(view, row) ?? each.name))),
  );
  view.outputs.forEach((each, row) => parts.push(port(each, width, row, "output", triangle ? "" : each.name)));
  return parts.join("");
}

/** The diagram at a path as a picture, as it stands on the canvas, in light colours. */
export function diagramSvg(scope: Scope, path: string): string {
  const where = placed(scope, path);
  const routes = routesOf(scope, path);
  const boxes = Object.entries(scope.nodes).map(([name, view]) => {
    const [x, y] = where[name] ?? [0, 0];
    return { name, view, x, y, ...sizeOf(name, view) };
  });
  const remarks = Object.values(scope.comments).map(({ text: words, box: [x, y, width, height] }) => {
    return { words, x, y, width, height };
  });
  const ways = [...routes.paths.values()].flat().map(([x, y]) => ({ x, y, width: 0, height: 0 }));
  const all = [...boxes, ...remarks, ...ways];
  const left = Math.min(0, ...all.map(({ x }) => x)) - MARGIN;
  const top = Math.min(0, ...all.map(({ y }) => y)) - MARGIN;
  const right = Math.max(0, ...all.map(({ x, width }) => x + width)) + MARGIN;
  const bottom = Math.max(0, ...all.map(({ y, height }) => y + height)) + MARGIN;
  const wires = Object.entries(scope.wires).map(([target, source]) => {
    const points = routes.paths.get(target);
    const [from, output] = source.split(".") as [string, string];
    const wide = !!scope.nodes[from]?.outputs.find(({ name }) => name === output)?.shape.length;
    return points
      ? `<path d="${drawnPath(points)}" fill="none" stroke="${INK.wire}" stroke-width="${wide ? 3 : 1.5}"/>`
      : "";
  });
  const joints = [...routes.joints.values()].flat();
  const size = `width="${right - left}" height="${bottom - top}"`;
  return [
    `<svg xmlns="http://www.w3.org/2000/svg" ${size} viewBox="${left} ${top} ${right - left} ${bottom - top}" `,
    `font-family="system-ui, sans-serif" role="img" aria-label="${escaped(scope.title || "diagram")}">`,
    `<rect x="${left}" y="${top}" ${size} fill="${INK.page}"/>`,
    ...remarks.map(
      ({ words, x, y, width, height }) =>
        `<g transform="translate(${x} ${y})"><rect width="${width}" height="${height}" rx="6" fill="${INK.remark}"/>` +
        words
          .split("\n")
          .map((line, i) => text(10, 20 + 17 * i, 12, line, `fill="${INK.name}"`))
          .join("") +
        "</g>",
    ),
    ...wires,
    ...joints.map(([x, y]) => `<circle cx="${x}" cy="${y}" r="3.5" fill="${INK.wire}"/>`),
    ...boxes.map(
      ({ name, view, x, y, ...each }) => `<g transform="translate(${x} ${y})">${block(name, view, each)}</g>`,
    ),
    "</svg>\n",
  ].join("");
}
