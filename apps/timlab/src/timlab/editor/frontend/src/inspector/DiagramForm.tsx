import { useCallback } from "react";
import { useAsk } from "../session/context";
import type { Field, Value } from "../session/types";
import { useScope } from "../session/useScope";
import { useUi } from "../ui/ui";
import { FieldRow } from "./FieldRow";
import { Parameters } from "./Parameters";

const field = (name: string, type: string, help: string, unit = "", choices?: string[]): Field => ({
  name,
  type,
  help,
  unit,
  required: false,
  default: null,
  role: "setting",
  choices,
});

const TEXTS = [field("title", "str", ""), field("comment", "str", "")];
const TIMES = [
  field("tick", "float", "length of a tick", "s"),
  field("solver", "str", "how continuous states are integrated; all but rk4 adapt their steps", "", [
    "rk4",
    "tsit5",
    "dopri8",
    "rodas5p",
  ]),
  field("substeps", "int", "RK4 steps per tick"),
  field("relative_tolerance", "float", "error of an adapted step, relative to the state"),
  field("absolute_tolerance", "float", "error of an adapted step, in addition"),
  field("precision", "str", "precision of the signals", "", ["single", "double"]),
  field("loops", "str", "what is done with algebraic loops", "", ["refuse", "solve"]),
  field(
    "on_fault",
    "str",
    "where a number is not finite or a limit of the solver is reached: stop the run, or warn once and go on",
    "",
    ["stop", "warn"],
  ),
];

/** The form of the diagram that is open. */
export function DiagramForm() {
  const ask = useAsk();
  const scope = useScope();
  const at = useUi((ui) => ui.at);
  const set = useCallback(
    async (name: string, value: Value) => (await ask({ op: "set", at, name: null, field: name, value })) !== null,
    [ask, at],
  );
  const fields = at.length ? TEXTS : [...TEXTS, ...TIMES];
  const blocks = Object.keys(scope.nodes).length;
  const wires = Object.keys(scope.wires).length;
  return (
    <form className="form" onSubmit={(event) => event.preventDefault()} aria-label="form of the diagram">
      <header>
        <strong>{at.length ? "This subsystem" : "This diagram"}</strong>
        <span className="quiet">
          {blocks} {blocks === 1 ? "block" : "blocks"}, {wires} {wires === 1 ? "wire" : "wires"}
        </span>
      </header>
      {fields.map((each) => (
        <FieldRow key={`${at.join("/")}.${each.name}`} field={each} value={scope[each.name as "title"]} onSet={set} />
      ))}
      <Parameters at={at} scope={scope} />
    </form>
  );
}
