import { BaseEdge, type Edge, type EdgeProps, getSmoothStepPath } from "@xyflow/react";
import { memo } from "react";

export type WireData = {
  wide: boolean;
  problem: string | null;
  title: string;
  /** How far its two blocks reach below its ends. */
  below: [number, number];
};
export type WireType = Edge<WireData, "wire">;

const CLEAR = 18;
const FAR = 36;

/** A wire: thin for one number, thick for many, red where something is wrong with it. */
export const Wire = memo(function Wire(props: EdgeProps<WireType>) {
  const { data, selected, sourceX, sourceY, targetX, targetY } = props;
  // What leads back goes round below both blocks.
  const back = sourceX + 2 * CLEAR > targetX && data;
  const centerY = back ? Math.max(sourceY + data.below[0], targetY + data.below[1]) + CLEAR : undefined;
  // What leads on turns soon, so that it passes other blocks at the height of its end, not through them.
  const centerX = back ? undefined : Math.min((sourceX + targetX) / 2, sourceX + FAR);
  const [path] = getSmoothStepPath({ ...props, borderRadius: 8, offset: CLEAR, centerX, centerY });
  const classes = ["wire", data?.wide && "wide", data?.problem && "wrong", selected && "selected"];
  return (
    <g className={classes.filter(Boolean).join(" ")}>
      <title>{data?.problem ? `${data.title}\n${data.problem}` : data?.title}</title>
      <BaseEdge id={props.id} path={path} interactionWidth={14} />
    </g>
  );
});
