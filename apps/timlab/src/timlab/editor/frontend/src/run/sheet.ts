/** Where a picture is drawn, with what it needs to know. */
export interface Sheet {
  context: CanvasRenderingContext2D;
  width: number;
  height: number;
  /** Room above the axes. */
  head?: number;
  /** Room beside the vertical axis, where its numbers need more than usual. */
  left?: number;
  /** What stands at the axes: below, and beside them. */
  titles?: [across: string, up: string];
  dark: boolean;
  ink: string;
  line: string;
  branch: string | null;
  branches: string[];
  /** The first and the last tick that are shown. */
  span: [number, number];
  tick: number;
  /** The tick at which the run stands. */
  now: number;
}
