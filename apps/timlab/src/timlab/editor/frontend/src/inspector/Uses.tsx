import { useAsk } from "../session/context";
import type { BlockView, Field } from "../session/types";
import { useScope } from "../session/useScope";
import { useUi } from "../ui/ui";
import { freshName } from "./Parameters";

const NEW = "\u0000";

/** Which parameters of the diagram stand for those of a block. */
export function Uses({ name, view, fields }: { name: string; view: BlockView; fields: Field[] }) {
  const ask = useAsk();
  const scope = useScope();
  const at = useUi((ui) => ui.at);
  const numbers = fields.filter((field) => field.kind !== "bool" && view.fields[field.name] != null);
  if (!numbers.length) return null;
  const choose = (field: string, chosen: string) => {
    const fresh = field in scope.parameters || field.includes(".") ? freshName(scope) : field;
    const parameter = chosen === NEW ? fresh : chosen || null;
    void ask({ op: "use", at, name, field, parameter });
  };
  return (
    <details className="uses" open={Object.keys(view.uses).length > 0}>
      <summary>Parameters of the {at.length ? "subsystem" : "diagram"}</summary>
      {numbers.map((field) => (
        <label key={field.name} className="name-row">
          <code>{field.name.replaceAll("_", " ")}</code>
          <select
            aria-label={`${field.name} comes from`}
            value={view.uses[field.name] ?? ""}
            onChange={(event) => choose(field.name, event.target.value)}
          >
            <option value="">its own value</option>
            {Object.keys(scope.parameters).map((each) => (
              <option key={each} value={each}>
                {each}
              </option>
            ))}
            <option value={NEW}>a new parameter</option>
          </select>
        </label>
      ))}
    </details>
  );
}
