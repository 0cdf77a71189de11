import type { Node, NodeProps } from "@xyflow/react";
import { memo } from "react";
import { useDocument } from "../session/store";
import type { BlockView, Problem } from "../session/types";
import { hueOf } from "../ui/category";
import { PortRow } from "./PortRow";
import { summary } from "./summary";

export type BlockData = {
  view: BlockView;
  name: string;
  path: string;
  /** The inputs to which wires lead. */
  wired: string[];
  problems: Problem[];
};
export type BlockNodeType = Node<BlockData, "block">;

/** What stands under the name: the type, where the name does not say it. */
function kind(name: string, type: string): string {
  if (type === "diagram") return "subsystem";
  return type === name || name.startsWith(`${type} `) ? "" : type;
}

/** A block on the canvas. It is drawn again only when it, or what is wrong with it, changes. */
export const BlockNode = memo(function BlockNode({ data, selected }: NodeProps<BlockNodeType>) {
  const { view, name, path, wired, problems } = data;
  const declaration = useDocument((document) => document.declarations[view.type]);
  const face = summary(view, declaration);
  const isOpenEnd = (port: string | null) =>
    view.inputs.some((input) => input.name === port) && !wired.includes(port ?? "");
  // An input without a wire is unfinished work, not a mistake: it is marked more quietly.
  const wrong = problems.some((problem) => problem.path !== path || !isOpenEnd(problem.port));
  const messages = problems.map((problem) => problem.message).join("\n");
  const classes = ["block", selected && "selected", wrong && "wrong", view.type === "diagram" && "inner"];
  return (
    <div className={classes.filter(Boolean).join(" ")} style={{ "--hue": hueOf(view.category) } as React.CSSProperties}>
      <div className="block-head">
        <strong>{name}</strong>
        <span className="block-face">
          {kind(name, view.type)}
          {face && !kind(name, view.type) && <em>{face}</em>}
        </span>
        {problems.length > 0 && (
          <span
            className={wrong ? "badge" : "badge soft"}
            role="img"
            aria-label={`problem: ${messages}`}
            title={messages}
          >
            !
          </span>
        )}
      </div>
      {view.inputs.map((port, row) => (
        <PortRow
          key={port.name}
          block={name}
          port={port}
          row={row}
          side="input"
          wired={wired.includes(port.name)}
          wanting={port.default === null && !wired.includes(port.name)}
          problem={problems.find((problem) => problem.path === path && problem.port === port.name)?.message}
        />
      ))}
      {view.outputs.map((port, row) => (
        <PortRow
          key={port.name}
          block={name}
          port={port}
          row={row}
          side="output"
          wired
          wanting={false}
          problem={undefined}
        />
      ))}
    </div>
  );
});
