import { REMARK } from "../canvas/flow";
import { find } from "../ui/root";
import { useUi } from "../ui/ui";
import type { Context } from "./command";

/** What is selected on the canvas: blocks by name, comments by id, wires by their target. */
export interface Selection {
  names: string[];
  comments: string[];
  wires: string[];
}

export function selection({ flow }: Context): Selection {
  const ids = flow
    .getNodes()
    .filter((node) => node.selected)
    .map((node) => node.id);
  return {
    names: ids.filter((id) => !id.startsWith(REMARK)),
    comments: ids.filter((id) => id.startsWith(REMARK)).map((id) => id.slice(REMARK.length)),
    wires: flow
      .getEdges()
      .filter((edge) => edge.selected)
      .map((edge) => edge.id),
  };
}

/** Select these blocks and nothing else; those that are not there yet when they come. */
export const select = (names: string[]): void => useUi.setState({ choose: names });

/** Select a wire and nothing else. */
export function selectWire({ flow }: Context, id: string): void {
  flow.setNodes((nodes) => nodes.map((node) => (node.selected ? { ...node, selected: false } : node)));
  flow.setEdges((edges) =>
    edges.map((edge) => (!!edge.selected === (edge.id === id) ? edge : { ...edge, selected: edge.id === id })),
  );
}

/** Where a new block goes: the middle of what is seen, beside what is there already. */
export function freePlace({ flow }: Context): [number, number] {
  const pane = find(".react-flow")?.getBoundingClientRect();
  const middle = flow.screenToFlowPosition({
    x: (pane?.left ?? 0) + (pane?.width ?? 800) / 2,
    y: (pane?.top ?? 0) + (pane?.height ?? 600) / 2,
  });
  let [x, y] = [Math.round(middle.x / 10) * 10 - 60, Math.round(middle.y / 10) * 10 - 30];
  const nodes = flow.getNodes();
  while (nodes.some((node) => Math.abs(node.position.x - x) < 150 && Math.abs(node.position.y - y) < 70)) {
    x += 170;
    if (x > middle.x + 400) [x, y] = [middle.x - 400, y + 90];
  }
  return [Math.round(x / 10) * 10, Math.round(y / 10) * 10];
}
