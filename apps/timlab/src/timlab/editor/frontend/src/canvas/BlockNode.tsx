import type { Node, NodeProps } from "@xyflow/react";
import { memo } from "react";
import { useDocument } from "../session/store";
import type { BlockView, Problem } from "../session/types";
import { BlockIcon } from "../ui/BlockIcon";
import { hueOf } from "../ui/category";
import { faceOf, gainText, inputLabel, isTriangle } from "./face";
import { Picture } from "./Picture";
import { PortRow } from "./PortRow";

export type BlockData = {
  view: BlockView;
  name: string;
  path: string;
  /** The inputs to which wires lead. */
  wired: string[];
  problems: Problem[];
  /** Whether it shows what it sees. */
  pictured: boolean;
};
export type BlockNodeType = Node<BlockData, "block">;

/** A block on the canvas. It is drawn again only when it, or what is wrong with it, changes. */
export const BlockNode = memo(function BlockNode({ data, selected }: NodeProps<BlockNodeType>) {
  const { view, name, path, wired, problems, pictured } = data;
  const isOpenEnd = (port: string | null) =>
    view.inputs.some((input) => input.name === port) && !wired.includes(port ?? "");
  // An input without a wire is unfinished work, not a mistake: it is marked more quietly.
  const serious = problems.filter((problem) => problem.grade !== "warning");
  const wrong = serious.some((problem) => problem.path !== path || !isOpenEnd(problem.port));
  const faulty = problems.some((problem) => problem.grade === "fault");
  const messages = problems.map((problem) => problem.message).join("\n");
  const triangle = isTriangle(view);
  const classes = [
    "block",
    triangle && "triangle",
    selected && "selected",
    wrong && "wrong",
    faulty && "faulty",
    view.type === "diagram" && "inner",
  ];
  return (
    <div className={classes.filter(Boolean).join(" ")} style={{ "--hue": hueOf(view.category) } as React.CSSProperties}>
      {triangle ? <Triangle view={view} name={name} /> : <Head view={view} name={name} />}
      {problems.length > 0 && (
        <span
          className={`badge ${wrong ? "" : serious.length ? "soft" : "warning"}`}
          role="img"
          aria-label={`problem: ${messages}`}
          title={messages}
        >
          !
        </span>
      )}
      {view.inputs.map((port, row) => (
        <PortRow
          key={port.name}
          block={name}
          port={port}
          row={row}
          side="input"
          label={triangle ? "" : (inputLabel(view, row) ?? port.name)}
          wired={wired.includes(port.name)}
          wanting={port.default === null && !wired.includes(port.name)}
          problem={serious.find((problem) => problem.path === path && problem.port === port.name)?.message}
        />
      ))}
      {view.outputs.map((port, row) => (
        <PortRow
          key={port.name}
          block={name}
          port={port}
          row={row}
          side="output"
          label={triangle ? "" : port.name}
          wired
          wanting={false}
          problem={undefined}
        />
      ))}
      {pictured && <Picture path={path} view={view} />}
    </div>
  );
});

/** Its picture, its name, and what it does. */
function Head({ view, name }: { view: BlockView; name: string }) {
  const declaration = useDocument((document) => document.declarations[view.type]);
  const face = faceOf(view, name, declaration);
  return (
    <div className="block-head">
      <BlockIcon type={view.type} category={view.category} />
      <strong>{name}</strong>
      <span className="block-face" title={face.text}>
        {face.value ? <em>{face.text}</em> : face.text}
      </span>
    </div>
  );
}

/** A gain: its number in a triangle, with its name above. */
function Triangle({ view, name }: { view: BlockView; name: string }) {
  return (
    <>
      <svg className="face" viewBox="0 0 100 60" preserveAspectRatio="none" aria-hidden="true">
        <path d="M1 1V59L99 30Z" vectorEffect="non-scaling-stroke" />
      </svg>
      <strong className="above">{name}</strong>
      <span className="inside">{gainText(view)}</span>
    </>
  );
}
