import { type ConnectionLineComponentProps, getSmoothStepPath } from "@xyflow/react";
import { misfitAt } from "../session/ports";
import { useScope } from "../session/useScope";

/** The wire that is being drawn; it says why it does not fit where it is held. */
export function ConnectionTip(props: ConnectionLineComponentProps) {
  const { fromX, fromY, toX, toY, fromPosition, toPosition, fromHandle, toHandle } = props;
  const scope = useScope();
  const [path] = getSmoothStepPath({
    sourceX: fromX,
    sourceY: fromY,
    sourcePosition: fromPosition,
    targetX: toX,
    targetY: toY,
    targetPosition: toPosition,
    borderRadius: 8,
  });
  const ends = toHandle && (fromHandle.type === "source" ? [fromHandle, toHandle] : [toHandle, fromHandle]);
  const why =
    ends && toHandle.type === fromHandle.type
      ? "a wire leads from an output to an input"
      : ends && misfitAt(scope, `${ends[0]!.nodeId}.${ends[0]!.id}`, `${ends[1]!.nodeId}.${ends[1]!.id}`);
  return (
    <g className={`drawing ${why ? "unfit" : toHandle ? "fit" : ""}`}>
      <path d={path} fill="none" />
      {why && (
        <foreignObject x={toX + 12} y={toY + 10} width={300} height={80} style={{ overflow: "visible" }}>
          <div className="tip" role="status">
            {why}
          </div>
        </foreignObject>
      )}
    </g>
  );
}
