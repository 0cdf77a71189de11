import { BaseEdge, type Edge, type EdgeProps, getSmoothStepPath } from "@xyflow/react";
import { memo } from "react";

export type WireType = Edge<{ wide: boolean; problem: string | null; title: string }, "wire">;

/** A wire: thin for one number, thick for many, red where something is wrong with it. */
export const Wire = memo(function Wire(props: EdgeProps<WireType>) {
  const [path] = getSmoothStepPath({ ...props, borderRadius: 8, offset: 18 });
  const { data, selected } = props;
  const classes = ["wire", data?.wide && "wide", data?.problem && "wrong", selected && "selected"];
  return (
    <g className={classes.filter(Boolean).join(" ")}>
      <title>{data?.problem ? `${data.title}\n${data.problem}` : data?.title}</title>
      <BaseEdge id={props.id} path={path} interactionWidth={14} />
    </g>
  );
});
