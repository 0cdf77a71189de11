import type { BlockView, Port } from "../session/types";
import { shapeLabel } from "../session/ports";

/** Sizes in pixels at 100 %. Blocks have the sizes that follow, so that none need be measured. */
export const GRID = 10;
export const HEADER = 40;
export const ROW = 20;
const PADDING = 10;
const NARROWEST = 120;
const WIDEST = 260;
const LETTER = 6.3;

const labelled = (port: Port | undefined): number =>
  port ? (port.name.length + shapeLabel(port).length + 1) * LETTER + 14 : 0;

export interface Size {
  width: number;
  height: number;
}

export const rowsOf = (block: BlockView): number => Math.max(block.inputs.length, block.outputs.length, 1);

export function sizeOf(name: string, block: BlockView): Size {
  let widest = Math.max(name.length * 7.4 + 28, block.type.length * 6 + 60);
  for (let row = 0; row < rowsOf(block); row += 1) {
    widest = Math.max(widest, labelled(block.inputs[row]) + labelled(block.outputs[row]) + 16);
  }
  const width = Math.min(WIDEST, Math.max(NARROWEST, widest));
  return { width: Math.ceil(width / GRID) * GRID, height: HEADER + rowsOf(block) * ROW + PADDING };
}

/** How far below a block's top its port stands. */
export const portHeight = (row: number): number => HEADER + row * ROW + ROW / 2;
