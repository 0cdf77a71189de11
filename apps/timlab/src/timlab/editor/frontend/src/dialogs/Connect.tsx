import { useAsk } from "../session/context";
import { ends, misfitAt } from "../session/ports";
import type { Scope } from "../session/types";
import { useScope } from "../session/useScope";
import { type Choice, Picker } from "../ui/Picker";
import { useUi } from "../ui/ui";

/** All wires that could be drawn at the selected blocks: those that fit first. */
function candidates(scope: Scope, selected: string[]): [source: string, target: string][] {
  const chosen = new Set(selected);
  const outputs = Object.values(scope.nodes).flatMap((node) => node.outputs.map((port) => `${node.name}.${port.name}`));
  const inputs = Object.values(scope.nodes).flatMap((node) => node.inputs.map((port) => `${node.name}.${port.name}`));
  const pairs: [string, string][] = [];
  for (const source of outputs)
    for (const target of inputs)
      if (!selected.length || chosen.has(ends(source)[0]) || chosen.has(ends(target)[0])) pairs.push([source, target]);
  return pairs;
}

/** Draws wires by the keyboard. */
export function Connect() {
  const ask = useAsk();
  const scope = useScope();
  const { at, selected } = useUi();
  const all = candidates(scope, selected).map(([source, target]): Choice & { order: number } => {
    const refused = misfitAt(scope, source, target);
    const held = scope.wires[target];
    const outgoing = selected.includes(ends(source)[0]);
    const isOwn = ends(source)[0] === ends(target)[0];
    return {
      id: `${source}→${target}`,
      label: `${source} → ${target}`,
      refused,
      note: held === source ? "connected: Enter removes the wire" : held ? `replaces ${held}` : "",
      order: (refused ? 8 : 0) + (held ? 4 : 0) + (isOwn ? 2 : 0) + (outgoing ? 0 : 1),
      pick: () => ask(held === source ? { op: "disconnect", at, target } : { op: "connect", at, source, target }),
    };
  });
  all.sort((a, b) => a.order - b.order);
  return (
    <Picker
      label="Connect"
      hint={selected.length ? `From or to ${selected.join(", ")}` : "Connect two ports"}
      choices={all}
    />
  );
}
