import { BaseEdge, type Edge, type EdgeProps, getSmoothStepPath } from "@xyflow/react";
import { memo } from "react";
import { drawnPath, type Point } from "./router";

export type WireData = {
  wide: boolean;
  problem: string | null;
  title: string;
  /** Its way round the blocks; null while there is none. */
  path: Point[] | null;
  /** Where it parts from others that carry the same signal. */
  joints: Point[];
};
export type WireType = Edge<WireData, "wire">;

const CLEAR = 18;

/** A wire: thin for one number, thick for many, red where something is wrong with it. While one of its blocks is moved,
 * it goes straight ahead. */
export const Wire = memo(function Wire(props: EdgeProps<WireType>) {
  const { data, selected, sourceX, sourceY, targetX, targetY } = props;
  const [first, last] = [data?.path?.[0], data?.path?.at(-1)];
  const near = (point: Point | undefined, x: number, y: number) =>
    point && Math.abs(point[0] - x) < 6 && Math.abs(point[1] - y) < 6;
  const fits = near(first, sourceX, sourceY) && near(last, targetX, targetY);
  const path = fits ? drawnPath(data!.path!) : getSmoothStepPath({ ...props, borderRadius: 8, offset: CLEAR })[0];
  const classes = ["wire", data?.wide && "wide", data?.problem && "wrong", selected && "selected"];
  return (
    <g className={classes.filter(Boolean).join(" ")}>
      <title>{data?.problem ? `${data.title}\n${data.problem}` : data?.title}</title>
      <BaseEdge id={props.id} path={path} interactionWidth={14} />
      {fits &&
        data!.joints.map(([x, y]) => (
          <circle key={`${x},${y}`} className="joint" cx={x} cy={y} r={data!.wide ? 4 : 3} />
        ))}
    </g>
  );
});
