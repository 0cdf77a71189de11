import { useCallback } from "react";
import { useAsk } from "../session/context";
import type { Field, Scope, Value } from "../session/types";
import { FieldRow } from "./FieldRow";

const declared = (name: string): Field => ({
  name,
  type: "float",
  role: "parameter",
  kind: "float",
  required: false,
  default: 0,
});

/** A name for a new parameter. */
export function freshName(scope: Scope): string {
  let number = 1;
  while (`p${number}` in scope.parameters) number += 1;
  return `p${number}`;
}

/** The parameters of the diagram that is open: their names, values, and what uses them. */
export function Parameters({ at, scope }: { at: string[]; scope: Scope }) {
  const ask = useAsk();
  const path = at.join("/");
  const set = useCallback(
    async (name: string, value: Value) =>
      (await ask({ op: "parameter", address: path ? `${path}.${name}` : name, value })) !== null,
    [ask, path],
  );
  const names = Object.keys(scope.parameters);
  const rename = (name: string, to: string) => to && to !== name && ask({ op: "declare", at, parameter: name, to });
  return (
    <fieldset className="parameters">
      <legend>Parameters</legend>
      {names.map((name) => {
        const users = Object.keys(scope.uses).filter((address) => scope.uses[address] === name);
        return (
          <div key={name} className="parameter">
            <div className="name-row">
              <input
                aria-label={`name of parameter ${name}`}
                defaultValue={name}
                onBlur={(event) => void rename(name, event.target.value.trim())}
                onKeyDown={(event) => event.key === "Enter" && event.currentTarget.blur()}
              />
              <button
                type="button"
                className="plain"
                aria-label={`Remove parameter ${name}`}
                title="Remove it; what uses it keeps its value"
                onClick={() => void ask({ op: "undeclare", at, parameter: name })}
              >
                ×
              </button>
            </div>
            <FieldRow
              field={declared(name)}
              value={scope.parameters[name]!}
              onSet={set}
              note={users.length ? `stands for ${users.join(", ")}` : "nothing uses it yet"}
            />
          </div>
        );
      })}
      {names.length === 0 && (
        <p className="help">
          A parameter stands for settings of several blocks{at.length > 0 && ", and is a field of the subsystem’s form"}
          .
        </p>
      )}
      <button
        type="button"
        className="plain"
        onClick={() => void ask({ op: "declare", at, parameter: freshName(scope) })}
      >
        Add a parameter
      </button>
    </fieldset>
  );
}
