import type { BlockView, Port } from "../session/types";
import { shapeLabel } from "../session/ports";
import { useUi } from "../ui/ui";
import { formulaOf, gainText, inputLabel, isTriangle } from "./face";

/** Sizes in pixels at 100 %. Blocks have the sizes that follow, so that none need be measured. */
export const GRID = 10;
export const HEADER = 40;
export const ROW = 20;
const PADDING = 10;
const NARROWEST = 120;
const WIDEST = 260;
const LETTER = 6.3;
/** Beside the text of the head: its picture, and its margins. */
const ICON = 44;
/** Of a picture of what a sink sees, on the canvas. */
const PICTURE: Size = { width: 260, height: 150 };
/** What can be seen on the canvas itself. */
export const PICTURED = new Set(["lines", "raster", "portrait", "histogram", "map"]);

const labelled = (port: Port | undefined): number =>
  port ? (port.name.length + shapeLabel(port).length + 1) * LETTER + 14 : 0;

export interface Size {
  width: number;
  height: number;
}

export const rowsOf = (block: BlockView): number => Math.max(block.inputs.length, block.outputs.length, 1);

/** Whether a block shows what it sees on the canvas. */
export const isPictured = (block: BlockView): boolean =>
  useUi.getState().pictures && block.drawing !== undefined && PICTURED.has(block.drawing);

const whole = (x: number): number => Math.ceil(x / GRID) * GRID;

export function sizeOf(name: string, block: BlockView): Size {
  if (isTriangle(block)) {
    const widest = Math.max(90, name.length * 7 + 10, gainText(block).length * 15 + 40);
    return { width: whole(Math.min(WIDEST, widest)), height: 80 };
  }
  let widest = Math.max(name.length * 7.8, block.type.length * 6 + 16, (formulaOf(block)?.length ?? 0) * 6.2) + ICON;
  for (let row = 0; row < rowsOf(block); row += 1) {
    const input = inputLabel(block, row) ? 2 * LETTER + 14 : labelled(block.inputs[row]);
    widest = Math.max(widest, input + labelled(block.outputs[row]) + 16);
  }
  const size = {
    width: whole(Math.min(WIDEST, Math.max(NARROWEST, widest))),
    height: HEADER + rowsOf(block) * ROW + PADDING,
  };
  if (!isPictured(block)) return size;
  return { width: Math.max(size.width, PICTURE.width), height: size.height + PICTURE.height };
}

/** How far below a block's top its port stands. */
export const portHeight = (row: number): number => HEADER + row * ROW + ROW / 2;
