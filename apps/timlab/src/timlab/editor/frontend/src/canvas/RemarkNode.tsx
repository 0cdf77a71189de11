import { type Node, type NodeProps, NodeResizer } from "@xyflow/react";
import { memo, useState } from "react";
import { useAsk } from "../session/context";
import type { Remark } from "../session/types";
import { useUi } from "../ui/ui";

export type RemarkNodeType = Node<{ remark: Remark; id: string }, "remark">;

/** A comment on the canvas: double click, or Enter, to write. */
export const RemarkNode = memo(function RemarkNode({ data, selected }: NodeProps<RemarkNodeType>) {
  const ask = useAsk();
  const [writing, setWriting] = useState(data.remark.text === "");
  const at = useUi((ui) => ui.at);
  const done = (text: string) => {
    setWriting(false);
    if (text !== data.remark.text) void ask({ op: "comment", at, id: data.id, text, box: data.remark.box });
  };
  return (
    <div className={`remark ${selected ? "selected" : ""}`} onDoubleClick={() => setWriting(true)}>
      <NodeResizer isVisible={selected} minWidth={80} minHeight={30} />
      {writing ? (
        <textarea
          className="nodrag nowheel"
          aria-label="comment"
          autoFocus
          defaultValue={data.remark.text}
          onBlur={(event) => done(event.target.value)}
          onKeyDown={(event) => {
            event.stopPropagation();
            if (event.key === "Escape") event.currentTarget.blur();
          }}
        />
      ) : (
        <p>{data.remark.text || "…"}</p>
      )}
    </div>
  );
});
