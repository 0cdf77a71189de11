import { goTo } from "../inspector/Problems";
import { useDocument } from "../session/store";
import { Picker } from "../ui/Picker";

/** Goes to any block of the diagram, also in subsystems. */
export function Find() {
  const scopes = useDocument((document) => document.scopes);
  const choices = Object.entries(scopes).flatMap(([at, scope]) =>
    Object.values(scope.nodes).map((node) => {
      const path = at ? `${at}/${node.name}` : node.name;
      return { id: path, label: path, note: node.type === "diagram" ? "subsystem" : node.type, pick: () => goTo(path) };
    }),
  );
  return <Picker label="Go to a block" hint="Which block?" choices={choices} />;
}
