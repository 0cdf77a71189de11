import { useCallback } from "react";
import { useContextOfCommands } from "../commands/useKeys";
import { select } from "../commands/selection";
import { describe, pathOf } from "../session/ports";
import { useDocument, useProblems, useRun } from "../session/store";
import type { BlockView, Value } from "../session/types";
import { hueOf } from "../ui/category";
import { prose } from "../ui/prose";
import { useUi } from "../ui/ui";
import { AS_ONE, ExpressionForm } from "./ExpressionForm";
import { FieldRow } from "./FieldRow";
import { Freeze } from "./Freeze";
import { Uses } from "./Uses";
import { toText } from "./values";

const SCHEDULE = new Set(["every", "period"]);
const ELSEWHERE = new Set(["every", "period", "frozen"]);

/** The form of one block, made from its type's declaration. */
export function BlockForm({ name, view }: { name: string; view: BlockView }) {
  const context = useContextOfCommands();
  const { ask } = context;
  const at = useUi((ui) => ui.at);
  const declaration = useDocument((document) => document.declarations[view.type]);
  const problems = useProblems();
  const watched = useRun((run) => run.watch);
  const overrides = useRun((run) => run.overrides);
  const path = pathOf(at, name);
  const declared = [...(declaration?.fields ?? []), ...(view.parameters ?? [])];
  const live = (field: { role?: string }) => field.role === "parameter";
  const names = declared
    .filter(live)
    .map((field) => field.name)
    .join(" ");
  const set = useCallback(
    async (field: string, value: Value) => {
      const isLive = names.split(" ").includes(field);
      const operation = isLive
        ? { op: "parameter", address: `${path}.${field}`, value }
        : { op: "set", at, name, field, value };
      return (await ask(operation)) !== null;
    },
    [ask, at, name, names, path],
  );
  const rename = async (to: string) => {
    if (to && to !== name && (await ask({ op: "rename", at, name, to }))) select([to]);
  };
  const watch = (address: string) =>
    ask({
      op: "watch",
      addresses: watched.includes(address) ? watched.filter((each) => each !== address) : [...watched, address],
    });
  const isFormula = view.type === "expression";
  const fields = declared
    .filter((field) => !ELSEWHERE.has(field.name) && !(isFormula && AS_ONE.has(field.name)))
    .sort((a, b) => Number(live(b)) - Number(live(a)));
  const schedule = (declaration?.fields ?? []).filter((field) => SCHEDULE.has(field.name));
  const own = problems.filter((problem) => problem.path === path);
  const noteOf = (field: string) => {
    const other = overrides[`${path}.${field}`];
    return other === undefined ? undefined : `in this branch ${toText(other)}`;
  };
  const row = (field: (typeof fields)[number]) => (
    <FieldRow
      key={`${path}.${field.name}`}
      field={field}
      value={view.fields[field.name] ?? null}
      onSet={set}
      note={noteOf(field.name)}
    />
  );
  return (
    <form className="form" onSubmit={(event) => event.preventDefault()} aria-label={`form of ${name}`}>
      <header style={{ "--hue": hueOf(view.category) } as React.CSSProperties}>
        <input
          key={name}
          className="name-field"
          aria-label="name"
          defaultValue={name}
          onBlur={(event) => void rename(event.target.value.trim())}
          onKeyDown={(event) => event.key === "Enter" && event.currentTarget.blur()}
        />
        <span className="quiet">{view.type === "diagram" ? "subsystem" : view.type}</span>
      </header>
      {own.map(({ message, port, grade }) => (
        <p key={message} className={grade === "warning" ? "caution" : "mistake"} role="alert">
          {port ? `${port}: ` : ""}
          {message}
        </p>
      ))}
      {isFormula && <ExpressionForm name={name} path={path} view={view} />}
      {fields.filter((field) => !(field.name in view.uses)).map(row)}
      <Uses name={name} view={view} fields={fields.filter(live)} />
      {view.category === "learning" && <Freeze path={path} view={view} />}
      {view.outputs.length > 0 && (
        <fieldset>
          <legend>Watch</legend>
          {view.outputs.map((port) => (
            <label key={port.name} className="check" title={port.help}>
              <input
                type="checkbox"
                checked={watched.includes(`${path}.${port.name}`)}
                onChange={() => void watch(`${path}.${port.name}`)}
              />
              {port.name} <span className="quiet">{describe(port)}</span>
            </label>
          ))}
        </fieldset>
      )}
      {schedule.length > 0 && (
        <details>
          <summary>Sample period</summary>
          {schedule.map(row)}
        </details>
      )}
      {declaration?.help && (
        <details>
          <summary>What it is</summary>
          <p className="help prose">{prose(declaration.help)}</p>
        </details>
      )}
    </form>
  );
}
